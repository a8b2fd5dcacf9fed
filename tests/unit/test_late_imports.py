"""What is imported late is there when it is used, and garbage is looked for as before."""

import gc
import sys
import textwrap

import pytest

from frf_ipz.late_imports import import_late


@pytest.fixture
def module(tmp_path, monkeypatch):
    """Name of a module that says whether garbage was looked for while it was imported."""
    text = """
        import gc
        WAS_COLLECTING = gc.isenabled()
        def double(value): return 2 * value
    """
    (tmp_path / "late_one.py").write_text(textwrap.dedent(text))
    monkeypatch.syspath_prepend(tmp_path)
    yield "late_one"
    sys.modules.pop("late_one", None)


def test_a_module_is_imported_when_something_of_it_is_used(module):
    late = import_late(module)
    assert module not in sys.modules
    assert late.double(2) == 4
    assert module in sys.modules


def test_no_garbage_is_looked_for_while_a_module_is_imported_but_afterwards(module):
    assert gc.isenabled()
    assert import_late(module).WAS_COLLECTING is False
    assert gc.isenabled()


def test_who_looks_for_no_garbage_does_not_after_an_import_either(module):
    gc.disable()
    try:
        import_late(module, "double")(1)
        assert not gc.isenabled()
    finally:
        gc.enable()


def test_garbage_is_looked_for_after_an_import_that_fails():
    with pytest.raises(ModuleNotFoundError):
        import_late("no_such_module").anything  # noqa: B018
    assert gc.isenabled()
