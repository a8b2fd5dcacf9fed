"""What is drawn are the numbers of the results."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from frf_ipz import plotting
from frf_ipz.errors import InputError
from frf_ipz.updating.targets import target_rows
from synthetic_run import synthetic_folder, synthetic_law


@pytest.fixture(scope="module")
def results():
    return synthetic_folder(diagnosed=True).results


def curve(ax, label):
    return next(line for line in ax.lines if line.get_label() == label)


def calls(results):
    """Every plot function with what it takes."""
    frfs, fit = results["ingest"].frfs, results["fit"]
    targets = target_rows(results["update"], results["pair"])
    return {
        "plot_cmif": (frfs, fit),
        "plot_coherence": (frfs,),
        "plot_convergence": (results["update"],),
        "plot_fit": (frfs, fit),
        "plot_frfs": (frfs,),
        "plot_law": (synthetic_law(),),
        "plot_levels": (results["levels"],),
        "plot_misfit": (frfs, fit),
        "plot_mismatch": (results["diagnose"],),
        "plot_pairs": (results["pair"],),
        "plot_phases": (frfs,),
        "plot_pole_zero_map": (fit,),
        "plot_prediction": (results["predict"],),
        "plot_proof": (results["diagnose"],),
        "plot_ranking": (results["diagnose"],),
        "plot_records": (results["ingest"],),
        "plot_responses": (results["ingest"],),
        "plot_stabilization": (fit, frfs),
        "plot_stiffness_change": (results["update"].parts,),
        "plot_structure": (results["model"].geometry,),
        "plot_targets": (targets,),
    }


def test_every_function_draws_on_axes_of_the_caller_and_on_its_own(results):
    known = calls(results)
    assert set(known) == {name for name in plotting.__all__ if name.startswith("plot_")}
    for name, arguments in known.items():
        ax = Figure().subplots()
        assert getattr(plotting, name)(*arguments, ax=ax) is ax, name
        assert ax.has_data(), name
        assert getattr(plotting, name)(*arguments).has_data(), name


def test_frfs_are_drawn_as_they_are(results):
    frfs = results["ingest"].frfs
    ax = plotting.plot_frfs(frfs)
    np.testing.assert_array_equal(curve(ax, str(frfs.labels[1])).get_ydata(), np.abs(frfs.values[:, 1]))
    assert ax.get_ylabel() == "Receptance, m/N"


def test_the_fitted_curve_is_that_of_the_model(results):
    frfs, fit = results["ingest"].frfs, results["fit"]
    used = frfs.select_lines(fit.used_lines)
    drawn = curve(plotting.plot_fit(frfs, fit), f"{frfs.labels[0]} fitted").get_ydata()
    np.testing.assert_array_equal(drawn, np.abs(fit.model(used.s)[:, 0]))


def test_poles_stand_at_their_frequency_and_damping(results):
    fit = results["fit"]
    x, y = curve(plotting.plot_pole_zero_map(fit), "poles").get_data()
    np.testing.assert_array_equal(x, fit.model.natural_frequency_hz)
    np.testing.assert_array_equal(y, 100 * fit.model.damping_ratio)


def test_the_prediction_is_that_of_the_updated_model(results):
    prediction = results["predict"]
    ax = plotting.plot_prediction(prediction)
    np.testing.assert_array_equal(curve(ax, "updated model").get_ydata(), np.abs(prediction.values[:, 0]))
    np.testing.assert_array_equal(curve(ax, "nominal model").get_ydata(), np.abs(prediction.nominal[:, 0]))


def test_a_misfit_that_is_not_there_is_named(results):
    assert plotting.plot_mismatch(results["diagnose"], column="after").images
    with pytest.raises(InputError, match="before, after"):
        plotting.plot_mismatch(results["diagnose"], column="later")
