"""A device, a pipe, a link in a circle or a folder in the place of any input: one line that names it, at once."""

import os
import sys

import pytest

from frf_ipz.cli import main as command
from small_campaign import write_campaign

MATRICES = '[model]\nkind = "matrices"\n[matrices]\nmass = "M.mtx"\nstiffness = "M.mtx"\ndofs = "dofs.csv"\n'
MATRIX = "%%MatrixMarket matrix coordinate real general\n2 2 2\n1 1 1.0\n2 2 1.0\n"
DOFS = "node,direction,x_m,y_m,z_m\n15,z,0,0,0\n21,z,1,0,0\n"
INSTEAD = {
    "device": lambda path: path.symlink_to("/dev/zero"),
    "pipe": os.mkfifo if hasattr(os, "mkfifo") else None,
    "circle": lambda path: path.symlink_to(path.name),
    "folder": lambda path: path.mkdir(),
}


@pytest.mark.skipif(sys.platform == "win32", reason="no devices, pipes and links for everybody there")
@pytest.mark.parametrize("kind", INSTEAD)
@pytest.mark.parametrize("name", ["pipeline.toml", "test.toml", "model.toml", "hits/blow_1.csv", "M.mtx", "dofs.csv"])
def test_what_is_no_file_is_named_in_one_line(tmp_path, monkeypatch, capsys, kind, name):
    write_campaign(tmp_path, records=1)
    if name in {"M.mtx", "dofs.csv"}:
        (tmp_path / "model.toml").write_text(MATRICES)
        (tmp_path / "M.mtx").write_text(MATRIX)
        (tmp_path / "dofs.csv").write_text(DOFS)
    (tmp_path / name).unlink()
    INSTEAD[kind](tmp_path / name)
    monkeypatch.setattr(sys, "argv", ["frf-ipz", "check", str(tmp_path / "pipeline.toml")])
    with pytest.raises(SystemExit) as stopped:
        command.main()
    error = capsys.readouterr().err
    assert stopped.value.code == 2
    assert error.count("\n") == 1
    assert name in error or "hits/*.csv" in error
