"""Files as a user would hand them in: recordings, test.toml, model.toml, pipeline.toml, matrices."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from frf_testbench.simulator.cases.records import Excitation
from frf_testbench.simulator.set_up import SetUp
from frf_testbench.simulator.specimens import Specimen
from frf_testbench.simulator.structures.beams import BeamDrawing, PointPart, Section
from frf_testbench.simulator.structures.frames import FrameDrawing
from frf_testbench.simulator.structures.nominal import NominalModel

FloatArray = NDArray[np.float64]


def write_recording(path: Path, columns: dict[str, FloatArray], rate_hz: float, *, digits: int = 6) -> None:
    """Write a CSV: ``time`` and one column a channel.

    Parameters
    ----------
    path : Path
        The file; its folder is made.
    columns : dict of str to (n,) array
        Channels in their own units.
    rate_hz : float
        Sampling rate.
    digits : int
        Significant digits of the channels.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    table = np.column_stack([np.arange(len(next(iter(columns.values())))) / rate_hz, *columns.values()])
    table += 0.0  # no negative zeros
    form = ",".join(["%.9g", *[f"%.{digits}g"] * len(columns)])
    lines = [",".join(["time", *columns]), *(form % tuple(row) for row in table.tolist())]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def file_name(excitations: tuple[Excitation, ...], set_up: SetUp) -> str:
    """Name a file of records by the point and the order of its first one, without its ending."""
    first = excitations[0]
    if set_up.kind != "hammer":
        return f"records/r_{first.order + 1:02d}"
    stem = f"hits/p{set_up.excited_points[first.point][0]}"
    return f"{stem}_all" if set_up.in_one_file else f"{stem}_{first.order + 1:02d}"


def read_beam(path: Path) -> BeamDrawing:
    """Read the table ``[beam]`` of a model file.

    Parameters
    ----------
    path : Path
        A ``model.toml`` of kind ``beam``.

    Returns
    -------
    BeamDrawing
        What the nominal model knows.
    """
    table = tomllib.loads(path.read_text(encoding="utf-8"))["beam"]
    sections = tuple(
        Section(
            first=entry["elements"][0],
            last=entry["elements"][1],
            width_m=entry.get("width_m", table["width_m"]),
            thickness_m=entry.get("thickness_m", table["thickness_m"]),
        )
        for entry in table.pop("section", [])
    )
    parts = tuple(
        PointPart(**{name.lower(): value for name, value in entry.items()})
        for key in ("point_mass", "point_spring")
        for entry in table.pop(key, [])
    )
    numbers = {key.lower(): value for key, value in table.items()}
    return BeamDrawing(**numbers, sections=sections, parts=parts)


def write_toml(path: Path, text: str) -> None:
    """Write a text file and its folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text.strip() + "\n", encoding="utf-8")


def write_model(folder: Path, specimen: Specimen, nominal_model: NominalModel, damping_ratio: float) -> None:
    """Write ``model.toml``, and the matrices of a model of kind matrices.

    Parameters
    ----------
    folder : Path
        Of the case.
    specimen : Specimen
        What its owner knows.
    nominal_model : NominalModel
        Its matrices.
    damping_ratio : float
        Of all modes.
    """
    drawing = specimen.drawing
    head = f'[model]\nkind = "{specimen.family}"\nname = "{specimen.name}"\n\n'
    head += f"[damping]\nmodal_ratio = {damping_ratio!r}\n\n"
    if isinstance(drawing, BeamDrawing):
        body = _format_beam(drawing)
    elif isinstance(drawing, FrameDrawing):
        body = _format_frame(drawing)
    else:
        body = _write_matrices(folder, nominal_model)
    write_toml(folder / "model.toml", head + body)


def _format_beam(drawing: BeamDrawing) -> str:
    keys = {
        "length_m": drawing.length_m,
        "elements": drawing.elements,
        "formulation": drawing.formulation,
        "youngs_modulus_Pa": drawing.youngs_modulus_pa,
        "density_kg_m3": drawing.density_kg_m3,
        "poisson_ratio": drawing.poisson_ratio,
        "width_m": drawing.width_m,
        "thickness_m": drawing.thickness_m,
        "left": drawing.left,
        "right": drawing.right,
    }
    text = "[beam]\n" + _format_keys(keys)
    for section in drawing.sections:
        text += f"\n[[beam.section]]\nelements = [{section.first}, {section.last}]\n"
        text += _format_keys({"thickness_m": section.thickness_m, "width_m": section.width_m})
    for part in drawing.parts:
        text += "\n[[beam.point_mass]]\n" + _format_keys({"node": part.node, "mass_kg": part.mass_kg})
    return text


def _format_frame(drawing: FrameDrawing) -> str:
    text = f'[lumped]\ndirection = "{drawing.direction}"\n'
    for i, mass in enumerate(drawing.masses_kg):
        text += "\n[[lumped.mass]]\n" + _format_keys({"node": i + 1, "mass_kg": mass})
    for spring in drawing.springs:
        text += f'\n[[lumped.spring]]\nid = "{spring.id}"\nnodes = [{spring.nodes[0]}, {spring.nodes[1]}]\n'
        text += f"stiffness_N_m = {spring.stiffness_n_m!r}\n"
    return text


def _format_keys(keys: dict[str, object]) -> str:
    return "".join(
        f'{key} = "{value}"\n' if isinstance(value, str) else f"{key} = {value!r}\n" for key, value in keys.items()
    )


def _write_matrices(folder: Path, model: NominalModel) -> str:
    folder.mkdir(parents=True, exist_ok=True)
    write_matrix(folder / "M.mtx", model.mass)
    write_matrix(folder / "K.mtx", model.stiffness)
    rows = ["node,direction,x_m,y_m,z_m"]
    for node, direction in model.dofs:
        rows.append(f"{node},{direction}," + ",".join(f"{value:.9g}" for value in model.nodes[node]))
    (folder / "dofs.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    text = '[matrices]\nmass = "M.mtx"\nstiffness = "K.mtx"\ndofs = "dofs.csv"\n'
    for name, (stiffness, mass) in model.groups.items():
        write_matrix(folder / f"K_{name}.mtx", stiffness)
        write_matrix(folder / f"M_{name}.mtx", mass)
        text += f'\n[[matrices.group]]\nname = "{name}"\nstiffness = "K_{name}.mtx"\nmass = "M_{name}.mtx"\n'
    return text


def write_matrix(path: Path, matrix: FloatArray) -> None:
    """Write a symmetric matrix in Matrix Market form, without what is zero to rounding.

    Parameters
    ----------
    path : Path
        The file.
    matrix : (n, n) array
        Symmetric.
    """
    symmetric = (matrix + matrix.T) / 2
    lower = np.tril(np.where(np.abs(symmetric) > 1e-15 * np.abs(symmetric).max(), symmetric, 0.0))
    j, i = np.nonzero(lower.T)
    entries = zip((i + 1).tolist(), (j + 1).tolist(), lower[i, j].tolist(), strict=True)
    lines = ["%%MatrixMarket matrix coordinate real symmetric", f"{len(matrix)} {len(matrix)} {i.size}"]
    lines += [f"{a} {b} {value:.14e}" for a, b, value in entries]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_test(folder: Path, specimen: Specimen, set_up: SetUp) -> None:
    """Write ``test.toml`` and ``pipeline.toml``."""
    direction = specimen.direction

    def dof(node: int, sign: int) -> str:
        return f"{node}:{'+' if sign > 0 else '-'}{direction}"

    text = f'[test]\nname = "{specimen.name}"\nkind = "{set_up.kind}"\n'
    text += f"nominal_damping_ratio = {set_up.damping_ratio!r}\n\n"
    text += '[[channel]]\ncolumn = "force"\nrole = "input"\nquantity = "force"\nunit = "N"\n'
    for sensor in set_up.sensors:
        text += f'\n[[channel]]\ncolumn = "{sensor.column}"\nrole = "output"\nquantity = "{sensor.quantity}"\n'
        text += f'unit = "{sensor.unit}"\ndof = "{dof(sensor.node, sensor.sign)}"\n'
    for node, sign in set_up.excited_points:
        table, pattern = ("hit", f"hits/p{node}_*.csv") if set_up.kind == "hammer" else ("record", "records/r_*.csv")
        text += f'\n[[{table}]]\ndof = "{dof(node, sign)}"\nfiles = ["{pattern}"]\n'
    write_toml(folder / "test.toml", text)
    low, high = set_up.band_hz
    points = ", ".join(f'"{node}:+{direction}"' for node in set_up.points)
    write_toml(
        folder / "pipeline.toml",
        f'[pipeline]\nname = "{specimen.name}"\ntest = "test.toml"\nmodel = "model.toml"\n\n'
        f"[fit]\nband_hz = [{low!r}, {high!r}]\n\n"
        f'[update]\nmethod = "minimal-change"\n\n[predict]\npoints = [{points}]\n',
    )
