"""Scripts that users read are short, and use public names of frf_ipz only."""

import ast
from pathlib import Path

import pytest

import frf_ipz

ROOT = Path(__file__).parents[2]
SCRIPTS = [path for folder in ("pipelines", "docs/gallery") for path in sorted((ROOT / folder).rglob("*.py"))]
MOST_LINES = 80


def dotted(node):
    """The names of an attribute chain, such as ["frf_ipz", "plotting", "plot_frfs"]; empty for anything else."""
    if isinstance(node, ast.Name):
        return [node.id]
    start = dotted(node.value) if isinstance(node, ast.Attribute) else []
    return [*start, node.attr] if start else []


def names_not_public(code):
    """Lines and names of what is not public."""
    wrong = []
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            imported = [(alias.name, alias.asname or alias.name) for alias in node.names]
            wrong += [
                (node.lineno, name) for name, alias in imported if is_ours(name) and (name, alias) != ("frf_ipz",) * 2
            ]
        elif isinstance(node, ast.ImportFrom) and is_ours(node.module or ""):
            wrong.append((node.lineno, node.module))
        elif isinstance(node, ast.Attribute):
            package, *names = dotted(node) or [""]
            if package == "frf_ipz" and not is_public(names):
                wrong.append((node.lineno, ".".join(names)))
    return wrong


def is_ours(module):
    return module.split(".")[0] in {"frf_ipz", "frf_testbench"}


def is_public(names):
    if names[0] == "plotting" and len(names) > 1:
        return names[1] in frf_ipz.plotting.__all__
    return names[0] in frf_ipz.__all__


def test_there_are_scripts():
    assert {path.name for path in SCRIPTS} >= {"cantilever.py", "poi_controller.py"}


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_script_is_short_and_uses_public_names_only(path):
    code = path.read_text(encoding="utf-8")
    assert len(code.splitlines()) <= MOST_LINES
    assert "import frf_ipz" in code
    assert names_not_public(code) == []


@pytest.mark.parametrize(
    ("code", "name"),
    [
        ("from frf_ipz.export.state_space import to_control", "frf_ipz.export.state_space"),
        ("from frf_ipz import fit_modes", "frf_ipz"),
        ("import frf_ipz.export", "frf_ipz.export"),
        ("import frf_ipz as fi", "frf_ipz"),
        ("import frf_testbench.cli", "frf_testbench.cli"),
        ("import frf_ipz\nx = frf_ipz.reduce_to_dofs(1)", "reduce_to_dofs"),
        ("import frf_ipz\nx = frf_ipz.export.state_space", "export"),
        ("import frf_ipz\nx = frf_ipz.plotting.figures", "plotting.figures"),
    ],
)
def test_a_private_name_would_be_seen(code, name):
    assert name in {wrong for _, wrong in names_not_public(code)}


def test_a_public_name_is_taken():
    code = "import numpy as np\nimport frf_ipz\nfrf_ipz.plotting.plot_frfs(frf_ipz.FrfSet.from_arrays(np.ones(1)))"
    assert names_not_public(code) == []
