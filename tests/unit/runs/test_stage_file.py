"""A file of a stage holds what was written, and nothing in it is larger in memory than on disk."""

import json
import tracemalloc

import numpy as np
import pytest

from frf_ipz.errors import FileFormatError
from frf_ipz.runs.stage_file import MAGIC, START, StageFile, read_stage_file, write_stage_file

ARRAYS = [np.arange(12.0).reshape(3, 4), np.asfortranarray(np.eye(3)), np.array([True]), np.zeros((0, 2), np.int64)]


def write(path, tree=(1, None, "text"), arrays=ARRAYS):
    write_stage_file(StageFile(key="a key", tree=tree, arrays=arrays), path)
    return path


def with_header(path, arrays, content=b"", digest=None):
    """A file with a header that is not true."""
    text = json.dumps({"key": "", "tree": None, "arrays": arrays}).encode()
    path.write_bytes(MAGIC + (digest or bytes(32)) + len(text).to_bytes(8, "little") + text + content)
    return path


def test_what_was_written_is_read(tmp_path):
    content = read_stage_file(write(tmp_path / "fit.result"))
    assert (content.key, content.tree) == ("a key", [1, None, "text"])
    for back, array in zip(content.arrays, ARRAYS, strict=True):
        assert back.dtype == array.dtype
        assert back.shape == array.shape
        assert back.tobytes() == array.tobytes()
        assert back.flags.writeable
    assert content.arrays[1].flags.f_contiguous


def test_a_part_of_an_array_is_written_as_the_values_it_shows(tmp_path):
    table = np.arange(24.0).reshape(4, 6)[::2, 1:5]
    (back,) = read_stage_file(write(tmp_path / "fit.result", arrays=[table])).arrays
    np.testing.assert_array_equal(back, table)


def test_every_byte_that_changes_is_noticed(tmp_path):
    path = write(tmp_path / "fit.result")
    data = path.read_bytes()
    for place in range(len(data)):
        path.write_bytes(data[:place] + bytes([data[place] ^ 0x10]) + data[place + 1 :])
        with pytest.raises(FileFormatError, match=r"damaged"):
            read_stage_file(path)


def test_every_cut_is_noticed(tmp_path):
    path = write(tmp_path / "fit.result")
    data = path.read_bytes()
    for length in range(len(data)):
        path.write_bytes(data[:length])
        with pytest.raises(FileFormatError, match=r"damaged"):
            read_stage_file(path)
    path.write_bytes(data + b"\0")
    with pytest.raises(FileFormatError, match=r"damaged"):
        read_stage_file(path)


@pytest.mark.parametrize(
    "arrays",
    [
        [["<f8", [10**9], "C"]],
        [["<f8", [2**40, 2**40], "C"]],
        [["<f8", [10**9, 0], "C"]],
        [["<f8", [-1, -2], "C"]],
        [["<f8", [1] * 64, "C"]],
        [["|O", [2], "C"]],
        [["<U1000000", [2], "C"]],
        [["<M8[s]", [2], "C"]],
        [["V100000000", [2], "C"]],
        [["<f8", [2], "K"]],
        [["<f8", [2]]],
        [["<f8", "2", "C"]],
        [["<f8", [1e400], "C"]],
        [[["<f8"], [2], "C"]],
        {"0": 1},
        None,
        3,
    ],
    ids=ascii,
)
def test_arrays_that_the_file_does_not_hold_are_refused_before_room_is_made(tmp_path, arrays):
    path = with_header(tmp_path / "fit.result", arrays, content=bytes(16))
    tracemalloc.start()
    with pytest.raises(FileFormatError, match="damaged"):
        read_stage_file(path)
    assert tracemalloc.get_traced_memory()[1] < 2**20
    tracemalloc.stop()


def test_millions_of_empty_values_are_refused_before_they_are_made(tmp_path):
    text = b"[" + b"[]," * (1 << 21) + b"0]"
    path = tmp_path / "fit.result"
    path.write_bytes(MAGIC + bytes(32) + len(text).to_bytes(8, "little") + text)
    tracemalloc.start()
    with pytest.raises(FileFormatError, match="256 MB of memory"):
        read_stage_file(path)
    assert tracemalloc.get_traced_memory()[1] < 2 * len(text)
    tracemalloc.stop()


def test_a_length_beyond_the_end_is_damage(tmp_path):
    path = tmp_path / "fit.result"
    path.write_bytes(MAGIC + bytes(32) + b"\xff" * 8)
    assert path.stat().st_size == START
    with pytest.raises(FileFormatError, match="damaged"):
        read_stage_file(path)


@pytest.mark.parametrize("values", [np.array(["a"]), np.array([None]), np.array(["2026"], "M8")], ids=str)
def test_what_is_no_number_is_not_written(tmp_path, values):
    with pytest.raises(TypeError, match="cannot be kept"):
        write(tmp_path / "fit.result", arrays=[values])
    assert not (tmp_path / "fit.result").exists()


def test_a_tree_that_could_not_be_read_again_is_not_written(tmp_path):
    with pytest.raises(TypeError, match="too many values"):
        write(tmp_path / "fit.result", tree=[[]] * 1_200_000)
