"""Sizes that double precision cannot hold together are an error of the package, or right; never one of a solver."""

from contextlib import suppress

import numpy as np
import pytest

import frf_ipz

BEAM = {
    "length_m": 0.5,
    "width_m": 0.02,
    "thickness_m": 0.005,
    "youngs_modulus_Pa": 70e9,
    "density_kg_m3": 2700.0,
    "elements": 10,
    "left": "clamped",
}
FAR = (1e-300, 1e-30, 1e-12, 1e12, 1e20, 1e30)


@pytest.mark.parametrize("value", FAR)
@pytest.mark.parametrize("key", ["length_m", "width_m", "thickness_m", "youngs_modulus_Pa", "density_kg_m3"])
def test_a_beam_far_from_any(key, value):
    with suppress(frf_ipz.FrfIpzError):
        modes = frf_ipz.solve_modes(frf_ipz.make_beam(**BEAM | {key: value}), n_modes=3)
        assert np.isfinite(modes.natural_frequency_hz).all()


@pytest.mark.parametrize("stiffness", [1e9, 1e12, 1e15, 1e20])
def test_a_spring_that_stands_for_a_support_holds(stiffness):
    """A free end held by a stiff spring is a clamped one."""
    spring = frf_ipz.BeamPointSpring(node=1, stiffness_N_m=stiffness, rotational_stiffness_Nm_rad=stiffness)
    held = frf_ipz.make_beam(**BEAM | {"left": "free", "point_spring": [spring]})
    clamped = frf_ipz.solve_modes(frf_ipz.make_beam(**BEAM), n_modes=4).natural_frequency_hz
    np.testing.assert_allclose(frf_ipz.solve_modes(held, n_modes=4).natural_frequency_hz, clamped, rtol=1e-4)
