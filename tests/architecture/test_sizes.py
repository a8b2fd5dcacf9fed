"""Modules, functions and folders stay small enough to be read."""

import ast
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "src" / "frf_ipz"
MODULES = sorted(SOURCE.rglob("*.py"))
MAX_MODULE_LINES = 400
MAX_FUNCTION_LINES = 40  # of code, without the docstring
MAX_FILES = 12
MAX_PUBLIC_NAMES = 10


def code_lines(function, text):
    body = function.body[1:] if ast.get_docstring(function) else function.body
    if not body:
        return 0
    lines = text.splitlines()[body[0].lineno - 1 : function.end_lineno]
    return sum(1 for line in lines if line.strip() and not line.strip().startswith("#"))


@pytest.mark.parametrize("module", MODULES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_module_is_small(module):
    text = module.read_text(encoding="utf-8")
    tree = ast.parse(text)
    assert len(text.splitlines()) <= MAX_MODULE_LINES
    public = [
        node.name
        for node in tree.body
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_")
    ]
    assert len(public) <= MAX_PUBLIC_NAMES, public
    long = {
        node.name: code_lines(node, text)
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and code_lines(node, text) > MAX_FUNCTION_LINES
    }
    assert not long


@pytest.mark.parametrize(
    "folder",
    sorted({path.parent for path in MODULES}),
    ids=lambda path: str(path.relative_to(SOURCE)),
)
def test_folder_is_small(folder):
    assert len([path for path in folder.glob("*.py") if path.name != "__init__.py"]) <= MAX_FILES


def test_no_catch_all_modules():
    banned = {"utils", "helpers", "core", "common", "base"}
    assert not [path for path in MODULES if path.stem in banned]
