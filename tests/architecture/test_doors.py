"""Files of others are opened by one module, and JSON and TOML of theirs are parsed by one each."""

import ast
from pathlib import Path

SOURCE = Path(__file__).parents[2] / "src" / "frf_ipz"
OPENS = {
    "open",
    "read_text",
    "read_bytes",
    "fdopen",
    "UFF",
    "mmread",
    "loadmat",
    "loadtxt",
    "genfromtxt",
    "read_csv",
    "read_table",
}
PARSES = {"json.load", "json.loads", "tomllib.load", "tomllib.loads", "pickle.load", "pickle.loads", "np.load"}
ALLOWED = {
    "input_files.py": {"path.open"},  # the door itself
    "json_files.py": {"json.loads"},
    "matlab_files.py": {"loadmat"},  # of bytes that are expanded up to a limit
    "toml_files.py": {"tomllib.loads"},
    "output_files.py": {"path.open", "os.open"},  # syncs what has just been written
    "numerics/free_memory.py": {"read_text"},  # what the system says of itself
    "report/html.py": {"read_text"},  # the package's own scripts and style sheets
    "cli/local_page.py": {"webbrowser.open"},
    "ingest/formats/registry.py": {"candidate.open"},  # a format's own method
    "reader_process.py": {"os.fdopen"},  # its own answers
    "ingest/formats/spreadsheet.py": {"archive.open"},  # a part of what the door has read
    "show/app.py": {"json.loads"},  # a request
    "fe/matrices/formats/matrix_market.py": {"io.mmread"},  # of bytes that are checked
    "ingest/formats/frf_uff.py": {"pyuff.UFF"},  # takes a path; the registry has read its head by the door
}


def calls(path):
    """Calls of a module that open or parse a file; ``read_text(path)`` and the like are those of the door."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.Call):
            continue
        name = ast.unparse(node.func)
        last = name.rpartition(".")[2]
        is_writing = any(isinstance(item, ast.Constant) and item.value in {"w", "wb", "x", "a"} for item in node.args)
        is_opening = last in OPENS and not is_writing and name not in {"read_text", "read_bytes"}
        if name in PARSES or is_opening:
            yield last if last == "read_text" else name


def test_only_the_doors_open_and_parse():
    found = {}
    for path in SOURCE.rglob("*.py"):
        place = path.relative_to(SOURCE).as_posix()
        others = set(calls(path)) - ALLOWED.get(place, set())
        if others:
            found[place] = others
    assert found == {}
