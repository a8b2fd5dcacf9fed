"""Importing the package stays light, and the command answers at once."""

import ast
import subprocess
import sys
from pathlib import Path

MODULES_AT_START = 125  # of 620 in all: those of options, files, the model, and the first stage
SOURCE = Path(__file__).parents[2] / "src" / "frf_ipz"


def modules_after(statement):
    code = f"import sys; {statement}; print('\\n'.join(sys.modules))"
    return set(subprocess.check_output([sys.executable, "-c", code], text=True).split())


def test_importing_the_package_leaves_heavy_packages_alone():
    loaded = modules_after("import frf_ipz")
    assert not loaded & {"matplotlib", "control", "plotly", "pandas", "scipy", "numpy"}


def test_importing_the_command_leaves_heavy_packages_alone():
    loaded = modules_after("import frf_ipz.cli.main")
    assert not loaded & {"matplotlib", "control", "plotly", "pandas", "scipy", "numpy", "pyarrow"}


def test_a_chain_starts_without_what_only_later_stages_need():
    """What is imported costs more than the first stages of a small test; counted, as seconds differ by machine."""
    loaded = modules_after("import frf_ipz.cli.main, frf_ipz.pipeline.run")
    scipys = "stats", "optimize", "signal", "interpolate", "ndimage", "fft", "spatial", "special"
    heavy = {"pandas", "pyarrow", *(f"scipy.{name}" for name in scipys)}
    assert not loaded & {*heavy, "jinja2", "joblib", "h5py", "frf_ipz.diagnosis.diagnose", "frf_ipz.report.page"}
    assert len([name for name in loaded if name.startswith("frf_ipz.")]) <= MODULES_AT_START


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
