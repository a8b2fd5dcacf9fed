"""Heaps of texts that the library of HDF5 would never come to the end of."""

import h5py
import pytest

from frf_ipz.errors import FileFormatError
from frf_ipz.hdf5_heaps import SIGNATURE, require_heaps

HEAD = 16  # bytes of a collection, and of an object in it


def look_at(path):
    with path.open("rb") as stream:
        require_heaps(path, stream)


@pytest.fixture(params=[0, 512])
def file(tmp_path, request):
    """A file with texts, behind a block of another program's or not."""
    path = tmp_path / "texts.h5"
    with h5py.File(path, "w", userblock_size=request.param) as new:
        for number in range(30):
            new.attrs[f"unit {number}"] = "m/s^2 " * number
        new.create_dataset("names", data=["x" * number for number in range(400)], dtype=h5py.string_dtype())
        new.attrs["gone"] = "of what is deleted, free space stays"
        del new.attrs["gone"]
    return path


def test_whole_heaps_are_read(file):
    look_at(file)
    assert file.read_bytes().count(SIGNATURE) > 1


@pytest.mark.parametrize("size", [0, 1 << 40, 1 << 63])
def test_an_object_without_an_end_is_damage(file, size):
    data = bytearray(file.read_bytes())
    first = data.index(SIGNATURE) + HEAD
    data[first : first + 2] = b"\0\0"  # free space
    data[first + 8 : first + 16] = size.to_bytes(8, "little")
    file.write_bytes(data)
    with pytest.raises(FileFormatError, match="a heap of its texts has no end"):
        look_at(file)


def test_an_empty_file_has_no_heap(tmp_path):
    path = tmp_path / "empty.h5"
    path.write_bytes(b"")
    look_at(path)
