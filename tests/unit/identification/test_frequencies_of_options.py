"""Frequencies in [fit] that can have no effect, or another than is meant, are refused or said, with their key."""

import numpy as np
import pytest

from frf_ipz.errors import InputError
from frf_ipz.identification.fit import fit_modes
from frf_ipz.identification.options import FitOptions, PinnedPole, RejectedPole
from frf_ipz.modes import ModalParameters
from synthetic_frfs import accelerances, random_modes

LINES_HZ = np.arange(40.0, 500.5, 0.5) / 2.0
SEED = 5


@pytest.fixture(scope="module")
def frfs():
    modes = random_modes(np.array([42.7, 136.8]), 0.01, n_outputs=2, n_inputs=1, seed=SEED)
    return accelerances(modes, LINES_HZ, noise=1e-3, seed=SEED)


def stated():
    shapes = np.ones((1, 2), complex)
    return ModalParameters(
        dofs=("1:+z",), natural_frequency_hz=np.array([40.0, 80.0]), damping_ratio=np.array([0.01, 0.01]), shapes=shapes
    )


@pytest.mark.parametrize("band_hz", [None, (25.0, 200.0)])
@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"pin_hz": (1e9,)}, "pin_hz at 1e[+]09 Hz: outside of the band that is fitted, .* to .* Hz"),
        ({"pin_hz": (PinnedPole(hz=500.0, why="seen"),)}, "pin_hz at 500 Hz"),
        ({"pin_hz": (42.7, 2.0)}, "pin_hz at 2 Hz"),
        ({"strike": (RejectedPole(hz=900.0, why="x"),)}, "strike at 900 Hz"),
        ({"strike": (RejectedPole(hz=3.0, why="x"),), "pin_hz": (0.5,)}, "pin_hz at 0.5 Hz, strike at 3 Hz"),
    ],
)
def test_poles_outside_of_the_band_are_refused_with_their_key(frfs, band_hz, options, says):
    with pytest.raises(InputError, match=rf"^\[fit\] {says}"):
        fit_modes(frfs, options=FitOptions(band_hz=band_hz, **options))


def test_a_pole_at_the_edge_of_the_band_may_be_rejected(frfs):
    fit = fit_modes(frfs, options=FitOptions(band_hz=(25.0, 200.0), strike=(RejectedPole(hz=201.0, why="edge"),)))
    assert "edge" in set(fit.decisions["reason"])


def test_poles_outside_of_the_band_of_stated_modes_are_refused():
    with pytest.raises(InputError, match=r"^\[fit\] strike at 900 Hz: outside of the band that is fitted, 30 to 90 Hz"):
        fit_modes(stated(), options=FitOptions(band_hz=(30.0, 90.0), strike=(RejectedPole(hz=900.0, why="x"),)))


@pytest.mark.parametrize("exclude_hz", [((20.0, 250.0),), ((10.0, 120.0), (119.0, 300.0))])
def test_an_exclusion_of_the_whole_band_is_blamed_itself(frfs, exclude_hz):
    with pytest.raises(InputError, match=r"exclude_hz leaves no frequency line of the band 25 to 240 Hz") as caught:
        fit_modes(frfs, options=FitOptions(band_hz=(25.0, 240.0), exclude_hz=exclude_hz))
    assert "set another [fit] band_hz" not in str(caught.value)


def test_an_exclusion_of_nearly_the_whole_band_is_blamed_itself(frfs):
    with pytest.raises(InputError, match=r"usable frequency lines remain .*: exclude less of it by \[fit\] exclude_hz"):
        fit_modes(frfs, options=FitOptions(band_hz=(25.0, 240.0), exclude_hz=((25.5, 240.0),)))


def test_an_exclusion_of_all_stated_modes_is_blamed_itself():
    with pytest.raises(InputError, match=r"no mode of the test is left .*: take less out by \[fit\] exclude_hz"):
        fit_modes(stated(), options=FitOptions(band_hz=(30.0, 90.0), exclude_hz=((35.0, 85.0),)))


def test_keys_without_effect_on_stated_modes_are_said():
    options = FitOptions(pin_hz=(50.0,), delay=True, strike=(RejectedPole(hz=60.0, why="x"),))
    texts = fit_modes(stated(), options=options).warnings
    assert "[fit] pin_hz, delay: no effect, as the modes were identified elsewhere" in texts
    assert "[fit] strike takes out no mode at 60 Hz: none is there" in texts


def test_an_exclusion_without_effect_is_said(frfs):
    fit = fit_modes(frfs, options=FitOptions(band_hz=(25.0, 200.0), exclude_hz=((49.5, 50.5), (900.0, 901.0))))
    (text,) = (text for text in fit.warnings if "exclude_hz" in text)
    assert text == "[fit] exclude_hz takes out no line by 900 to 901 Hz: the lines of the band go from 25 to 200 Hz"


def test_milliseconds_are_only_thought_of_where_they_would_explain_the_band(frfs):
    with pytest.raises(InputError, match="set another") as caught:
        fit_modes(frfs, options=FitOptions(band_hz=(400.0, 900.0)))
    assert "ms" not in str(caught.value)
