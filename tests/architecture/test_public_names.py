"""The public names are sorted, importable and documented, and the examples in docstrings hold."""

import ast
import doctest
import importlib
import inspect
import pkgutil
from pathlib import Path

import pytest

import frf_ipz

STUB = Path(frf_ipz.__file__).with_suffix(".pyi")
NAMES = [
    alias.asname
    for node in ast.parse(STUB.read_text(encoding="utf-8")).body
    if isinstance(node, ast.ImportFrom)
    for alias in node.names
]
MODULES = [found.name for found in pkgutil.walk_packages(frf_ipz.__path__, "frf_ipz.") if "__main__" not in found.name]


def test_public_names_are_those_of_the_stub():
    assert sorted(frf_ipz.__all__) == sorted(NAMES)
    assert set(NAMES) <= set(dir(frf_ipz))


@pytest.mark.parametrize("name", NAMES)
def test_public_name_is_documented(name):
    thing = getattr(frf_ipz, name)
    text = inspect.getdoc(thing) or ""
    assert text, name
    if inspect.isfunction(thing):
        parameters = inspect.signature(thing).parameters
        assert "Parameters\n----------" in text
        assert "Returns\n-------" in text or inspect.signature(thing).return_annotation in {None, "None"}
        assert not [parameter for parameter in parameters if parameter not in text.split("Returns\n")[0]]


@pytest.mark.parametrize("name", NAMES)
def test_a_path_may_be_a_text(name):
    thing = getattr(frf_ipz, name)
    methods = [method for method_name, method in inspect.getmembers(thing, callable) if method_name[0] != "_"]
    hints = [getattr(function, "__annotations__", {}) for function in (methods if inspect.isclass(thing) else [thing])]
    paths = [str(hint) for of_one in hints for argument, hint in of_one.items() if argument != "return"]
    assert not [hint for hint in paths if "Path" in hint and "str" not in hint]


@pytest.mark.parametrize("name", MODULES)
def test_examples_in_docstrings_hold(name):
    module = importlib.import_module(name)
    assert doctest.testmod(module).failed == 0
