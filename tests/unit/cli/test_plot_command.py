"""Pictures from the command line: every name draws, and what is wrong is said in one line."""

import sys

import pytest

from demo_case import made_demo
from frf_ipz.cli import main as command

KINDS = {"svg": b"<?xml", "pdf": b"%PDF", "png": b"\x89PNG"}
OF_DIAGNOSIS = {"mismatch", "ranking", "proof", "law", "levels"}


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    return made_demo(tmp_path_factory) / "out"


@pytest.fixture
def call(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["frf-ipz", *map(str, arguments)])
        status = 0
        try:
            command.main()
        except SystemExit as stop:
            status = stop.code or 0
        output = capsys.readouterr()
        return status, output.out, output.err

    return run


def test_every_picture_that_is_named_draws(call, out, tmp_path):
    status, output, _ = call("plot", out)
    names = output.splitlines()[1:]
    assert status == 0
    assert len(names) >= 10
    for name in sorted(set(names) - OF_DIAGNOSIS):
        assert call("plot", out, name)[:2] == (0, f"wrote {name}.svg\n"), name
        assert (tmp_path / f"{name}.svg").read_bytes().startswith(KINDS["svg"])


@pytest.mark.parametrize("kind", KINDS)
def test_the_format_is_the_one_asked_for(call, out, tmp_path, kind):
    assert call("plot", out, "poles", "--format", kind, "--out", tmp_path / "here")[0] == 0
    assert (tmp_path / "here").read_bytes().startswith(KINDS[kind])


@pytest.mark.parametrize("kind", KINDS)
def test_the_format_is_that_of_the_name_of_the_file(call, out, tmp_path, kind):
    assert call("plot", out, "poles", "--out", tmp_path / f"here.{kind.upper()}")[0] == 0
    assert (tmp_path / f"here.{kind.upper()}").read_bytes().startswith(KINDS[kind])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("pole",), "did you mean 'poles'"),
        (("poles", "--format", "jpg"), "'jpg' is not known"),
        (("ranking",), "needs the result of 'diagnose'"),
        (("poles", "--out", "nowhere/poles.svg"), "cannot be written"),
        (("poles", "--out", "poles.jpg"), "'jpg' is not known"),
        (("poles", "--out", "poles.png", "--format", "svg"), "ends as .png, and --format is svg"),
    ],
    ids=str,
)
def test_what_is_wrong_is_said_in_a_line(call, out, arguments, message):
    status, _, output = call("plot", out, *arguments)
    assert (status, output.count("\n")) == (2, 1)
    assert message in output


def test_a_folder_without_a_run_is_refused(call, tmp_path):
    for arguments in (("plot", tmp_path), ("plot", tmp_path, "poles"), ("show", tmp_path)):
        status, _, output = call(*arguments)
        assert status == 2, arguments
        assert "there is no run here" in output
