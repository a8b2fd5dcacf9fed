"""Arrays survive the way into the page."""

import base64

import numpy as np

from frf_ipz.report.page_data import Packer

SINGLE = 2e-7  # relative rounding of single precision


def unpacked(packer, reference):
    return np.frombuffer(base64.b64decode(packer.arrays[reference["$"]]), "<f4")


def test_long_arrays_come_back_in_single_precision():
    packer = Packer()
    values = np.geomspace(1e-12, 1e6, 100)
    arrays = unpacked(packer, packer.pack({"x": values})["x"])
    np.testing.assert_allclose(arrays, values, rtol=SINGLE, atol=0)


def test_equal_arrays_are_stored_once():
    packer = Packer()
    first, second = packer.pack([np.arange(50.0), np.arange(50)])
    assert first == second
    assert len(packer.arrays) == 1


def test_short_arrays_are_numbers():
    assert Packer().pack(np.array([1.0, 2.5])) == [1.0, 2.5]


def test_what_is_not_finite_is_null_or_nan():
    packer = Packer()
    assert packer.pack([np.inf, np.float64(np.nan), 1.0]) == [None, None, 1.0]
    long = np.full(40, np.nan)
    assert np.isnan(unpacked(packer, packer.pack(long))).all()


def test_plain_values_stay_what_they_are():
    tree = {"a": True, "b": [1, "x", None], "c": (np.int64(3), np.bool_(False))}
    assert Packer().pack(tree) == {"a": True, "b": [1, "x", None], "c": [3, False]}
