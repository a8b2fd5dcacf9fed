"""The documentation has every key, every column and every public name, and its links lead somewhere."""

import importlib.util
import json
import re
from dataclasses import fields, is_dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import get_args, get_type_hints

import pyarrow.parquet as pq
import pytest

import frf_ipz
from demo_case import made_demo
from frf_ipz import plotting
from frf_ipz.fe.model_file import model_kinds
from frf_ipz.fleet.fleet_file import FleetFile
from frf_ipz.ingest.campaign_file import CampaignFileKeys
from frf_ipz.pipeline.config import PipelineFile
from synthetic_run import synthetic_folder

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md"))]
BUILT = ("auto_gallery", "generated", "api", "_build")  # what exists only after a build


def load_extension():
    path = DOCS / "_extensions" / "generated_reference.py"
    specification = importlib.util.spec_from_file_location("generated_reference", path)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def reference():
    return load_extension()


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory):
    return made_demo(tmp_path_factory) / "out"


def dataclasses_in(hint):
    """The dataclasses that a type hint names, at any depth."""
    if is_dataclass(hint) and getattr(hint, "__module__", "").startswith("frf_ipz"):
        yield hint
    for argument in get_args(hint):
        yield from dataclasses_in(argument)


def keys_of(kind):
    """Every key that a file may have whose content is a dataclass, sections and tables in them included."""
    hints = get_type_hints(kind, include_extras=True)
    for item in fields(kind):
        yield item.name
        for inner in dataclasses_in(hints[item.name]):
            yield from keys_of(inner)


TOML_FILES = [
    ("test_toml.md", CampaignFileKeys),
    ("pipeline_toml.md", PipelineFile),
    ("fleet_toml.md", FleetFile),
    *(("model_toml.md", kind.FILE) for kind in model_kinds().values()),
]


@pytest.mark.parametrize(("page", "kind"), TOML_FILES, ids=lambda value: getattr(value, "__name__", value))
def test_every_key_of_every_toml_file_is_in_the_reference(reference, page, kind):
    text = reference.reference_pages()[page]
    known = set(re.findall(r"^\| `([^`]+)` \|", text, re.MULTILINE))
    known |= {part for title in re.findall(r"^#+ `\[+([^\]]+)\]+", text, re.MULTILINE) for part in title.split(".")}
    assert set(keys_of(kind)) - known == set()


def test_every_key_says_what_it_means(reference):
    rows = [
        row
        for page in ("test_toml.md", "pipeline_toml.md", "model_toml.md", "fleet_toml.md")
        for row in re.findall(r"^\| `.*$", reference.reference_pages()[page], re.MULTILINE)
    ]
    assert [row for row in rows if not row.rstrip("| ").rpartition(" | ")[2].strip()] == []


def columns_in(page):
    """The declared columns of each table on a page."""
    tables = re.split(r"^### `([^`]+)`$", page, flags=re.MULTILINE)[1:]
    return {
        name: re.findall(r"^\| `([^`]+)` \|", text, re.MULTILINE)
        for name, text in zip(tables[::2], tables[1::2], strict=True)
    }


def test_every_column_that_a_run_writes_is_in_the_reference(reference, run_folder):
    declared = columns_in(reference.reference_pages()["tables.md"])
    written = {path.name: pq.read_schema(path).names for path in run_folder.glob("*.parquet")}
    assert set(written) == set(declared) - {"coherence.parquet"}  # of several forces at once: it has tests of its own
    unknown = [
        f"{name}: {column}"
        for name, columns in written.items()
        for column in columns
        if not any(fnmatchcase(column, pattern) for pattern in declared[name])
    ]
    assert unknown == []


def leaves(value, path=""):
    """The paths of a JSON value: a.b for keys, a[] for the items of a list of objects."""
    if isinstance(value, dict) and value:
        for key, inner in value.items():
            yield from leaves(inner, f"{path}.{key}" if path else key)
    elif isinstance(value, list) and any(isinstance(item, dict) for item in value):
        for item in value:
            yield from leaves(item, f"{path}[]")
    else:
        yield path


def undocumented(value, declared):
    return sorted(
        {
            path
            for path in leaves(value)
            if not any(
                fnmatchcase(path, pattern.replace("[]", "[[]]"))
                or path.startswith((f"{pattern}.", f"{pattern}[]"))
                or pattern.startswith((f"{path}.", f"{path}[]"))  # an object or a list that is empty here
                for pattern in declared
            )
        }
    )


def test_every_key_of_the_json_files_is_in_the_reference(reference, run_folder):
    entries = reference.file_entries()
    for name in ("run.json", "statespace.json"):
        written = json.loads((run_folder / name).read_text(encoding="utf-8"))
        assert undocumented(written, entries[name]) == [], name
    diagnosis = synthetic_folder(diagnosed=True).results["diagnose"].to_json()
    assert undocumented(diagnosis, entries["diagnosis.json"]) == []


def entries_in(page):
    return set(re.findall(r"^ {3}(\w+)$", page, re.MULTILINE))


def test_every_public_name_is_on_the_page_of_the_python_interface():
    page = (DOCS / "reference" / "python.md").read_text(encoding="utf-8")
    of_package, _, of_plotting = page.partition("currentmodule:: frf_ipz.plotting")
    assert set(frf_ipz.__all__) - {"plotting"} - entries_in(of_package) == set()
    assert set(plotting.__all__) - entries_in(of_plotting) == set()


def links_in(page):
    text = page.read_text(encoding="utf-8")
    text = re.sub(r"^(```|~~~).*?^\1", "", text, flags=re.MULTILINE | re.DOTALL)
    yield from re.findall(r"\]\(([^)\s#]+)(?:#[^)]*)?\)", text)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_to_files_lead_to_files(page):
    missing = [
        link
        for link in links_in(page)
        if "://" not in link
        and not link.startswith("mailto:")
        and not any(part in BUILT for part in Path(link).parts)
        and not (page.parent / link).exists()
        and not (page.parent / f"{link}.md").exists()
    ]
    assert missing == []
