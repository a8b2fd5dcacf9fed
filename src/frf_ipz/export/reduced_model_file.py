"""`updated_model.npz`: the updated model in a file, and a state space that is built from it again.

The matrices are those of the retained DOFs; beside them stand the motions of what was measured or is of interest, and
of all ports, so that a state space may have other inputs and outputs than the one that was exported.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np

from frf_ipz.arguments import require_file, require_type
from frf_ipz.arrays import require_finite
from frf_ipz.dofs import PortDof, as_dofs, parse_label
from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.export.options import ExportOptions
from frf_ipz.export.ports import choose_ports_of_model
from frf_ipz.export.state_space import realise_state_space, to_control
from frf_ipz.numpy_files import read_numpy
from frf_ipz.output_files import replacing
from frf_ipz.structure import ReducedModel

if TYPE_CHECKING:
    from collections.abc import Sequence

    import control

    from frf_ipz.dofs import AnyDof

REDUCED_MODEL = {  # arrays of updated_model.npz
    "M": "(r, r) mass matrix, SI",
    "B": "(r, r) damping matrix, SI",
    "K": "(r, r) stiffness matrix, SI",
    "dofs": "(r,) label of each row: a DOF, or the name of a port",
    "expansion": "(n, r) motion of what was measured, of points of interest and of ports for unit motions of the rows",
    "expanded_dofs": "(n,) label of each row of the expansion",
    "units": "(n,) m, or rad for a port that is an angle; empty for DOFs",
    "rigid": "(r, n_rigid) mass-normalised rigid-body modes",
    "n_modes": "number of modes among the r motions; the others are residual flexibility",
}


def write_reduced_model(model: ReducedModel, path: str | Path, *, dofs: Sequence[AnyDof] = ()) -> None:
    """Write the matrices of a reduced model, and what a state space needs besides.

    Parameters
    ----------
    model : ReducedModel
        The model.
    path : str or Path
        An ``.npz`` file with the arrays of `REDUCED_MODEL`.
    dofs : sequence of Dof or PortDof
        What to keep beside the retained DOFs and the ports.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    wanted = {*model.dofs, *(dof.unsigned for dof in dofs)}
    rows = [row for row, dof in enumerate(model.expanded_dofs) if dof in wanted or isinstance(dof, PortDof)]
    expanded = [model.expanded_dofs[row] for row in rows]
    arrays: dict[str, Any] = {
        "M": model.mass,
        "B": model.damping,
        "K": model.stiffness,
        "dofs": np.array([dof.name for dof in model.dofs]),
        "expansion": model.expansion[rows],
        "expanded_dofs": np.array([dof.name for dof in expanded]),
        "units": np.array([dof.unit if isinstance(dof, PortDof) else "" for dof in expanded]),
        "rigid": model.rigid if model.rigid.size else np.zeros((len(model.dofs), 0)),
        "n_modes": np.array(model.n_modes),
    }
    with replacing(Path(path)) as target, target.open("wb") as stream:
        np.savez(stream, **arrays)


def read_updated_model(path: str | Path) -> ReducedModel:
    """Read the matrices of an updated model.

    Parameters
    ----------
    path : str or Path
        ``updated_model.npz`` of a results folder.

    Returns
    -------
    ReducedModel
        With the rows of what was measured, of points of interest and of ports.

    Raises
    ------
    FileFormatError
        If the file holds no such model.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... ).with_ports([frf_ipz.Port("tip tilt", {"11:z": 20.0, "10:z": -20.0}, "rad")])
    >>> lines = np.arange(5, 400.0, 0.5)
    >>> tip, middle = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
    >>> labels = [frf_ipz.FrfLabel(output, tip, frf_ipz.FrfQuantity.ACCELERANCE) for output in (middle, tip)]
    >>> values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=[middle, tip], inputs=[tip], variance=np.full(values.shape, 1e-4)
    ... )
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     _ = frf_ipz.Campaign(frfs, beam).run(folder, until="export")
    ...     path = f"{folder}/updated_model.npz"
    ...     model = frf_ipz.read_updated_model(path)
    >>> [str(dof) for dof in model.expanded_dofs if dof not in model.dofs]
    ['tip tilt']
    """
    path = require_file(path)
    try:
        content = read_numpy(path, only="").arrays
        arrays = {name: content[name] for name in REDUCED_MODEL}
        rigid = np.asarray(arrays["rigid"], float)
        units = zip(arrays["expanded_dofs"].tolist(), arrays["units"].tolist(), strict=True)
        expanded = tuple(_dof_of(str(name), str(unit)) for name, unit in units)
        known = {dof: dof for dof in expanded}
        matrices = [np.asarray(arrays[name], float) for name in ("M", "B", "K", "expansion")]
        for matrix in (*matrices, rigid):
            require_finite("the model", matrix)
        return ReducedModel(
            mass=matrices[0],
            damping=matrices[1],
            stiffness=matrices[2],
            dofs=tuple(known[parse_label(str(name))] for name in arrays["dofs"].tolist()),
            expansion=matrices[3],
            expanded_dofs=expanded,
            n_modes=int(arrays["n_modes"]),
            rigid=rigid if rigid.shape[1] else np.zeros((0, 0)),
        )
    except (KeyError, ValueError, TypeError, OSError, EOFError, IndexError, BadZipFile) as error:
        raise FileFormatError(
            path, f"holds no updated model as this version writes it ({type(error).__name__}: {error}); run it again"
        ) from error


def _dof_of(name: str, unit: str) -> AnyDof:
    dof = parse_label(name)
    return PortDof(dof.name, 1, unit) if isinstance(dof, PortDof) else dof


def rebuild_state_space(
    path: str | Path,
    *,
    inputs: Sequence[AnyDof | str],
    outputs: Sequence[AnyDof | str],
    options: ExportOptions | None = None,
) -> control.StateSpace:
    """Build a state space from ``updated_model.npz``: with other inputs and outputs, or in another form.

    Gains of a test of unknown scale, delays of channels and members of the posterior are not in that file.

    Parameters
    ----------
    path : str or Path
        ``updated_model.npz`` of a results folder.
    inputs, outputs : sequence of Dof, PortDof, Port or str
        DOFs and ports that were measured, are points of interest, or are defined in the FE model; their signs count.
    options : ExportOptions, optional
        Form of the state space; displacements in continuous time by default.

    Returns
    -------
    control.StateSpace
        SI.

    Raises
    ------
    FileFormatError
        If the file holds no such model.
    InputError
        If it does not know a DOF or a port, or the options do not fit.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... ).with_ports([frf_ipz.Port("tip tilt", {"11:z": 20.0, "10:z": -20.0}, "rad")])
    >>> lines = np.arange(5, 400.0, 0.5)
    >>> tip, middle = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
    >>> labels = [frf_ipz.FrfLabel(output, tip, frf_ipz.FrfQuantity.ACCELERANCE) for output in (middle, tip)]
    >>> values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=[middle, tip], inputs=[tip], variance=np.full(values.shape, 1e-4)
    ... )
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     _ = frf_ipz.Campaign(frfs, beam).run(folder, until="export")
    ...     path = f"{folder}/updated_model.npz"
    ...     system = frf_ipz.rebuild_state_space(path, inputs=["11:z"], outputs=["-tip tilt"])
    >>> system.output_labels, system.input_labels
    (['-tip tilt'], ['11:+z'])
    """
    require_type("options", options, ExportOptions, optional=True)
    model = read_updated_model(path)
    chosen = options or ExportOptions(outputs="displacement")
    if chosen.ports or chosen.inputs or chosen.outputs == "measured":
        raise InputError(
            "the options name ports or inputs, or outputs as they were measured; inputs and outputs are arguments "
            "here, and ExportOptions(outputs=...) says what they measure"
        )
    named = {"inputs": as_dofs(inputs, name="inputs"), "outputs": as_dofs(outputs, name="outputs")}
    for name, dofs in named.items():
        if not dofs:
            raise InputError(f"{name} is empty; name at least one DOF or port")
    ports = choose_ports_of_model(model.expanded_dofs, chosen, **named)
    return to_control(realise_state_space(model, ports, chosen))
