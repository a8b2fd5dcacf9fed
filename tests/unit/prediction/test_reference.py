"""Predicted FRFs find their measured counterparts, with the right sign and on the right lines."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.dofs import Dof
from frf_ipz.prediction.reference import measured_at
from frf_ipz.quantities import FrfQuantity
from synthetic_run import synthetic_folder


@pytest.fixture(scope="module")
def results():
    return synthetic_folder().results


def test_the_frf_kept_aside_is_found(results):
    measured = measured_at(results["predict"], results["reference"])
    np.testing.assert_array_equal(measured[0], results["reference"].values[:, 0])


def test_signs_of_sensors_turn_the_values(results):
    reference = results["reference"]
    label = reference.labels[0]
    turned = replace(label, output_dof=Dof(label.output_dof.node, label.output_dof.direction, -1))
    measured = measured_at(results["predict"], replace(reference, labels=(turned,)))
    np.testing.assert_array_equal(measured[0], -reference.values[:, 0])


def test_another_quantity_is_no_counterpart(results):
    reference = results["reference"]
    accelerance = replace(reference.labels[0], quantity=FrfQuantity.ACCELERANCE)
    assert measured_at(results["predict"], replace(reference, labels=(accelerance,))) == {}


def test_lines_that_were_not_measured_are_not_known(results):
    reference = results["reference"]
    known = np.arange(reference.n_lines) < 500
    measured = measured_at(results["predict"], reference.select_lines(known))[0]
    np.testing.assert_array_equal(np.isfinite(measured), known)


def test_other_points_are_no_counterpart(results):
    assert measured_at(results["predict"], results["ingest"].frfs) == {}
    assert measured_at(results["predict"], None) == {}


def test_where_the_level_is_open_the_measured_frf_comes_at_the_level_of_the_prediction(results):
    reference, prediction = results["reference"], results["predict"]
    prediction = replace(prediction, relative=(0,))
    exact = replace(reference, values=-30.0 * prediction.values, variance=reference.variance)
    np.testing.assert_allclose(measured_at(prediction, exact)[0], prediction.values[:, 0], rtol=1e-12)
    measured = measured_at(prediction, reference)[0]
    ratio = measured / reference.values[:, 0]
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-12)  # one real factor, the shape stays
    assert np.median(np.log(np.abs(measured / prediction.values[:, 0]))) == pytest.approx(0.0, abs=1e-12)
