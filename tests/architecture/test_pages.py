"""The pages' HTML stands in templates: none is made in Python, and only the page's own assets are marked as safe."""

import ast
import re
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "src" / "frf_ipz"
PAGES = [path for area in ("report", "show") for path in sorted((SOURCE / area).rglob("*.py"))]
TEMPLATES = [path for area in ("report", "show") for path in sorted((SOURCE / area / "templates").glob("*.html"))]
TAG = re.compile(r"</?[a-zA-Z][\w-]*(?:[\s/>]|$)|<!|&\w+;")
# Tags of Plotly's texts, which know no scripts; what their own signs become in them; a type of NumPy's.
NO_HTML = ("<br>", "<extra>", "</extra>", "&amp;", "&lt;", "&gt;", "<f4")
MARKED_AS_SAFE = {"style", "margins", "script"}


def texts(tree):
    """All strings but docstrings, with their lines."""
    docstrings = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
        and node.body
        and isinstance(node.body[0], ast.Expr)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
            yield node.lineno, node.value


def html_in(code):
    lines = set()
    for line, text in texts(ast.parse(code)):
        for tag in NO_HTML:
            text = text.replace(tag, "")
        if TAG.search(text):
            lines.add(line)
    return sorted(lines)


@pytest.mark.parametrize("path", PAGES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_no_html_is_made_in_python(path):
    code = path.read_text(encoding="utf-8")
    assert html_in(code) == []
    assert "Markup" not in code
    assert not re.search(r"from html import|html\.escape|markupsafe", code)


def test_html_in_python_would_be_seen():
    assert html_in('def f(x):\n    """<b>"""\n    return x') == []
    assert html_in('def f(x):\n    return f"<td{x}>"') == [2]
    assert html_in('def f(x):\n    return f"<td>{x}</td>"') == [2]
    assert html_in('A = "a <img src=x> b"') == [1]
    assert html_in('A = "%{x}<br>%{y}<extra></extra>"') == []


@pytest.mark.parametrize("path", TEMPLATES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_only_assets_are_markup(path):
    code = path.read_text(encoding="utf-8")
    assert set(re.findall(r"(\w+)\s*\|\s*safe", code)) <= MARKED_AS_SAFE
    assert "autoescape" not in code
    for attribute in re.findall(r"[\w-]+=([^\"'\s>]*\{\{)", code):
        raise AssertionError(f"an attribute without quotes: {attribute}")
