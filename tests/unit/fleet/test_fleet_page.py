"""The page of a fleet, and the tables behind it, of forty simulated machines."""

import json
import re

import plotly.graph_objects as go
import pyarrow.parquet as pq
import pytest

from fleet_records import HOSTILE, simulated_records
from frf_ipz.export.parquet import write_table
from frf_ipz.fleet.analysis import analyse_fleet
from frf_ipz.fleet.machine_record import MachineRecord
from frf_ipz.fleet.page import write_page
from frf_ipz.fleet.tables import FILES, fleet_tables


@pytest.fixture(scope="module")
def analysis():
    return analyse_fleet(simulated_records())


@pytest.fixture(scope="module")
def page(analysis, tmp_path_factory):
    out = tmp_path_factory.mktemp("fleet")
    (out / "machines" / "m07").mkdir(parents=True)
    (out / "machines" / "m07" / "report.html").write_text("")
    write_page(f"line {HOSTILE}", analysis, out)
    return (out / "fleet.html").read_text(encoding="utf-8")


def test_what_is_off_drifts_and_is_shared_is_known(analysis):
    assert analysis.outliers == ("m07",)
    assert [(each.effect, each.of) for each in analysis.findings] == [("added_mass", "model"), ("grounded_mass", "m11")]
    assert {drift.along for drift in analysis.drifts} == {"date", "serial_number"}
    assert any(drift.is_significant for drift in analysis.drifts)
    assert all(drift.percent_in_all < 0 for drift in analysis.drifts)
    assert len(analysis.population.machines) == 38


def test_every_section_is_there_and_pages_of_machines_are_linked(page):
    assert re.findall(r'<section id="([^"]+)"', page) == [
        "overview", "findings", "poles", "zeros", "drift", "population",
    ]  # fmt: skip
    assert page.count('href="machines/') == 1
    assert '<a href="machines/m07/report.html">m07</a>' in page


def test_names_and_messages_of_others_are_text(page):
    assert HOSTILE not in page
    assert "&lt;/script&gt;" in page


def test_plotly_knows_all_that_the_pictures_ask_for(page):
    data = json.loads(re.search(r'id="page-data">(.*?)</script>', page, re.DOTALL)[1])
    assert {"fleet-poles", "fleet-zeros-0", "fleet-zeros-1", "drift-date", "population-stiffness"} <= set(
        data["pictures"]
    )
    assert "population-mass" not in data["pictures"]  # that of a sensor is no ratio
    for picture in data["pictures"].values():
        traces = [{key: value for key, value in trace.items() if key not in {"x", "y"}} for trace in picture["data"]]
        text = re.sub(r'"@[^"]*"', '"#123456"', json.dumps(traces))
        assert go.Figure(data=json.loads(re.sub(r'\{"\$": \d+\}', "null", text))).data


def test_tables_say_what_their_columns_mean(analysis, tmp_path):
    tables = fleet_tables(analysis)
    assert set(tables) == set(FILES)
    for name, table in tables.items():
        write_table(table, tmp_path / name)
        schema = pq.read_schema(tmp_path / name)
        assert [field.name for field in schema] == [column.name for column in FILES[name]]
    poles = tables["fleet_poles.parquet"].to_pandas()
    assert set(poles["machine"][poles["outlier"]]) == {"m07"}
    assert poles["deviation_sigma"].abs().max() > 10
    fleet = tables["fleet.parquet"].to_pandas().set_index("machine")
    assert fleet["n_modes"].isna().sum() == 1
    assert fleet.loc["m40", "status"] == "failed"


@pytest.mark.parametrize("count", [0, 1, 3])
def test_few_machines_and_none_that_worked_have_a_page(tmp_path, count):
    records = [*simulated_records()[:count], MachineRecord(machine="x", status="failed", message="no file")]
    analysis = analyse_fleet(records)
    write_page("small", analysis, tmp_path)
    assert "An outlier needs 5 machines" in (tmp_path / "fleet.html").read_text(encoding="utf-8")
    assert all(table.num_columns for table in fleet_tables(analysis).values())
    assert analysis.outliers == ()
