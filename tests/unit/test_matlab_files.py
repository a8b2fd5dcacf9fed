"""MATLAB files: what SciPy writes is read, what a hostile hand writes is refused before memory is taken."""

import struct
import zlib

import numpy as np
import pytest
import scipy.sparse
from scipy.io import savemat

from frf_ipz.errors import FileFormatError
from frf_ipz.matlab_files import read_matlab

VALUES = {"A": np.arange(6.0).reshape(2, 3), "names": np.array(["a", "bc"], dtype=object), "z": np.array([[1 + 2j]])}


def header(order="<"):
    return b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack(f"{order}HH", 0x0100, 0x4D49)


def compressed(content):
    packed = zlib.compress(content, 9)
    return struct.pack("<II", 15, len(packed)) + packed


@pytest.mark.parametrize("options", [{"format": "4"}, {}, {"do_compression": True}])
def test_every_version_below_seven_point_three_is_read(tmp_path, options):
    values = {"A": VALUES["A"]} if options.get("format") == "4" else VALUES
    savemat(tmp_path / "a.mat", values, **options)
    back = read_matlab(tmp_path / "a.mat")
    for name in values.keys() - {"names"}:
        np.testing.assert_array_equal(back[name], values[name])
    if "names" in values:
        assert [str(text[0]) for text in back["names"].ravel()] == ["a", "bc"]


def test_a_small_file_of_many_zeros_is_refused(tmp_path):
    path = tmp_path / "bomb.mat"
    path.write_bytes(header() + compressed(bytes(3_000_000)))
    with pytest.raises(FileFormatError, match=r"bomb\.mat.*more than 1 MB, expanded"):
        read_matlab(path, most_bytes=1 << 20)


def test_small_parts_add_up(tmp_path):
    path = tmp_path / "bomb.mat"
    path.write_bytes(header() + compressed(bytes(600_000)) * 2)
    with pytest.raises(FileFormatError, match="expanded"):
        read_matlab(path, most_bytes=1 << 20)


def cells_that_are_said_to_be(number):
    flags = struct.pack("<IIII", 6, 8, 1, 0)
    dimensions = struct.pack("<IIii", 5, 8, number, 1)
    content = flags + dimensions + struct.pack("<II", 1, 1) + b"c".ljust(8)
    return struct.pack("<II", 14, len(content)) + content


@pytest.mark.parametrize(
    "body",
    [
        cells_that_are_said_to_be(2_000_000_000),
        cells_that_are_said_to_be(-5),
        struct.pack("<II", 14, 0xFFFFFFF0),
        struct.pack("<II", 15, 8) + b"no zlib!",
        struct.pack("<II", 14, 16) + b"\xff" * 16,
        compressed(cells_that_are_said_to_be(3)[:20]),
    ],
    ids=["many cells", "fewer than none", "long", "no zlib", "no matrix", "cut"],
)
def test_what_is_damaged_is_one_clear_error(tmp_path, body):
    path = tmp_path / "damaged.mat"
    path.write_bytes(header() + body)
    with pytest.raises(FileFormatError, match=r"damaged\.mat"):
        read_matlab(path)


RICH = {
    **VALUES,
    "sparse": scipy.sparse.random(6, 5, 0.4, random_state=1).tocsc(),
    "record": {"name": "a", "values": np.arange(4, dtype=np.int16), "inner": {"deep": np.eye(2)}},
    "cells": np.array([np.eye(2), "text", np.array([], dtype=object)], dtype=object),
    "text": "some text",
}


def test_all_that_can_be_written_is_read(tmp_path):
    savemat(tmp_path / "a.mat", RICH, do_compression=True)
    back = read_matlab(tmp_path / "a.mat")
    np.testing.assert_array_equal(back["sparse"].toarray(), RICH["sparse"].toarray())
    assert back["text"][0] == "some text"
    np.testing.assert_array_equal(back["record"]["inner"][0, 0]["deep"][0, 0], np.eye(2))
    assert back["cells"].ravel()[1][0] == "text"


def element(kind, content):
    return struct.pack("<II", kind, len(content)) + content.ljust(-(-len(content) // 8) * 8, b"\0")


def matrix(flags, *parts, dimensions=(1, 1), dimensions_kind=5):
    content = element(6, struct.pack("<II", flags, 8)) + element(dimensions_kind, struct.pack("<2i", *dimensions))
    content += element(1, b"v") + b"".join(parts)
    return struct.pack("<II", 14, len(content)) + content


LOGICAL_SPARSE = matrix(
    0x205,
    element(5, struct.pack("<3i", 0, 1, 2)),
    element(5, struct.pack("<4i", 0, 1, 1, 3)),
    element(9, b"\1\1\1"),  # one byte each under the type of eight
    dimensions=(3, 3),
)


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        (LOGICAL_SPARSE, [[1, 0, 0], [0, 0, 1], [0, 0, 1]]),
        (matrix(6, element(9, struct.pack("<2d", 3, 4)), dimensions=(1, 2), dimensions_kind=6), [[3, 4]]),
    ],
    ids=["logical, sparse", "dimensions without a sign"],
)
def test_what_other_programs_write_is_read(tmp_path, body, expected):
    path = tmp_path / "a.mat"
    path.write_bytes(header() + body)
    value = read_matlab(path)["v"]
    np.testing.assert_array_equal(value.toarray() if scipy.sparse.issparse(value) else value, expected)


def test_a_blank_needs_no_letter_and_many_blanks_do(tmp_path):
    path = tmp_path / "a.mat"
    path.write_bytes(header() + matrix(4, element(16, b"")))
    assert read_matlab(path)["v"] == [" "]
    path.write_bytes(header() + matrix(4, element(16, b""), dimensions=(1, 1 << 28)))
    with pytest.raises(FileFormatError, match="fewer letters"):
        read_matlab(path)


@pytest.mark.parametrize(
    "body",
    [
        matrix(6, element(9, struct.pack("<d", 3)), dimensions=(-1, -1), dimensions_kind=6),
        matrix(
            0x205, element(5, bytes(12)), element(5, struct.pack("<2i", 0, 3)), element(9, b"\1"), dimensions=(3, 1)
        ),
        matrix(0xA05, element(5, bytes(4)), element(5, struct.pack("<2i", 0, 1)), element(9, b"\1"), dimensions=(1, 1)),
    ],
    ids=["negative dimensions", "logical entries missing", "logical, sparse and complex"],
)
def test_what_no_program_writes_is_refused(tmp_path, body):
    path = tmp_path / "a.mat"
    path.write_bytes(header() + body)
    with pytest.raises(FileFormatError, match="damaged"):
        read_matlab(path)


def test_a_sparse_matrix_that_is_logical_and_complex_is_refused(tmp_path):
    """SciPy would take what follows for imaginary parts."""
    path = tmp_path / "a.mat"
    entries = element(5, bytes(4)), element(5, struct.pack("<2i", 0, 1)), element(9, b"\1")
    path.write_bytes(header() + matrix(0xA05, *entries))
    with pytest.raises(FileFormatError, match="logical and complex"):
        read_matlab(path)


def test_a_changed_byte_gives_values_or_the_error_of_the_project(tmp_path):
    path = tmp_path / "a.mat"
    savemat(path, RICH, do_compression=False)
    whole = path.read_bytes()
    rng = np.random.default_rng(3)
    refused = 0
    for _ in range(600):
        damaged = bytearray(whole)
        for place in rng.integers(124, len(whole), rng.integers(1, 4)):
            damaged[place] = rng.choice([0, 1, 255, rng.integers(256)])
        path.write_bytes(damaged)
        try:
            read_matlab(path)
        except FileFormatError:
            refused += 1
    assert 0 < refused < 600


def version_4(name, *, kind=0):
    """Give one number under a name; the kind says how its bytes stand."""
    text = name.encode("latin-1") + b"\0"
    return struct.pack("<5i", kind, 1, 1, 0, len(text)) + text + struct.pack("<d", 2.5)


def test_numbers_that_scipy_reads_as_others_are_refused(tmp_path):
    path = tmp_path / "a.mat"
    path.write_bytes(version_4("K"))
    assert read_matlab(path)["K"] == 2.5
    path.write_bytes(version_4("K", kind=2000))  # of a VAX
    with pytest.raises(FileFormatError, match=r"a\.mat.*VAX"):
        read_matlab(path)
    path.write_bytes(header() + matrix(6, element(9, struct.pack("<d", 3))) + matrix(6, element(9, bytes(8))))
    with pytest.raises(FileFormatError, match="Duplicate"):
        read_matlab(path)


def test_what_is_said_of_a_damaged_name_is_one_short_line(tmp_path):
    path = tmp_path / "a.mat"
    path.write_bytes(version_4("K\n" * 3000)[:-4])
    with pytest.raises(FileFormatError, match="damaged") as caught:
        read_matlab(path)
    assert len(str(caught.value)) < 500 + len(str(path))
    assert "\n" not in str(caught.value)
