"""Files of the controller-ready model and of what robust design needs besides.

The state space as JSON or for MATLAB, members of the posterior, and the uncertainty weight of every output. Nothing is
lost on the way: what is read equals what was written, to the last bit.
"""

from __future__ import annotations

import json
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.arguments import require_file
from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.export.state_space import ARRAYS, NAMES, StateSpaceModel, from_control, matrix_shapes, to_control
from frf_ipz.export.uncertainty import UncertaintyWeights
from frf_ipz.json_files import read_json
from frf_ipz.late_imports import import_late
from frf_ipz.matlab_files import read_matlab
from frf_ipz.output_files import replacing, write_text

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import control
    from scipy.io import savemat
else:
    savemat = import_late("scipy.io", "savemat")


SUFFIXES = (".json", ".mat")
ENSEMBLE = {  # what is different in the file of an ensemble
    "A": "(n_states, n_states, n_members), SI units",
    "B": "(n_states, n_inputs, n_members)",
    "C": "(n_outputs, n_states, n_members)",
    "D": "(n_outputs, n_inputs, n_members)",
}
MOST_MEMORY = 1 << 32  # bytes of a state space as text: some 3000 states


def write_state_space(system: StateSpaceModel | control.StateSpace, path: str | Path) -> None:
    """Write a state space as JSON or for MATLAB.

    Parameters
    ----------
    system : control.StateSpace or StateSpaceModel
        The state space, with the names of its inputs, outputs and states; only the latter has units.
    path : str or Path
        Ends in ``.json`` or ``.mat``.

    Raises
    ------
    InputError
        If it ends in something else, cannot be written, or what is given is no state space.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> lines = np.arange(5, 400.0, 0.5)
    >>> tip, middle = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
    >>> labels = [frf_ipz.FrfLabel(output, tip, frf_ipz.FrfQuantity.ACCELERANCE) for output in (middle, tip)]
    >>> values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=[middle, tip], inputs=[tip], variance=np.full(values.shape, 1e-4)
    ... )
    >>> fit = frf_ipz.fit_modes(frfs)
    >>> reduced_model = frf_ipz.reduce_model(fit, beam, points=["9:+z"])
    >>> updated_model = frf_ipz.update_model(fit, reduced_model)
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> system = frf_ipz.to_state_space(fit, updated_model)
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "statespace.mat"
    ...     frf_ipz.write_state_space(system, path)
    ...     bool((frf_ipz.read_state_space(path).A == system.A).all())
    True
    """
    path = Path(path)
    arrays = system if isinstance(system, StateSpaceModel) else from_control(system)
    values: dict[str, Any] = asdict(arrays)
    with _errors_of_writing(path):
        if _suffix(path) == ".json":
            plain = {name: value.tolist() if name in ARRAYS else value for name, value in values.items()}
            write_text(path, json.dumps(plain, indent=1))
        else:
            notes = np.array(arrays.notes, dtype=object)
            with replacing(path) as target:
                savemat(target, {**values, **_names_for_matlab(arrays), "notes": notes}, appendmat=False)


def read_state_space_arrays(path: str | Path) -> StateSpaceModel:
    """Read what `write_state_space` wrote.

    Parameters
    ----------
    path : str or Path
        Ends in ``.json`` or ``.mat``.

    Returns
    -------
    StateSpaceModel
        Equal to what was written, to the last bit.

    Raises
    ------
    InputError
        If the file is no such state space.
    """
    path = require_file(path)
    values = read_json(path, most_memory=MOST_MEMORY) if _suffix(path) == ".json" else read_matlab(path)
    try:
        names = _names_in(values)
        arrays = {name: np.array(values[name], float).reshape(shape) for name, shape in matrix_shapes(names).items()}
        dt = float(np.squeeze(values["dt"]))
        notes = tuple(str(_text_in(text)) for text in np.ravel(values.get("notes", ())))
    except (KeyError, TypeError, ValueError) as error:
        raise FileFormatError(
            path, f"is no state space written by frf_ipz ({type(error).__name__}: {error}); export it again"
        ) from error
    fields: dict[str, Any] = {**arrays, **names, "dt": dt, "notes": notes}
    return StateSpaceModel(**fields)


def read_state_space(path: str | Path) -> control.StateSpace:
    """Read a state space for python-control.

    Parameters
    ----------
    path : str or Path
        Ends in ``.json`` or ``.mat``.

    Returns
    -------
    control.StateSpace
        With the names of inputs, outputs and states.

    Raises
    ------
    InputError
        If the file is no such state space.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> lines = np.arange(5, 400.0, 0.5)
    >>> tip, middle = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
    >>> labels = [frf_ipz.FrfLabel(output, tip, frf_ipz.FrfQuantity.ACCELERANCE) for output in (middle, tip)]
    >>> values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=[middle, tip], inputs=[tip], variance=np.full(values.shape, 1e-4)
    ... )
    >>> fit = frf_ipz.fit_modes(frfs)
    >>> reduced_model = frf_ipz.reduce_model(fit, beam, points=["9:+z"])
    >>> updated_model = frf_ipz.update_model(fit, reduced_model)
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> system = frf_ipz.to_state_space(fit, updated_model, points=["9:+z"])
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "statespace.json"
    ...     frf_ipz.write_state_space(system, path)
    ...     frf_ipz.read_state_space(path).output_labels
    ['6:+z', '11:+z', '9:+z']
    """
    return to_control(read_state_space_arrays(path))


def write_ensemble(models: Sequence[StateSpaceModel], path: str | Path) -> None:
    """Write members of the posterior for MATLAB and for `read_ensemble`.

    Parameters
    ----------
    models : sequence of StateSpaceModel
        As from `make_state_space_ensemble`: inputs, outputs and states have the same names in all.
    path : str or Path
        A ``.mat`` file. ``A``, ``B``, ``C``, ``D`` have the members on a third axis, as model arrays of MATLAB have;
        names, units and ``dt`` are as in the file of one state space.

    Raises
    ------
    InputError
        If there is no member.
    OSError
        If it cannot be written.
    """
    if not models:
        raise InputError(
            "the update has no ensemble to write; use [update] method = 'minimal-change' with ensemble = 200, or set "
            "[export] ensemble = 0"
        )
    values: dict[str, Any] = {name: np.stack([getattr(model, name) for model in models], axis=-1) for name in ARRAYS}
    with replacing(Path(path)) as target:
        savemat(target, {**values, **_names_for_matlab(models[0]), "dt": models[0].dt}, appendmat=False)


def read_ensemble_arrays(path: str | Path) -> tuple[StateSpaceModel, ...]:
    """Read what `write_ensemble` wrote.

    Parameters
    ----------
    path : str or Path
        A ``.mat`` file.

    Returns
    -------
    tuple of StateSpaceModel
        Equal to what was written, to the last bit.

    Raises
    ------
    InputError
        If the file is no such ensemble.
    """
    path = require_file(path)
    values = read_matlab(path)
    try:
        fields: dict[str, Any] = {**_names_in(values)}
        arrays = {
            name: np.moveaxis(np.array(values[name], float).reshape(*shape, -1), -1, 0)
            for name, shape in matrix_shapes(fields).items()
        }
        fields["dt"] = float(np.squeeze(values["dt"]))
        return tuple(
            StateSpaceModel(**fields, **dict(zip(ARRAYS, member, strict=True)))
            for member in zip(*(arrays[name] for name in ARRAYS), strict=True)
        )
    except (KeyError, TypeError, ValueError) as error:
        raise FileFormatError(
            path, f"is no ensemble written by frf_ipz ({type(error).__name__}: {error}); export it again"
        ) from error


def read_ensemble(path: str | Path) -> list[control.StateSpace]:
    """Read members of the posterior for python-control.

    Parameters
    ----------
    path : str or Path
        A ``.mat`` file.

    Returns
    -------
    list of control.StateSpace
        With the names of inputs, outputs and states.

    Raises
    ------
    InputError
        If the file is no such ensemble.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> lines = np.arange(5, 400.0, 0.5)
    >>> tip, middle = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
    >>> labels = [frf_ipz.FrfLabel(output, tip, frf_ipz.FrfQuantity.ACCELERANCE) for output in (middle, tip)]
    >>> values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=[middle, tip], inputs=[tip], variance=np.full(values.shape, 1e-4)
    ... )
    >>> from tempfile import TemporaryDirectory
    >>> options = {"diagnose": frf_ipz.DiagnoseOptions(run="never"), "export": frf_ipz.ExportOptions(ensemble=3)}
    >>> campaign = frf_ipz.Campaign(frfs, beam, points=["9:+z"], **options)
    >>> with TemporaryDirectory() as folder:
    ...     _ = campaign.run(folder, until="export")
    ...     len(frf_ipz.read_ensemble(f"{folder}/statespace_ensemble.mat"))
    3
    """
    return [to_control(model) for model in read_ensemble_arrays(path)]


def write_uncertainty_weights(weights: UncertaintyWeights, path: str | Path) -> None:
    """Write the multiplicative uncertainty of every output as JSON.

    Parameters
    ----------
    weights : UncertaintyWeights
        The relative errors and the weights that bound them.
    path : str or Path
        A ``.json`` file with the fields of `UncertaintyWeights`.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    values = asdict(weights)
    plain = {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in values.items()}
    write_text(Path(path), json.dumps(plain, indent=1))


def read_uncertainty_weights(path: str | Path) -> UncertaintyWeights:
    """Read what `write_uncertainty_weights` wrote.

    Parameters
    ----------
    path : str or Path
        A ``.json`` file.

    Returns
    -------
    UncertaintyWeights
        Equal to what was written, to the last bit.

    Raises
    ------
    InputError
        If the file holds no such weights.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> lines = np.arange(5, 400.0, 0.5)
    >>> tip, middle = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
    >>> labels = [frf_ipz.FrfLabel(output, tip, frf_ipz.FrfQuantity.ACCELERANCE) for output in (middle, tip)]
    >>> values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=[middle, tip], inputs=[tip], variance=np.full(values.shape, 1e-4)
    ... )
    >>> from tempfile import TemporaryDirectory
    >>> options = {"diagnose": frf_ipz.DiagnoseOptions(run="never"), "export": frf_ipz.ExportOptions(ensemble=3)}
    >>> campaign = frf_ipz.Campaign(frfs, beam, points=["9:+z"], **options)
    >>> with TemporaryDirectory() as folder:
    ...     _ = campaign.run(folder, until="export")
    ...     frf_ipz.read_uncertainty_weights(f"{folder}/uncertainty.json").output_names
    ('6:+z', '11:+z', '9:+z')
    """
    path = require_file(path)
    values = read_json(path)
    try:
        names = tuple(str(name) for name in values.pop("output_names"))
        return UncertaintyWeights(
            output_names=names, **{name: np.array(value, float) for name, value in values.items()}
        )
    except (KeyError, TypeError, ValueError) as error:
        raise FileFormatError(
            path, f"holds no uncertainty weights written by frf_ipz ({type(error).__name__}: {error}); export it again"
        ) from error


def _names_for_matlab(model: StateSpaceModel) -> dict[str, np.ndarray]:
    """Give names and units as cells of MATLAB.

    Parameters
    ----------
    model : StateSpaceModel
        The state space.

    Returns
    -------
    dict of str to array
        One array of texts for each of `NAMES`.
    """
    return {name: np.array(getattr(model, name), dtype=object) for name in NAMES}


def _names_in(values: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    """Read names and units from the content of a JSON or MATLAB file.

    Parameters
    ----------
    values : mapping of str to object
        The content of the file.

    Returns
    -------
    dict of str to tuple of str
        Each of `NAMES`.

    Raises
    ------
    KeyError
        If one is missing.
    """
    return {name: tuple(str(_text_in(text)) for text in np.ravel(values[name])) for name in NAMES}


@contextmanager
def _errors_of_writing(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}") from None


def _suffix(path: Path) -> str:
    if path.suffix not in SUFFIXES:
        raise InputError(f"{path}: a state space is written as .json or .mat; give one of these endings")
    return path.suffix


def _text_in(text: object) -> object:
    """Unwrap a text from a cell of a MATLAB file."""
    return text.item() if isinstance(text, np.ndarray) and text.size else ("" if isinstance(text, np.ndarray) else text)
