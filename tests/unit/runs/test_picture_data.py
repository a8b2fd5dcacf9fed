"""What pictures draw beside results: the models at the measured points, and how alike mode shapes are."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.fe.response import compute_frfs
from frf_ipz.runs.picture_data import models_beside_measurement, shape_agreements
from frf_ipz.runs.results import Results
from frf_ipz.updating.scale import MeasuredScale
from synthetic_run import synthetic_folder, with_results


@pytest.fixture(scope="module")
def run():
    return Results(synthetic_folder())


def off(values, measured):
    return np.linalg.norm(values - measured, axis=0) / np.linalg.norm(measured, axis=0)


def test_the_updated_model_lies_on_the_measurement_and_the_nominal_one_beside_it(run):
    compared = models_beside_measurement(run)
    low, high = run.band_hz
    assert compared.frequency_hz[0] >= low
    assert compared.frequency_hz[-1] <= high
    assert compared.measured.shape == compared.updated.shape == (len(compared.frequency_hz), len(run.labels))
    assert np.all(off(compared.updated, compared.measured) < 0.2 * off(compared.nominal, compared.measured))


def test_models_have_the_window_of_the_measurement(run):
    frfs = replace(run.frfs, window_decay_1_s=20.0)
    compared = models_beside_measurement(with_results(run, estimate=replace(run.estimate, frfs=frfs)))
    s = 20.0 + 2j * np.pi * compared.frequency_hz
    expected = compute_frfs(run.updated_model.model, run.labels, s)
    np.testing.assert_allclose(compared.updated, expected, rtol=1e-9, atol=0)


def test_models_have_the_fitted_gain_of_a_measurement_of_unknown_scale(run):
    frfs = replace(run.frfs, values=-3.0 * run.frfs.values, unknown_scale="common")
    scale = MeasuredScale(
        kind="common", labels=frfs.labels, log_gain=np.log([3.0]), sign=-np.ones(1), draws=np.log([[3.0]])
    )
    updated = replace(run.updated_model, scale=scale, nominal_scale=scale)
    compared = models_beside_measurement(
        with_results(run, estimate=replace(run.estimate, frfs=frfs), updated_model=updated)
    )
    exact = models_beside_measurement(run)
    assert compared.has_fitted_gains
    assert not exact.has_fitted_gains
    np.testing.assert_allclose(compared.updated, -3.0 * exact.updated, rtol=1e-9, atol=0)


def test_frfs_between_the_same_dofs_have_names_of_their_own(run):
    compared = models_beside_measurement(run)
    twice = replace(compared, labels=(compared.labels[0], compared.labels[0]))
    assert len(set(twice.names)) == 2
    assert all(name.startswith(str(compared.labels[0])) for name in twice.names)


def test_every_measured_mode_has_its_own_shape_in_the_updated_model(run):
    nominal, updated = shape_agreements(run)
    assert (nominal.model, updated.model) == ("nominal model", "updated model")
    for agreement in (nominal, updated):
        assert agreement.mac.shape == (len(agreement.measured_hz), len(agreement.computed_hz))
        assert np.sum(agreement.computed_hz > run.band_hz[1]) == 1
    own = [int(np.argmin(np.abs(updated.computed_hz - hertz))) for hertz in updated.measured_hz]
    assert np.all(updated.mac[np.arange(len(own)), own] > 0.98)


def test_one_dof_says_nothing_about_shapes(run):
    one = replace(run.fit, labels=(run.fit.labels[0],) * len(run.fit.labels))
    assert shape_agreements(with_results(run, fit=one)) == []


def test_frfs_are_named_once_for_all_pictures(run):
    compared = models_beside_measurement(run)
    assert compared.names is compared.names
