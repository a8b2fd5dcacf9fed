"""The first screen and the section say what a diagnosis has found."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.result import Ambiguity, as_appearance
from frf_ipz.plotting.structure import finding_nodes, mismatch_nodes
from frf_ipz.report.findings import card_texts, typeset, verdict_of
from frf_ipz.report.section import Figure, Table
from frf_ipz.report.sections.diagnosis import build
from frf_ipz.report.sections.overview import build as overview
from frf_ipz.runs.results import Results
from frf_ipz.runs.summary import diagnosis_lines
from synthetic_run import synthetic_folder, with_results


@pytest.fixture(scope="module")
def run():
    return Results(synthetic_folder(diagnosed=True))


def figure(run, name):
    return next(block for block in build(run).blocks if isinstance(block, Figure) and block.picture.name == name)


def table(run, caption):
    return next(block for block in build(run).blocks if isinstance(block, Table) and block.caption == caption)


def test_findings_are_the_verdict(run):
    sentence, addition = verdict_of(run.diagnosis)
    assert sentence.startswith("A mass of 12.3 g (± 0.4 g) sits at node")
    assert addition == "The sensor's sign is flipped."


def test_the_least_certain_finding_is_stated(run):
    assert card_texts(run.diagnosis) == ("added mass and sensor gain", "probability 0.98")


def test_nothing_missing_is_said(run):
    diagnosis = replace(run.diagnosis, verdict="consistent", findings=())
    assert verdict_of(diagnosis) == ("Nothing significant is missing from the model.", "")
    assert card_texts(diagnosis)[0] == "nothing"


def test_what_nothing_explains_is_unknown(run):
    looks = tuple(replace(entry, statement=as_appearance(entry.statement)) for entry in run.diagnosis.findings)
    diagnosis = replace(run.diagnosis, verdict="unexplained", findings=looks)
    assert "nothing in the catalogue explains" in verdict_of(diagnosis)[0]
    assert verdict_of(diagnosis)[1].startswith("A part of it looks like this, and need not be: a mass")
    addition = verdict_of(replace(diagnosis, unexplained_part="damping is 2 % (+- 1 %)"))[1]
    assert addition.startswith("What is not explained: damping is 2 % (± 1 %). A part of it looks like this")
    assert card_texts(diagnosis)[0] == "unknown"
    assert card_texts(replace(diagnosis, findings=()))[0] == "unknown"
    found = next(block for block in build(with_results(run, diagnosis=diagnosis)).blocks if isinstance(block, Table))
    assert [row[1] for row in found.rows] == ["looks like", "looks like", "alternative"]
    assert [row[-1].startswith("If it were this: ") for row in found.rows] == [False, False, True]


def test_measured_damping_is_nothing_missing(run):
    """The formal verdict stays; whatever people read says that nothing remains."""
    said = "Damping ratios are as measured, and nothing missing: 1.5 % at 16 Hz (model: 0.1 %)."
    damping = replace(run.diagnosis, verdict="unexplained", statements=(said,))
    assert damping.is_explained
    assert card_texts(damping) == ("added mass and sensor gain", "probability 0.98; damping is as measured")
    assert card_texts(replace(damping, findings=())) == ("nothing", "but damping, which is as measured")
    assert verdict_of(damping)[0].startswith("A mass")
    assert not replace(damping, unexplained_part="something").is_explained


def test_places_of_findings_are_marked_on_the_structure(run):
    nodes = run.geometry.nodes.tolist()
    sensor = run.labels[0].output_dof.node
    assert finding_nodes(run.diagnosis, run.frfs) == {nodes[1]: "added mass", sensor: "sensor gain"}


def test_the_location_of_an_unexplained_mismatch_is_stated_and_marked(run):
    diagnosis = replace(run.diagnosis, verdict="unexplained", findings=(), mismatch_location=Location.at_node(4))
    sentence = "An unknown force at node 4 would explain most of the mismatch."
    assert verdict_of(diagnosis)[1] == sentence
    assert sentence in build(with_results(run, diagnosis=diagnosis)).notes
    assert list(mismatch_nodes(diagnosis, run.frfs)) == [4]
    blocks = overview(with_results(run, diagnosis=diagnosis)).blocks
    drawn = next(block.picture for block in blocks if isinstance(block, Figure) and block.picture.name == "structure")
    (ring,) = [layer for layer in drawn.layers if layer.name == "location of the mismatch"]
    assert "(node 4)" in drawn.alt
    at = run.geometry.coordinates_m[run.geometry.nodes == 4, 0]
    np.testing.assert_array_equal(ring.x, at)


@pytest.mark.parametrize(("verdict", "location"), [("explained", Location.at_node(4)), ("unexplained", Location())])
def test_no_place_is_marked_where_there_is_none(run, verdict, location):
    diagnosis = replace(run.diagnosis, verdict=verdict, mismatch_location=location)
    assert mismatch_nodes(diagnosis, run.frfs) == {}
    assert "unknown force" not in verdict_of(diagnosis)[1]


def test_elements_are_marked_at_all_their_nodes(run):
    finding = replace(run.diagnosis.findings[0], location=Location(elements=(3, 5)))
    assert sorted(finding_nodes(replace(run.diagnosis, findings=(finding,)), run.frfs)) == [3, 4, 5, 6]


def test_the_map_holds_misfits_before_and_after(run):
    before, after = figure(run, "mismatch").picture.layers
    assert before.values.shape == (len(run.labels), 3)
    assert before.values[1, 0] == pytest.approx(15.0, rel=1e-12)
    assert (after.values == 1).all()


def test_models_that_hold_no_force_law_are_not_said_to_hold_it(run):
    linear = figure(run, "mismatch").picture
    assert "as it is and with findings" in linear.alt
    law = figure(with_results(run, diagnosis=replace(run.diagnosis, linearised_law="a spring")), "mismatch").picture
    assert len(linear.layers) == 2
    assert len(law.layers) == 1
    assert "the force law explains" in law.note
    assert "the force law explains" not in linear.note


def test_an_explanation_that_gains_nothing_has_no_probability_on_its_bar(run):
    worse = replace(run.diagnosis.alternatives[0], log_evidence_gain=-5e7)
    diagnosis = replace(run.diagnosis, alternatives=(worse,))
    (bars,) = figure(with_results(run, diagnosis=diagnosis), "ranking").picture.layers
    assert bars.texts[-1] == "worse than without"
    assert min(bars.sizes) >= 0
    assert bars.texts[0].startswith("p = ")


def test_numbers_of_a_few_digits_are_written_out(run):
    diagnosis = replace(run.diagnosis, warnings=("Blows differ, 3.28e+03 times more than noise.",))
    assert "Blows differ, 3280 times more than noise." in build(with_results(run, diagnosis=diagnosis)).notes
    assert typeset("658.1 N/m (+- 1.2e+02) and 4.2e+09 N/m") == "658.1 N/m (± 120) and 4.2e+09 N/m"


def test_findings_come_before_alternatives(run):
    findings = table(run, "Findings and alternatives")
    assert [row[0] for row in findings.rows] == ["added mass", "sensor gain", "local stiffness"]
    assert "mass_kg = 0.0123 ± 0.0004" in findings.rows[0]


def test_proof_on_held_out_data_is_in_percent(run):
    proof = figure(run, "proof")
    assert proof.picture.layers[1].sizes.tolist() == pytest.approx([43.0, 22.0, 2.0])
    assert proof.table.rows[2][2] == "2 %"


def test_what_cannot_be_distinguished_is_a_note_with_its_remedy(run):
    assert "These data cannot tell apart: added mass and local stiffness. Strike 4:+z." in build(run).notes


def test_what_cannot_be_distinguished_is_printed_on_the_command_line(run):
    lines = [text for _, text in diagnosis_lines(run.diagnosis)]
    assert "These data cannot tell apart: added mass and local stiffness. Strike 4:+z." in lines


def test_three_indistinguishable_effects_are_a_list():
    alike = Ambiguity(effects=("axial_load", "added_mass", "time_delay"), log_bayes_factor=1.0, resolve_by="")
    assert alike.statement == "These data cannot tell apart: axial load, added mass and time delay."


def test_checks_that_could_not_be_made_are_only_in_the_table(run):
    checks = figure(run, "data-checks")
    assert checks.picture.layers[0].y == ["homogeneity"]
    assert [row[0] for row in checks.table.rows] == ["homogeneity", "reciprocity"]
