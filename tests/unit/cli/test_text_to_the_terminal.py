"""Whatever a name holds, a terminal is shown letters: no sequence that it obeys, no line that nobody said."""

import ast
import sys
import unicodedata
import warnings
from pathlib import Path

import pytest

from frf_ipz.cli import main as command
from frf_ipz.visible_text import lines, one_line
from small_campaign import PIPELINE, write_campaign

SOURCE = Path(__file__).parents[3] / "src" / "frf_ipz"
EVIL = "\x1b]0;title\x07\x1b[2J\u202egnp\u202c\x9b31m\u2028\rfrf-ipz"
EVIL_LINE = EVIL + "\nfrf-ipz: done"
IN_TOML = "".join(f"\\U{ord(letter):08x}" for letter in EVIL_LINE)
SHOWN = r"\x1b]0;title\x07\x1b[2J\u202egnp\u202c\x9b31m\u2028\rfrf-ipz\nfrf-ipz: done"


@pytest.fixture
def call(monkeypatch, capsys):
    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["frf-ipz", *map(str, arguments)])
        status = 0
        with warnings.catch_warnings(), monkeypatch.context() as patched:
            patched.setattr(sys, "excepthook", sys.excepthook)
            try:
                command.main()
            except SystemExit as stop:
                status = stop.code or 0
        output = capsys.readouterr()
        return status, output.out, output.err

    return run


def assert_only_letters(text):
    assert [letter for letter in text if letter not in "\n\t " and unicodedata.category(letter)[0] in "CZ"] == []


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    folder = tmp_path_factory.mktemp("names")
    write_campaign(folder)
    hits = sorted((folder / "hits").glob("*.csv"))
    if sys.platform != "win32":
        hits[0].rename(folder / "hits" / f"{EVIL}.csv")
    test = folder / "test.toml"
    text = test.read_text(encoding="utf-8")
    text = text.replace('"small cantilever"', f'"{IN_TOML}"')
    test.write_text(text, encoding="utf-8")
    model = folder / "model.toml"
    model.write_text(model.read_text(encoding="utf-8").replace('"small cantilever"', f'"{IN_TOML}"'), encoding="utf-8")
    (folder / "pipeline.toml").write_text(PIPELINE.replace('"small cantilever"', f'"{IN_TOML}"'), encoding="utf-8")
    return folder


def test_names_of_test_model_and_pipeline_are_shown_as_letters(call, campaign):
    status, output, error = call("check", campaign / "pipeline.toml")
    assert (status, error) == (0, "")
    assert output.count(SHOWN) == 3
    assert_only_letters(output)


def test_names_of_files_in_the_summary_are_shown_as_letters(call, campaign, tmp_path):
    status, output, error = call("fit", campaign / "pipeline.toml", "--out", tmp_path / "out")
    assert (status, error) == (0, "")
    assert output.splitlines()[0] == SHOWN
    assert_only_letters(output)
    status, output, error = call("plot", tmp_path / "out")
    assert (status, error) == (0, "")
    assert_only_letters(output)


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("test.toml", 'column = "acc"', f'column = "{IN_TOML}"'),
        ("test.toml", 'dof = "21:+z"', f'dof = "{IN_TOML}"'),
        ("test.toml", 'unit = "m/s^2"', f'unit = "{IN_TOML}"'),
        ("test.toml", 'files = ["hits/*.csv"]', f'files = ["{IN_TOML}"]'),
        ("test.toml", "[[hit]]", f'"{IN_TOML}" = 1\n[[hit]]'),
        ("pipeline.toml", 'points = ["11:+z"]', f'points = ["{IN_TOML}"]'),
        ("pipeline.toml", 'model = "model.toml"', f'model = "{IN_TOML.replace("0000000a", "00000041")}"'),
        ("model.toml", 'kind = "beam"', f'kind = "{IN_TOML}"'),
        ("model.toml", 'left = "clamped"', f'left = "{IN_TOML}"'),
    ],
    ids=["channel", "DOF", "unit", "files", "key", "point", "model file", "kind", "end"],
)
def test_an_error_is_one_line_of_letters(call, tmp_path, file, old, new):
    write_campaign(tmp_path)
    text = (tmp_path / file).read_text(encoding="utf-8")
    assert old in text
    (tmp_path / file).write_text(text.replace(old, new), encoding="utf-8")
    status, output, error = call("fit", tmp_path / "pipeline.toml", "--out", tmp_path / "out", "--quiet")
    assert (status, output) == (2, "")
    assert error.count("\n") == 1
    assert error.endswith("\n")
    assert r"\x1b" in error
    assert_only_letters(error)


@pytest.mark.skipif(sys.platform == "win32", reason="no such names there")
def test_a_header_with_controls_is_shown_as_letters(call, tmp_path):
    write_campaign(tmp_path)
    for path in (tmp_path / "hits").glob("*.csv"):
        path.write_text(path.read_text(encoding="utf-8").replace("acc", "a\x1b[2Jc"), encoding="utf-8")
    status, _, error = call("fit", tmp_path / "pipeline.toml", "--out", tmp_path / "out")
    assert status == 2
    assert r"a\x1b[2Jc" in error
    assert_only_letters(error)


def test_a_name_that_is_no_text_is_shown_as_letters():
    assert one_line("hit\udcff.csv") == r"hit\udcff.csv"
    one_line("hit\udcff.csv").encode("utf-8")


def test_letters_of_all_scripts_stay():
    text = "Träger 梁 балка \u200dنیم\u200cفاصله 🔨 µ²"
    assert one_line(text) == lines(text) == text


def test_warnings_and_faults_are_shown_as_letters(monkeypatch, capsys, campaign):
    def fail(path):  # noqa: ARG001
        raise RuntimeError(EVIL)

    hooks = {}
    monkeypatch.setattr(
        "frf_ipz.cli.commands.app", lambda: hooks.update(fault=sys.excepthook, warn=warnings.showwarning)
    )
    with warnings.catch_warnings(), monkeypatch.context() as patched:
        patched.setattr(sys, "excepthook", sys.excepthook)
        command.main()
    try:
        fail(campaign)
    except RuntimeError as error:
        hooks["fault"](type(error), error, error.__traceback__)
    hooks["warn"](EVIL, UserWarning, "file.py", 1)
    error = capsys.readouterr().err
    assert error.count(r"\x1b[2J") == 2
    assert_only_letters(error)


def test_nothing_else_prints():
    prints = [
        f"{path.relative_to(SOURCE)}:{node.lineno}"
        for path in SOURCE.rglob("*.py")
        if path.relative_to(SOURCE).as_posix() != "cli/printing.py"
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and ast.unparse(node.func) in {"print", "sys.stdout.write", "sys.stderr.write"}
    ]
    assert prints == []
