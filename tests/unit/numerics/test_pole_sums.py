"""Sums over poles at many lines, against the sums themselves."""

import numpy as np
import pytest

from frf_ipz.numerics.pole_sums import PoleSums

SAME = 1e-11  # relative to the largest value of the sum


def models(rng):
    omega = np.linspace(50.0, 60e3, 120) * np.exp(0.01 * rng.standard_normal((3, 120)))
    poles = list((-0.01 + 1j) * omega)
    poles[2] = np.append(poles[2], [-300.0, -2e4])
    return poles, [rng.standard_normal((len(p), 4)) + 1j * rng.standard_normal((len(p), 4)) for p in poles]


@pytest.mark.parametrize(
    "s",
    [
        1j * np.linspace(20, 9e3, 400),
        np.array([2e3j]),
        1j * np.linspace(0, 9e3, 400),
        100 + 1j * np.linspace(20, 9e3, 50),
    ],
    ids=["band", "one line", "from 0 Hz", "beside the axis"],
)
def test_sums_are_those_over_poles_and_conjugates(s):
    poles, residues = models(np.random.default_rng(1))
    sums = PoleSums.over(poles, s)
    for number, (p, r) in enumerate(zip(poles, residues, strict=True)):
        found = np.concatenate(
            [sums.factors(number, part) @ sums.terms(number, r) for part in (slice(0, 100), slice(100, None))]
        )
        expected = (1 / (s[:, None] - p)) @ r + (1 / (s[:, None] - p.conj())) @ r.conj()
        assert np.abs(found - expected).max() < SAME * np.abs(expected).max()


def test_lines_cost_what_poles_in_the_band_and_nodes_are():
    poles, _ = models(np.random.default_rng(1))
    factors = PoleSums.over(poles, 1j * np.linspace(20, 9e3, 1000)).factors(0, slice(None))
    assert factors.shape[1] < 80  # of 240 poles, some 18 of them in the band
