"""Results folders that are damaged, or made to do harm: some fifty kinds, each a change of a good one.

A kind is a function of the folder, and of a folder of the user's beside it that nobody may touch.
"""

import json
import os
import pickle
import shutil
import sys
import zipfile
from dataclasses import replace

import numpy as np

from frf_ipz.runs.folder import open_run
from frf_ipz.runs.generations import GENERATIONS, HIDDEN, POINTER, current_folder
from frf_ipz.runs.stage_file import MAGIC, SUFFIX, StageFile, read_stage_file, write_stage_file
from hostile_run import hostile_folder
from synthetic_run import synthetic_folder

KINDS = {}
VERSION_KEYS = ("frf_ipz", "python", "packages", "when", "pipeline", "name", "configuration", "inputs")


def write_folder(path, source=None):
    """Write the results of every stage, as a run leaves them."""
    source = synthetic_folder(diagnosed=True) if source is None else source
    with open_run(path) as folder:
        for name, result in source.results.items():
            kept = result.geometry if name == "model" else result
            folder.stage(name, f"{len(name):064x}", lambda kept=kept: kept, lambda _: {})
        diagnosis = source.results["diagnose"]
        folder.page("report", "1" * 64, {"diagnosis.json": lambda to: to.write_text(json.dumps(diagnosis.to_json()))})
        folder.manifest.update({key: source.manifest[key] for key in VERSION_KEYS if key != "frf_ipz"})
    return path


def kind(function):
    """Add a kind under its name."""
    KINDS[function.__name__] = function
    return function


def stage_file(folder, stage):
    """The file of a stage, wherever the folder keeps it."""
    return next(path for path in folder.rglob(f"*{SUFFIX}") if path.name.startswith(stage))


def copies(folder, name):
    """A file where users open it, and where the program reads it."""
    return list(dict.fromkeys([folder / name, current_folder(folder) / name]))


def change_manifest(folder, change):
    """Change ``run.json``."""
    for path in copies(folder, "run.json"):
        manifest = json.loads(path.read_text(encoding="utf-8"))
        change(manifest)
        path.write_text(json.dumps(manifest), encoding="utf-8")


def column_of(fields, arrays, name):
    """A column of numbers of the rows of a result."""
    return arrays[fields["rows"]["columns"][name]["array"]]


def change_tree(folder, stage, change):
    """Change what a stage's file says, and seal it again, as somebody would who means it."""
    path = stage_file(folder, stage)
    content = read_stage_file(path)
    tree = json.loads(json.dumps(content.tree))
    changed = change(tree[1]["fields"], content.arrays)
    write_stage_file(replace(content, tree=tree if changed is None else changed), path)


def _replace_by(path, data):
    path.unlink()
    path.write_bytes(data)


def _replace_manifest(folder, data):
    for path in copies(folder, "run.json"):
        _replace_by(path, data)


for _name, _data in {
    "empty": b"",
    "zeros": bytes(1000),
    "no_text": b"\xff\xfe{}",
    "list": b"[]",
    "deep": b'{"name":' + b"[" * 200_000,
    "deep_and_closed": b'{"configuration":' + b'{"a":' * 900 + b"1" + b"}" * 901,
    "long_number": b'{"name": ' + b"1" * 100_000 + b"}",
    "bomb_of_lists": b'{"configuration": {"a": [' + b"[]," * 3_000_000 + b"0]}}",
    "bomb_of_texts": b'{"configuration": {"a": [' + b'"ab",' * 3_000_000 + b"0]}}",
    "only_a_brace": b"{}",
}.items():
    KINDS[f"manifest_{_name}"] = lambda folder, user, data=_data: _replace_manifest(folder, data)

for _name, _values in {
    "stages_list": {"stages": ["fit"]},
    "stages_number": {"stages": 3},
    "stage_outside": {"stages": {"../../user/secret": {"key": "a", "files": ["../../user/secret"]}}},
    "stage_unknown": {"stages": {"__class__": {}}},
    "files_outside": {"stages": {"fit": {"key": "a", "seconds": 1.0, "files": ["../user/precious.txt"]}}},
    "files_absolute": {"stages": {"fit": {"key": "a", "seconds": 1.0, "files": ["/etc/passwd"]}}},
    "seconds_text": {"stages": {"fit": {"key": "a", "seconds": "long", "files": []}}},
    "seconds_infinite": {"stages": {"fit": {"key": "a", "seconds": 1e999, "files": []}}},
    "name_long": {"name": "a" * 1_000_000},
    "name_evil": {"name": "\x1b[2J\n\r\0\u202e", "pipeline": "\x1b[2J\n"},
    "name_half_a_letter": {"name": "\ud800\udfff\udcff", "inputs": {"\udc80": "\ud800"}},
    "pipeline_no_name": {"pipeline": "a\0b"},
    "pipeline_of_others": {"pipeline": "/etc/passwd"},
    "pipeline_device": {"pipeline": "/dev/zero"},
    "packages_numbers": {"packages": {"numpy": 2}},
    "other_version": {"frf_ipz": "99.0.0"},
    "version_no_text": {"frf_ipz": ["0.1.0"]},
    "assessment": {"assessment": {"verdict": 3, "checks": 4, "likely_cause": []}},
}.items():
    KINDS[f"manifest_{_name}"] = lambda folder, user, values=_values: change_manifest(
        folder, lambda manifest: manifest.update(values)
    )


@kind
def manifest_missing(folder, user):
    for path in copies(folder, "run.json"):
        path.unlink()


@kind
def manifest_cut(folder, user):
    _replace_manifest(folder, (folder / "run.json").read_bytes()[:100])


@kind
def manifest_names_stages_that_are_not_there(folder, user):
    for path in folder.rglob(f"*{SUFFIX}"):
        path.unlink()


for _what in ("run.json", "fit", "diagnosis.json"):

    def _paths(folder, what=_what):
        paths = [stage_file(folder, what)] if what == "fit" else copies(folder, what)
        return [path for path in paths if path.exists()]

    def _folder_instead(folder, user, paths=_paths):
        for place in paths(folder):
            place.unlink()
            place.mkdir()

    def _pipe_instead(folder, user, paths=_paths):
        for place in paths(folder):
            place.unlink()
            os.mkfifo(place)

    def _circle_instead(folder, user, paths=_paths):
        for place in paths(folder):
            place.unlink()
            place.symlink_to(place.name)

    def _device_instead(folder, user, paths=_paths):
        for place in paths(folder):
            place.unlink()
            place.symlink_to("/dev/zero")

    def _link_to_the_user(folder, user, paths=_paths):
        for place in paths(folder):
            place.unlink()
            place.symlink_to(user / "precious.txt")

    def _terabyte(folder, user, paths=_paths):
        for place in paths(folder):
            with place.open("r+b") as stream:
                stream.truncate(1 << 40)

    KINDS |= {
        f"{_what}_is_a_folder": _folder_instead,
        f"{_what}_is_a_pipe": _pipe_instead,
        f"{_what}_is_a_link_in_a_circle": _circle_instead,
        f"{_what}_is_a_device": _device_instead,
        f"{_what}_is_a_link_to_the_user": _link_to_the_user,
        f"{_what}_has_a_terabyte": _terabyte,
    }


class _Harm:
    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.remove, (str(self.path),)


@kind
def stage_is_a_pickle(folder, user):
    _replace_by(stage_file(folder, "fit"), pickle.dumps(_Harm(user / "precious.txt")))


@kind
def stage_is_an_archive_with_a_pickle(folder, user):
    path = stage_file(folder, "fit")
    path.unlink()
    with path.open("wb") as stream:
        np.savez(stream, tree=np.array([_Harm(user / "precious.txt")], dtype=object))


@kind
def stage_is_a_packed_bomb(folder, user):
    path = stage_file(folder, "fit")
    path.unlink()
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("tree.npy", "w", force_zip64=True) as stream,
    ):
        for _ in range(60):
            stream.write(bytes(10_000_000))


@kind
def stage_is_empty(folder, user):
    _replace_by(stage_file(folder, "ingest"), b"")


@kind
def stage_is_cut(folder, user):
    path = stage_file(folder, "update")
    path.write_bytes(path.read_bytes()[:-100])


@kind
def stage_has_another_byte(folder, user):
    path = stage_file(folder, "predict")
    data = bytearray(path.read_bytes())
    data[-9] ^= 1
    path.write_bytes(data)


@kind
def stage_has_an_endless_header(folder, user):
    _replace_by(stage_file(folder, "fit"), MAGIC + bytes(32) + b"\xff" * 7 + b"\x7f" + b"{}")


@kind
def stage_holds_a_bomb_of_lists(folder, user):
    text = b'{"tree": [' + b"[]," * 3_000_000 + b"0]}"
    _replace_by(stage_file(folder, "fit"), MAGIC + bytes(32) + len(text).to_bytes(8, "little") + text)


@kind
def stage_holds_arrays_that_are_not_there(folder, user):
    text = json.dumps({"key": "", "tree": None, "arrays": [["<f8", [400_000_000], "C"]]}).encode()
    _replace_by(stage_file(folder, "fit"), MAGIC + bytes(32) + len(text).to_bytes(8, "little") + text)


@kind
def stages_are_swapped(folder, user):
    fit, pair = stage_file(folder, "fit"), stage_file(folder, "pair")
    kept = fit.read_bytes()
    shutil.copy(pair, fit)
    pair.write_bytes(kept)


@kind
def stages_is_a_file(folder, user):
    place = stage_file(folder, "fit").parent
    shutil.rmtree(place)
    place.write_text("no folder")


@kind
def stages_is_a_link_to_the_user(folder, user):
    place = stage_file(folder, "fit").parent
    shutil.rmtree(place)
    place.symlink_to(user)


for _name, _tree in {
    "a_function": ["os:system", ["true"]],
    "a_class_of_others": ["subprocess:Popen", {"fields": {"args": "true"}}],
    "a_function_of_ours": ["frf_ipz.cli.main:main", {"fields": {}}],
    "a_module_of_the_folder": ["harm:Harm", {"fields": {}}],
    "an_object_of_ours_that_is_no_result": ["frf_ipz.runs.folder:RunFolder", {"fields": {"path": "."}}],
    "plain_values": ["", [1, 2, 3]],
    "nothing": None,
    "deep_lists": ["", json.loads("[" * 900 + "]" * 900)],
}.items():
    KINDS[f"stage_builds_{_name}"] = lambda folder, user, tree=_tree: write_stage_file(
        StageFile(key="", tree=tree, arrays=[]), stage_file(folder, "fit")
    )

for _stage, _name, _change in [
    ("fit", "misses_a_field", lambda fields, _: fields.pop("zeros")),
    ("fit", "has_a_field_too_many", lambda fields, _: fields.update(__class__="text")),
    ("fit", "has_a_text_for_a_number", lambda fields, _: fields.update(n_modes="3")),
    ("fit", "counts_below_nothing", lambda fields, _: fields.update(n_modes=-5)),
    ("fit", "counts_beyond_memory", lambda fields, _: fields.update(n_modes=2**62)),
    ("fit", "has_a_band_of_nothing", lambda fields, _: fields.update(band_hz=[float("nan"), float("inf")])),
    ("fit", "has_a_band_of_three", lambda fields, _: fields.update(band_hz=[1.0, 2.0, 3.0])),
    ("fit", "has_no_labels", lambda fields, _: fields.update(labels=[])),
    ("fit", "has_tables_without_columns", lambda fields, _: fields.update(stabilization={"frame": [], "rows": 0})),
    ("fit", "has_texts_in_a_table", lambda fields, _: fields["misfit"].update(frame=[["frf", ["x"]]], rows=1)),
    ("ingest", "has_no_values", lambda _, arrays: [array.fill(np.nan) for array in arrays if array.dtype.kind == "f"]),
    ("ingest", "has_huge_values", lambda _, arrays: [array.fill(1e308) for array in arrays if array.dtype.kind == "c"]),
    ("ingest", "has_no_tables", lambda fields, _: fields.update(records={"frame": [], "rows": 0})),
    ("ingest", "has_a_long_name", lambda fields, _: fields.update(choices=["a" * 1_000_000])),
    ("ingest", "has_half_a_letter", lambda fields, _: fields.update(warnings=["\ud800 hit\udcff.csv"])),
    ("pair", "points_beyond_the_end", lambda fields, arrays: column_of(fields, arrays, "frf").fill(999)),
    ("pair", "points_before_the_start", lambda fields, arrays: column_of(fields, arrays, "measured").fill(-9)),
    ("pair", "has_an_unknown_choice", lambda fields, _: fields["rows"]["columns"]["verdict"][0].append("__init__")),
    (
        "pair",
        "has_an_unknown_text",
        lambda fields, arrays: arrays[fields["rows"]["columns"]["verdict"][1]["array"]].fill(99),
    ),
    ("pair", "has_rows_beyond_memory", lambda fields, _: fields["rows"].update(rows=2**62)),
    ("update", "has_another_history", lambda fields, _: fields.update(history={"frame": [], "rows": 0})),
    ("update", "is_for_no_dofs", lambda fields, _: fields["model"]["fields"].update(dofs=[])),
    ("predict", "has_no_labels", lambda fields, _: fields.update(labels=[])),
    ("export", "has_no_inputs", lambda fields, _: fields.update(input_names=[])),
    ("model", "has_unknown_supports", lambda fields, _: fields.update(supports={"dict": [[10**9, "clamped"]]})),
    ("diagnose", "has_an_unknown_verdict", lambda fields, _: fields.update(verdict="<script>")),
    (
        "diagnose",
        "has_lists_for_names",
        lambda fields, _: fields.update(mismatch_location={"fields": {"nodes": [[]]}}),
    ),
    ("levels", "has_another_table", lambda fields, _: fields.update(modes={"frame": [["a", ["b"]]], "rows": 1})),
]:
    KINDS[f"{_stage}_{_name}"] = lambda folder, user, stage=_stage, change=_change: change_tree(
        folder, stage, lambda fields, arrays: change(fields, arrays) and None
    )


@kind
def arrays_have_other_axes(folder, user):
    path = stage_file(folder, "fit")
    content = read_stage_file(path)
    write_stage_file(replace(content, arrays=[array.ravel() for array in content.arrays]), path)


@kind
def arrays_have_other_lengths(folder, user):
    path = stage_file(folder, "ingest")
    content = read_stage_file(path)
    write_stage_file(replace(content, arrays=[array[: len(array) // 2] for array in content.arrays]), path)


@kind
def arrays_are_empty(folder, user):
    path = stage_file(folder, "predict")
    content = read_stage_file(path)
    write_stage_file(replace(content, arrays=[array[:0] for array in content.arrays]), path)


@kind
def names_are_markup(folder, user):
    shutil.rmtree(folder)
    write_folder(folder, _listed(hostile_folder()))


def _listed(source):
    source.manifest["stages"] = {}
    return source


for _name, _text in {"text": "one", "path": "../../user", "far": "9" * 18, "long": "9" * 5000, "empty": ""}.items():
    KINDS[f"current_generation_is_{_name}"] = lambda folder, user, text=_text: (folder / HIDDEN / POINTER).write_text(
        text
    )


@kind
def current_generation_is_a_pipe(folder, user):
    (folder / HIDDEN / POINTER).unlink()
    os.mkfifo(folder / HIDDEN / POINTER)


@kind
def generations_is_a_link_to_the_user(folder, user):
    shutil.rmtree(folder / HIDDEN / GENERATIONS)
    (folder / HIDDEN / GENERATIONS).symlink_to(user)


@kind
def what_is_hidden_is_a_link_in_a_circle(folder, user):
    shutil.rmtree(folder / HIDDEN)
    (folder / HIDDEN).symlink_to(HIDDEN)


@kind
def files_of_code_lie_about(folder, user):
    harm = f"import os; os.remove({str(user / 'precious.txt')!r})\n"
    for name in ("harm.py", "sitecustomize.py", "numpy.py", "frf_ipz.py", "conftest.py"):
        (folder / name).write_text(harm)
    (folder / "pipeline.toml").write_text('[pipeline]\ntest = "t.toml"\n[diagnose]\nextra_effects = ["harm.py:Harm"]\n')
    (folder / "matplotlibrc").write_text("backend: module://harm\n")


@kind
def leftovers_are_links_to_the_user(folder, user):
    for name in (".partial-1", ".partial-x", ".lock", "report.html"):
        (folder / name).symlink_to(user)


if sys.platform == "win32":  # no pipes, devices and links for everybody there
    KINDS = {name: change for name, change in KINDS.items() if "_is_a_" not in name and "links" not in name}
