"""Results that cannot be written: one line that says why, exit status 2, and the old ones byte for byte."""

import errno
import os
import shutil
import sys

import pytest

import commands
from frf_ipz.errors import InputError
from frf_ipz.pipeline.run import run_pipeline
from small_campaign import write_campaign
from whole_results import content, faults_after_a_command, results_of

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="processes are copied, limits are those of POSIX")


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """A pipeline, and the results of another band."""
    folder = tmp_path_factory.mktemp("writing")
    pipeline = write_campaign(folder)
    assert commands.run("run", pipeline, "--out", folder / "old", log=folder / "log")[0] == 0
    pipeline.write_text(pipeline.read_text().replace("600.0", "580.0"))
    return folder


@pytest.fixture
def out(campaign):
    """A copy of the old results."""
    shutil.rmtree(campaign / "out", ignore_errors=True)
    shutil.copytree(campaign / "old", campaign / "out")
    return campaign / "out"


def refused(campaign, out, **options):
    """What a command says that is refused."""
    status, said, _ = commands.run("run", campaign / "pipeline.toml", "--out", out, log=campaign / "log", **options)
    assert (status, said.count("\n")) == (2, 1), said
    return said


def test_a_write_that_fails_half_way(campaign, out):
    largest = max(len(data) for data in content(out).values())
    for most_bytes in (2_000, 5_000, 60_000, largest // 2):  # of the lock's holder, a table, a result and the page
        assert "File too large" in refused(campaign, out, most_bytes=most_bytes)
        assert content(out) == content(campaign / "old")
        assert faults_after_a_command(out) == []


def test_a_folder_where_a_file_has_to_be(campaign, out):
    (out / "poles.parquet").unlink()
    (out / "poles.parquet").mkdir()
    (out / "poles.parquet" / "own.txt").write_text("the user's")
    before = content(out)
    assert f"{out / 'poles.parquet'}: cannot be written" in refused(campaign, out)
    assert content(out) == before
    assert results_of(out) == results_of(campaign / "old")


@pytest.mark.parametrize("reason", [errno.EACCES, errno.EROFS], ids=errno.errorcode.get)
def test_a_folder_that_nothing_can_be_written_to(campaign, out, reason):
    said = refused(campaign, out, within=out, refused=reason, refused_from=0)
    assert f"{out}: cannot be written: {os.strerror(reason)}" in said
    assert content(out) == content(campaign / "old")
    assert faults_after_a_command(out) == []
    for command in (("plot", out, "fit", "--out", campaign / "fit.svg"), ("plot", out)):  # to read needs no permission
        status, said, n_changes = commands.run(
            *command, log=campaign / "log", within=out, refused=reason, refused_from=0
        )
        assert (status, n_changes) == (0, 0), said


def test_a_new_folder_where_none_can_be_made(campaign):
    place = campaign / "none" / "out"
    assert "cannot be written" in refused(
        campaign, place, within=campaign / "none", refused=errno.EACCES, refused_from=0
    )
    assert not place.parent.exists()


def test_names_that_no_folder_can_have(campaign):
    assert "File name too long" in refused(campaign, campaign / ("n" * 256))
    assert "not in UTF-8" in refused(campaign, os.fsdecode(os.fsencode(campaign) + b"/b\xff"))
    assert sorted(path.name for path in campaign.iterdir() if path.name.startswith(("n", "b"))) == []


@pytest.mark.parametrize("stage", ["fit", "update"])
def test_a_folder_that_is_deleted_while_the_command_is_at_work(campaign, out, stage):
    def delete(fraction, text):
        del fraction
        if text.startswith(stage) and out.exists():
            shutil.rmtree(out)

    with pytest.raises(InputError, match="cannot be written: its folder is gone") as said:
        run_pipeline(campaign / "pipeline.toml", out, progress=delete)
    assert "\n" not in str(said.value)
    assert not out.exists()
    run_pipeline(campaign / "pipeline.toml", out)
    assert faults_after_a_command(out) == []
