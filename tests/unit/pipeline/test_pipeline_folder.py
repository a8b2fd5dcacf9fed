"""A folder may stand for the pipeline that it holds; where it holds none or several, the message lists them."""

import json
import re

import pytest

from frf_ipz.errors import InputError
from frf_ipz.pipeline.inputs import read_inputs
from frf_ipz.pipeline.run import run_pipeline
from small_campaign import write_campaign

PIPELINE = '[pipeline]\ntest = "test.toml"\n'


@pytest.fixture
def campaign(tmp_path):
    write_campaign(tmp_path)
    return tmp_path


def refusal(folder):
    with pytest.raises(InputError) as refused:
        read_inputs(folder)
    return str(refused.value)


def test_the_folder_stands_for_the_pipeline_in_it(campaign):
    assert read_inputs(campaign).source == read_inputs(campaign / "pipeline.toml").source
    assert run_pipeline(str(campaign), campaign / "out", until="ingest").frfs.labels


def test_several_are_listed(campaign):
    (campaign / "second.toml").write_text(PIPELINE, encoding="utf-8")
    files = [str(campaign / name) for name in ("pipeline.toml", "second.toml")]
    assert refusal(campaign) == f"{campaign}: holds 2 pipelines; name one of them: {files[0]} and {files[1]}"


def test_those_of_the_folders_below_are_listed(campaign):
    for name in ("a", "b"):
        (campaign / name).mkdir()
        (campaign / name / "run.toml").write_text(PIPELINE, encoding="utf-8")
    (campaign / "pipeline.toml").unlink()
    message = refusal(campaign)
    assert "holds no pipeline itself" in message
    assert re.findall(r"\w/run\.toml", message) == ["a/run.toml", "b/run.toml"]


def test_where_there_is_none_init_is_named(campaign):
    (campaign / "pipeline.toml").unlink()
    assert refusal(campaign).endswith(f"write one with 'frf-ipz init {campaign}'")


def test_results_name_what_they_were_made_from(tmp_path):
    manifest = {"pipeline": "/a/pipeline.toml", "stages": {}}
    (tmp_path / "run.json").write_text(json.dumps(manifest), encoding="utf-8")
    assert refusal(tmp_path).endswith(
        "holds results and no pipeline; name the one they were made from: /a/pipeline.toml"
    )


def test_a_damaged_one_is_read_for_its_message(campaign):
    (campaign / "pipeline.toml").write_text("[pipeline\n", encoding="utf-8")
    assert "pipeline.toml: is not valid TOML" in refusal(campaign)
