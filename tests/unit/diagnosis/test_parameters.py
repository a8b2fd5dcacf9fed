"""What a diagnosis has found are parameters that an update, by either method, brings to what was measured."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosed import beam, labels, measured, observed
from frf_ipz.diagnosis.apply import correct_model
from frf_ipz.diagnosis.diagnose import diagnose
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.diagnosis.parameters import _modal_damping_matrix, make_diagnosed_basis
from frf_ipz.dofs import Dof
from frf_ipz.errors import InputError
from frf_ipz.fe.changes import with_point_masses
from frf_ipz.fe.reduction.options import ReduceOptions
from frf_ipz.fe.reduction.reduce import reduce_to_dofs
from frf_ipz.identification.fit import fit_modes
from frf_ipz.identification.options import FitOptions
from frf_ipz.pairing.pair import pair_roots
from frf_ipz.updating.options import UpdateOptions
from frf_ipz.updating.update import update_model

MASS_KG, OFF = 0.02, 0.85  # the value that an update starts from, over the one that was found
ROUNDING = 1e-8  # of the largest entry
NEAR = 0.02  # relative: noise, and modes above the band that the reduction has left out


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    nominal = beam(tmp_path_factory.mktemp("beam"))
    frfs = measured(with_point_masses(nominal, {12: MASS_KG}))
    diagnosis = diagnose(observed(frfs), nominal, options=DiagnoseOptions(effects=("added_mass", "grounded_spring")))
    (finding,) = diagnosis.findings
    wrong = replace(diagnosis, findings=(replace(finding, values=tuple(OFF * value for value in finding.values)),))
    fit = fit_modes(frfs, options=FitOptions(band_hz=(10.0, 700.0)))
    model = correct_model(wrong, nominal)
    ends = [tuple(dict.fromkeys(ends)) for ends in zip(*((x.input_dof, x.output_dof) for x in labels()), strict=True)]
    reduced = reduce_to_dofs(
        model, options=ReduceOptions(), actuators=ends[0], sensors=ends[1], points=(), band_hz=fit.band_hz
    )
    return nominal, wrong, fit, reduced


def test_the_parameter_is_the_mass_relative_to_what_was_found(case):
    nominal, wrong, _, reduced = case
    basis = make_diagnosed_basis(wrong, nominal, reduced)
    assert basis.is_from_diagnosis
    assert basis.names == ("added_mass mass_kg",)
    assert not basis.stiffness.any()
    location = reduced.row(nominal.all_dofs[nominal.full_index(labels()[0].output_dof)])
    assert location.shape == (len(reduced.dofs),)
    row = reduced.expansion[[dof.name for dof in reduced.expanded_dofs].index("12:z")]
    np.testing.assert_allclose(basis.mass[0], OFF * MASS_KG * np.outer(row, row), rtol=NEAR, atol=1e-12)


@pytest.mark.parametrize("method", ["minimal-change", "ipz"])
def test_an_update_of_what_was_found_finds_its_size(case, method):
    nominal, wrong, fit, reduced = case
    options = UpdateOptions(method=method, damping=False, delta=1e-9, max_iterations=60)
    basis = make_diagnosed_basis(wrong, nominal, reduced)
    updated = update_model(fit, reduced, pairs=pair_roots(fit, reduced), options=options, basis=basis)
    row = reduced.expansion[[dof.name for dof in reduced.expanded_dofs].index("12:z")]
    added = row @ (updated.model.mass - reduced.mass) @ row / (row @ row) ** 2
    assert abs(wrong.findings[0].values[0] + added - MASS_KG) < NEAR * MASS_KG


def test_nothing_in_the_structure_is_refused(case):
    nominal, wrong, _, reduced = case
    with pytest.raises(InputError, match="nothing in the structure"):
        make_diagnosed_basis(replace(wrong, findings=()), nominal, reduced)


@pytest.mark.parametrize("left_end", ["clamped", "free"])
def test_modal_damping_is_that_of_the_reduction(tmp_path, left_end):
    model = replace(beam(tmp_path, left=left_end), modal_damping=np.array([0.01, 0.02, 0.03, 0.005]))
    ends = {"actuators": (Dof(5, "z"),), "sensors": (Dof(12, "z"),), "points": ()}
    reduced = reduce_to_dofs(model, options=ReduceOptions(), band_hz=(10.0, 700.0), **ends)
    size = np.abs(reduced.damping).max()
    np.testing.assert_allclose(_modal_damping_matrix(model, reduced), reduced.damping, atol=ROUNDING * size)
