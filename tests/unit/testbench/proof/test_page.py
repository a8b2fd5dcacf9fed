"""The whole proof with a command that guesses: the page stands on its own and says what was counted."""

import base64
import json
import re
import sys
from html.parser import HTMLParser
from xml.etree import ElementTree

import pytest

from frf_testbench.proof.page import write_page, write_scores
from frf_testbench.proof.prove import run_proof
from frf_testbench.proof.scoring import score_bars

GUESS = """
import json, sys
from pathlib import Path
stage, pipeline, _, out, _ = sys.argv[1:]
if stage == "diagnose":
    mass = {"mass_kg": {"value": 0.02, "std": 1e-3}}
    finding = {"effect": "added_mass", "location": {"nodes": [3]}, "parameters": mass, "probability": 0.9,
               "log_evidence_gain": 50.0}
    if "case_2" in pipeline:
        sys.exit("frf-ipz: <the fit> failed")
    verdict = "consistent" if "case_3" in pipeline else "explained"
    found = [] if verdict == "consistent" else [finding]
    Path(out).mkdir(parents=True)
    Path(out, "diagnosis.json").write_text(json.dumps({"verdict": verdict, "findings": found}))
    Path(out, "run.json").write_text(json.dumps({"stages": {"diagnose": {"seconds": 1.5}}}))
"""
ANSWERS = {
    "case_1": {"effect": "added_mass", "location": {"nodes": [3]}, "parameters": {"mass_kg": 0.0201}},
    "case_2": {"effect": "added_mass", "location": {"nodes": [3]}, "parameters": {"mass_kg": 0.0201}},
    "case_3": {"effect": "null", "location": {}, "parameters": {}},
    "case_4": {"effect": "unknown", "unknown_kind": "skew", "location": {"nodes": [3, 5]}, "parameters": {}},
}


class Page(HTMLParser):
    """Elements that must be closed, and where pictures come from."""

    def __init__(self):
        super().__init__()
        self.open, self.sources, self.links = [], [], []

    def handle_starttag(self, tag, attributes):
        if tag not in ("meta", "img", "br"):
            self.open.append(tag)
        self.sources += [value for name, value in attributes if name == "src"]
        self.links += [value for name, value in attributes if name == "href"]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def scored(tmp_path_factory):
    """Run the proof on a folder of cases with their answers beside them."""
    folder = tmp_path_factory.mktemp("practice")
    for name, answer in ANSWERS.items():
        (folder / name).mkdir()
        (folder / name / "model.toml").write_text("[beam]\nelements = 9\n", encoding="utf-8")
        (folder / name / "pipeline.toml").write_text('[pipeline]\ntest = "test.toml"\n', encoding="utf-8")
        (folder / "truth").mkdir(exist_ok=True)
        (folder / "truth" / f"{name}.json").write_text(json.dumps(answer), encoding="utf-8")
    guess = folder / "guess.py"
    guess.write_text(GUESS, encoding="utf-8")
    out = folder / "results"
    run_proof(cases=folder, out=out, command=[sys.executable, str(guess)])
    return out


def test_scores_say_what_was_counted(scored):
    scores = json.loads((scored / "scores.json").read_text(encoding="utf-8"))
    said = {case["judgement"]["name"]: case["judgement"]["stated_label"] for case in scores["cases"]}
    assert said == {"case_1": "added_mass", "case_2": "failed", "case_3": "consistent", "case_4": "added_mass"}
    faults = {case["judgement"]["name"]: case["fault"] for case in scores["cases"]}
    assert faults == {"case_1": "", "case_2": "frf-ipz: <the fit> failed", "case_3": "", "case_4": ""}
    assert scores["machines"] == {"linear": 2, "null": 1, "unknown": 1}
    found = {(bar["group"], bar["name"]): bar for bar in scores["bars"]}
    first = found["linear", "effect named first, of all"]
    assert (first["rate"]["hits"], first["rate"]["count"], first["passes"]) == (1, 2, False)
    assert first["interval"][0] < 0.5 < first["interval"][1]
    assert found["nulls", "false alarms"]["passes"] is True
    assert found["outside the catalogue", "flagged"]["value"] == 0
    assert found["two effects", "both"]["value"] is None
    assert found["time", "linear case, from FRFs, median"]["value"] == 1.5


def test_the_page_stands_on_its_own(scored):
    text = (scored / "proof.html").read_text(encoding="utf-8")
    page = Page()
    page.feed(text)
    assert page.open == []
    assert page.links == []
    assert page.sources
    for source in page.sources:
        head, data = source.split(",", 1)
        assert head == "data:image/svg+xml;base64"
        ElementTree.fromstring(base64.b64decode(data))
    assert "<script" not in text
    assert "&lt;the fit&gt; failed" in text
    assert "1 of 2: 50.0% (1.3% to 98.7%)" in text
    headings = re.findall("<h2>(.*?)</h2>", text)
    assert headings[:3] == ["Bars", "What was stated for what", "Locations"]
    assert len(headings) == 12


def test_the_documentation_gets_the_bars_with_their_intervals(scored):
    text = (scored / "validation.md").read_text(encoding="utf-8")
    code = json.loads((scored / "scores.json").read_text(encoding="utf-8"))["package"]["code"]
    assert "| 1 | [Blind proof of the diagnosis](#blind-proof-of-the-diagnosis) | 2 linear, 1 null, 1 unknown |" in text
    assert f"code {code} |" in text
    assert "| linear | effect named first, of all | 1 of 2 | 50.0 % | 1.3 to 98.7 % | at least 90 % | no |" in text
    assert "| nulls | false alarms | 0 of 1 | 0.0 % | 0.0 to 97.5 % | at most 2 % | yes |" in text
    assert "| time | linear case, from FRFs, median |  | 1.5 |  | at most 10 s | yes |" in text
    assert "| two effects | both | 0 of 0 |  |  | at least 75 % |  |" in text


def test_a_page_without_cases_is_drawn(tmp_path):
    write_page(tmp_path / "proof.html", [], score_bars([]), title="None & nothing", code="x")
    write_scores(tmp_path / "scores.json", [], score_bars([]), title="None & nothing", code="x")
    page = Page()
    page.feed((tmp_path / "proof.html").read_text(encoding="utf-8"))
    assert page.open == []
    assert "<h1>None &amp; nothing</h1>" in (tmp_path / "proof.html").read_text(encoding="utf-8")
    assert json.loads((tmp_path / "scores.json").read_text(encoding="utf-8"))["cases"] == []
