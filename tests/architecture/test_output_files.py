"""Every file is written beside its place and renamed: no module but one opens a file to write to it."""

import ast
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "src" / "frf_ipz"
METHODS = {"write_text", "write_bytes", "savefig", "touch", "tofile", "to_parquet", "to_csv"}
FUNCTIONS = {
    "savemat",
    "savez",
    "savez_compressed",
    "save",
    "savetxt",
    "write_table",
    "write_feather",
    "dump",
    "copyfile",
}
GIVE_TEXT = {"to_csv"}  # where no file is named
OWN = "output_files.py"


def writes(call):
    """The part of a call that names the file, where the call writes one."""
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    owner = call.func.value if isinstance(call.func, ast.Attribute) else None
    if name == "open":
        given = [*call.args, *(word.value for word in call.keywords)]
        texts = [item.value for item in given if isinstance(item, ast.Constant) and isinstance(item.value, str)]
        writing = any(len(text) <= 3 and set(text) & set("wax+") for text in texts)
        return (owner if owner is not None else call.args[0]) if writing else None
    if name == "savefig":
        return call.args[0]
    if name in METHODS and owner is not None and (call.args or name not in GIVE_TEXT):
        return owner
    if name in FUNCTIONS and owner is not None and ast.unparse(owner) in {"np", "pq", "json", "shutil", "scipy.io"}:
        return call.args[1] if name in {"write_table", "dump", "copyfile"} else call.args[0]
    return call.args[0] if name == "savemat" else None


def given_by(item, block):
    """The name of what `replacing` gives in a with statement, or of what is opened there."""
    maker, name = ast.unparse(item.context_expr), ast.unparse(item.optional_vars) if item.optional_vars else ""
    if maker.startswith("replacing("):
        return name
    targets = [ast.unparse(other.optional_vars) for other in block.items if "replacing(" in ast.unparse(other)]
    return name if any(maker.startswith(f"{target}.open(") for target in targets) else ""


def in_place(tree):
    """Calls that write to what `replacing` has not given."""
    parents = {child: node for node in ast.walk(tree) for child in ast.iter_child_nodes(node)}
    for call in ast.walk(tree):
        file = writes(call) if isinstance(call, ast.Call) else None
        if file is None:
            continue
        node, given = call, set()
        while node is not None:
            given |= {
                name for item in (node.items if isinstance(node, ast.With) else ()) if (name := given_by(item, node))
            }
            node = parents.get(node)
        if ast.unparse(file) not in given:
            yield f"{call.lineno}: {ast.unparse(call)}"


def test_no_module_writes_a_file_in_place():
    found = {
        str(path.relative_to(SOURCE)): list(in_place(ast.parse(path.read_text(encoding="utf-8"))))
        for path in SOURCE.rglob("*.py")
        if path.name != OWN
    }
    assert {name: calls for name, calls in found.items() if calls} == {}


@pytest.mark.parametrize(
    "text",
    [
        "path.write_text('a')",
        "with path.open('wb') as stream:\n    stream.write(b'')",
        "with open(path, mode='a') as stream:\n    pass",
        "np.savez(stream, a=1)",
        "with replacing(path) as target:\n    np.savez(path, a=1)",
        "figure.savefig(path, format='svg')",
        "savemat(path, {})",
    ],
)
def test_what_writes_in_place_is_seen(text):
    assert list(in_place(ast.parse(text)))


@pytest.mark.parametrize(
    "text",
    [
        "with replacing(path) as target:\n    target.write_text('a')",
        "with replacing(path) as target, target.open('wb') as stream:\n    np.savez(stream, a=1)",
        "path.open('rb')",
        "webbrowser.open(address)",
        "write_text(path, 'a')",
    ],
)
def test_what_writes_beside_or_only_reads_is_not(text):
    assert not list(in_place(ast.parse(text)))
