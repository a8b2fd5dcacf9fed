"""Where recordings are missing, a study says which file, and where they come from."""

import pytest
from typer.testing import CliRunner

from frf_testbench.cli import app
from frf_testbench.studies.recordings import SOURCES
from frf_testbench.studies.run import STUDIES

FOLDERS = {name: name for name in STUDIES} | {"left_out": "steel_beam_5x3", "beam_physics": "freefree_beam"}
ORIGINS = {
    "cantilever_masses": "Dataset Beam-signal_Healthy.zip",
    "double_beam_ringdown": "laser vibrometer",
    "silverbox": "www.nonlinearbenchmark.org",
    "left_out": "flexible steel beam",
    "beam_physics": "roving hammer",
}


def run(name, folder):
    outcome = CliRunner().invoke(app, ["study", name, str(folder)])
    return outcome.exit_code, " ".join(outcome.stderr.split()), outcome.stdout


@pytest.mark.parametrize("name", STUDIES)
def test_a_folder_that_is_not_there_is_named_with_its_origin(name, tmp_path):
    folder = tmp_path / FOLDERS[name]
    code, message, printed = run(name, folder)
    assert code == 2
    assert message.startswith(f"frf-testbench: there is no folder {folder}. It has to hold")
    assert ORIGINS[name] in message
    assert "not part of the repository" in message
    assert printed == ""


@pytest.mark.parametrize("name", STUDIES)
def test_the_file_that_is_missing_is_named(name, tmp_path):
    folder = tmp_path / FOLDERS[name]
    *present, missing = SOURCES[FOLDERS[name]].files
    folder.mkdir()
    for file in present:
        (folder / file).parent.mkdir(exist_ok=True)
        (folder / file).touch()
    code, message, _ = run(name, folder)
    assert code == 2
    assert message.startswith(f"frf-testbench: there is no {missing} in {folder}. It has to hold")
    assert ORIGINS[name] in message


@pytest.mark.parametrize("name", ["left_out", "beam_physics"])
def test_a_study_of_beams_names_both_folders(name, tmp_path):
    code, message, _ = run(name, tmp_path)
    assert code == 2
    assert "steel_beam_5x3 and freefree_beam" in message
    assert "flexible steel beam" in message
    assert "roving hammer" in message


def test_an_unknown_study_is_answered_with_those_that_there_are(tmp_path):
    code, message, _ = run("silver_box", tmp_path)
    assert code == 2
    assert "there is no study 'silver_box'" in message
    assert all(name in message for name in STUDIES)


def test_a_file_that_cannot_be_read_is_named(tmp_path):
    folder = tmp_path / "steel_beam_5x3"
    folder.mkdir()
    for file in SOURCES["steel_beam_5x3"].files:
        (folder / file).write_text("[test\n", encoding="utf-8")
    code, message, _ = run("left_out", folder)
    assert code == 2
    assert "test.toml" in message


def test_the_help_names_every_study():
    text = CliRunner().invoke(app, ["study", "--help"], terminal_width=200).output
    assert all(name in text for name in STUDIES)
