"""Each example of the gallery runs, draws, is short, and needs public names only."""

import ast
import runpy
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import pytest

import frf_ipz

GALLERY = Path(__file__).parents[2] / "docs" / "gallery"
EXAMPLES = sorted(GALLERY.glob("plot_*.py"))
LONGEST = 80
QUICK = {"plot_diagnosis", "plot_own_arrays", "plot_recordings"}  # a build of the documentation runs them all
ALLOWED = {"frf_ipz", "matplotlib.pyplot", "numpy", "pathlib"}


def private_names(code):
    """What an example uses of the package that is not public, and modules that it should not need."""
    bad = []
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            bad += [alias.name for alias in node.names if alias.name not in ALLOWED]
        elif isinstance(node, ast.ImportFrom):
            bad += [str(node.module)] if node.module != "pathlib" else []
        elif isinstance(node, ast.Attribute):
            of_package = isinstance(node.value, ast.Name) and node.value.id == "frf_ipz"
            if node.attr.startswith("_") or (of_package and node.attr not in frf_ipz.__all__):
                bad.append(node.attr)
    return bad


def test_there_are_examples():
    assert {path.stem for path in EXAMPLES} >= QUICK
    assert 6 <= len(EXAMPLES) <= 12


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_is_short_and_public(path):
    code = path.read_text(encoding="utf-8")
    assert len(code.splitlines()) <= LONGEST
    assert private_names(code) == []


def test_a_private_name_would_be_seen():
    assert private_names("import frf_ipz\nfrf_ipz.fit_modes(1)") == []
    assert private_names("import frf_ipz\nfrf_ipz.fe(1)._hidden") == ["_hidden", "fe"]
    assert private_names("from frf_ipz.fe import eigen\nimport os") == ["frf_ipz.fe", "os"]


@pytest.mark.parametrize(
    "path",
    [pytest.param(path, id=path.stem, marks=[] if path.stem in QUICK else pytest.mark.slow) for path in EXAMPLES],
)
def test_example_runs_and_draws(path, monkeypatch, capsys):
    mpl.use("Agg")
    drawn = []
    monkeypatch.chdir(path.parent)
    monkeypatch.setattr(plt, "show", lambda: drawn.extend(plt.get_fignums()))
    try:
        runpy.run_path(str(path))
    finally:
        plt.close("all")
    assert drawn
    assert capsys.readouterr().out
