"""The first screen says what the results say."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from frf_ipz.pairing.pairs import PairVerdict
from frf_ipz.plotting.wording import number
from frf_ipz.prediction.agreement import compare_frfs
from frf_ipz.report.section import Cards
from frf_ipz.report.sections.overview import build, verdict
from frf_ipz.runs.picture_data import update_targets
from frf_ipz.runs.results import Results
from frf_ipz.updating.scale import MeasuredScale
from synthetic_run import synthetic_folder, with_results


@pytest.fixture(scope="module")
def run():
    return Results(synthetic_folder())


def card(run, title):
    return next(
        card for block in build(run).blocks if isinstance(block, Cards) for card in block.cards if card.title == title
    )


def test_the_error_at_the_point_of_interest_is_that_against_the_frf_kept_aside(run):
    truth = run.reference.values
    figures = [compare_frfs(truth, values).median_db[0] for values in (run.prediction.nominal, run.prediction.values)]
    text = card(run, "Error at the point of interest").figure
    assert text == " → ".join(number(float(figure), 2) for figure in figures) + " dB"


def test_the_worst_target_is_the_largest_error(run):
    errors = [abs(row.after) for row in update_targets(run)]
    measured = [pair.measured_value for pair in run.pairs.targets]
    by_hand = np.abs(np.abs(run.updated_model.after) / np.abs(measured) - 1)
    np.testing.assert_allclose(errors, by_hand, rtol=1e-9, atol=1e-15)  # differences of nearly equal numbers
    worst = update_targets(run)[int(np.argmax(by_hand))]
    target = card(run, "Worst target after updating")
    assert target.figure == f"{100 * by_hand.max():.2g} %"
    assert target.meaning.startswith(worst.name)


def test_the_verdict_counts_poles_and_zeros(run):
    poles = sum(pair.kind == "pole" for pair in run.pairs.targets)
    zeros = sum(pair.kind == "zero" for pair in run.pairs.targets)
    assert f"{poles} measured poles and {zeros} measured zeros" in verdict(run)[0]


def test_roots_that_the_model_lacks_are_counted(run):
    rows = tuple(
        replace(row, verdict=PairVerdict.MISSING_IN_MODEL, computed=-1) if place < 2 else row
        for place, row in enumerate(run.pairs.rows)
    )
    figure = card(with_results(run, pairs=replace(run.pairs, rows=rows)), "Missing in the model").figure
    assert figure == "2 poles and zeros"


def test_masses_that_the_update_found_are_missing_in_the_model(run):
    kilograms = [0.012, -0.008, 0.005, 0.002]
    masses = pd.DataFrame(
        {"node": list("2468"), "mass_kg": kilograms, "mass_kg_low": kilograms, "mass_kg_high": kilograms}
    )
    found = card(with_results(run, updated_model=replace(run.updated_model, masses=masses)), "Missing in the model")
    assert found.figure.startswith("4 masses")
    assert "+0.012 kg at node 2, -0.008 kg at node 4, +0.005 kg at node 6 and 1 other" in found.meaning


def test_errors_are_stated_with_the_gains_that_are_fitted(run):
    frfs = replace(
        run.estimate.frfs,
        values=3.0 * run.estimate.frfs.values,
        variance=9.0 * run.estimate.frfs.variance,
        unknown_scale="common",
    )
    scale = MeasuredScale(
        kind="common", labels=frfs.labels, log_gain=np.log([3.0]), sign=np.ones(1), draws=np.log([[3.0]])
    )
    updated = replace(run.updated_model, scale=scale, nominal_scale=scale)
    scaled = with_results(run, estimate=replace(run.estimate, frfs=frfs), updated_model=updated, prediction=None)
    figures = [card(contents, "Error at the measured points").figure for contents in (run_without_points(run), scaled)]
    assert figures[0] == figures[1]
    assert "unknown gains are fitted" in card(scaled, "Error at the measured points").meaning


def run_without_points(run):
    return with_results(run, prediction=None)


def test_a_worst_target_that_came_no_closer_stands_apart_from_the_others(run):
    assert "right within" in verdict(run)[0]
    assert "worst" not in verdict(run)[0]
    worse = run.updated_model.after.copy()
    worse[0] *= 1.5
    sentence = verdict(with_results(run, updated_model=replace(run.updated_model, after=worse)))[0]
    assert "in the median (before: " in sentence
    assert ", but the worst 50 %" in sentence
