"""What holds for every update, whatever the structure: on random beams, frames and plates."""

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from frf_ipz.export.state_space import make_state_space, to_control
from frf_ipz.fe.response import compute_frfs
from frf_ipz.frf import FrfLabel
from frf_ipz.numerics.pencils import undamped_poles
from frf_ipz.updating.options import UpdateOptions
from frf_ipz.updating.parameters import make_structural_basis
from frf_ipz.updating.update import update_model
from frf_ipz.updating.updated_model import UpdateStatus
from frf_testbench.updating.study import make_update_case

EXAMPLES = settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.too_slow])  # an update each
SEEDS = st.integers(2000, 10**6)  # beyond all that constants were chosen or reported on
ROUNDING = 1e-9  # of the largest value


def updated(seed, *, parts, mass=False, ensemble=5):
    case = make_update_case(seed)
    basis = make_structural_basis(case.structure.nominal_model, case.reduced_model, mass=mass) if parts else None
    return case, update_model(
        case.fit, case.reduced_model, pairs=case.pairs, options=UpdateOptions(ensemble=ensemble), basis=basis
    )


@EXAMPLES
@given(SEEDS, st.booleans(), st.booleans())
def test_an_update_keeps_a_structure_a_structure(seed, parts, mass):
    case, update = updated(seed, parts=parts, mass=mass)
    assert update.status in {UpdateStatus.CONVERGED, UpdateStatus.MAX_ITERATIONS, UpdateStatus.NOTHING_TO_DO}
    for members in ((update.model.mass, update.model.damping, update.model.stiffness), *update.ensemble):
        for matrix in members:
            assert np.array_equal(matrix, matrix.T)
            assert np.linalg.eigvalsh(matrix)[0] >= -ROUNDING * np.abs(matrix).max() * len(matrix)
    nominal = undamped_poles(case.reduced_model.mass, case.reduced_model.stiffness).values.real
    rigid = int(np.count_nonzero(nominal < 1e-6 * np.abs(case.fit.model.poles[0]) ** 2))
    after = undamped_poles(update.model.mass, update.model.stiffness).values.real
    assert np.all(after[:rigid] < 1e-5 * np.abs(case.fit.model.poles[0]) ** 2)


@EXAMPLES
@given(SEEDS)
def test_an_update_is_reciprocal_and_its_export_the_same_model(seed):
    case, update = updated(seed, parts=True)
    first = case.labels[0]
    back = FrfLabel(first.input_dof, first.output_dof, first.quantity)
    s = 2j * np.pi * np.linspace(*case.fit.band_hz, 20)
    forward, updated_again = compute_frfs(update.model, [first, back], s).T
    assert np.abs(forward - updated_again).max() < ROUNDING * np.abs(forward).max()
    exported = to_control(make_state_space(case.fit, update, points=case.structure.points))(s)
    row = exported.reshape(-1, exported.shape[-1])[0]
    assert np.abs(row - forward).max() < 1e-6 * np.abs(forward).max()


def units_do_not_matter(seed, factor):
    """Masses and stiffnesses in other units are the same structure: poles and zeros stay, and so do the ratios.

    Whether an update is kept is left out: of two models whose levels differ, which one is nearer to that of FRFs which
    stay in their unit goes with the unit of the matrices.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("frf_ipz.updating.update.keep_if_better", lambda update, _fit: update)
        _units_do_not_matter(seed, factor)


def _units_do_not_matter(seed, factor):
    case, update = updated(seed, parts=False, ensemble=0)
    model = case.reduced_model
    in_other_units = type(model)(
        mass=factor * model.mass,
        damping=factor * model.damping,
        stiffness=factor * model.stiffness,
        dofs=model.dofs,
        expansion=model.expansion,
        expanded_dofs=model.expanded_dofs,
        n_modes=model.n_modes,
    )
    updated_again = update_model(case.fit, in_other_units, pairs=case.pairs, options=UpdateOptions(ensemble=0))
    assert_allclose(updated_again.after, update.after, rtol=1e-6)


@settings(EXAMPLES, max_examples=4)
@given(SEEDS, st.sampled_from([1e-3, 1e3]))
def test_units_do_not_matter(seed, factor):
    units_do_not_matter(seed, factor)


@pytest.mark.slow
@EXAMPLES
@example(483182, 1e-3)  # its update is not kept where the matrices are in SI
@example(642030, 1e-3)  # its search for masses once went where the error of an amplitude is e^309
@given(SEEDS, st.sampled_from([1e-3, 1e3]))
def test_units_matter_nowhere(seed, factor):
    units_do_not_matter(seed, factor)
