"""A result is computed anew where anything that it depends on has changed: inputs, code, libraries, effects."""

import json
import os
from dataclasses import replace

import numpy as np
import pytest

import frf_ipz
from frf_ipz.diagnosis.catalogue.effect import Effect
from frf_ipz.diagnosis.catalogue.finder import read_class
from frf_ipz.errors import InputError
from frf_ipz.input_files import Ledger, digest_file, entering, open_input
from frf_ipz.pipeline import inputs as inputs_module
from frf_ipz.pipeline import run as run_module
from frf_ipz.pipeline import stage_runner
from frf_ipz.pipeline.inputs import read_inputs
from frf_ipz.pipeline.stages import measurement, mismatch
from frf_ipz.runs import software
from frf_ipz.runs.generations import current_folder
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


def test_a_damaged_result_is_computed_anew_and_the_summary_says_so(campaign):
    pipeline, out = campaign / "pipeline.toml", campaign / "out"
    clean = frf_ipz.run_pipeline(pipeline, out, until="fit").summary()
    assert "mended" not in clean
    kept = current_folder(out) / "stages" / "fit.result"
    kept.write_bytes(kept.read_bytes()[:100])
    (out / "poles.parquet").unlink()
    said = frf_ipz.run_pipeline(pipeline, out, until="fit").summary().splitlines()
    notes = [f"{name} was damaged or gone, and has been made again" for name in ("stages/fit.result", "poles.parquet")]
    place = said.index(f"{'mended':<12}{notes[0]}")
    assert said[place + 1] == " " * 12 + notes[1]
    assert "mended" not in frf_ipz.run_pipeline(pipeline, out, until="fit").summary()


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


def test_another_model_computes_anew(campaign):
    def key():
        frf_ipz.run_pipeline(campaign / "pipeline.toml", campaign / "out", until="pair")
        return json.loads((campaign / "out" / "run.json").read_text(encoding="utf-8"))["stages"]["reduce"]["key"]

    before = key()
    assert key() == before
    model = campaign / "model.toml"
    model.write_text(model.read_text(encoding="utf-8").replace("0.33", "0.30"), encoding="utf-8")
    assert key() != before


def save_again(path):
    """As an editor does: in place of the old one, and as long."""
    text = path.read_text(encoding="utf-8")
    beside = path.with_name("beside")
    beside.write_text(text.replace("1", "2", 1), encoding="utf-8")
    beside.replace(path)


@pytest.mark.parametrize("name", ["test.toml", "model.toml"])
def test_a_file_that_is_saved_between_being_read_and_digested_is_refused(campaign, monkeypatch, name):
    reader = {"test.toml": "read_test", "model.toml": "read_model"}[name]
    read = getattr(inputs_module, reader)

    def read_and_save(path):
        content = read(path)
        save_again(path)
        return content

    monkeypatch.setattr(inputs_module, reader, read_and_save)
    with pytest.raises(InputError, match=rf"{name}: has been changed while this command was at work"):
        frf_ipz.run_pipeline(campaign / "pipeline.toml", campaign / "out", until="ingest")
    assert not (campaign / "out").exists()


def test_a_recording_that_is_saved_between_being_digested_and_read_is_refused(campaign, monkeypatch):
    recording = sorted((campaign / "hits").glob("*.csv"))[0]
    frf_ipz.run_pipeline(campaign / "pipeline.toml", campaign / "out", until="ingest")
    before = (campaign / "out" / "run.json").read_bytes()
    (campaign / "pipeline.toml").write_text(
        (campaign / "pipeline.toml").read_text(encoding="utf-8") + '[ingest]\nestimator = "H2"\n', "utf-8"
    )
    estimate = measurement.estimate_from

    def save_and_estimate(*arguments, **options):
        save_again(recording)
        return estimate(*arguments, **options)

    monkeypatch.setattr(measurement, "estimate_from", save_and_estimate)
    with pytest.raises(InputError, match=rf"{recording.name}: has been changed while this command was at work"):
        frf_ipz.run_pipeline(campaign / "pipeline.toml", campaign / "out", until="ingest")
    assert (campaign / "out" / "run.json").read_bytes() == before


def test_a_file_that_is_written_to_while_it_is_read_is_refused(campaign):
    path = campaign / "model.toml"
    with entering(Ledger()):
        with pytest.raises(InputError, match="has been changed"), open_input(path):
            os.utime(path, ns=(1, 1))
        assert digest_file(path)


def test_an_effect_that_is_saved_between_being_digested_and_executed_is_refused(campaign):
    (campaign / "own.py").write_text(EFFECT, encoding="utf-8")
    ledger = Ledger()
    with entering(ledger):
        digest_file(campaign / "own.py")
        with pytest.raises(InputError, match="has no effect"):  # it was executed, and the class is abstract
            read_class("own.py:Own", campaign, (Effect,))
    (campaign / "own.py").write_text(EFFECT.replace("Own", "New"), encoding="utf-8")
    with pytest.raises(InputError, match="has been changed"), entering(ledger):
        read_class("own.py:New", campaign, (Effect,))
    with pytest.raises(InputError, match="has no effect"):
        read_class("own.py:New", campaign, (Effect,))


@pytest.mark.parametrize("name", ["part.py", "page.js", "page.css", "card.html"])
def test_the_code_of_the_package_and_of_its_pages_is_digested(monkeypatch, tmp_path, name):
    (tmp_path / "__init__.py").write_text("first", encoding="utf-8")
    monkeypatch.setattr(frf_ipz, "__file__", str(tmp_path / "__init__.py"))
    first = software.code_digest.__wrapped__()
    (tmp_path / name).write_text("second", encoding="utf-8")
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


def test_what_was_found_counts_as_long_as_nothing_changes_that_it_rests_on(campaign, monkeypatch):
    """And no search is made for that, whatever was asked for."""
    searches = []

    def find_causes(*_, **__):
        searches.append(1)
        return replace(synthetic_folder(diagnosed=True).results["diagnose"], verdict="consistent", findings=())

    monkeypatch.setattr(mismatch, "find_causes", find_causes)
    path, out = campaign / "pipeline.toml", campaign / "out"
    frf_ipz.run_pipeline(path, out, diagnosing=True)
    text = path.read_text(encoding="utf-8")

    def run(**values):
        changed = text
        for old, new in values.values():
            assert old in text
            changed = changed.replace(old, new)
        path.write_text(changed, encoding="utf-8")
        results = frf_ipz.run_pipeline(path, out, diagnosing=False)
        says = [check.says for check in results.assessment.checks if check.name == "diagnosis"]
        return results, says, (out / "report.html").read_text(encoding="utf-8")

    results, says, _ = run()
    assert says == ["nothing significant is missing in the model"]
    results, says, _ = run(point=('"11:+z"', '"10:+z"'))
    assert says == ["nothing significant is missing in the model"]
    assert not results.stale
    results, says, page = run(band=("600.0", "550.0"))
    assert says == ["not looked for"]
    assert results.stale == {"diagnose", "levels"}
    assert "Not looked for since the last change. Before it: " in page
    assert "<dd>not looked for</dd><dd>since the last change</dd>" in page
    assert "Nothing significant is missing" not in page.split('<section id="diagnosis"')[0]
    results, says, page = run()
    assert says == ["nothing significant is missing in the model"]
    assert not results.stale
    assert "since the last change" not in page
    assert len(searches) == 1
