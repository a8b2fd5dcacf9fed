"""A fleet from the command line: tables, failures, what is done again and what is not, and bad input."""

import json
import sys

import pyarrow.parquet as pq
import pytest

import frf_ipz
from fleet_case import write_fleet
from frf_ipz.cli import main as command
from frf_ipz.fleet import machine_run
from frf_ipz.pipeline import inputs, shared_model
from frf_ipz.runs.generations import stamp

COLUMNS = {  # of the contract, which may grow
    "fleet": "machine status message n_modes verdict assessment poi_error_db cpu_s",
    "fleet_poles": "machine mode frequency_hz damping_ratio frequency_std_hz damping_ratio_std deviation_sigma outlier",
    "fleet_zeros": "machine mode frequency_hz damping_ratio frequency_std_hz damping_ratio_std deviation_sigma outlier",
    "fleet_parameters": "machine value std",
    "fleet_findings": "effect location of value std log_evidence probability",
}


def run(monkeypatch, *arguments):
    """The exit status of a command."""
    monkeypatch.setattr(sys, "argv", ["frf-ipz", *map(str, arguments)])
    try:
        command.main()
    except SystemExit as stopped:
        return stopped.code
    return 0


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    """A fleet of six, of which the second is much softer and the last cannot be read."""
    folder = tmp_path_factory.mktemp("fleet")
    path = write_fleet(folder, 6, scatter=0.001, factors=(1.0, 0.8), more='pages = "outliers"\n')
    (folder / "machines" / "m06" / "hits" / "blow_1.csv").write_text("time,force,acc\n0.0,1.0,no number\n")
    frf_ipz.run_fleet(path, folder / "out", jobs=1)
    return path


@pytest.fixture
def results(fleet):
    return frf_ipz.open_fleet(fleet.parent / "out")


def test_each_machine_has_a_row_and_a_folder_of_results(results):
    frame = results.to_frame().set_index("machine")
    assert frame["status"].to_dict() == {f"m{k:02d}": "failed" if k == 6 else "done" for k in range(1, 7)}
    assert "line 2" in frame.loc["m06", "message"]
    assert "blow_1.csv" in frame.loc["m06", "message"]
    assert frame.loc["m01", "n_modes"] == 4
    assert frame.loc["m01", "assessment"] in {"usable", "with care", "not usable"}
    assert results.open("m01").fit.n_modes == 4
    assert results.open("m02").name == "m02"


@pytest.mark.parametrize("table", COLUMNS)
def test_tables_have_the_columns_of_the_contract(results, table):
    schema = pq.read_schema(results.path / f"{table}.parquet")
    assert set(COLUMNS[table].split()) <= set(schema.names)
    assert all(field.metadata[b"meaning"] for field in schema)


def test_modes_are_matched_and_the_soft_machine_is_named(results):
    poles = results.to_frame("fleet_poles")
    assert poles.groupby("mode")["machine"].count().to_dict() == {1: 5, 2: 5, 3: 5, 4: 5}
    assert set(poles["machine"][poles["outlier"]]) == {"m02"}
    assert results.to_frame()["machine"][results.to_frame()["outlier"]].tolist() == ["m02"]
    assert "outliers    m02" in results.summary()


def test_only_the_outlier_has_a_page_and_the_page_of_the_fleet_leads_to_it(results):
    machines = results.path / "machines"
    assert [page.parent.name for page in sorted(machines.glob("*/report.html"))] == ["m02"]
    page = (results.path / "fleet.html").read_text(encoding="utf-8")
    assert 'href="machines/m02/report.html"' in page
    assert 'href="machines/m01/report.html"' not in page


def test_the_population_is_that_of_the_machines_that_are_no_outliers(results):
    population = json.loads((results.path / "population.json").read_text())
    assert population["machines"] == ["m01", "m03", "m04", "m05"]
    assert len(population["covariance"]) == len(population["parameters"]) == len(population["mean"])
    members = frf_ipz.read_ensemble(results.path / "population_ensemble.mat")
    assert len(members) == 200
    first = [min(abs(member.poles().imag[member.poles().imag > 1])) for member in members]
    assert 0.9 < min(first) / max(first) < 1.0


def test_a_fleet_that_is_started_again_computes_nothing_that_is_done(fleet, monkeypatch):
    out = fleet.parent / "out"
    before = {folder.name: stamp(folder) for folder in (out / "machines").iterdir()}
    made = []
    monkeypatch.setattr(inputs, "read_model", lambda path: made.append(path))
    frf_ipz.run_fleet(fleet, out, jobs=1)
    assert {folder.name: stamp(folder) for folder in (out / "machines").iterdir()} == before
    assert made == []  # the model is read by the fleet, and by no machine


def test_the_model_is_read_once_and_reduced_once(fleet, tmp_path, monkeypatch):
    read, reduced = [], []
    for module in (inputs, shared_model):
        original = module.read_model
        monkeypatch.setattr(module, "read_model", lambda path, original=original: read.append(path) or original(path))
    save = shared_model.save_result
    monkeypatch.setattr(shared_model, "save_result", lambda *a, **k: reduced.append(1) or save(*a, **k))
    results = frf_ipz.run_fleet(fleet, tmp_path / "out", jobs=1, only=["m01", "m03"])
    assert (len(read), len(reduced)) == (1, 1)
    statuses = results.to_frame().set_index("machine")["status"].to_dict()
    assert statuses == {f"m{k:02d}": "done" if k in {1, 3} else "not run" for k in range(1, 7)}


def test_what_a_machine_gets_in_a_fleet_is_what_it_gets_alone(tmp_path, results):
    frf_ipz.run_pipeline(results.path / "pipelines" / "m01.toml", tmp_path / "alone", until="export")
    together = results.open("m01")
    for table in ("poles", "zeros", "parameters"):
        name = f"{table}.parquet"
        assert pq.read_table(tmp_path / "alone" / name).equals(pq.read_table(together.path / name))


def test_one_fault_of_the_program_is_a_row_too(fleet, tmp_path, monkeypatch):
    def fails(*_, **__):
        raise RuntimeError("unforeseen")

    monkeypatch.setattr(machine_run, "run_chain", fails)
    frame = frf_ipz.run_fleet(fleet, tmp_path / "out", jobs=1, only=["m01"]).to_frame().set_index("machine")
    assert frame.loc["m01", "status"] == "failed"
    assert "RuntimeError: unforeseen" in frame.loc["m01", "message"]


def test_the_command_runs_what_is_named_and_says_how_it_went(fleet, capsys, monkeypatch):
    out = fleet.parent / "out"
    assert run(monkeypatch, "fleet", fleet, "--out", out, "--jobs", "1", "--only", "m01, m06") == 0
    said = capsys.readouterr().out
    assert "machines    6: 5 done, 1 failed" in said
    assert "failed      m06: " in said


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--only", "m1"], "there is no machine 'm1'"),
        (["--scheduler", "tcp://127.0.0.1:9", "--jobs", "2"], "a cluster has the workers that it has"),
    ],
)
def test_bad_arguments_are_one_line(fleet, tmp_path, capsys, monkeypatch, arguments, words):
    assert run(monkeypatch, "fleet", fleet, "--out", tmp_path / "out", *arguments) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_dask_without_a_scheduler_says_what_is_missing(fleet, tmp_path):
    other = fleet.with_name("dask.toml")
    other.write_text(fleet.read_text() + 'engine = "dask"\n')
    with pytest.raises(frf_ipz.InputError, match="needs the address of a scheduler: --scheduler"):
        frf_ipz.run_fleet(other, tmp_path / "out")


def test_no_fleet_no_machine_no_table(tmp_path, results):
    with pytest.raises(frf_ipz.InputError, match="there is no fleet here"):
        frf_ipz.open_fleet(tmp_path)
    with pytest.raises(frf_ipz.InputError, match="there is no machine 'm9'"):
        results.open("m9")
    with pytest.raises(frf_ipz.InputError, match="a fleet has no table 'poles'"):
        results.to_frame("poles")
