"""The first screen of the command: few notes, and the same figures as the page."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.assessment.assessment import Assessment, Check, Verdict
from frf_ipz.diagnosis.result import as_appearance
from frf_ipz.report.page import write_report
from frf_ipz.report.section import Cards
from frf_ipz.report.sections import frfs as frf_section
from frf_ipz.report.sections import overview, pairing
from frf_ipz.runs.figures import coherence_text, deviation_of
from frf_ipz.runs.results import Results
from frf_ipz.runs.summary import MOST_NOTES, diagnosis_lines, prediction_lines
from synthetic_run import synthetic_folder, with_results


@pytest.fixture(scope="module")
def run():
    return Results(synthetic_folder(diagnosed=True))


def cards(run):
    (block,) = [block for block in overview.build(run).blocks if isinstance(block, Cards)]
    return {card.title: card for card in block.cards}


def test_the_error_is_that_of_the_page(run):
    deviation = deviation_of(run)
    assert f"{deviation.figures} (median of {deviation.where}; kept aside)" in run.summary()
    card = cards(run)["Error at the point of interest"]
    assert card.figure == f"{deviation.nominal_db:.2g} → {deviation.updated_db:.2g} dB"
    assert deviation.where in card.meaning
    assert "Hz" in deviation.where


def test_the_error_at_the_measured_points_has_one_figure(run):
    alone = with_results(run, reference=None)
    deviation = deviation_of(alone)
    assert deviation.at == "measured points"
    card = cards(alone)["Error at the measured points"]
    assert card.figure == f"{deviation.nominal_db:.2g} → {deviation.updated_db:.2g} dB"
    assert deviation.where in card.meaning
    assert "%" not in card.meaning
    assert deviation.figures in alone.summary()


def test_the_coherence_is_that_of_the_band_and_of_the_page(run):
    frfs = run.estimate.frfs
    outside = ~run.fit.used_lines
    coherence = np.where(outside[:, None], 0.1, np.full(frfs.values.shape, 0.98765))
    drowned = with_results(run, estimate=replace(run.estimate, frfs=replace(frfs, coherence=coherence)))
    text = coherence_text(drowned)
    assert text.startswith("0.9877 (median, ")
    assert f"coherence {text}" in drowned.summary()
    without_model = with_results(drowned, updated_model=None, diagnosis=None)
    assert cards(without_model)["Coherence"].figure == "0.9877"
    (table,) = [block.table for block in frf_section.build(drowned).blocks if getattr(block, "table", None)]
    assert {row[5] for row in table.rows} == {"0.9877"}


def test_no_measurement_is_perfectly_coherent(run):
    perfect = replace(run.estimate.frfs, coherence=np.full(run.estimate.frfs.values.shape, 0.999999))
    assert "above 0.9999" in coherence_text(with_results(run, estimate=replace(run.estimate, frfs=perfect)))


def test_poles_and_zeros_are_counted_once(run):
    for kind in ("pole", "zero"):
        count = run.pairs.count(kind)
        assert count.measured == sum(row.kind == kind and row.measured >= 0 for row in run.pairs.rows)
        assert count.paired == sum(row.kind == kind for row in run.pairs.targets)
        assert count.text in run.summary()
        assert count.text in pairing.build(run).lead


def test_few_notes_stand_on_the_first_screen_and_the_rest_is_counted_where_it_is(run):
    pairs = replace(run.pairs, warnings=("pairs one", "pairs two"))
    prediction = replace(run.prediction, warnings=tuple(f"prediction {place}" for place in range(5)))
    estimate = replace(run.estimate, warnings=("record",))
    fit = replace(run.fit, warnings=())
    updated = replace(run.updated_model, warnings=(), unmet=())
    diagnosis = replace(run.diagnosis, warnings=())
    arrays = replace(run.state_space_arrays, notes=())
    noisy = with_results(
        run, pairs=pairs, prediction=prediction, estimate=estimate, fit=fit, updated_model=updated,
        diagnosis=diagnosis, state_space_arrays=arrays,
    )  # fmt: skip
    lines = noisy.summary().splitlines()
    notes = [line.removeprefix("  note").strip() for line in lines if line.startswith("  note")]
    assert notes == ["record", "pairs one", "prediction 0"]  # one of each before a second one
    assert len(notes) == MOST_NOTES
    (rest,) = [line.strip() for line in lines if "more notes" in line]
    assert rest == "and 5 more notes in the report: 1 under Pairing, 4 under Points of interest"


def test_numbers_of_a_few_digits_are_written_out_in_the_terminal_and_on_the_page(run, tmp_path):
    fit = replace(run.fit, warnings=("the misfit is 4.2e+02 times the noise",))
    check = Check(
        name="phase", verdict=Verdict.NOT_USABLE, figure=180.0, limit=5.0, unit="deg", says="1.8e+02 degrees off"
    )
    loud = with_results(run, fit=fit, assessment=Assessment(verdict=check.verdict, checks=(check,)))
    assert "  note      the misfit is 420 times the noise\n" in loud.summary()
    assert "because     180 degrees off" in loud.summary()
    write_report(loud, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "the misfit is 420 times the noise" in page
    assert "180 degrees off" in page
    assert "1.8e+02" not in page


def test_few_predictions_stand_there_the_widest_first(run):
    labels = run.prediction.labels * 5
    widths = np.array([0.5, 3.0, 1.0, 2.0, 0.1])[: len(labels)]
    values = np.tile(run.prediction.values, (1, 5))
    wide = replace(
        run.prediction, labels=labels, values=values, nominal=values, warnings=(),
        magnitude_low=np.abs(values) * 10 ** (-widths / 20), magnitude_high=np.abs(values) * 10 ** (widths / 20),
    )  # fmt: skip
    texts = [text for _, text in prediction_lines(wide)]
    assert ["+-3 dB" in texts[0], "+-2 dB" in texts[1], "+-1 dB" in texts[2]] == [True] * 3
    assert texts[3] == "and 2 more, with narrower bands"
    assert all("Hz" in text for text in texts[:3])


def test_causes_come_first_each_on_its_line(run):
    mass, gain = run.diagnosis.findings
    found = replace(run.diagnosis, statement=f"{mass.statement} {gain.statement} With that, all is explained.")
    texts = [text for _, text in diagnosis_lines(found)]
    assert texts[:3] == [mass.statement, gain.statement, "With that, all is explained."]


def test_where_nothing_explains_that_comes_first(run):
    mass = replace(run.diagnosis.findings[0], statement=as_appearance(run.diagnosis.findings[0].statement))
    statement = f"Something is missing that nothing in the catalogue explains: x. {mass.statement}"
    unexplained = replace(
        run.diagnosis, verdict="unexplained", unexplained_part="x", findings=(mass,), statement=statement
    )
    texts = [text for _, text in diagnosis_lines(unexplained)]
    assert texts[0] == "Something is missing that nothing in the catalogue explains: x."
    assert texts[1].startswith("A part of it looks like this, and need not be: a mass")
