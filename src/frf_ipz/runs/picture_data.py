"""What pictures and pages draw of a run beside its results: the models at the measured points, targets, parts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from frf_ipz.fe.response import compute_frfs
from frf_ipz.updating.targets import Target, target_rows

if TYPE_CHECKING:
    from frf_ipz.arrays import ComplexArray, IntArray
    from frf_ipz.runs.results import Results
    from frf_ipz.structure import ReducedModel

FRFS_SHOWN_AT_FIRST = 6  # the others are a click away


def hidden_frfs(run: Results) -> list[int]:
    """List the measured FRFs that are not shown at first.

    Parameters
    ----------
    run : Results
        The run.

    Returns
    -------
    list of int
        Places among the measured FRFs.
    """
    return list(range(FRFS_SHOWN_AT_FIRST, len(run.labels)))


def fitted_lines(run: Results) -> IntArray:
    """Give the lines of the measured FRFs that were fitted; all of them without a fit.

    Parameters
    ----------
    run : Results
        The run.

    Returns
    -------
    (n_used,) int array
        Places on the frequency axis; empty without a measurement.
    """
    if run.frfs is None:
        return np.zeros(0, int)
    return np.arange(run.frfs.n_lines) if run.fit is None else np.flatnonzero(run.fit.used_lines)


def model_values(run: Results, model: ReducedModel) -> ComplexArray:
    """Compute FRFs of a reduced model at the measured points, on the lines and at the s of the measurement.

    Parameters
    ----------
    run : Results
        The run.
    model : ReducedModel
        Nominal or updated.

    Returns
    -------
    (n_used, n_frfs) complex array
        In the unit of the measurement; empty without one.
    """
    if run.frfs is None:
        return np.zeros((0, 0), complex)
    values = compute_frfs(model, run.frfs.labels, run.frfs.s[fitted_lines(run)])
    updated = run.updated_model
    return values if updated is None else values * updated.scale_of(model).gains(run.frfs.labels)


def update_targets(run: Results) -> list[Target]:
    """List the targets of the update, before and after.

    Parameters
    ----------
    run : Results
        The run.

    Returns
    -------
    list of Target
        Poles first; empty without an update.
    """
    if run.updated_model is None or run.pairs is None:
        return []
    return target_rows(run.updated_model, run.pairs)


def changed_parts(run: Results) -> pd.DataFrame:
    """Give the change of the stiffness of every part of the FE model by the update.

    Parameters
    ----------
    run : Results
        The run.

    Returns
    -------
    DataFrame
        As `UpdatedModel.parts`; empty where that is not known.
    """
    return pd.DataFrame() if run.updated_model is None else run.updated_model.parts
