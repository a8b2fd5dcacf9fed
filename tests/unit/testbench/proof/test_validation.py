"""The page of the documentation holds the figures that were counted."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from frf_testbench.cli import app
from frf_testbench.proof.validation import ScoresError, read_campaign, render_validation

DOCS = Path(__file__).parents[4] / "docs"
FIGURES = sorted((DOCS / "validation").glob("*.json"))
FEW = {
    "title": "A few machines",
    "machines": {"linear": 3, "null": 2},
    "package": {"version": "1.2.3", "code": "abc"},
    "seeds": {"linear": [5, 7], "null": [9, 9]},
    "notes": ["One & two <three>."],
    "bars": [
        {"group": "linear", "name": "named", "rate": {"hits": 2, "count": 3}},
        {"group": "time", "name": "median", "value": 1.25},
    ],
}


@pytest.fixture
def scores(tmp_path):
    def write(name="scores.json", **changes):
        path = tmp_path / name
        path.write_text(json.dumps(FEW | changes), encoding="utf-8")
        return path

    return write


def test_the_page_of_the_documentation_is_made_of_the_figures_beside_it():
    text = render_validation([read_campaign(path) for path in FIGURES])
    assert (DOCS / "validation.md").read_text(encoding="utf-8") == text


def test_a_campaign_has_its_machines_seeds_version_and_intervals(scores):
    text = render_validation([read_campaign(scores())])
    assert "| [A few machines](#a-few-machines) | 3 linear, 2 null | linear 5 to 7; null 9 | 1.2.3, code abc |" in text
    assert "## A few machines\n\nOne & two <three>.\n" in text
    assert "| linear | named | 2 of 3 | 66.7 % | 9.4 to 99.2 % |" in text  # the interval is that of the binomial tails
    assert "| time | median |  | 1.25 |  |" in text
    assert "required" not in text


def test_what_is_not_known_is_not_invented(scores):
    text = render_validation([read_campaign(scores(package=None, seeds=None))])
    assert "| 3 linear, 2 null | not recorded | not recorded |" in text


def test_campaigns_stand_side_by_side_where_they_counted_the_same(scores):
    other = {"bars": [{"group": "linear", "name": "named", "rate": {"hits": 4, "count": 4}}], "title": "More"}
    text = render_validation([read_campaign(scores()), read_campaign(scores("more.json", **other))])
    assert "| linear | named | 2 of 3 | 4 of 4 |" in text
    assert "| | counted |" in text
    assert "| | counted |" not in render_validation([read_campaign(scores())])


def test_notes_without_machines_are_a_section_of_text(scores):
    text = render_validation([read_campaign(scores(title="Limits", machines={}, bars=[]))])
    assert "## Limits\n\nOne & two <three>.\n" in text
    assert "[Limits]" not in text


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"title": "x", "bars": [{"rate": {}}]}'])
def test_what_holds_no_scores_is_refused(tmp_path, text):
    path = tmp_path / "scores.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ScoresError, match=r"scores\.json"):
        read_campaign(path)
    outcome = CliRunner().invoke(app, ["validation", str(path), "--out", str(tmp_path / "page.md")])
    assert outcome.exit_code == 2
    assert not (tmp_path / "page.md").exists()


def test_the_command_writes_the_page(scores, tmp_path):
    out = tmp_path / "docs" / "validation.md"
    outcome = CliRunner().invoke(app, ["validation", str(scores()), "--out", str(out)])
    assert outcome.exit_code == 0
    assert "## A few machines" in out.read_text(encoding="utf-8")
