"""Files of a run that are changed at random, most of them sealed again: shown, or refused in one line; no harm."""

import json
import random
import shutil
import sys

import numpy as np
import pytest

from frf_ipz.errors import FrfIpzError
from frf_ipz.runs.generations import current_folder
from frf_ipz.runs.results import open_results
from frf_ipz.runs.stage_file import SUFFIX, StageFile, read_stage_file, write_stage_file
from hostile_folders import change_manifest, write_folder
from looking import Watch, in_a_child, look

VALUES = (None, True, 0, -1, 3, 2**40, 0.5, -1e300, float("nan"), "", "z", "\x1b[2J", "../..", "\ud800", [], [[]], {})
LOOKED_AT = ("library", "plot", "show ")  # the report draws what the page of show does
FEW, MANY = 30, 300


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    return write_folder(tmp_path_factory.mktemp("good") / "results")


def places(node, path=()):
    """Paths to all values of a tree."""
    yield path
    items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for key, value in items:
        yield from places(value, (*path, key))


def mutate(tree, rng):
    """Replace, remove, double or rename something of a tree."""
    path = rng.choice([path for path in places(tree) if path])
    parent = tree
    for key in path[:-1]:
        parent = parent[key]
    key = path[-1]
    way = rng.choice(("value", "value", "remove", "double", "name"))
    if way == "value":
        parent[key] = rng.choice(VALUES)
    elif way == "remove":
        del parent[key]
    elif isinstance(parent, list):
        parent.insert(key, parent[key])
    else:
        parent[rng.choice(("z", "__class__", "rows", "fields"))] = parent.pop(key)


def mutate_array(array, rng):
    """Give an array other values, another length, other axes or another type."""
    ways = {
        "length": lambda: array[: rng.randrange(len(array) + 1)] if array.ndim else array,
        "axes": array.ravel,
        "turned": lambda: np.ascontiguousarray(array.T),
        "type": lambda: array.astype(rng.choice([np.float32, np.int64, np.bool_, np.complex128])),
        "value": lambda: np.full_like(array, rng.choice([0, 1, -1, 10**6])),
    }
    return ways[rng.choice(list(ways))]()


def harm(folder, rng):
    """Change one file of a folder."""
    if rng.random() < 0.2:
        change_manifest(folder, lambda manifest: mutate(manifest, rng))
        return
    path = rng.choice(sorted(current_folder(folder).rglob(f"*{SUFFIX}")))
    if rng.random() < 0.2:
        data = bytearray(path.read_bytes())
        for _ in range(rng.choice((1, 5, 100))):
            data[rng.randrange(len(data))] = rng.randrange(256)
        path.write_bytes(data[: rng.choice((len(data), rng.randrange(len(data))))])
        return
    content = read_stage_file(path)
    tree, arrays = json.loads(json.dumps(content.tree)), list(content.arrays)
    for _ in range(rng.choice((1, 1, 3))):
        if arrays and rng.random() < 0.4:
            place = rng.randrange(len(arrays))
            with np.errstate(all="ignore"):
                arrays[place] = mutate_array(arrays[place], rng)
        else:
            mutate(tree, rng)
    write_stage_file(StageFile(key=content.key, tree=tree, arrays=arrays), path)


def look_at_mutations(good, folder, out, count, seed):
    """Views of so many folders, each changed in another way; what went wrong, and how many were refused."""
    watch = Watch(out)
    wrong, refused = [], 0
    for number in range(count):
        rng = random.Random(f"{seed} {number}")
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(good, folder)
        harm(folder, rng)
        faults, said = watch.look(folder, out, LOOKED_AT)
        refused += bool(said)
        wrong += [f"{number}: {fault}" for fault in faults]
    return wrong, refused


@pytest.mark.skipif(sys.platform != "linux", reason="measured by what Linux tells of a process")
@pytest.mark.parametrize("count", [FEW, pytest.param(MANY, marks=pytest.mark.slow)], ids=["a few", "many"])
def test_whatever_is_changed_nothing_happens_but_one_line(tmp_path, good, count):
    user, out = tmp_path / "user", tmp_path / "out"
    user.mkdir()
    out.mkdir()
    (user / "precious.txt").write_text("years of work")

    def work():
        wrong, refused = look_at_mutations(good, tmp_path / "results", out, count, seed=40)
        if refused < count / 4:
            wrong.append(f"only {refused} of {count} were refused: the mutations change too little")
        return "\n".join(wrong)

    assert in_a_child(work) == ""
    assert (user / "precious.txt").read_text() == "years of work"


def test_a_folder_that_is_not_changed_is_shown(tmp_path, good):
    assert look(good, tmp_path, LOOKED_AT) == ([], {})
    with pytest.raises(FrfIpzError):
        open_results(tmp_path)
