"""The first steps of a new user: files to start from, and a look at the set-up before anything is run."""

import sys

import pytest

from frf_ipz.cli import main as command
from frf_ipz.errors import InputError
from frf_ipz.ingest.campaign_file import read_test
from frf_ipz.pipeline.check import describe_setup
from frf_ipz.pipeline.config import read_pipeline
from frf_ipz.pipeline.init import write_starting_files
from frf_ipz.pipeline.inputs import read_inputs
from small_campaign import write_campaign


@pytest.fixture
def campaign(tmp_path):
    write_campaign(tmp_path)
    return tmp_path


def test_init_writes_files_that_can_be_read_as_they_are(campaign):
    for name in ("test.toml", "pipeline.toml"):
        (campaign / name).unlink()
    written = write_starting_files(campaign)
    assert all(written.values())
    test = read_test(campaign / "test.toml")
    assert test.input_channel.column == "force"
    assert [channel.column for channel in test.output_channels] == ["acc"]
    assert len(test.files) == 3
    assert read_pipeline(campaign / "pipeline.toml").model_path == campaign / "model.toml"


def test_init_leaves_what_is_there(campaign):
    before = (campaign / "test.toml").read_text()
    assert not any(write_starting_files(campaign).values())
    assert (campaign / "test.toml").read_text() == before


def test_init_groups_blows_by_the_name_of_their_files(campaign):
    (campaign / "test.toml").unlink()
    for number, name in enumerate(["p18_01", "p18_02", "p180_01"]):
        (campaign / "hits" / f"blow_{number + 1}.csv").rename(campaign / "hits" / f"{name}.csv")
    write_starting_files(campaign)
    test = read_test(campaign / "test.toml")
    assert {str(setup.input_dof): len(setup.files) for setup in test.setups} == {"180:+z": 1, "18:+z": 2}


def test_init_of_frfs_writes_a_test_of_their_kind(tmp_path):
    (tmp_path / "frf.csv").write_text(
        "frequency_hz,output_dof,input_dof,real,imag\n1,1:+z,2:+z,0.1,0\n2,1:+z,2:+z,1,0\n"
    )
    write_starting_files(tmp_path)
    assert read_test(tmp_path / "test.toml").kind == "frf"


def test_init_of_an_empty_folder_says_so(tmp_path):
    with pytest.raises(InputError, match=r"no \.csv"):
        write_starting_files(tmp_path)


def test_init_refuses_columns_that_differ(campaign):
    (campaign / "hits" / "blow_2.csv").write_text("time,a\n0,1\n1,2\n")
    with pytest.raises(InputError, match=r"blow_2\.csv.*columns"):
        write_starting_files(campaign)


def test_check_draws_the_set_up_and_writes_nothing(campaign, monkeypatch, capsys):
    before = sorted(campaign.rglob("*"))
    monkeypatch.setattr(sys, "argv", ["frf-ipz", "check", str(campaign / "pipeline.toml")])
    with pytest.raises(SystemExit) as stop:
        command.main()
    assert not stop.value.code
    drawing = capsys.readouterr().out
    assert "21:+z" in drawing
    assert drawing.splitlines()[2].startswith("#")
    assert {"S", "F", "*"} <= set(drawing.splitlines()[2])
    assert sorted(campaign.rglob("*")) == before


def only_recordings(folder, change):
    for name in ("test.toml", "pipeline.toml"):
        (folder / name).unlink()
    for path in (folder / "hits").glob("*.csv"):
        path.write_text(change(path.read_text(encoding="utf-8")), encoding="utf-8")


def add_columns(text):
    head, *rows = text.splitlines()
    return "\n".join([f",{head},acc", *(f"{n},{row},{row.split(',')[-1]}" for n, row in enumerate(rows))]) + "\n"


@pytest.mark.parametrize(
    ("change", "columns"),
    [
        (lambda text: "Test,Beam\nTime of test,12:30:05\n\n" + text, ["force", "acc"]),
        (lambda text: "written by a logger\n\n" + text, ["force", "acc"]),
        (lambda text: "sep=;\n" + text.replace(",", ";"), ["force", "acc"]),
        (lambda text: text.replace("\n", ",\n"), ["force", "acc"]),
        (add_columns, ["force", "4", "5"]),
        (lambda text: add_columns(text).replace("acc,acc", "Time,acc"), ["force", "acc"]),
    ],
    ids=["preamble", "free text", "sep", "delimiter at the end", "index and a name twice", "a second time"],
)
def test_check_accepts_what_init_writes(campaign, change, columns):
    only_recordings(campaign, change)
    (campaign / "model.toml").unlink()
    write_starting_files(campaign)
    test = read_test(campaign / "test.toml")
    assert [channel.column for channel in test.channels] == columns
    assert [str(channel.dof) for channel in test.output_channels] == [f"{n}:+z" for n in range(1, len(columns))]
    assert "  read      3 x " in describe_setup(read_inputs(campaign / "pipeline.toml"))


def test_check_opens_every_recording(campaign):
    assert "  read      3 x " in describe_setup(read_inputs(campaign / "pipeline.toml"))
    path = campaign / "hits" / "blow_2.csv"
    path.write_text(path.read_text(encoding="utf-8").replace("acc", "acceleration"), encoding="utf-8")
    with pytest.raises(InputError, match=r"blow_2\.csv, line 1: has no column 'acc'"):
        describe_setup(read_inputs(campaign / "pipeline.toml"))


def test_init_invents_no_rate(campaign):
    only_recordings(campaign, lambda text: "\n".join(line.partition(",")[2] for line in text.splitlines()) + "\n")
    (campaign / "model.toml").unlink()
    write_starting_files(campaign)
    assert "\n# sample_rate_hz = " in (campaign / "test.toml").read_text(encoding="utf-8")
    with pytest.raises(InputError, match=r"write sample_rate_hz = \.\.\. under \[test\]"):
        describe_setup(read_inputs(campaign / "pipeline.toml"))


def test_check_reads_large_recordings_to_the_first_block(campaign, monkeypatch):
    monkeypatch.setattr("frf_ipz.pipeline.check.WHOLE_BYTES", 0)
    assert "  read      3 x more than " in describe_setup(read_inputs(campaign / "pipeline.toml"))


def test_check_counts_the_recordings_that_it_cannot_read(campaign):
    for name in ("blow_1.csv", "blow_2.csv"):
        (campaign / "hits" / name).write_text("time,force,acc\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"blow_1\.csv.*2 of 3 recordings cannot be read"):
        describe_setup(read_inputs(campaign / "pipeline.toml"))
