"""Modes and FRFs in the files of other modal software: CSV, XLSX, and universal files 55, 58 and of geometry.

What the records hold: Universal File Datasets Summary, Structural Dynamics Research Laboratory, University of
Cincinnati. Its numbers have six digits (shapes, frequency lines) and twelve (FRFs).
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import lazy_loader
import numpy as np

from frf_ipz.arguments import as_path, require_type
from frf_ipz.dofs import DIRECTIONS, Dof, node_dofs
from frf_ipz.errors import InputError, did_you_mean
from frf_ipz.export.run_tables import mode_table, pole_table
from frf_ipz.frf import FrfSet
from frf_ipz.identification.modal_fit import ModalFit
from frf_ipz.identification.results.shapes import mode_shapes
from frf_ipz.output_files import cannot_write, replacing, write_text
from frf_ipz.quantities import FrfQuantity

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import pandas as pd

    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.dofs import AnyDof
    from frf_ipz.frf import FrfLabel
    from frf_ipz.structure import Geometry

openpyxl = lazy_loader.load("openpyxl")

MODES_FORMATS = (".csv", ".xlsx", ".unv", ".uff")
FRF_FORMATS = (".unv", ".uff")
END, NONE = f"{-1:6d}", "NONE"
COMPLEX_MODE, COMPLEX_DATA, DISPLACEMENT = 3, 5, 8
FRF_FUNCTION, COHERENCE_FUNCTION = 4, 6
REAL_DOUBLE, COMPLEX_DOUBLE = 4, 6
FREQUENCY, FORCE, GENERAL = 18, 13, 1
MOTIONS = {FrfQuantity.RECEPTANCE: 8, FrfQuantity.MOBILITY: 11, FrfQuantity.ACCELERANCE: 12}
TRANSLATIONS = 3
PEN_UP, NODES_A_LINE = 0, 8  # of trace lines
SHELLS = {3: 91, 4: 94}  # linear thin shells by their corners
EVEN = 1e-6  # of the spacing: the last digit of the step
SHAPE_COLUMNS = [
    "mode",
    "frequency_hz",
    "damping_ratio",
    "frequency_std_hz",
    "damping_ratio_std",
    "dof",
    "real",
    "imag",
]


def write_modes(fit: ModalFit, path: str | Path, *, geometry: Geometry | None = None) -> None:
    """Write natural frequencies, damping ratios and mode shapes for other modal software.

    Parameters
    ----------
    fit : ModalFit
        The fitted model.
    path : str or Path
        ``.csv``: one row a mode and DOF, which ``[[modes]]`` of a test reads; ``.xlsx``: a sheet of modes and one of
        shapes; ``.unv`` or ``.uff``: a data set 55 a mode.
    geometry : Geometry, optional
        Where the nodes are, for universal files: data sets 2411 (nodes), 82 (trace lines) and 2412 (faces, as shells).

    Raises
    ------
    InputError
        If the ending is another, or the file cannot be written.

    Examples
    --------
    >>> import frf_ipz
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> modes = frf_ipz.ModalParameters(
    ...     natural_frequency_hz=[12.5], damping_ratio=[0.02], shapes=[[0.5], [1.0]], dofs=["6:+z", "11:+z"],
    ...     frequency_std_hz=[0.01], damping_ratio_std=[0.001],
    ... )
    >>> with TemporaryDirectory() as folder:
    ...     frf_ipz.write_modes(frf_ipz.fit_modes(modes), Path(folder) / "modes.csv")
    ...     (Path(folder) / "modes.csv").read_text().splitlines()[1].split(",")[-3:]
    ['6:+z', '0.5', '0.0']
    """
    require_type("fit", fit, ModalFit)
    target = _require_format(as_path(path), MODES_FORMATS)
    kind = target.suffix.lower()
    try:
        if kind == ".xlsx":
            _write_workbook(target, {"modes": _mode_rows(fit), "shapes": _shape_rows(fit)})
        elif kind == ".csv":
            with np.printoptions(legacy=False):  # that of a program may shorten numbers
                write_text(target, _shape_rows(fit).to_csv(index=False, lineterminator="\n"))
        else:
            shapes = _shape_lines(fit)
            drawn = [] if geometry is None else [*_units(), *_geometry_lines(geometry, fit)]
            write_text(target, "\n".join([*drawn, *shapes]) + "\n")
    except OSError as error:
        raise cannot_write(target, error) from None


def write_frfs(frfs: FrfSet, path: str | Path) -> None:
    """Write FRFs, and their coherence where it is known, as a universal file for other modal software.

    Parameters
    ----------
    frfs : FrfSet
        The FRFs.
    path : str or Path
        ``.unv`` or ``.uff``: a data set 58 of double precision an FRF, in SI.

    Raises
    ------
    InputError
        If the ending is another, or the file cannot be written.

    Examples
    --------
    >>> import frf_ipz
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> values = np.full((3, 1, 1), 1 - 2j)
    >>> frfs = frf_ipz.FrfSet.from_arrays([1.0, 2.0, 3.0], values, outputs=["2:-x"], inputs=["1:+x"])
    >>> with TemporaryDirectory() as folder:
    ...     frf_ipz.write_frfs(frfs, Path(folder) / "frf.unv")
    ...     frf_ipz.read_frfs(Path(folder) / "frf.unv")
    FrfSet: 1 FRF (accelerance) on 3 lines from 1 to 3 Hz, 2:-x / 1:+x
    """
    require_type("frfs", frfs, FrfSet)
    target = _require_format(as_path(path), FRF_FORMATS)
    lines = ["", *_units()]
    for place, label in enumerate(frfs.labels):
        motion = MOTIONS[label.quantity], label.unit.removesuffix("/N").removesuffix("/(N m)")
        lines += _function(FRF_FUNCTION, label, frfs.frequency_hz, frfs.values[:, place], motion)
        if np.isfinite(frfs.coherence[:, place]).all():
            values = frfs.coherence[:, place]
            lines += _function(COHERENCE_FUNCTION, label, frfs.frequency_hz, values, (GENERAL, NONE))
    try:
        write_text(target, "\n".join(lines[1:]) + "\n")
    except OSError as error:
        raise cannot_write(target, error) from None


def _require_format(path: Path, known: Sequence[str]) -> Path:
    if path.suffix.lower() not in known:
        raise InputError(f"{path}: the ending '{path.suffix}' is no format; {did_you_mean(path.suffix, known)}")
    return path


def _mode_rows(fit: ModalFit) -> pd.DataFrame:
    """One row a mode."""
    poles: pd.DataFrame = pole_table(fit).to_pandas()
    table = poles[["pole_id", "frequency_hz", "damping_ratio", "frequency_std_hz", "damping_ratio_std"]]
    shown = [name for name in ("mpc", "quality", "remarks") if name in fit.modes]
    return table.rename(columns={"pole_id": "mode"}).join(fit.modes[shown].reset_index(drop=True))


def _shape_rows(fit: ModalFit) -> pd.DataFrame:
    """One row a mode and DOF, as `[[modes]]` of a test reads it."""
    table: pd.DataFrame = mode_table(fit).to_pandas()
    names = {"pole_id": "mode", "shape_real": "real", "shape_imag": "imag"}
    shapes = table[[*names, "dof"]].rename(columns=names)
    shapes["dof"] = shapes["dof"].str.replace(":", ":+")
    return shapes.merge(_mode_rows(fit), on="mode")[SHAPE_COLUMNS]


def _write_workbook(path: Path, sheets: dict[str, pd.DataFrame]) -> None:
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, table in sheets.items():
        sheet = book.create_sheet(name)
        sheet.append(list(table.columns))
        for row in table.itertuples(index=False):
            sheet.append([_cell(value) for value in row])
        sheet.freeze_panes = "A2"
    with replacing(path) as target:
        book.save(target)


def _cell(value: object) -> object:
    """Give a value as a workbook holds it: a text as a text, also where it looks like a formula."""
    if isinstance(value, str):
        return f"'{value}" if value.startswith(("=", "+", "-", "@")) else value
    plain = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(plain, float) and not np.isfinite(plain) else plain


def _shape_lines(fit: ModalFit) -> list[str]:
    """Give data sets 55 of complex modes; a DOF without a sensor is 0."""
    modes = mode_shapes(fit)
    width = len(DIRECTIONS) if any(dof.direction.startswith("r") for dof in modes.dofs) else TRANSLATIONS
    dofs = [_at_node(dof) for dof in modes.dofs]
    nodes = list(dict.fromkeys(dof.node for dof in dofs))
    lines: list[str] = []
    for mode, pole in enumerate(fit.model.poles[: fit.n_modes]):
        values = np.zeros((len(nodes), width), complex)
        for dof, value in zip(dofs, modes.shapes[:, mode], strict=True):
            values[nodes.index(dof.node), DIRECTIONS.index(dof.direction)] = value
        hertz = float(modes.natural_frequency_hz[mode])
        lines += [END, f"{55:6d}", "frf_ipz", NONE, NONE, NONE, f"Mode {mode + 1:d} Frequency {hertz:.6g} Hz"]
        lines += [_integers(1, COMPLEX_MODE, 2 if width == TRANSLATIONS else 3, DISPLACEMENT, COMPLEX_DATA, width)]
        modal_a = 2j * pole.imag  # of a mass-normalised mode; modal B is minus that times the pole
        lines += [_integers(2, 6, 1, mode + 1), *_numbers(_parts([pole, modal_a, -modal_a * pole]))]
        for node, row in zip(nodes, values, strict=True):
            lines += [_integers(node), *_numbers(_parts(row))]
        lines.append(END)
    return lines


def _geometry_lines(geometry: Geometry, fit: ModalFit) -> list[str]:
    """Give data sets of nodes in double precision, of lines that no face has, and of faces."""
    mesh = geometry.outline({dof.node for dof in node_dofs(mode_shapes(fit).dofs)})
    lines = [END, f"{2411:6d}"]
    for node, place in zip(mesh.nodes.tolist(), mesh.coordinates_m.tolist(), strict=True):
        lines += [_integers(node, 0, 0, 1), "".join(f"{value:25.16E}" for value in place).replace("E", "D")]
    lines.append(END)
    if len(mesh.lines):
        pen = [number for pair in mesh.lines.tolist() for number in (*pair, PEN_UP)][:-1]
        rows = [_integers(*pen[at : at + NODES_A_LINE]) for at in range(0, len(pen), NODES_A_LINE)]
        lines += [END, f"{82:6d}", _integers(1, len(pen), 1), "frf_ipz", *rows, END]
    if len(mesh.faces):
        lines += [END, f"{2412:6d}"]
        for number, face in enumerate(mesh.faces.tolist(), start=1):
            corners = tuple(dict.fromkeys(face))
            lines += [_integers(number, SHELLS[len(corners)], 1, 1, 1, len(corners)), _integers(*corners)]
        lines.append(END)
    return lines


def _units() -> list[str]:
    """Give a data set 164 for SI: factors of length, force and temperature, and the offset of the latter."""
    factors = [f"{value:25.17E}".replace("E", "D") for value in (1.0, 1.0, 1.0, 273.15)]
    return [END, f"{164:6d}", f"{1:10d}{'SI: m N':<20}{2:10d}", "".join(factors[:3]), factors[3], END]


def _function(
    kind: int, label: FrfLabel, frequency_hz: FloatArray, values: np.ndarray, motion: tuple[int, str]
) -> list[str]:
    """Give a data set 58."""
    steps = np.diff(frequency_hz)
    step = float(np.mean(steps)) if len(steps) else 0.0
    is_even = len(steps) > 0 and bool(np.abs(steps - step).max() < EVEN * step)
    is_complex = kind == FRF_FUNCTION
    dofs = _at_node(label.output_dof), _at_node(label.input_dof)
    ends = "".join(f" {NONE:<10}{dof.node:10d}{_direction(dof):4d}" for dof in dofs)
    start = float(frequency_hz[0])
    return [
        END,
        f"{58:6d}",
        "frf_ipz",
        str(label),
        NONE,
        NONE,
        NONE,
        f"{kind:5d}{0:10d}{0:5d}{0:10d}{ends}",
        f"{COMPLEX_DOUBLE if is_complex else REAL_DOUBLE:10d}{len(frequency_hz):10d}{int(is_even):10d}"
        f"{start if is_even else 0.0:13.5E}{step if is_even else 0.0:13.5E}{0.0:13.5E}",
        _axis(FREQUENCY, "Frequency", "Hz"),
        _axis(*(motion if is_complex else (GENERAL, NONE)), name=label.quantity.value if is_complex else "Coherence"),
        _axis(FORCE if is_complex else GENERAL, "Force", label.unit.rpartition("/")[2].strip("()")),
        _axis(0, NONE, NONE),
        *_values(frequency_hz, values, is_even=is_even, is_complex=is_complex),
        END,
    ]


def _at_node(dof: AnyDof) -> Dof:
    if isinstance(dof, Dof):
        return dof
    raise InputError(
        f"'{dof}' is a port over several DOFs, and a universal file knows nodes only; write modes.csv instead"
    )


def _direction(dof: Dof) -> int:
    return dof.sign * (DIRECTIONS.index(dof.direction) + 1)


def _axis(data_type: int, unit_or_name: str, unit: str = "", *, name: str = "") -> str:
    label, stated = (name, unit_or_name) if name else (unit_or_name, unit)
    return f"{data_type:10d}{0:5d}{0:5d}{0:5d} {label[:20]:<20} {stated[:20]:<20}"


def _values(frequency_hz: FloatArray, values: np.ndarray, *, is_even: bool, is_complex: bool) -> list[str]:
    """Give the numbers of a data set 58; each line has as many values as FORTRAN's format of its kind."""
    columns = _parts(values).reshape(len(values), 2) if is_complex else np.asarray(values)[:, None]
    texts = [[f"{number:20.11E}" for number in row] for row in columns.tolist()]
    if not is_even:
        texts = [[f"{hertz:13.5E}", *row] for hertz, row in zip(frequency_hz.tolist(), texts, strict=True)]
    at_once = 2 if is_even and is_complex else 4 if is_even else 1 if is_complex else 2
    rows = ["".join(row) for row in texts]
    return ["".join(rows[at : at + at_once]) for at in range(0, len(rows), at_once)]


def _parts(values: Sequence[complex] | ComplexArray) -> FloatArray:
    array = np.asarray(values, complex)
    return np.stack([array.real, array.imag], axis=-1).ravel()


def _integers(*values: int) -> str:
    return "".join(f"{value:10d}" for value in values)


def _numbers(values: Iterable[float]) -> list[str]:
    texts = [f"{value:13.5E}" for value in values]
    return ["".join(texts[at : at + 6]) for at in range(0, len(texts), 6)]
