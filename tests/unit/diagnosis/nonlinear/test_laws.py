import numpy as np
import pytest
from numpy.testing import assert_allclose

from frf_ipz.diagnosis.nonlinear.laws.finder import shipped_laws
from frf_ipz.diagnosis.nonlinear.laws.law import Law, StepCompliance

STEP = {"cubic_stiffness": (2e-5, 1e-2, 3e9, 0.0), "gap_contact": (2e-5, 1e-2, 3e5, 2e-4)}
SOLVED = 1e-9  # relative: Newton's method ends far closer


def test_all_laws_of_the_contract_are_found():
    assert set(shipped_laws()) == {"cubic_stiffness", "dry_friction", "gap_contact"}


@pytest.mark.parametrize("name", STEP)
def test_force_of_a_step_fits_the_motion_that_it_leaves(name):
    law, step = shipped_laws()[name], StepCompliance(*STEP[name])
    w = np.linspace(-1e-3, 1e-3, 41)
    force = law.solve(w, np.zeros_like(w), step)
    law_force = step.strength * law.unit_force(w - step.motion * force, np.zeros_like(w), step.shape)
    assert np.abs(force).max() > 1e-3 * step.strength * 1e-9
    assert_allclose(law_force, force, rtol=SOLVED, atol=SOLVED * np.abs(force).max())


def test_friction_sticks_below_its_force_and_slides_above():
    law, step = shipped_laws()["dry_friction"], StepCompliance(1e-6, 1e-2, 5.0, 0.0)
    v = np.array([-0.2, -0.04, 0.0, 0.03, 0.2])
    force = law.solve(np.zeros_like(v), v, step)
    assert_allclose(force, [-5.0, -4.0, 0.0, 3.0, 5.0], rtol=SOLVED, atol=SOLVED)
    assert_allclose((v - step.velocity * force)[1:4], 0.0, atol=1e-15)


def test_a_users_law_needs_its_force_only():
    class Cubic(Law):
        name = "mine"
        strength_name = "k"

        def unit_force(self, w, v, shape):
            del v, shape
            return w**3

    step = StepCompliance(*STEP["cubic_stiffness"])
    w = np.linspace(2e-4, 1e-3, 7)
    expected = shipped_laws()["cubic_stiffness"].solve(w, 0 * w, step)
    assert_allclose(Cubic().solve(w, 0 * w, step), expected, rtol=1e-6, atol=0)  # by finite differences
