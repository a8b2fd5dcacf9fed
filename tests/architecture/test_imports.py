"""Importing the package stays light, and the command answers at once."""

import ast
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from array_files import write_matlab_7_3
from small_campaign import write_campaign

MODULES_AT_START = 127  # of 605 in all: those of options, files, the model, and the first stage
NOT_AT_START = {
    *("pandas", "pyarrow", "jinja2", "filelock", "joblib", "h5py", "pint", "rich", "matplotlib", "plotly", "control"),
    *(f"scipy.{name}" for name in ("stats", "optimize", "signal", "interpolate", "ndimage", "fft", "spatial")),
    *("scipy.special", "scipy.io"),
}
SOURCE = Path(__file__).parents[2] / "src" / "frf_ipz"


def modules_after(statement, folder=None):
    code = f"import sys; {statement}; print('\\n'.join(sys.modules))"
    return set(subprocess.check_output([sys.executable, "-c", code], text=True, cwd=folder).split())


def test_importing_the_package_leaves_heavy_packages_alone():
    loaded = modules_after("import frf_ipz")
    assert not loaded & {"matplotlib", "control", "plotly", "pandas", "scipy", "numpy"}


def test_importing_the_command_leaves_heavy_packages_alone():
    loaded = modules_after("import frf_ipz.cli.main")
    assert not loaded & {"matplotlib", "control", "plotly", "pandas", "scipy", "numpy", "pyarrow"}


def test_a_chain_starts_without_what_only_later_stages_need():
    """What is imported costs more than the first stages of a small test; counted, as seconds differ by machine."""
    loaded = modules_after("import frf_ipz.cli.main, frf_ipz.pipeline.run")
    assert not names_of(loaded) & {*NOT_AT_START, "frf_ipz.diagnosis.diagnose", "frf_ipz.report.page"}
    assert len([name for name in loaded if name.startswith("frf_ipz.")]) <= MODULES_AT_START


@pytest.mark.parametrize("command", ["ingest", "fit", "pair", "update", "predict", "export", "run", "check"])
def test_a_command_opens_its_file_before_it_loads_what_its_work_may_not_need(tmp_path, command):
    file = tmp_path / "pipeline.toml"
    file.write_text("")
    loaded = modules_of_command([command, str(file)], until_it_opens=file)
    assert "numpy" in loaded
    assert not names_of(loaded) & {*NOT_AT_START, "frf_ipz.assessment.assess", "frf_ipz.diagnosis.diagnose"}


def test_a_fit_loads_nothing_of_the_stages_after_it(tmp_path):
    file = write_campaign(tmp_path)
    loaded = modules_of_command(["fit", str(file), "--out", str(tmp_path / "out")])
    assert "frf_ipz.identification.fit" in loaded
    after = {"assessment.assess", "prediction.predict", "report.page", "updating.update", "pairing.pair"}
    assert not names_of(loaded) & {f"frf_ipz.{name}" for name in after}
    assert not names_of(loaded) & {"rich", "jinja2", "control", "scipy.optimize", "scipy.signal", "scipy.io"}


def modules_of_command(arguments, *, until_it_opens=None):
    """Names of all modules that a command has loaded at its end, or when it opens a file."""
    code = f"""
import atexit, os, sys
def tell():
    print("\\n".join(sys.modules), flush=True)
def look(event, seen):
    if event == "open" and seen[0] == {str(until_it_opens)!r}:
        tell()
        os._exit(0)
atexit.register(tell)
sys.addaudithook(look)
sys.argv = ["frf-ipz", *{arguments!r}]
from frf_ipz.cli.main import main
main()
"""
    return set(subprocess.check_output([sys.executable, "-c", code], text=True).split())


def names_of(modules):
    """Modules with the packages that they are of."""
    return {".".join(parts[:count]) for parts in (name.split(".") for name in modules) for count in (1, 2, 3)}


def test_imports_stand_at_the_top():
    allowed = {"cli", "export"}  # the command starts fast; control is slow to import
    late = [
        f"{path.relative_to(SOURCE)}:{node.lineno}"
        for path in SOURCE.rglob("*.py")
        if path.relative_to(SOURCE).parts[0] not in allowed
        for function in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(function, ast.FunctionDef)
        for node in ast.walk(function)
        if isinstance(node, ast.Import | ast.ImportFrom)
    ]
    assert not late


def test_the_library_of_hdf5_is_loaded_in_no_process_of_the_user(tmp_path):
    """A damaged file may end the process that reads it."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["frf"], file["f"] = np.full((3, 1, 1), 1 + 1j), np.arange(1.0, 4.0)
    write_matlab_7_3(tmp_path / "a.mat", {"K": np.eye(2)})
    read = "frf_ipz.read_frfs('a.h5', quantity='receptance', output='1:+z', input='1:+z')"
    code = f"import frf_ipz; {read}; from pathlib import Path; from frf_ipz.fe.matrices.registry import read_matrix; "
    code += "from frf_ipz.fe.matrices.stored import MatrixRequest; "
    code += "read_matrix(MatrixRequest(path=Path('a.mat'), what='stiffness'))"
    assert not [name for name in modules_after(code, folder=tmp_path) if name.startswith("h5py.")]
