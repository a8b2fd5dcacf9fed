"""The nuisance prior: how many modes scatter, and how much."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from frf_ipz import read_model, solve_modes
from frf_ipz.diagnosis.model.basis import make_basis
from frf_ipz.diagnosis.model.layout import make_layout
from frf_ipz.diagnosis.model.nuisance import UNIFORM_STD, NuisanceBlocks, make_nuisance_prior
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.dofs import Dof
from frf_ipz.frf import FrfLabel, FrfQuantity

BEAM = """
[model]
kind = "beam"
[damping]
modal_ratio = 0.01
[beam]
length_m = 0.6
elements = 60
formulation = "{formulation}"
youngs_modulus_Pa = 2.1e11
density_kg_m3 = 7800
poisson_ratio = 0.3
width_m = 0.03
thickness_m = {thickness_m}
left = "free"
right = "free"
"""


def model_of(folder, *, thickness_m=0.01, formulation="euler-bernoulli"):
    path = folder / f"{formulation}.toml"
    path.write_text(BEAM.format(thickness_m=thickness_m, formulation=formulation))
    return read_model(path)


def nuisance_prior_of(model, top_hz):
    label = FrfLabel(output_dof=Dof(1, "z"), input_dof=Dof(12, "z"), quantity=FrfQuantity.ACCELERANCE)
    basis = make_basis(model, 2 * np.pi * top_hz, [label.output_dof, label.input_dof])
    return make_nuisance_prior(basis, make_layout([label]), DiagnoseOptions())


def test_the_damping_of_modes_beyond_the_band_is_less_certain(tmp_path):
    model, top_hz = model_of(tmp_path), 1500.0
    nuisance_prior = nuisance_prior_of(model, top_hz)
    frequency_hz = solve_modes(model, n_modes=nuisance_prior.n_modes).natural_frequency_hz
    inside, tolerance = frequency_hz <= top_hz, UNIFORM_STD * DiagnoseOptions().damping_tolerance
    assert_allclose(nuisance_prior.damping_std[2:][inside[2:]], tolerance)
    assert (nuisance_prior.damping_std[~inside] > 1.5 * tolerance).all()
    assert (nuisance_prior.damping_std <= 0.5).all()


@pytest.mark.parametrize(("thickness_m", "brings"), [(0.08, True), (0.01, False)])
def test_modes_that_shear_brings_into_the_band_scatter(tmp_path, thickness_m, brings):
    model = model_of(tmp_path, thickness_m=thickness_m)
    sheared = model_of(tmp_path, thickness_m=thickness_m, formulation="timoshenko")
    top_hz = 25_000.0 if brings else 3000.0
    below = int(np.count_nonzero(solve_modes(sheared, n_modes=20).natural_frequency_hz <= top_hz))
    twice = int(np.count_nonzero(solve_modes(model, n_modes=20).natural_frequency_hz <= 2 * top_hz))
    assert (below > twice) == brings, "the case is not what it should be"
    n_modes = nuisance_prior_of(model, top_hz).n_modes
    assert n_modes >= below
    assert brings or n_modes == twice


def test_each_parameter_stands_in_one_block():
    blocks = NuisanceBlocks.in_order(
        stiffness=3, mass=3, damping=2, coupling=1, suspension=1, output_shifts=4, input_shifts=2, local=2, gains=3
    )
    in_turn = np.concatenate([np.arange(21)[getattr(blocks, name)] for name in NuisanceBlocks.__dataclass_fields__])
    assert in_turn.tolist() == list(range(21))
