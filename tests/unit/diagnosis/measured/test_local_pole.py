"""The pole of a single resonance."""

import numpy as np

from frf_ipz.diagnosis.measured.local_pole import fit_local_pole

POLE = 2 * np.pi * 50 * (-0.01 + 1j)
S = 6.0 + 2j * np.pi * np.linspace(48.0, 52.0, 30)


def resonance(noise):
    return (1 / (S - POLE) + 0.01) * (1 + noise * np.random.default_rng(0).standard_normal(len(S)))


def test_standard_deviations_do_not_depend_on_the_unit():
    """Of one resonance with noise, as accelerance and as faint as compliances in m/N are."""
    strong, faint = (fit_local_pole(S, unit * resonance(1e-3), 1.001 * POLE) for unit in (1.0, 1e-9))
    np.testing.assert_allclose([faint.pole, faint.std_rad_s], [strong.pole, strong.std_rad_s], rtol=1e-6)
    assert strong.std_rad_s > 1e-5 * abs(strong.pole)
    assert abs(strong.pole - POLE) < 4 * strong.std_rad_s


def test_noise_alone_has_no_pole():
    rng = np.random.default_rng(1)
    assert fit_local_pole(S, rng.standard_normal(len(S)) + 1j * rng.standard_normal(len(S)), POLE) is None
