"""A run's folder: everything or nothing, and nothing twice."""

import errno
import json
import os
import stat
from pathlib import Path

import pytest

import frf_ipz
from frf_ipz.errors import InputError
from frf_ipz.input_files import digest_file
from frf_ipz.runs import generations
from frf_ipz.runs.digests import digest
from frf_ipz.runs.folder import open_run, read_manifest, read_run
from frf_ipz.runs.folder_lock import LOCK
from frf_ipz.runs.generations import POINTER, current_folder
from frf_ipz.runs.stage_file import SUFFIX
from small_results import number_in, stage, write_text
from whole_results import faults_after_a_command


def contents(folder):
    """All that is in a folder, but the lock, which has none."""
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file() and path.name != LOCK}


def test_a_stage_is_computed_once_for_a_key(tmp_path):
    with open_run(tmp_path) as folder:
        assert stage(folder, "a", 1) == 1
    with open_run(tmp_path) as folder:
        assert stage(folder, "a", 2) == 1
        assert folder.computed == []
    with open_run(tmp_path) as folder:
        assert stage(folder, "b", 3) == 3
        assert folder.computed == ["model"]
    assert (tmp_path / "model.txt").read_text() == "3"
    assert number_in(read_run(tmp_path).load("model")) == 3


def test_a_command_that_finds_nothing_to_do_leaves_all_as_it_was(tmp_path):
    with open_run(tmp_path) as folder:
        stage(folder, "a", 1)
        folder.manifest["when"] = "then"
    before, reading = contents(tmp_path), read_run(tmp_path)
    with open_run(tmp_path) as folder:
        stage(folder, "a", 1)
        folder.manifest["when"] = "now"
    assert contents(tmp_path) == before
    assert number_in(reading.load("model")) == 1
    with open_run(tmp_path) as folder:
        stage(folder, "a", 1)
        folder.manifest["name"] = "another"
    assert read_manifest(tmp_path)["name"] == "another"


def test_a_damaged_result_is_computed_again(tmp_path):
    with open_run(tmp_path) as folder:
        stage(folder, "a", 1)
    (tmp_path / "stages" / "model.result").write_bytes(b"no result")
    with open_run(tmp_path) as folder:
        assert stage(folder, "a", 2) == 2


def test_a_file_that_was_deleted_is_written_again(tmp_path):
    with open_run(tmp_path) as folder:
        stage(folder, "a", 1)
    (tmp_path / "model.txt").unlink()
    with open_run(tmp_path) as folder:
        stage(folder, "a", 1)
    assert (tmp_path / "model.txt").read_text() == "1"
    assert read_manifest(tmp_path)["notes"] == ["model.txt was damaged or gone, and has been made again"]
    with open_run(tmp_path) as folder:
        stage(folder, "a", 1)
    assert "notes" not in read_manifest(tmp_path)


def test_a_file_that_its_stage_no_longer_writes_goes_and_one_of_another_stage_stays(tmp_path):
    writers = {"model.txt": write_text("1"), "more.txt": write_text("2"), "shared.txt": write_text("3")}
    with open_run(tmp_path) as folder:
        stage(folder, "a", 1, writers)
        folder.page("report", "a", {"shared.txt": write_text("4")})
    (tmp_path / "own.txt").write_text("the user's")
    with open_run(tmp_path) as folder:
        stage(folder, "b", 2)
        assert (tmp_path / "more.txt").exists()
    assert not (tmp_path / "more.txt").exists()
    assert (tmp_path / "shared.txt").read_text() == "4"
    assert (tmp_path / "own.txt").exists()


def test_a_run_that_fails_leaves_what_was_there(tmp_path):
    with open_run(tmp_path) as folder:
        stage(folder, "a", 1)
    before = contents(tmp_path)
    with pytest.raises(ZeroDivisionError), open_run(tmp_path) as folder:
        stage(folder, "b", 2)
        _ = 1 / 0
    assert contents(tmp_path) == before


@pytest.mark.parametrize("step", ["write_text", "_remove"])
def test_a_signal_while_results_take_their_place_leaves_nothing_lying_about(tmp_path, monkeypatch, step):
    """It comes when the step has been done, once: only the next command would clear up."""
    with open_run(tmp_path) as folder:
        stage(folder, "a", 1)
    original = getattr(generations, step)

    def interrupted(*arguments):
        original(*arguments)
        monkeypatch.undo()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), open_run(tmp_path) as folder:
        stage(folder, "b", 2)
        monkeypatch.setattr(generations, step, interrupted)
    assert number_in(read_run(tmp_path).load("model")) == 2
    assert faults_after_a_command(tmp_path) == []


def test_a_first_run_that_fails_leaves_no_folder(tmp_path):
    out = tmp_path / "new" / "results"
    with pytest.raises(ZeroDivisionError), open_run(out):
        _ = 1 / 0
    assert not out.exists()


def test_a_reader_never_sees_half_a_file(tmp_path):
    with open_run(tmp_path) as folder:
        stage(folder, "a", 1)
        assert not (tmp_path / "model.txt").exists()
    assert (tmp_path / "model.txt").exists()


def test_all_is_synced_before_it_counts_and_as_windows_wants_it(tmp_path, monkeypatch):
    synced, counted = [], []
    replace = os.replace

    def sync(descriptor):
        if not stat.S_ISDIR(os.fstat(descriptor).st_mode):
            os.write(descriptor, b"")  # fails for what is open for reading only, as does Windows' fsync
        synced.append(os.fstat(descriptor).st_ino)

    def note_replace(source, target):
        if Path(target).name == POINTER:
            counted.append(len(synced))
        replace(source, target)

    monkeypatch.setattr(os, "fsync", sync)
    monkeypatch.setattr(os, "replace", note_replace)
    with open_run(tmp_path) as folder:
        stage(folder, "a", 1)
    generation = current_folder(tmp_path)
    files = [path for path in generation.rglob("*") if path.suffix != ".json"]
    assert len(files) == 3  # with the folder of the results
    assert {path.stat().st_ino for path in (*files, generation, tmp_path, tmp_path / "stages")} <= set(
        synced[: counted[-1]]
    )


@pytest.fixture
def open_elsewhere(monkeypatch):
    """Files that are open in another program, as Windows sees it: nothing can take their place, nor can they go."""
    held = set()
    replace = os.replace

    def replace_if_free(source, target):
        if held & {Path(source), Path(target)}:
            raise PermissionError(errno.EACCES, "Permission denied")
        replace(source, target)

    monkeypatch.setattr(os, "replace", replace_if_free)
    return held


@pytest.mark.parametrize("held", ["model.txt", "abandoned.txt", "run.json", f"stages/model{SUFFIX}"])
def test_where_one_file_is_open_elsewhere_all_are_as_they_were(tmp_path, open_elsewhere, held):
    old = {"model.txt": write_text("1"), "abandoned.txt": write_text("1"), "same.txt": write_text("1")}
    with open_run(tmp_path) as folder:
        stage(folder, "a", 1, old)
    (tmp_path / "same.txt").write_text("edited by the user")
    before = contents(tmp_path)
    open_elsewhere.add(tmp_path / held)
    new = {"another.txt": write_text("2"), "model.txt": write_text("2"), "same.txt": write_text("1")}
    with pytest.raises(InputError, match=r"cannot be written: .*close it") as refused, open_run(tmp_path) as folder:
        stage(folder, "b", 2, new)
    assert str(refused.value).startswith(str(tmp_path / held))
    assert contents(tmp_path) == before
    assert number_in(read_run(tmp_path).load("model")) == 1
    open_elsewhere.clear()
    with open_run(tmp_path) as folder:
        stage(folder, "b", 3, new)
    assert (tmp_path / "model.txt").read_text() == "2"
    assert not (tmp_path / "abandoned.txt").exists()
    assert number_in(read_run(tmp_path).load("model")) == 3


def test_a_full_disk_is_said_in_one_line_and_loses_nothing(tmp_path):
    with open_run(tmp_path) as folder:
        stage(folder, "a", 1)

    def fail(path):
        path.write_text("half")
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(InputError, match="disk is full"), open_run(tmp_path) as folder:
        stage(folder, "b", 2, {"model.txt": fail})
    assert (tmp_path / "model.txt").read_text() == "1"


def test_an_out_folder_that_cannot_be_made_is_said(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="choose another --out"), open_run(tmp_path / "file" / "results"):
        pass


def test_a_folder_without_a_run_is_said(tmp_path):
    with pytest.raises(InputError, match="no run here"):
        read_run(tmp_path)


def test_a_damaged_manifest_means_computing_anew(tmp_path):
    (tmp_path / "run.json").write_text("{half")
    assert read_manifest(tmp_path) == {}


def test_files_of_a_page_are_there_again_when_they_are_gone(tmp_path):
    for key, expected in (("a", ["report"]), ("a", []), ("b", ["report"])):
        with open_run(tmp_path) as folder:
            folder.page("report", key, {"report.html": write_text(f"page {key}")})
            assert folder.computed == expected
        assert (tmp_path / "report.html").read_text() == f"page {key}"
        (tmp_path / "report.html").unlink()


def test_digests_follow_the_content(tmp_path):
    assert digest({"a": 1, "b": 2}) == digest({"b": 2, "a": 1})
    assert digest({"a": 1}) != digest({"a": 2})
    (tmp_path / "file").write_text("1")
    first = digest_file(tmp_path / "file")
    (tmp_path / "file").write_text("2")
    assert digest_file(tmp_path / "file") != first


def test_results_of_another_version_are_refused_with_what_to_do(tmp_path):
    manifest = {"frf_ipz": "0.1.0", "pipeline": "p.toml", "stages": {}}
    (tmp_path / "run.json").write_text(json.dumps(manifest), encoding="utf-8")
    with pytest.raises(InputError, match=r"made by frf_ipz 0\.1\.0, .*frf-ipz run p\.toml --out") as refused:
        read_run(tmp_path)
    assert "\n" not in str(refused.value)
    (tmp_path / "run.json").write_text(json.dumps({**manifest, "frf_ipz": frf_ipz.__version__}), encoding="utf-8")
    assert read_run(tmp_path).manifest["pipeline"] == "p.toml"
