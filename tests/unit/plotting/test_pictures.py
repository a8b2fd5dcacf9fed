"""What is drawn are the numbers of the results."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from frf_ipz.plotting.frfs import plot_fit, plot_frfs
from frf_ipz.plotting.poles import plot_pole_zero_map
from frf_ipz.plotting.updating import plot_prediction
from synthetic_run import synthetic_folder


@pytest.fixture(scope="module")
def results():
    return synthetic_folder().results


def curve(ax, label):
    return next(line for line in ax.lines if line.get_label() == label)


def test_frfs_are_drawn_on_the_axes_of_the_caller(results):
    ax = Figure().subplots()
    frfs = results["ingest"].frfs
    assert plot_frfs(frfs, ax=ax) is ax
    drawn = curve(ax, str(frfs.labels[1])).get_ydata()
    np.testing.assert_array_equal(drawn, np.abs(frfs.values[:, 1]))
    assert ax.get_ylabel() == "Receptance, m/N"


def test_the_fitted_curve_is_that_of_the_model(results):
    frfs, fit = results["ingest"].frfs, results["fit"]
    used = frfs.select_lines(fit.used_lines)
    drawn = curve(plot_fit(frfs, fit), str(frfs.labels[0])).get_ydata()
    np.testing.assert_array_equal(drawn, np.abs(fit.model(used.s)[:, 0]))


def test_poles_stand_at_their_frequency_and_damping(results):
    fit = results["fit"]
    x, y = curve(plot_pole_zero_map(fit), "poles").get_data()
    np.testing.assert_array_equal(x, fit.model.natural_frequency_hz)
    np.testing.assert_array_equal(y, 100 * fit.model.damping_ratio)


def test_the_prediction_is_that_of_the_updated_model(results):
    prediction = results["predict"]
    ax = plot_prediction(prediction)
    np.testing.assert_array_equal(curve(ax, "updated model").get_ydata(), np.abs(prediction.values[:, 0]))
    np.testing.assert_array_equal(curve(ax, "nominal model").get_ydata(), np.abs(prediction.nominal[:, 0]))
