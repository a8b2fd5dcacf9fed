"""JSON of anybody's: one object, within a bound of memory."""

import json
import tracemalloc

import pytest

from frf_ipz.errors import FileFormatError
from frf_ipz.json_files import memory_of_values, read_json


def test_an_object_is_read(tmp_path):
    path = tmp_path / "run.json"
    path.write_text('{"a": [1, "ä", null, "\\ud83d\\udd28"]}', encoding="utf-8")
    assert read_json(path) == {"a": [1, "ä", None, "\U0001f528"]}


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (b"", "no JSON text"),
        (b"[1, 2]", "no JSON object"),
        (b'{"a": \xff}', "no JSON text"),
        (b'{"a": 1', "no JSON text"),
        (b"\x00" * 100, "no JSON text"),
        (b'{"a":' + b"[" * 100_000, "no JSON text"),
        (b'{"a":' + b"9" * 5000 + b"}", "no JSON text"),
        (b'{"a": "\\ud800"}', "no JSON text"),
        (b'{"a": [' + b"[]," * (1 << 21) + b"0]}", "256 MB of memory"),
    ],
    ids=["empty", "list", "bytes", "cut", "zeros", "deep", "long number", "half a letter", "many"],
)
def test_what_is_none_is_refused_in_one_line(tmp_path, data, problem):
    path = tmp_path / "run.json"
    path.write_bytes(data)
    with pytest.raises(FileFormatError, match=problem) as caught:
        read_json(path)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize(
    "value",
    [
        [[]] * 10_000,
        [{}] * 10_000,
        [{"a": 1}] * 10_000,
        [1e-9 * number for number in range(10_000)],
        list(range(10**9, 10**9 + 10_000)),
        ["ab" + chr(0x1F600)] * 10_000,
        ["x" * 100_000 + chr(0x1F600)],
        {f"name {number}": number for number in range(10_000)},
        [[[[[]]]]] * 5000,
    ],
    ids=["lists", "objects", "full objects", "numbers", "integers", "texts", "wide text", "names", "nested"],
)
def test_the_bound_of_memory_holds(value):
    data = json.dumps(value, separators=(",", ":"), ensure_ascii=False).encode()
    tracemalloc.start()
    kept = json.loads(data.decode())
    used = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert kept == value
    assert used < memory_of_values(data)
