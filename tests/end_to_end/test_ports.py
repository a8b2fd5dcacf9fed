"""A tilt, a mean and a force pair go from the files through the whole chain, and come out as they are."""

import json
import re
import sys
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO

import numpy as np
import pandas as pd
import pytest

import frf_ipz
from clamped_beam import BEAM
from frf_ipz.cli.main import main
from frf_ipz.diagnosis.options import DiagnoseOptions

BAND_HZ = (10.0, 700.0)
LINES_HZ = np.arange(10.0, 700.25, 0.5)
NOISE = 0.01  # of the median FRF
CLOSE_DB = 0.2  # at the median line: noise of 1 %, many lines, and a stiffness 4 % off
PORTS = {
    "tip tilt": frf_ipz.Port("tip tilt", {"21:z": 10.0, "17:z": -10.0}, "rad"),
    "mean": frf_ipz.Port("mean", {"21:z": 0.5, "17:z": 0.5}),
    "force pair": frf_ipz.Port("force pair", {"12:z": 1.0, "10:z": -1.0}),
}
OUTPUTS, INPUTS, POINTS = ("mean", "9:+z", "15:-z"), ("force pair", "9:+z"), ("-tip tilt", "probe")
MODEL = """
[model]
kind = "beam"
[damping]
modal_ratio = 0.005
[beam]
length_m = 0.5
elements = 20
youngs_modulus_Pa = 67e9
density_kg_m3 = 2700.0
width_m = 0.02
thickness_m = 0.005
left = "clamped"
[[port]]
name = "tip tilt"
dofs = { "21:z" = 10.0, "17:z" = -10.0 }
unit = "rad"
[[port]]
name = "mean"
dofs = { "21:z" = 0.5, "17:z" = 0.5 }
unit = "m"
[[port]]
name = "force pair"
dofs = { "12:z" = 1.0, "10:z" = -1.0 }
unit = "m"
[[port]]
name = "probe"
point_m = [0.4, 0.0, 0.0]
direction = "z"
"""
TEST = '[test]\nkind = "frf"\n[[frf]]\nfile = "frf.csv"\nquantity = "accelerance"\n'
PIPELINE = """
[pipeline]
name = "ports"
test = "test.toml"
model = "model.toml"
[fit]
band_hz = [10.0, 700.0]
[diagnose]
run = "never"
[reduce]
residual_flexibility = ["force pair"]
[predict]
points = ["-tip tilt", "probe"]
"""


def command(*arguments):
    """Exit status, and what is said, of ``frf-ipz`` with these arguments."""
    said = StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(said), redirect_stderr(said):
        patch.setattr(sys, "argv", ["frf-ipz", *map(str, arguments)])
        patch.setenv("COLUMNS", "200")
        with pytest.raises(SystemExit) as stop:
            main()
    return stop.value.code or 0, said.getvalue()


def truth():
    return frf_ipz.make_beam(**BEAM).with_ports(list(PORTS.values()))


def values_of(model, outputs, inputs, lines_hz=LINES_HZ):
    labels = [frf_ipz.FrfLabel(output, force, "accelerance") for output in outputs for force in inputs]
    values = frf_ipz.compute_frfs(model, labels, 2j * np.pi * lines_hz)
    return values.reshape(len(lines_hz), len(outputs), len(inputs))


def measure(seed):
    values = values_of(truth(), OUTPUTS, INPUTS)
    noise = NOISE * np.median(np.abs(values), axis=0)
    parts = np.random.default_rng(seed).normal(size=(*values.shape, 2)) / 2**0.5
    return values + noise * parts.view(complex)[..., 0], np.broadcast_to(noise**2, values.shape)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ports")
    values, variance = measure(20)
    rows = [
        (hertz, OUTPUTS[i], INPUTS[j], values[k, i, j].real, values[k, i, j].imag, variance[k, i, j])
        for i in range(3)
        for j in range(2)
        for k, hertz in enumerate(LINES_HZ)
    ]
    columns = ["frequency_hz", "output_dof", "input_dof", "real", "imag", "variance"]
    pd.DataFrame(rows, columns=columns).to_csv(folder / "frf.csv", index=False)
    for name, text in (("test", TEST), ("model", MODEL), ("pipeline", PIPELINE)):
        (folder / f"{name}.toml").write_text(text)
    status, said = command("run", folder / "pipeline.toml", "--out", folder / "out")
    assert status == 0, said
    return folder


def test_points_that_are_ports_are_predicted(folder):
    table = pd.read_parquet(folder / "out" / "poi_frf.parquet")
    assert set(table["output_dof"]) == set(POINTS)
    assert set(table["input_dof"]) == set(INPUTS)
    for output, dof, sign in (("-tip tilt", "tip tilt", -1.0), ("probe", "17:z", 1.0)):
        for force in INPUTS:
            rows = table[(table["output_dof"] == output) & (table["input_dof"] == force)]
            expected = sign * values_of(truth(), [dof], [force], rows["frequency_hz"].to_numpy())[:, 0, 0]
            ratio = (rows["real"] + 1j * rows["imag"]).to_numpy() / expected
            assert np.median(np.abs(20 * np.log10(np.abs(ratio)))) < CLOSE_DB
            assert np.median(ratio.real) > 0.9


def test_the_state_space_knows_names_and_units_of_ports(folder):
    exported = json.loads((folder / "out" / "statespace.json").read_text())
    assert exported["input_names"] == ["force pair", "9:+z"]
    assert exported["output_names"] == ["mean", "9:+z", "15:-z", "-tip tilt", "probe"]
    assert exported["output_units"] == ["m/s^2", "m/s^2", "m/s^2", "rad/s^2", "m/s^2"]
    assert exported["input_units"] == ["N", "N"]
    page = (folder / "out" / "report.html").read_text()
    assert "-tip tilt / force pair" in page


def test_a_diagnosis_takes_ports_as_they_are(folder):
    """A wrong modulus is found through a mean and a force pair; neither is said to be misplaced."""
    values, variance = measure(21)
    frfs = frf_ipz.FrfSet.from_arrays(LINES_HZ, values, outputs=OUTPUTS, inputs=INPUTS, variance=variance)
    options = DiagnoseOptions(effects=("global_stiffness", "sensor_misplaced"))
    model = frf_ipz.read_model(folder / "model.toml")
    (finding,) = frf_ipz.diagnose(frfs, model, options=options).findings
    assert finding.effect == "global_stiffness"
    assert finding.parameters["stiffness_ratio"].value == pytest.approx(70 / 67, rel=2e-3)


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("pipeline.toml", '"-tip tilt"', '"-tip tlit"', "'-tip tlit' is no DOF label.*did you mean 'tip tilt'"),
        ("pipeline.toml", '["force pair"]', '["pair"]', "'pair' is no DOF label"),
        ("frf.csv", "mean", "maen", "'maen' is no DOF label.*did you mean 'mean'"),
        ("model.toml", 'name = "mean"', 'name = "force pair"', "two ports are called 'force pair'"),
        ("test.toml", 'quantity = "accelerance"', 'quantity = "accelerance"\nunit = "rad/s^2/N"', "frf.csv.*rad"),
    ],
)
def test_a_name_that_is_none_is_refused(folder, tmp_path, file, old, new, message):
    for name in ("frf.csv", "test.toml", "model.toml", "pipeline.toml"):
        text = (folder / name).read_text()
        (tmp_path / name).write_text(text.replace(old, new) if name == file else text)
    status, said = command("run", tmp_path / "pipeline.toml", "--out", tmp_path / "out")
    assert status == 2
    assert "Traceback" not in said
    assert re.search(message, said, re.DOTALL), said


RECORDED = """
[test]
kind = "hammer"
[[channel]]
column = "force"
role = "input"
quantity = "force"
unit = "N"
[[channel]]
column = "tilt"
role = "output"
quantity = "acceleration"
unit = "{unit}"
dof = "tip tilt"
[[hit]]
dof = "9:+z"
files = ["hit.csv"]
"""


@pytest.mark.parametrize(("unit", "status"), [("m/s^2", 2), ("mrad/s^2", 0)])
def test_a_channel_in_the_unit_of_another_port_is_refused(folder, tmp_path, unit, status):
    for name in ("model.toml", "pipeline.toml"):
        (tmp_path / name).write_text((folder / name).read_text())
    (tmp_path / "test.toml").write_text(RECORDED.format(unit=unit))
    time = np.arange(4096) / 4096
    force = np.where((time > 0.02) & (time < 0.022), 50.0 * np.sin(np.pi * (time - 0.02) / 0.002), 0.0)
    response = np.convolve(force, np.exp(-4 * time) * np.sin(2 * np.pi * 40 * time))[:4096]
    noise = 1e-3 * np.random.default_rng(3).normal(size=(4096, 2)) * [50.0, np.ptp(response)]
    table = np.column_stack([time, np.stack([force, response], 1) + noise])
    np.savetxt(tmp_path / "hit.csv", table, delimiter=",", header="time,force,tilt", comments="")
    ended, said = command("check", tmp_path / "pipeline.toml")
    assert ended == status, said
    assert ("[[channel]] 'tilt' at tip tilt" if status else "tip tilt") in said
