"""The uncertainty weight lies above the posterior, is stable and stays close."""

import numpy as np
import pytest

from chains import chain, label, updated
from frf_ipz.dofs import Dof
from frf_ipz.errors import InputError
from frf_ipz.export.uncertainty import estimate_uncertainty_weights
from measured_labels import measured

LINES = np.linspace(2.0, 120.0, 300)
LABELS = (label(2, 1), label(2, 3))


def spread(factors):
    model = chain(damping=0.05, between=True)
    return updated(model, [(model.mass, model.damping, factor * model.stiffness) for factor in factors])


@pytest.fixture(scope="module")
def weights():
    return estimate_uncertainty_weights(
        measured(LABELS), spread(np.linspace(0.97, 1.03, 30)), points=(Dof(99, "x"),), frequency_hz=LINES
    )


def test_the_weight_bounds_the_members_and_stays_close(weights):
    assert weights.output_names == ("2:+x", "99:+x")
    for output, system in enumerate(weights.to_control()):
        bound, error = np.abs(system(2j * np.pi * LINES)), weights.relative_error[:, output]
        assert np.all(bound >= error)
        assert bound.min() / error.max() < 10
        assert (bound / error).min() < 1 + 1e-6


def test_it_is_stable_and_so_is_its_inverse(weights):
    for system in weights.to_control():
        assert np.all(system.poles().real < 0)
        assert np.all(system.zeros().real < 0)


def test_the_error_is_that_of_the_row_over_all_inputs():
    """Static: every member is softer or stiffer by its factor, so the error is |1 / factor - 1|."""
    weights = estimate_uncertainty_weights(
        measured(LABELS), spread([0.8] * 10), points=(), frequency_hz=np.array([1e-3, 2e-3, 3e-3])
    )
    np.testing.assert_allclose(weights.relative_error, 0.25, rtol=1e-3)


def test_without_an_ensemble_nothing_is_known():
    with pytest.raises(InputError, match="minimal-change"):
        estimate_uncertainty_weights(measured(LABELS), spread([]), points=(), frequency_hz=LINES)
