"""Looking at anybody's results: none of their code, nothing outside touched, one line, 500 MB at most."""

import os
import shutil
import sys
from functools import partial

import pytest

from hostile_folders import KINDS, write_folder
from looking import Watch, content, in_a_child, look

# Left to the slow suite: another file or value of what a kind in the quick one shows, refused by the same lines.
ALIKE = (
    *(f"{file}_is_a_{what}" for file in ("run.json", "diagnosis.json") for what in ("folder", "link_in_a_circle")),
    *("run.json_is_a_device", "diagnosis.json_is_a_pipe", "run.json_has_a_terabyte", "fit_is_a_folder"),
    *("manifest_zeros", "manifest_deep", "manifest_bomb_of_texts", "manifest_only_a_brace", "manifest_stages_number"),
    *("manifest_files_absolute", "manifest_seconds_infinite", "manifest_name_evil", "manifest_pipeline_no_name"),
    *("manifest_pipeline_device", "manifest_other_version", "manifest_version_no_text", "stage_is_empty"),
    *("stage_is_an_archive_with_a_pickle", "stage_builds_a_class_of_others", "stage_builds_nothing"),
    *("stage_builds_plain_values", "fit_counts_below_nothing", "fit_has_a_band_of_three", "fit_has_no_labels"),
    *("fit_has_texts_in_a_table", "ingest_has_huge_values", "ingest_has_no_tables", "pair_points_before_the_start"),
    *("update_has_another_history", "predict_has_no_labels", "levels_has_another_table", "arrays_are_empty"),
    *("current_generation_is_text", "current_generation_is_far", "current_generation_is_empty"),
)


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    folder = write_folder(tmp_path_factory.mktemp("good") / "results")
    look(folder, tmp_path_factory.mktemp("out"))  # what looking loads once is there in every copy of this process
    return folder


def _look(folder, out):
    os.chdir(folder)
    return "\n".join(Watch(out).look(folder, out)[0])


@pytest.mark.skipif(sys.platform != "linux", reason="measured by what Linux tells of a process")
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if name in ALIKE else name for name in KINDS]
)
def test_looking_does_no_harm_and_says_what_is_wrong_in_one_line(tmp_path, good, name):
    folder, user, out = tmp_path / "results", tmp_path / "user", tmp_path / "out"
    shutil.copytree(good, folder)
    user.mkdir()
    out.mkdir()
    (user / "precious.txt").write_text("years of work")
    KINDS[name](folder, user)
    before = content(tmp_path)
    assert in_a_child(partial(_look, folder, out)) == ""
    assert (user / "precious.txt").exists()
    after = {path: data for path, data in content(tmp_path).items() if not path.is_relative_to(out)}
    assert after.keys() == before.keys()
    assert after == before


def test_kinds_that_are_left_to_the_slow_suite_are_there():
    assert set(ALIKE) <= set(KINDS) or sys.platform == "win32"


def test_a_good_folder_is_shown_without_a_word(tmp_path, good):
    wrong, said = look(good, tmp_path)
    assert wrong == []
    assert said == {}
