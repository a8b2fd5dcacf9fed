"""fleet.toml: machines from a pattern, a table or a list, overrides, and one clear line for whatever is wrong."""

import json

import pytest

from frf_ipz.errors import InputError
from frf_ipz.fleet.fleet_file import read_fleet
from frf_ipz.toml_files import parse_toml
from small_campaign import MODEL, PIPELINE, TEST

HEAD = '[fleet]\nmodel = "model.toml"\npipeline = "pipeline.toml"\n'


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "model.toml").write_text(MODEL)
    (tmp_path / "pipeline.toml").write_text(PIPELINE)
    for name in ("a1", "a2", "a10"):
        (tmp_path / "machines" / name).mkdir(parents=True)
        (tmp_path / "machines" / name / "test.toml").write_text(TEST)
    return tmp_path


def fleet_of(folder, text):
    path = folder / "fleet.toml"
    path.write_text(text)
    return read_fleet(path)


def test_a_pattern_finds_machines_by_their_folders(folder):
    fleet = fleet_of(folder, HEAD + 'machines = "machines/*/test.toml"\n')
    assert [machine.id for machine in fleet.machines] == ["a1", "a10", "a2"]
    assert fleet.name == "fleet"
    assert (fleet.engine, fleet.pages) == ("local", "outliers")
    assert all(machine.test_path.is_file() for machine in fleet.machines)


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_a_table_names_machines_with_their_particulars(folder, delimiter):
    rows = [["id", "test", "serial_number", "date"], ["m 1", "machines/a1/test.toml", "S-1", "2026-01-02"]]
    (folder / "list.csv").write_text("\n".join(delimiter.join(row) for row in rows) + "\n\n")
    (machine,) = fleet_of(folder, HEAD + 'machines = "list.csv"\n').machines
    assert machine.id == "m 1"
    assert machine.particulars == {"serial_number": "S-1", "date": "2026-01-02"}


def test_a_machine_overrides_the_common_settings_only_where_it_says_so(folder):
    more = '[[machine]]\nid = "a2"\nfit = { band_hz = [20.0, 500.0] }\ndate = 2026-03-04\n'
    fleet = fleet_of(folder, HEAD + 'machines = "machines/*/test.toml"\n' + more)
    machines = {machine.id: machine for machine in fleet.machines}
    own, common = (fleet.pipeline_of(machines[name]) for name in ("a2", "a1"))
    assert own["fit"] == {"band_hz": [20.0, 500.0]}
    assert common["fit"] == {"band_hz": [10.0, 600.0]}
    assert own["predict"] == common["predict"] == {"points": ["11:+z"]}
    assert machines["a2"].particulars == {"date": "2026-03-04"}


def test_the_pipeline_of_a_machine_can_be_run_from_where_it_is_written(folder, tmp_path):
    with_effect = PIPELINE.replace('run = "never"', 'run = "never"\nextra_effects = ["own.py:Mine"]')
    (folder / "pipeline.toml").write_text(with_effect + 'reference = "aside/frf.csv"\n')
    fleet = fleet_of(folder, HEAD + 'machines = "machines/*/test.toml"\n')
    written = tmp_path / "elsewhere.toml"
    fleet.write_pipeline(fleet.machines[0], written)
    table = parse_toml(written.read_text(), written)
    assert table["pipeline"]["test"] == str(folder / "machines" / "a1" / "test.toml")
    assert table["pipeline"]["model"] == str(folder / "model.toml")
    assert table["predict"]["reference"] == str(folder / "aside" / "frf.csv")
    assert table["diagnose"]["extra_effects"] == [f"{folder / 'own.py'}:Mine"]


WRONG = {
    "unknown key": (HEAD + 'machins = "x"\n', "unknown key 'machins'; did you mean 'machines'?"),
    "engine": (HEAD + 'engine = "slurm"\n', "key 'fleet.engine'"),
    "pages": (HEAD + 'pages = "some"\n', "key 'fleet.pages'"),
    "no machine": (HEAD, "names no machine"),
    "nothing fits": (HEAD + 'machines = "machine/*/test.toml"\n', "no file fits 'machine/*/test.toml'"),
    "absolute pattern": (HEAD + 'machines = "/machines/*/test.toml"\n', "a pattern is relative to this file"),
    "unknown id": (
        HEAD + 'machines = "machines/*/test.toml"\n[[machine]]\nid = "a3"\n',
        "no such machine was found, and no 'test' is named; known are a1, a10, a2",
    ),
    "no test": (HEAD + '[[machine]]\nid = "a3"\n', "the key 'test' is missing"),
    "twice": (HEAD + 2 * '[[machine]]\nid = "a3"\ntest = "t.toml"\n', "the id 'a3' is there more than once"),
    "case": (
        HEAD + 'machines = "machines/*/test.toml"\n[[machine]]\nid = "A1"\ntest = "t.toml"\n',
        "'a1', 'A1' is there more than once",
    ),
    "misspelt override": (
        HEAD + '[[machine]]\nid = "a3"\ntest = "t.toml"\nfit = { band = [1.0, 2.0] }\n',
        "machine 'a3', key 'fit.band': unknown key 'band'; did you mean 'band_hz'?",
    ),
    "misspelt section": (HEAD + '[[machine]]\nid = "a3"\ntest = "t.toml"\nfitt = { }\n', "unknown key 'fitt'"),
    "the model's name": (HEAD + '[[machine]]\nid = "model"\ntest = "t.toml"\n', "the id 'model' stands for"),
    "no section": ('[machine]\nid = "a"\n', "has no section [fleet]"),
    "no model": ('[fleet]\nmodel = "modell.toml"\npipeline = "pipeline.toml"\n', "modell.toml: there is no such file"),
    "no model, where": ('[fleet]\nmodel = "modell.toml"\npipeline = "pipeline.toml"\n', "key 'fleet.model': "),
    "no pipeline": ('[fleet]\npipeline = "pipe.toml"\n', "pipe.toml: there is no such file"),
    "no pipeline, where": ('[fleet]\npipeline = "pipe.toml"\n', "fleet.toml, key 'fleet.pipeline': "),
}


@pytest.mark.parametrize("kind", WRONG)
def test_what_is_wrong_is_said_in_one_line(folder, kind):
    text, words = WRONG[kind]
    with pytest.raises(InputError) as error:
        fleet_of(folder, text)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_a_wrong_key_for_all_is_said_of_the_pipeline(folder):
    (folder / "pipeline.toml").write_text(PIPELINE.replace("band_hz", "band_Hz"))
    with pytest.raises(InputError, match=r"pipeline\.toml, key 'fit\.band_Hz': unknown key"):
        fleet_of(folder, HEAD + 'machines = "machines/*/test.toml"\n')


def test_wrong_keys_of_all_files_are_said_at_once(folder):
    (folder / "pipeline.toml").write_text(PIPELINE.replace("band_hz", "band_Hz"))
    (folder / "model.toml").write_text(MODEL.replace("width_m", "widht_m"))
    with pytest.raises(InputError) as error:
        fleet_of(folder, HEAD + 'machinse = "machines/*/test.toml"\n')
    message = str(error.value)
    assert message.startswith("3 mistakes in 3 files: (1) ")
    for words in (
        "fleet.toml, key 'fleet.machinse'",
        "pipeline.toml, key 'fit.band_Hz'",
        "model.toml, key 'beam.widht",
    ):
        assert words in message
    assert "\n" not in message


@pytest.mark.parametrize("name", ["a/b", "..", "a:b", " a", "a.", "CON", "nul.txt", "a\\b", "x" * 101, "a\tb", ""])
def test_an_id_that_no_folder_can_have_is_refused(folder, name):
    with pytest.raises(InputError, match="is no name that a folder can have"):
        fleet_of(folder, HEAD + f"[[machine]]\nid = {json.dumps(name)}\ntest = 't.toml'\n")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("test\nmachines/a1/test.toml\n", "line 1: has no column 'id'"),
        ("id,test,serial\na,t,1\n", "unknown column 'serial'; did you mean 'serial_number'?"),
        ("id,test,test\na,t,t\n", "has two columns 'test'"),
        ("id,test\na\n", "line 2: has 1 cells; 2 are expected"),
        ("id,test\n,t\n", "line 2: the cell of 'id' is empty"),
        ("id,test\n", "names no machine"),
        ("", "line 1: has no column 'id'"),
        ("id,test\na,t\na,u\n", "the id 'a' is there more than once"),
    ],
)
def test_a_wrong_table_is_said_by_line(folder, text, words):
    (folder / "list.csv").write_text(text)
    with pytest.raises(InputError) as error:
        fleet_of(folder, HEAD + 'machines = "list.csv"\n')
    assert words in str(error.value)
