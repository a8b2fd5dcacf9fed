"""Arrays survive the way into the page."""

import base64

import numpy as np
import pytest
from numpy.testing import assert_allclose

from frf_ipz.report.page_data import Packer, short_numbers

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


def unshortened(short):
    whole = np.frombuffer(base64.b64decode(short["bytes"]), "<u2").astype(float)
    values = np.where(whole == 65535, np.nan, short["low"] + short["step"] * whole)
    return np.exp(values) if short.get("log") else values


@pytest.mark.parametrize(
    ("values", "tolerance"),
    [
        (5.0 + 0.25 * np.array([0, 1, 4, 9, 4000]), 1e-12),  # lines of a spectrum: exact
        (np.geomspace(1e-9, 1e-2, 500), 2e-4),  # a magnitude: 0.002 dB
        (np.where(np.arange(500) % 7, np.linspace(0, 1, 500), np.nan), 1e-5),  # a coherence with gaps
        (np.full(30, 3.0), 1e-12),
        (np.full(30, np.nan), 1e-12),
        (np.linspace(-180.0, 180.0, 500) ** 3, 2e-5),
    ],
)
def test_numbers_of_16_bits_are_as_good_as_a_screen_shows(values, tolerance):
    found = unshortened(short_numbers(values))
    scale = np.abs(values) if short_numbers(values).get("log") else np.nanmax(np.abs([*values, 1e-300]))
    assert np.array_equal(np.isnan(found), np.isnan(values))
    assert np.all((np.abs(found - values) <= tolerance * scale) | np.isnan(values))


def test_pages_of_many_frfs_hold_short_numbers():
    packer = Packer(is_short=True)
    reference = packer.pack(np.linspace(0.0, 1.0, 100))
    assert_allclose(unshortened(packer.arrays[reference["$"]]), np.linspace(0.0, 1.0, 100), atol=1e-5)
