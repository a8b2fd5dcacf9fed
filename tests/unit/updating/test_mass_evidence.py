"""Frequencies tell whether the mass of a model is off, or the test."""

from types import SimpleNamespace

import numpy as np
import pytest

from frf_ipz.updating.mass_evidence import frequency_factor, probability_of_mass

ROOTS = np.array([100j, 150j, 420j, 900j])


def pairs_of(measured, kinds):
    return SimpleNamespace(
        targets=[SimpleNamespace(kind=kind, measured_value=value) for kind, value in zip(kinds, measured, strict=True)]
    )


def test_the_factor_of_squared_frequencies_is_that_of_the_poles():
    measured = ROOTS * np.sqrt(1.06) * np.exp([0.01, 0.3, -0.01, 0.0])
    factor, std = frequency_factor(pairs_of(measured, ["pole", "zero", "pole", "pole"]), ROOTS)
    assert factor == pytest.approx(np.log(1.06), rel=1e-9)
    assert std == pytest.approx(0.02 / np.sqrt(3), rel=1e-9)


def test_one_pole_tells_nothing():
    assert frequency_factor(pairs_of(ROOTS[:1], ["pole"]), ROOTS[:1]) == (0.0, np.inf)
    assert probability_of_mass(0.2, 0.01, 0.0, np.inf) == 0.5


@pytest.mark.parametrize("log_level", [-0.3, -0.06, 0.06, 0.3])
def test_frequencies_off_by_the_same_factor_speak_for_the_mass_and_others_against_it(log_level):
    alike = probability_of_mass(log_level, 0.005, log_level, 0.01)
    none = probability_of_mass(log_level, 0.005, 0.0, 0.01)
    opposite = probability_of_mass(log_level, 0.005, -log_level, 0.01)
    assert min(none, opposite) > 1 / 3
    assert max(none, opposite) < 0.5 < alike < 1.0


def test_a_mass_at_some_places_is_never_excluded():
    assert probability_of_mass(3.0, 0.001, 0.0, 0.001) == pytest.approx(1 / 3, abs=0.01)
