"""One version, bounds on what is installed, locks that keep to them, the same commands without make."""

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

import frf_ipz

ROOT = Path(__file__).parents[2]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT = PYPROJECT["project"]
EXTRAS = PROJECT["optional-dependencies"]
BUILD = PYPROJECT["build-system"]["requires"]
LOCKED = {
    "run": [*BUILD, *PROJECT["dependencies"]],
    "test": [*BUILD, *PROJECT["dependencies"], *EXTRAS["test"]],
    "docs": [*BUILD, *PROJECT["dependencies"], *EXTRAS["docs"]],
}
READERS = {"tdms", "mdf", "nastran", "ansys", "mesh"}  # the tests' lock holds what they need
UNLOCKED = {"peers", "mkl", *READERS, "cluster"}
FORBIDDEN_ON_WINDOWS = re.compile(r'[<>:"\\|?*]|(^|/)(con|prn|aux|nul|com\d|lpt\d)(\.|/|$)|[ .](/|$)', re.IGNORECASE)


def locked_versions(name):
    """Versions of each package in a lock (more than one where they depend on Python's), and its count of hashes."""
    text = (ROOT / "requirements" / f"{name}.txt").read_text(encoding="utf-8").replace("\\\n", " ")
    versions = {}
    for line in text.splitlines():
        if line and not line.lstrip().startswith("#"):
            requirement = Requirement(line.split("--hash")[0])
            (pin,) = requirement.specifier
            assert pin.operator == "=="
            assert "--hash=sha256:" in line, line
            versions.setdefault(canonicalize_name(requirement.name), []).append(Version(pin.version))
    return versions


def test_the_version_stands_in_one_place():
    assert "version" in PROJECT["dynamic"]
    assert "version" not in PROJECT
    assert PYPROJECT["tool"]["hatch"]["version"]["path"] == "src/frf_ipz/__init__.py"
    assert re.search(rf'^__version__ = "{frf_ipz.__version__}"$', Path(frf_ipz.__file__).read_text(), re.MULTILINE)


def test_the_citation_is_of_this_version():
    (cited,) = re.findall(r"^version: (.*)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE)
    assert cited == frf_ipz.__version__


def test_every_extra_is_locked_or_said_not_to_be():
    assert set(EXTRAS) == (set(LOCKED) - {"run"}) | UNLOCKED
    assert PYPROJECT["dependency-groups"] == {"build": BUILD}


@pytest.mark.parametrize("text", sorted({requirement for group in LOCKED.values() for requirement in group}))
def test_a_dependency_has_a_lower_and_an_upper_bound(text):
    operators = sorted(specifier.operator for specifier in Requirement(text).specifier)
    assert operators == ["<", ">="]


@pytest.mark.parametrize("name", LOCKED)
def test_the_lock_holds_each_direct_dependency_within_its_bounds(name):
    locked = locked_versions(name)
    outside = {
        text: locked.get(canonicalize_name(requirement.name))
        for text in LOCKED[name]
        for requirement in [Requirement(text)]
        if not locked.get(canonicalize_name(requirement.name))
        or not all(requirement.specifier.contains(pin) for pin in locked[canonicalize_name(requirement.name)])
    }
    assert not outside, "run make lock"


@pytest.mark.parametrize("name", sorted(set(LOCKED) - {"run"}))
def test_locks_agree(name):
    """They are installed one over the other, into one environment."""
    locked = locked_versions(name)
    assert {package: locked.get(package) for package in locked_versions("run")} == locked_versions("run")


def makefile():
    """Commands of each target, with the variables put in; and what each target needs first."""
    lines = (ROOT / "Makefile").read_text(encoding="utf-8").replace("\\\n\t", "").splitlines()
    variables = dict(re.match(r"(\w+) [:?]= ?(.*)", line).groups() for line in lines if re.match(r"\w+ [:?]=", line))
    commands, needs, target = {}, {}, ""
    for line in lines:
        if rule := re.match(r"(\.venv/\w+|\w+):(?!=) ?(.*)", line):
            target = rule[1]
            needs[target], commands[target] = rule[2].split("#")[0].split(), []
        elif line.startswith("\t"):
            command = line.strip()
            while "$(" in command:
                command = re.sub(r"\$\((\w+)\)", lambda match: variables[match[1]], command)
            commands[target].append(command.replace(" --quiet --disable-pip-version-check", ""))
    return commands, needs


def documented_commands():
    """Commands that the page on installing gives for each target of the Makefile."""
    page = (ROOT / "docs" / "how-to" / "install.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (.+?) \| (.+) \|$", page, re.MULTILINE)
    return {name.strip("`"): re.findall(r"`([^`]+)`", cell) for name, cell in rows if "`" in cell and name != "target"}


def test_the_commands_without_make_are_those_of_the_makefile():
    commands, needs = makefile()
    documented = documented_commands()
    _, venv, *installs, _ = commands[".venv/run"]  # between the check of Python's version and the stamp
    assert documented["set-up"] == [venv.replace("python3", "python", 1), *installs]
    targets = {target for target in commands if not target.startswith(".venv")} - {"help", "lock", "clean"}
    assert {name.removeprefix("make ") for name in documented if name.startswith("make ")} == targets
    for target in targets:
        (stamp,) = needs[target]
        install = [] if stamp == ".venv/run" else [line for line in commands[stamp] if "pip install" in line]
        if stamp == ".venv/peers":
            install = [line for line in commands[".venv/test"] if "pip install" in line] + install
        assert documented[f"make {target}"] == install + commands[target]


def test_every_target_is_said_by_make_help():
    commands, _ = makefile()
    said = set(re.findall(r"make (\w+)", "\n".join(commands["help"])))
    assert said == {target for target in commands if not target.startswith(".venv")} - {"help"}


def test_file_names_are_names_on_windows_too():
    ignored = {".git", ".venv", "results", "shared"}
    paths = [
        path.relative_to(ROOT).as_posix()
        for top in ROOT.iterdir()
        if top.name not in ignored and not top.name.endswith("_cache")
        for path in ([top] if top.is_file() else top.rglob("*"))
        if "__pycache__" not in path.parts
    ]
    assert len(paths) > 500
    assert not [path for path in paths if FORBIDDEN_ON_WINDOWS.search(path)]
    lower = [path.lower() for path in paths]
    assert len(set(lower)) == len(lower)
