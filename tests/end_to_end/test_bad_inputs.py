"""What a user gets wrong is said in one clear line, with exit status 2, and leaves nothing half-written."""

import errno
import os
import sys

import numpy as np
import pytest

from frf_ipz.cli import main as command
from frf_ipz.runs import folder as run_folder
from small_campaign import write_campaign, write_csv

MATRICES = """
[model]
kind = "matrices"
[damping]
modal_ratio = 0.01
[matrices]
mass = "M.mtx"
stiffness = "K.mtx"
dofs = "dofs.csv"
"""


@pytest.fixture(scope="module")
def template(tmp_path_factory):
    folder = tmp_path_factory.mktemp("template")
    write_campaign(folder)
    return folder


@pytest.fixture
def campaign(template, tmp_path):
    for path in template.rglob("*"):
        target = tmp_path / path.relative_to(template)
        target.mkdir() if path.is_dir() else target.write_bytes(path.read_bytes())
    return tmp_path


def run(monkeypatch, capsys, *arguments):
    monkeypatch.setattr(sys, "argv", ["frf-ipz", *map(str, arguments)])
    try:
        command.main()
        status = 0
    except SystemExit as stop:
        status = stop.code or 0
    return status, capsys.readouterr().err


def edit(folder, name, old, new):
    path = folder / name
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def edit_blow(folder, change, number=1):
    path = folder / "hits" / f"blow_{number}.csv"
    lines = path.read_text().splitlines()
    path.write_text("\n".join(change(lines)) + "\n")


def with_field(line, column, text):
    def change(lines):
        fields = lines[line].split(",")
        fields[column] = text
        return [*lines[:line], ",".join(fields), *lines[line + 1 :]]

    return change


def without_force(folder):
    rng = np.random.default_rng(5)
    for path in (folder / "hits").glob("*.csv"):
        samples = 2048
        write_csv(path, np.arange(samples) / 4096, *(1e-3 * rng.standard_normal((2, samples))))


def cut_off(folder):
    """Cut the top of every pulse: no blow is left that can be used."""
    for path in (folder / "hits").glob("*.csv"):
        time, force, acc = np.loadtxt(path, delimiter=",", skiprows=1).T
        write_csv(path, time, np.minimum(force, 0.6 * force.max()), acc)


def matrices(folder, mass=None, stiffness=None, dofs="node,direction,x_m,y_m,z_m\n15,z,0.35,0,0\n21,z,0.5,0,0\n"):
    edit(folder, "pipeline.toml", 'points = ["11:+z"]', "points = []")
    (folder / "model.toml").write_text(MATRICES)
    (folder / "dofs.csv").write_text(dofs)
    for name, given in (("M", mass), ("K", stiffness)):
        matrix = np.array([[2.0, -1.0], [-1.0, 2.0]]) * (1.0 if name == "M" else 1e6) if given is None else given
        rows, columns = matrix.shape
        values = "\n".join(f"{i + 1} {j + 1} {matrix[i, j]:g}" for j in range(columns) for i in range(rows))
        text = f"%%MatrixMarket matrix coordinate real general\n{rows} {columns} {matrix.size}\n{values}\n"
        (folder / f"{name}.mtx").write_text(text)


CASES = {
    "no pipeline file": (lambda f: (f / "pipeline.toml").unlink(), ["pipeline.toml", "no such file"]),
    "pipeline is no TOML": (lambda f: (f / "pipeline.toml").write_text("[pipeline\n"), ["pipeline.toml", "TOML"]),
    "unknown section": (lambda f: edit(f, "pipeline.toml", "[fit]", "[fitt]"), ["pipeline.toml", "'fitt'", "'fit'"]),
    "unknown key": (lambda f: edit(f, "pipeline.toml", "band_hz", "bands_hz"), ["bands_hz", "band_hz"]),
    "no test file": (lambda f: (f / "test.toml").unlink(), ["test.toml", "no such file"]),
    "no model file": (lambda f: (f / "model.toml").unlink(), ["model.toml", "no such file"]),
    "band is text": (lambda f: edit(f, "pipeline.toml", "[10.0, 600.0]", '"all"'), ["fit.band_hz"]),
    "band is reversed": (lambda f: edit(f, "pipeline.toml", "[10.0, 600.0]", "[600.0, 10.0]"), ["band_hz"]),
    "band outside the data": (lambda f: edit(f, "pipeline.toml", "[10.0, 600.0]", "[9e4, 9.9e4]"), ["band", "Hz"]),
    "wrong unit": (lambda f: edit(f, "test.toml", 'unit = "N"', 'unit = "furlong"'), ["test.toml", "furlong"]),
    "no unit at all": (lambda f: edit(f, "test.toml", 'unit = "N"', 'unit = "qqq"'), ["test.toml", "qqq"]),
    "unknown kind of test": (lambda f: edit(f, "test.toml", '"hammer"', '"hamer"'), ["test.toml", "hammer"]),
    "bad DOF": (lambda f: edit(f, "test.toml", '"21:+z"', '"tip"'), ["test.toml", "tip"]),
    "DOF not in the model": (lambda f: edit(f, "test.toml", '"21:+z"', '"99:+z"'), ["model.toml", "99"]),
    "direction not in the model": (lambda f: edit(f, "test.toml", '"21:+z"', '"21:+y"'), ["model.toml", "21"]),
    "point not in the model": (lambda f: edit(f, "pipeline.toml", "11:+z", "77:+z"), ["77"]),
    "point is held": (lambda f: edit(f, "pipeline.toml", "11:+z", "1:+z"), ["1:z", "held"]),
    "no files": (lambda f: edit(f, "test.toml", "hits/*.csv", "hit/*.csv"), ["test.toml", "hit/*.csv"]),
    "missing column": (lambda f: edit(f, "test.toml", 'column = "acc"', 'column = "acx"'), ["acx", "acc"]),
    "empty recording": (lambda f: (f / "hits" / "blow_1.csv").write_text(""), ["blow_1.csv", "empty"]),
    "truncated recording": (lambda f: edit_blow(f, lambda lines: [*lines[:-1], "0.99,0.1"]), ["blow_1.csv", "line"]),
    "only a header": (lambda f: edit_blow(f, lambda lines: lines[:1]), ["blow_1.csv"]),
    "NaN": (lambda f: edit_blow(f, with_field(50, 2, "nan")), ["blow_1.csv", "line 51", "acc"]),
    "text in a number": (lambda f: edit_blow(f, with_field(50, 1, "oops")), ["blow_1.csv", "line 51", "oops"]),
    "time not uniform": (
        lambda f: edit_blow(f, lambda lines: [*lines[:100], *lines[180:]]),
        ["blow_1.csv", "step"],
    ),
    "time goes back": (lambda f: edit_blow(f, with_field(50, 0, "0.0")), ["blow_1.csv"]),
    "unequal lengths": (lambda f: edit_blow(f, lambda lines: lines[: len(lines) // 2]), ["blow_1.csv", "samples"]),
    "no impact found": (without_force, ["no impact found"]),
    "all blows dropped": (
        lambda f: edit(
            f,
            "pipeline.toml",
            "[fit]",
            '[ingest]\ndrop = ["hits/blow_1.csv", "hits/blow_2.csv", "hits/blow_3.csv"]\n[fit]',
        ),
        ["[ingest] drop", "15:+z", "keep one"],
    ),
    "no mode in the band": (
        lambda f: edit(f, "pipeline.toml", "[10.0, 600.0]", "[130.0, 250.0]"),
        ["no mode", "132 and 250 Hz", "band_hz"],
    ),
    "parameters of a diagnosis that is not applied": (
        lambda f: edit(f, "pipeline.toml", "[predict]", '[update]\nparameters = "diagnosis"\n[predict]'),
        ["pipeline.toml", "parameters", "apply = true"],
    ),
    "mass indefinite": (lambda f: matrices(f, mass=np.diag([1.0, -1.0])), ["M.mtx", "21:z", "mass -1"]),
    "stiffness indefinite": (lambda f: matrices(f, stiffness=np.diag([1e6, -1e6])), ["K.mtx", "definite"]),
    "not symmetric": (lambda f: matrices(f, stiffness=np.array([[2e6, 0.0], [-1e6, 2e6]])), ["K.mtx", "symmetric"]),
    "not square": (lambda f: matrices(f, mass=np.ones((2, 3))), ["M.mtx"]),
    "sizes differ": (lambda f: matrices(f, mass=np.eye(3)), ["M.mtx"]),
    "DOF twice": (
        lambda f: matrices(f, dofs="node,direction,x_m,y_m,z_m\n15,z,0,0,0\n15,z,0,0,0\n"),
        ["dofs.csv", "15"],
    ),
    "negative length": (lambda f: edit(f, "model.toml", "length_m = 0.5", "length_m = -0.5"), ["length_m"]),
    "unknown formulation": (lambda f: edit(f, "model.toml", '"euler-bernoulli"', '"euler"'), ["formulation"]),
    "more modes than the model has": (
        lambda f: edit(f, "pipeline.toml", "[predict]", "[reduce]\nmodes = 400\n[predict]"),
        ["modes"],
    ),
    "kept DOFs do not fit the modes": (
        lambda f: edit(f, "pipeline.toml", "[predict]", '[reduce]\nmodes = 3\ndofs = ["15:z"]\n[predict]'),
        ["dofs"],
    ),
}


@pytest.mark.parametrize("case", CASES, ids=lambda name: name.replace(" ", "-"))
def test_what_is_wrong_is_said_in_one_line(case, campaign, monkeypatch, capsys):
    spoil, words = CASES[case]
    spoil(campaign)
    status, said = run(monkeypatch, capsys, "run", campaign / "pipeline.toml", "--out", campaign / "out")
    assert status == 2, said
    lines = said.strip().splitlines()
    assert len(lines) == 1, said
    assert lines[0].startswith("frf-ipz: ")
    assert all(word in said for word in words), said
    assert not (campaign / "out").exists()


def test_where_all_blows_are_bad_the_least_bad_is_used_and_it_is_said(campaign, monkeypatch, capsys):
    cut_off(campaign)
    monkeypatch.setattr(
        sys, "argv", ["frf-ipz", "ingest", str(campaign / "pipeline.toml"), "--out", str(campaign / "out")]
    )
    with pytest.raises(SystemExit) as stop:
        command.main()
    said = capsys.readouterr().out
    assert not stop.value.code
    assert "used although it is bad (clipping of force): no better record at 15:+z" in " ".join(said.split())


def test_out_that_is_a_file(campaign, monkeypatch, capsys):
    (campaign / "out").write_text("mine")
    status, said = run(monkeypatch, capsys, "ingest", campaign / "pipeline.toml", "--out", campaign / "out")
    assert status == 2
    assert "out" in said
    assert (campaign / "out").read_text() == "mine"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_out_that_cannot_be_written(campaign, monkeypatch, capsys):
    (campaign / "locked").mkdir(mode=0o500)
    status, said = run(monkeypatch, capsys, "ingest", campaign / "pipeline.toml", "--out", campaign / "locked" / "out")
    assert status == 2
    assert "locked" in said


def test_a_full_disk_leaves_the_last_good_results(campaign, monkeypatch, capsys):
    out = campaign / "out"
    assert run(monkeypatch, capsys, "ingest", campaign / "pipeline.toml", "--out", out)[0] == 0
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    edit(campaign, "test.toml", '"15:+z"', '"15:-z"')

    def full(_, path, **__):
        path.write_bytes(b"half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(run_folder, "save_result", full)
    status, said = run(monkeypatch, capsys, "ingest", campaign / "pipeline.toml", "--out", out)
    assert status == 2
    assert "disk is full" in said
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before


def test_a_combination_without_mass_follows_statically(campaign, monkeypatch, capsys):
    matrices(campaign, mass=np.array([[1.0, 1.0], [1.0, 1.0]]))
    status, said = run(monkeypatch, capsys, "run", campaign / "pipeline.toml", "--out", campaign / "out")
    assert status == 0, said
