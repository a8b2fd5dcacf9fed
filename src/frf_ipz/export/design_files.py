"""Files for robust design: members of the posterior, and how far each output may be from its model.

Sits after updating, beside the state space of the updated model itself.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.io import loadmat, savemat

from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.export.state_space import ARRAYS, StateSpaceModel, shapes, to_control
from frf_ipz.export.state_space_files import UNREADABLE, names_for_matlab, names_in
from frf_ipz.export.uncertainty import UncertaintyWeights

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import control


def save_ensemble(models: Sequence[StateSpaceModel], path: Path) -> None:
    """Write members of the posterior for MATLAB and for `load_ensemble`.

    Parameters
    ----------
    models : sequence of StateSpaceModel
        As from `to_ensemble`: inputs, outputs and states have the same names in all.
    path : Path
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
    savemat(path, {**values, **names_for_matlab(models[0]), "dt": models[0].dt})


def read_ensemble(path: Path) -> tuple[StateSpaceModel, ...]:
    """Read what `save_ensemble` wrote.

    Parameters
    ----------
    path : Path
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
    try:
        values = loadmat(path)
        fields: dict[str, Any] = {**names_in(values)}
        arrays = {
            name: np.moveaxis(np.array(values[name], float).reshape(*shape, -1), -1, 0)
            for name, shape in shapes(fields).items()
        }
        fields["dt"] = float(np.squeeze(values["dt"]))
        return tuple(
            StateSpaceModel(**fields, **dict(zip(ARRAYS, member, strict=True)))
            for member in zip(*(arrays[name] for name in ARRAYS), strict=True)
        )
    except (*UNREADABLE, KeyError, TypeError, ValueError) as error:
        raise FileFormatError(
            path, f"is no ensemble written by frf_ipz ({type(error).__name__}: {error}); export it again"
        ) from error


def load_ensemble(path: Path) -> list[control.StateSpace]:
    """Read members of the posterior for python-control.

    Parameters
    ----------
    path : Path
        A ``.mat`` file.

    Returns
    -------
    list of control.StateSpace
        With the names of inputs, outputs and states.

    Raises
    ------
    InputError
        If the file is no such ensemble.
    """
    return [to_control(model) for model in read_ensemble(path)]


def save_weights(weights: UncertaintyWeights, path: Path) -> None:
    """Write the multiplicative uncertainty of every output as JSON.

    Parameters
    ----------
    weights : UncertaintyWeights
        The relative errors and the weights that bound them.
    path : Path
        A ``.json`` file with the fields of `UncertaintyWeights`.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    values = asdict(weights)
    plain = {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in values.items()}
    path.write_text(json.dumps(plain, indent=1), encoding="utf-8")


def read_weights(path: Path) -> UncertaintyWeights:
    """Read what `save_weights` wrote.

    Parameters
    ----------
    path : Path
        A ``.json`` file.

    Returns
    -------
    UncertaintyWeights
        Equal to what was written, to the last bit.

    Raises
    ------
    InputError
        If the file holds no such weights.
    """
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
        names = tuple(str(name) for name in values.pop("output_names"))
        return UncertaintyWeights(
            output_names=names, **{name: np.array(value, float) for name, value in values.items()}
        )
    except (KeyError, TypeError, ValueError) as error:
        raise FileFormatError(
            path, f"holds no uncertainty weights written by frf_ipz ({type(error).__name__}: {error}); export it again"
        ) from error
