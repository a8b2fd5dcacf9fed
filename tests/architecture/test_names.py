"""Names say what a value is: pronouns and participles alone are no names, and no module is named like a test."""

import ast
from pathlib import Path

import pytest

SRC = Path(__file__).parents[2] / "src"
NO_NAMES = frozenset(
    [
        "one",
        "other",
        "others",
        "found",
        "left",
        "told",
        "seen",
        "near",
        "own",
        "both",
        "again",
        "rather",
        "another",
        "each",
        "any",
        "all",
        "some",
        "few",
        "many",
        "more",
        "most",
        "less",
        "this",
        "that",
        "these",
        "those",
        "it",
        "its",
        "it",
        "they",
        "them",
        "kept",
        "given",
        "taken",
        "made",
        "done",
        "shown",
        "said",
        "asked",
        "wanted",
    ]
)
MAX_SHARE = 0.02  # of assigned names and arguments: twice the worst of the packages that we learn from


def names_of(tree):
    """Assigned names and arguments in lower case, once for each place."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            name = node.id
        elif isinstance(node, ast.arg):
            name = node.arg
        else:
            continue
        if name == name.lower():
            yield name


def says_nothing(name):
    words = [word for word in name.split("_") if word]
    return bool(words) and NO_NAMES.issuperset(words)


@pytest.mark.parametrize("name", ["one", "left", "each_other", "_found", "kept"])
def test_a_pronoun_or_a_participle_alone_is_no_name(name):
    assert says_nothing(name)


@pytest.mark.parametrize("name", ["_", "one_mode", "left_end", "found_poles", "retained_dofs"])
def test_a_noun_makes_a_name(name):
    assert not says_nothing(name)


@pytest.mark.parametrize("package", ["frf_ipz", "frf_testbench"])
def test_names_say_what_the_value_is(package):
    files = sorted((SRC / package).rglob("*.py"))
    names = [(file, name) for file in files for name in names_of(ast.parse(file.read_text(encoding="utf-8")))]
    empty = [f"{file.relative_to(SRC)}: {name}" for file, name in names if says_nothing(name)]
    assert len(names) > 1000
    assert len(empty) < MAX_SHARE * len(names), empty


def test_no_module_is_named_like_a_test():
    assert [*SRC.rglob("test_*.py"), *SRC.rglob("*_test.py")] == []
