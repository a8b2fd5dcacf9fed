"""What the page is made of: the report's sections, forms where something can be changed, and the user's choices."""

import pytest

from frf_ipz.fe.reduction.options import ReduceOptions
from frf_ipz.identification.options import FitOptions, PinnedPole, RejectedPole
from frf_ipz.ingest.options import IngestOptions
from frf_ipz.pipeline.config import PipelineFile, PipelineSection
from frf_ipz.prediction.options import PredictOptions
from frf_ipz.report.html import page_environment
from frf_ipz.report.section import pictures_of
from frf_ipz.runs.results import Results
from frf_ipz.show.controls import Choices, list_choices
from frf_ipz.show.marks import with_choices, with_retained
from frf_ipz.show.page import SHOW, page_sections
from synthetic_run import synthetic_folder

OF_MODEL = ("model", "reduce", "pair", "update", "predict", "export", "reference")
CHOICES = PipelineFile(
    pipeline=PipelineSection(test="test.toml"),
    ingest=IngestOptions(keep=("hits/p_02.csv",), drop=("hits/p_04.csv",), hide=("9:+z",)),
    fit=FitOptions(
        band_hz=(5.0, 500.0),
        pin_hz=(20.0, PinnedPole(hz=33.0, why="seen by eye")),
        strike=(RejectedPole(hz=50.0, why="mains"),),
        exclude_hz=((49.0, 51.0),),
    ),
    reduce=ReduceOptions(dofs=("3:z", "5:z")),
    predict=PredictOptions(points=("3:+z",)),
)


@pytest.fixture(scope="module")
def run():
    return Results(synthetic_folder())


def html_of(run, choices=CHOICES):
    macros = page_environment(SHOW).get_template("report/macros.html").module
    return "\n".join(macros.section(section) for section in page_sections(run, choices))


def test_all_that_is_chosen_is_listed_with_a_button_each():
    panel = (
        page_environment(SHOW).get_template("show/choices.html").render(choices=Choices(entries=list_choices(CHOICES)))
    )
    for text in (
        "5 to 500 Hz",
        "pinned at 20 Hz ",
        "pinned at 33 Hz: seen by eye",
        "at 50 Hz rejected: mains",
        "49 to 51 Hz left out",
        "p_02",
        "p_04",
        "3:+z",
        "sensor 9:+z left out",
        "reduced to 3:z 5:z",
    ):
        assert text in panel
    assert panel.count("data-change=") == 10


def test_forms_stand_beside_the_pictures(run):
    html = html_of(run)
    for part in ("pole-form", "band-form", "point-form", "reduce-form", "shape-form", "record-choices", "modes"):
        assert html.count(f'id="{part}"') == 1
    assert html.count("data-fill=") == run.fit.n_modes


def test_the_list_of_records_shows_what_was_chosen_and_what_is_used(run):
    html = html_of(run)
    for name, use in (("p_02", "keep"), ("p_04", "drop"), ("p_01", "checks")):
        row = html.split(f'data-record="hits/{name}.csv"')[1].split("</tr>")[0]
        assert f'value="{use}" selected' in row
        assert row.count("selected") == 1


@pytest.mark.parametrize(
    ("without", "missing"),
    [
        (OF_MODEL, {"reduce-form"}),
        (("fit", *OF_MODEL), {"reduce-form", "pole-form", "modes"}),
        (
            ("ingest", "fit", *OF_MODEL),
            {"point-form", "reduce-form", "pole-form", "modes", "shape-form", "record-choices"},
        ),
    ],
    ids=["no model", "no fit", "nothing"],
)
def test_a_run_that_ended_early_has_the_forms_it_can_have(without, missing):
    html = html_of(Results(synthetic_folder(without=without)))
    forms = {"point-form", "reduce-form", "pole-form", "modes", "shape-form", "record-choices"}
    assert {form for form in forms if f'id="{form}"' not in html} == missing


def picture_of(run, name, choices=None):
    return next(picture for picture, _ in pictures_of(page_sections(run, choices)) if picture.name == name)


def test_choices_and_handles_are_drawn_into_the_diagram(run):
    diagram = picture_of(run, "stabilisation")
    marked = with_choices(diagram, run.fit, CHOICES.fit)
    layers = {layer.name: layer for layer in marked.layers}
    assert layers["pinned"].x.tolist() == [20.0, 33.0]
    assert layers["pinned"].texts == ["pinned", "pinned: seen by eye"]
    assert layers["rejected"].texts == ["rejected: mains"]
    assert (layers["left out"].low, layers["left out"].high) == (49.0, 51.0)
    handles = layers["handles of the modes"]
    assert list(handles.x) == list(run.fit.model.natural_frequency_hz[: run.fit.n_modes])
    (low, high), (before, same_high) = marked.panels[0].y.limits, diagram.panels[0].y.limits
    assert all(low < height < before for height in handles.y)
    assert high == same_high
    assert "2 pinned, 1 rejected, 1 range left out" in marked.note


def test_without_a_pipeline_file_there_is_the_report_alone(run):
    html = html_of(run, None)
    assert "pole-form" not in html
    assert "shape-form" in html


def test_nodes_that_the_model_is_reduced_to_are_ringed(run):
    drawing = picture_of(run, "structure")
    ringed = with_retained(drawing, run.geometry, run.reduced_model.dofs)
    rings = ringed.layers[-1]
    nodes = next(layer for layer in drawing.layers if layer.name == "nodes")
    for dof, x in zip(run.reduced_model.dofs, rings.x, strict=True):
        assert x == nodes.x[nodes.texts.index(f"node {dof.node}")]
    assert list(rings.texts) == [dof.name for dof in run.reduced_model.dofs]
    names = [layer.name for layer in picture_of(run, "structure", CHOICES).layers]
    assert "retained in the reduction" in names
