"""The public names are sorted, importable and documented section by section, and the examples in docstrings hold."""

import ast
import doctest
import importlib
import inspect
import pkgutil
from pathlib import Path

import pytest
from numpydoc.docscrape import NumpyDocString

import frf_ipz

STUB = Path(frf_ipz.__file__).with_suffix(".pyi")
NAMES = [
    alias.asname
    for node in ast.parse(STUB.read_text(encoding="utf-8")).body
    if isinstance(node, ast.ImportFrom)
    for alias in node.names
]
MODULES = [found.name for found in pkgutil.walk_packages(frf_ipz.__path__, "frf_ipz.") if "__main__" not in found.name]
PUBLIC = {name: getattr(frf_ipz, name) for name in NAMES if name != "plotting"}
PLOTS = {f"plotting.{name}": getattr(frf_ipz.plotting, name) for name in frf_ipz.plotting.__all__}
FUNCTIONS = {name: value for name, value in (PUBLIC | PLOTS).items() if inspect.isfunction(value)}
CLASSES = {name: value for name, value in PUBLIC.items() if inspect.isclass(value)}
METHODS = {
    f"{name}.{key}": inspect.unwrap(getattr(value, key))
    for name, value in CLASSES.items()
    for key, member in vars(value).items()
    if not key.startswith("_") and (inspect.isfunction(member) or isinstance(member, classmethod))
}
WITHOUT_EXAMPLE = {  # they draw details of results, which a test of a second does not have
    "plotting.draw_pictures",
    "plotting.plot_law",
    "plotting.plot_levels",
    "plotting.plot_targets",
}
DATA = {"frfs", "fit", "test", "data", "measured", "pairs", "diagnosis"}
MODELS = {"fe_model", "reduced_model", "updated_model"}
PLAIN_ARGUMENTS = {"compute_frfs"}  # of a function of three: H(model, labels, s)


def read_doc(value):
    return NumpyDocString(inspect.getdoc(value) or "")


def documented_names(doc):
    return [name.strip(" *") for parameter in doc["Parameters"] for name in parameter.name.split(",")]


def parameters_of(function):
    parameters = inspect.signature(function).parameters.values()
    return [parameter for parameter in parameters if parameter.name not in {"self", "cls", "_"}]


def test_public_names_are_those_of_the_stub():
    assert sorted(frf_ipz.__all__) == sorted(NAMES)
    assert set(NAMES) <= set(dir(frf_ipz))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_public_function_documents_what_it_takes_and_returns(name):
    function = FUNCTIONS[name]
    doc = read_doc(function)
    assert doc["Summary"]
    assert sorted(documented_names(doc)) == sorted(parameter.name for parameter in parameters_of(function))
    returns_nothing = inspect.signature(function).return_annotation in {None, "None"}
    assert bool(doc["Returns"]) is not returns_nothing
    assert all(description.desc for section in ("Parameters", "Returns", "Raises") for description in doc[section])


@pytest.mark.parametrize("name", CLASSES)
def test_a_public_class_documents_what_it_is_made_of(name):
    kind = CLASSES[name]
    doc = read_doc(kind)
    assert doc["Summary"]
    if "__init__" in vars(kind) and not getattr(kind, "_is_protocol", False):
        names = {parameter.name for parameter in parameters_of(kind)}
        assert names <= set(documented_names(doc))


@pytest.mark.parametrize("name", METHODS)
def test_a_public_method_says_what_it_does(name):
    doc = read_doc(METHODS[name])
    assert doc["Summary"]
    documented = documented_names(doc)
    assert set(documented) <= {parameter.name for parameter in parameters_of(METHODS[name])}
    if documented:
        assert documented == [parameter.name for parameter in parameters_of(METHODS[name])]


@pytest.mark.parametrize("name", sorted({*PUBLIC, *PLOTS} - WITHOUT_EXAMPLE))
def test_a_public_name_has_an_example(name):
    value = PUBLIC.get(name) or PLOTS[name]
    examples = doctest.DocTestParser().get_examples("\n".join(read_doc(value)["Examples"]))
    skipped = [example for example in examples if doctest.SKIP in example.options]
    assert len(examples) > len(skipped), "no line of the examples is run"


@pytest.mark.parametrize("name", FUNCTIONS)
def test_data_come_first_then_the_model_and_the_rest_has_names(name):
    positional = [p.name for p in parameters_of(FUNCTIONS[name]) if p.kind is p.POSITIONAL_OR_KEYWORD]
    if name not in PLAIN_ARGUMENTS:
        assert len(positional) <= 2 or set(positional[1:]) <= MODELS
    ranks = [0 if key in DATA else 1 for key in positional if key in DATA | MODELS]
    assert ranks == sorted(ranks)


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
