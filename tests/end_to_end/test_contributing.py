"""The effect that CONTRIBUTING.md adds step by step is found and passes its own test, as the page has them."""

import re
import sys
from pathlib import Path

import pytest

from frf_ipz.diagnosis.catalogue import effects
from frf_ipz.diagnosis.catalogue.finder import shipped_effects

PAGE = (Path(__file__).parents[2] / "CONTRIBUTING.md").read_text(encoding="utf-8")
EFFECT, ITS_TEST = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
MODULE = f"{effects.__name__}.steel_cube"


@pytest.fixture
def _catalogue_with_the_effect(tmp_path, monkeypatch):
    (tmp_path / "steel_cube.py").write_text(EFFECT, encoding="utf-8")
    monkeypatch.setattr(effects, "__path__", [*effects.__path__, str(tmp_path)])
    yield
    sys.modules.pop(MODULE, None)
    vars(effects).pop("steel_cube", None)


@pytest.mark.usefixtures("_catalogue_with_the_effect")
def test_the_effect_is_found_and_passes_its_test():
    assert "steel_cube" in shipped_effects()
    names = {}
    exec(compile(ITS_TEST, "CONTRIBUTING.md", "exec"), names)
    tests = [test for name, test in names.items() if name.startswith("test_")]
    assert len(tests) == 2
    for test in tests:
        test()


def test_every_file_that_the_page_names_is_there():
    root = Path(__file__).parents[2]
    named = re.findall(r"`((?:src|tests|docs)/[\w./-]+)`", PAGE) + re.findall(r"\]\(([\w./-]+)\)", PAGE)
    examples = ("NAME", "steel_cube")
    assert not [name for name in named if not any(word in name for word in examples) and not (root / name).exists()]
