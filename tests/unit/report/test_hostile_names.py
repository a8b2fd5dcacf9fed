"""Whatever a user names, and however, is text on both pages: no markup, no template, no script."""

import json
from html.parser import HTMLParser

import pytest

from frf_ipz.identification.options import FitOptions, PinnedPole, RejectedPole
from frf_ipz.ingest.options import IngestOptions
from frf_ipz.pipeline.config import PipelineFile, PipelineSection
from frf_ipz.report.html import page_environment
from frf_ipz.report.page import run_values, write_report
from frf_ipz.runs.results import Results
from frf_ipz.show.controls import Choices, list_choices
from frf_ipz.show.page import SHOW, Addresses, page_sections
from hostile_run import HOSTILE, hostile_folder

SCRIPTS_OF_REPORT = 5  # data of pictures and shapes, plotly, the two of the page
SCRIPTS_OF_SHOW = 6  # the data, plotly, the four of the page


class Reader(HTMLParser):
    """Collects elements, attributes, and text outside scripts."""

    def __init__(self):
        super().__init__()
        self.elements, self.attributes, self.texts = [], [], []

    def handle_starttag(self, tag, attributes):
        self.elements.append(tag)
        self.attributes += [(tag, name, value) for name, value in attributes]

    def handle_data(self, data):
        if self.elements[-1:] != ["script"]:
            self.texts.append(data)


def read(text):
    reader = Reader()
    reader.feed(text)
    return reader


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    path = tmp_path_factory.mktemp("hostile") / "report.html"
    write_report(Results(hostile_folder()), path)
    return path.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def workbench():
    run = Results(hostile_folder())
    file = PipelineFile(
        pipeline=PipelineSection(name=HOSTILE, test=HOSTILE),
        ingest=IngestOptions(keep=(HOSTILE,), drop=(HOSTILE,), hide=(HOSTILE,)),
        fit=FitOptions(
            pin_hz=(PinnedPole(hz=33.0, why=HOSTILE),), strike=(RejectedPole(hz=50.0, why=HOSTILE),), exclude_hz=()
        ),
    )
    return (
        page_environment(SHOW)
        .get_template("show/workbench.html")
        .render(
            **run_values(run, page_sections(run, file)),
            stamp=HOSTILE,
            addresses=Addresses(home=HOSTILE, assets=HOSTILE, files=HOSTILE),
            folder=HOSTILE,
            choices=Choices(entries=list_choices(file), command=HOSTILE, text=HOSTILE),
        )
    )


@pytest.mark.parametrize(("page", "n_scripts"), [("report", SCRIPTS_OF_REPORT), ("workbench", SCRIPTS_OF_SHOW)])
def test_names_are_no_markup(page, n_scripts, request):
    reader = read(request.getfixturevalue(page))
    assert reader.elements.count("script") == n_scripts
    assert "img" not in reader.elements
    assert [name for _, name, _ in reader.attributes if name.startswith("on")] == []


@pytest.mark.parametrize("page", ["report", "workbench"])
def test_names_stand_on_the_page_as_they_were_given(page, request):
    reader = read(request.getfixturevalue(page))
    assert sum(HOSTILE in text for text in reader.texts) > 20
    assert any(HOSTILE in value for _, name, value in reader.attributes if name == "aria-label")
    assert not any("49" in text and "{{7*7}}" not in text and "window.hacked" in text for text in reader.texts)


def test_a_wish_comes_back_from_its_button_as_it_was(workbench):
    wishes = [json.loads(value) for _, name, value in read(workbench).attributes if name == "data-change"]
    assert {"kind": "record", "name": HOSTILE, "use": "checks"} in wishes


@pytest.mark.parametrize("page", ["report", "workbench"])
def test_no_name_ends_the_data_of_the_pictures(page, request):
    text = request.getfixturevalue(page)
    data = text.split('id="page-data">')[1].split("</script>")[0]
    assert "<" not in data
    assert "hacked" in data
    assert json.loads(data)["pictures"]
