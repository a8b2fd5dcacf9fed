"""FRFs of an ensemble, all at once, against those of each member."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from chains import chain, label
from frf_ipz.fe.response import compute_frfs
from frf_ipz.numerics import pole_forms
from frf_ipz.numerics.pencils import undamped_poles
from frf_ipz.numerics.pole_forms import DampedModel
from frf_ipz.prediction.ensemble import ModelEnsemble

S = 2j * np.pi * np.linspace(2.0, 100.0, 30)
SAME = 1e-8  # relative to the peak: modes and matrices solve one problem in two ways


def members(models):
    ensemble = np.array([(model.mass, model.damping, model.stiffness) for model in models])
    return ModelEnsemble(matrices=ensemble, lowest_rad_s=float(np.abs(S).min()))


@pytest.mark.parametrize("damping", [0.001, 0.3], ids=["light", "heavy"])
def test_receptances_are_those_of_the_matrices(damping):
    models = [chain(seed=seed, damping=damping, between=True) for seed in range(4)]
    frf_label = label(99, 3)
    output, force = models[0].row(frf_label.output_dof), models[0].row(frf_label.input_dof)
    computed = members(models).receptance(output, force, S)
    for member, model in zip(computed, models, strict=True):
        expected = compute_frfs(model, [frf_label], S)[:, 0]
        assert np.abs(member - expected).max() < SAME * np.abs(expected).max()


@pytest.mark.parametrize("is_free", [False, True])
def test_a_member_by_its_poles_is_that_of_its_matrices(is_free, monkeypatch):
    """Poles that receptances need are not computed again for zeros; of a free body they are others."""
    ensemble = members([chain(seed=seed, damping=0.02, between=True, free=is_free) for seed in range(3)])
    expected = [DampedModel.of(*matrices) for matrices in ensemble.matrices]
    assert len(ensemble.roots) == 3
    again, rows = [], (np.eye(5)[[0, 1]], np.eye(5)[[2, 1]])
    monkeypatch.setattr(pole_forms, "undamped_poles", lambda *given: again.append(given) or undamped_poles(*given))
    for member, by_matrices in enumerate(expected):
        by_poles = ensemble.by_poles(member)
        for found, told in ((by_poles.damped, by_matrices.damped), (by_poles.undamped, by_matrices.undamped)):
            assert_allclose(np.sort_complex(found.poles), np.sort_complex(told.poles), rtol=1e-9, atol=1e-3)
            near = 60j if told.damping is not None else 3600.0
            zeros, is_found = told.zeros(*rows, np.full(2, near))
            assert is_found.all()
            assert_allclose(found.zeros(*rows, zeros)[0], zeros, rtol=1e-8)
    assert bool(again) == is_free


def test_a_body_that_is_free_to_fly_has_no_division_by_zero():
    model = chain(free=True)
    frf_label = label(1, 5)
    computed = members([model]).receptance(model.row(frf_label.output_dof), model.row(frf_label.input_dof), S)[0]
    expected = compute_frfs(model, [frf_label], S)[:, 0]
    assert_allclose(computed, expected, rtol=1e-4)  # its rigid-body mode is given a thousandth of the lowest frequency


def test_amplitudes_are_products_of_mass_normalised_shapes():
    model = chain()
    frf_label = label(2, -4)
    computed = members([model]).amplitudes(model.row(frf_label.output_dof), model.row(frf_label.input_dof), 3)
    shapes = undamped_poles(model.mass, model.stiffness).right_vectors.real
    assert computed.shape == (1, 3)
    assert_allclose(computed[0], -shapes[1, :3] * shapes[3, :3], rtol=1e-9)


def test_a_negative_stiffness_counts_as_none():
    model = chain()
    soft = replace(model, stiffness=model.stiffness - 3e4 * np.eye(5))
    assert undamped_poles(soft.mass, soft.stiffness).values.real.min() < 0
    assert members([soft]).modes[0].min() > 0
