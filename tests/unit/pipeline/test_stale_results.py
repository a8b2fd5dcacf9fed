"""A result is computed anew where anything that it depends on has changed: inputs, code, libraries, effects."""

import json
from dataclasses import replace

import numpy as np
import pytest

import frf_ipz
from frf_ipz.diagnosis.catalogue.effect import Effect
from frf_ipz.diagnosis.catalogue.finder import read_class
from frf_ipz.errors import InputError
from frf_ipz.pipeline import run as run_module
from frf_ipz.pipeline import stage_runner
from frf_ipz.pipeline.inputs import read_inputs
from frf_ipz.pipeline.stages import mismatch
from frf_ipz.runs import software
from small_campaign import write_campaign
from synthetic_run import synthetic_folder

EFFECT = '"""An effect."""\nfrom frf_ipz import Effect\n\nclass Own(Effect):\n    name = "own"\n'


@pytest.fixture
def campaign(tmp_path):
    write_campaign(tmp_path)
    return tmp_path


def ingest_key(campaign):
    frf_ipz.run_pipeline(campaign / "pipeline.toml", campaign / "out", until="ingest")
    return json.loads((campaign / "out" / "run.json").read_text(encoding="utf-8"))["stages"]["ingest"]["key"]


def test_what_has_not_changed_keeps_its_key(campaign):
    assert ingest_key(campaign) == ingest_key(campaign)


@pytest.mark.parametrize(
    "changed",
    [{"code": "other"}, {"python": "3.99.0"}, {"packages": {"numpy": "99.0"}}],
    ids=lambda one: next(iter(one)),
)
def test_other_software_computes_anew(campaign, monkeypatch, changed):
    before = ingest_key(campaign)
    same = software.software()
    monkeypatch.setattr(stage_runner, "software", lambda: {**same, **changed})
    assert ingest_key(campaign) != before


def test_another_recording_computes_anew(campaign):
    before = ingest_key(campaign)
    hit = sorted((campaign / "hits").glob("*.csv"))[0]
    hit.write_text(hit.read_text(encoding="utf-8").replace("1", "2", 1), encoding="utf-8")
    assert ingest_key(campaign) != before


def test_another_operator_makes_the_page_anew_and_nothing_else(campaign):
    (campaign / "pipeline.toml").write_text(
        (campaign / "pipeline.toml")
        .read_text(encoding="utf-8")
        .replace('model = "model.toml"', "")
        .replace('points = ["11:+z"]', ""),
        encoding="utf-8",
    )
    run = run_with_operator(campaign, "A. Meier")
    later = run_with_operator(campaign, "B. Huber")
    assert run["test"] == {"name": "small cantilever", "kind": "hammer", "operator": "A. Meier"}
    assert later["test"]["operator"] == "B. Huber"
    changed = [name for name, stage in later["stages"].items() if stage["key"] != run["stages"][name]["key"]]
    assert changed == ["report"]


def run_with_operator(campaign, operator):
    path = campaign / "test.toml"
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("operator")]
    lines.insert(lines.index("[test]") + 1, f'operator = "{operator}"')
    path.write_text("\n".join(lines), encoding="utf-8")
    frf_ipz.run_pipeline(campaign / "pipeline.toml", campaign / "out")
    return json.loads((campaign / "out" / "run.json").read_text(encoding="utf-8"))


def test_the_code_of_the_package_is_digested(monkeypatch, tmp_path):
    (tmp_path / "__init__.py").write_text("first", encoding="utf-8")
    monkeypatch.setattr(frf_ipz, "__file__", str(tmp_path / "__init__.py"))
    first = software.code_digest.__wrapped__()
    (tmp_path / "part.py").write_text("second", encoding="utf-8")
    assert software.code_digest.__wrapped__() != first
    assert software.package_versions()["numpy"] == np.__version__


def test_an_edited_effect_is_another_model_key(campaign):
    text = (campaign / "pipeline.toml").read_text(encoding="utf-8")
    text = text.replace("[diagnose]\n", '[diagnose]\nextra_effects = ["own.py:Own"]\n')
    (campaign / "pipeline.toml").write_text(text, encoding="utf-8")
    (campaign / "own.py").write_text(EFFECT, encoding="utf-8")
    before = read_inputs(campaign / "pipeline.toml")
    (campaign / "own.py").write_text(EFFECT.replace('"own"', '"new"'), encoding="utf-8")
    after = read_inputs(campaign / "pipeline.toml")
    assert before.model_key != after.model_key
    assert str(campaign / "own.py") in before.digests


def test_an_effect_is_read_from_its_text_and_leaves_no_cache(tmp_path):
    (tmp_path / "own.py").write_text("raise ValueError('first')\n", encoding="utf-8")
    with pytest.raises(InputError, match="first"):
        read_class("own.py:Own", tmp_path, (Effect,))
    (tmp_path / "own.py").write_text("raise ValueError('other')\n", encoding="utf-8")  # as long, in the same second
    with pytest.raises(InputError, match="other"):
        read_class("own.py:Own", tmp_path, (Effect,))
    assert not list(tmp_path.rglob("*.pyc"))


def test_an_effect_file_that_ends_the_program_is_an_error(tmp_path):
    (tmp_path / "own.py").write_text("raise SystemExit(0)\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"own\.py cannot be loaded: SystemExit"):
        read_class("own.py:Own", tmp_path, (Effect,))


def test_an_effect_that_ends_the_program_in_a_run_is_an_error(campaign, monkeypatch):
    def chain(*_, **__):
        raise SystemExit(0)

    monkeypatch.setattr(run_module, "chain", chain)
    with pytest.raises(InputError, match="an effect of your own ended the program"):
        frf_ipz.run_pipeline(campaign / "pipeline.toml", campaign / "out", until="ingest")


def test_a_run_takes_over_what_a_diagnosis_in_any_time_has_found(campaign, monkeypatch):
    searches = []

    def find_causes(*_, deadline, only_where_they_differ, **__):
        searches.append((deadline.seconds, only_where_they_differ))
        return replace(synthetic_folder(diagnosed=True).results["diagnose"], verdict="consistent", findings=())

    monkeypatch.setattr(mismatch, "find_causes", find_causes)
    path, out = campaign / "pipeline.toml", campaign / "out"
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace('run = "never"', 'run = "auto"'), encoding="utf-8")
    frf_ipz.run_pipeline(path, out, until="predict")
    assert searches == [(mismatch.RUN_SECONDS, True)]
    frf_ipz.run_pipeline(path, out, until="diagnose", diagnosing=True)
    assert searches[1:] == [(None, False)]
    frf_ipz.run_pipeline(path, out, until="predict")
    path.write_text(text.replace('run = "never"', 'run = "auto"\napply = true'), encoding="utf-8")
    frf_ipz.run_pipeline(path, out, until="predict")
    assert len(searches) == 2
