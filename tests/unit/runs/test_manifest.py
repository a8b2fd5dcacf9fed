"""``run.json`` is read as what anybody may have written."""

import json

import pytest

from frf_ipz.errors import FileFormatError
from frf_ipz.runs.folder import open_run, read_manifest, read_run
from frf_ipz.runs.manifest import load_manifest

GOOD = {
    "name": "beam",
    "packages": {"numpy": "2.0"},
    "inputs": {"test.toml": "0" * 64},
    "configuration": {"fit": {"band_hz": None}},
    "stages": {"fit": {"key": "a", "seconds": 1, "files": ["poles.parquet"], "stale": True, "later": 1}},
    "assessment": {"verdict": "usable"},
}


def write(folder, manifest):
    (folder / "run.json").write_text(json.dumps(manifest))
    return folder


def test_a_good_one_is_read_whole(tmp_path):
    assert load_manifest(write(tmp_path, GOOD)) == GOOD


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"name": ["beam"]}, "key 'name'"),
        ({"when": 3}, "key 'when'"),
        ({"packages": []}, "key 'packages'"),
        ({"notes": "none"}, "key 'notes'"),
        ({"notes": [1]}, "key 'notes'"),
        ({"packages": {"numpy": 2}}, "key 'packages.numpy'"),
        ({"inputs": {"test.toml": None}}, "key 'inputs.test.toml'"),
        ({"test": "beam"}, "key 'test'"),
        ({"test": {"operator": 3}}, "key 'test.operator'"),
        ({"configuration": "fit"}, "key 'configuration'"),
        ({"stages": ["fit"]}, "key 'stages'"),
        ({"stages": {"../fit": {}}}, "key 'stages.../fit'"),
        ({"stages": {"fit": "a"}}, "key 'stages.fit'"),
        ({"stages": {"fit": {"key": 1}}}, "key 'stages.fit.key'"),
        ({"stages": {"fit": {"seconds": "1"}}}, "key 'stages.fit.seconds'"),
        ({"stages": {"fit": {"seconds": True}}}, "key 'stages.fit.seconds'"),
        ({"stages": {"fit": {"stale": 1}}}, "key 'stages.fit.stale'"),
        ({"stages": {"fit": {"files": "poles.parquet"}}}, "key 'stages.fit.files'"),
        *[
            ({"stages": {"fit": {"files": [name]}}}, "key 'stages.fit.files'")
            for name in (
                "../poles.parquet",
                "/etc/passwd",
                "a/b.txt",
                "a\\b.txt",
                "C:poles.parquet",
                "..",
                ".hidden",
                "run.json",
                "",
                "a\0.txt",
                "a.txt\n",
                3,
            )
        ],
    ],
    ids=str,
)
def test_what_is_not_what_it_should_be_is_named(tmp_path, change, where):
    write(tmp_path, {**GOOD, **change})
    with pytest.raises(FileFormatError, match="damaged") as caught:
        read_run(tmp_path)
    assert where in str(caught.value)
    assert "\n" not in str(caught.value)
    assert read_manifest(tmp_path) == {}


def test_a_damaged_one_is_written_anew(tmp_path):
    (tmp_path / "run.json").write_bytes(b"\xff{")
    with open_run(tmp_path) as folder:
        folder.stage("fit", "a", lambda: 1, lambda _: {})
    assert list(load_manifest(tmp_path)["stages"]) == ["fit"]
