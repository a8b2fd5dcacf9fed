"""Change along the structure: a factor on the stiffness of every part of the FE model.

A method that changes the parts gives the factors itself, with the band of its posterior. For one that has changed
the reduced matrices only, the change is read back as the smallest change of the parts that explains it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.late_imports import import_late
from frf_ipz.numerics.pencils import undamped_poles
from frf_ipz.updating.gaussian import linearise, solve_step
from frf_ipz.updating.parameters import make_structural_basis
from frf_ipz.updating.target_noise import TargetNoise

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from frf_ipz.structure import ReducedModel, StructuralModel
    from frf_ipz.updating.regions import Region
    from frf_ipz.updating.updated_model import UpdatedModel
else:
    pd = import_late("pandas")

BAND = (0.05, 0.95)
READ_BACK = 0.02  # of the largest entry of a relative change: the part that parts need not explain
SIGNS = {-1: "softer", 1: "stiffer"}
COLUMNS = (
    "kind",
    "name",
    "nodes",
    "x_m",
    "y_m",
    "z_m",
    "stiffness_ratio",
    "stiffness_ratio_low",
    "stiffness_ratio_high",
)


def change_along_structure(updated: UpdatedModel, fe_model: StructuralModel) -> pd.DataFrame:
    """Tabulate the change of stiffness of every part of the FE model.

    Parameters
    ----------
    updated : UpdatedModel
        The result of an update, by any method.
    fe_model : StructuralModel
        The FE model that was reduced.

    Returns
    -------
    DataFrame
        One row a part: ``kind, name, nodes`` (as text), ``x_m, y_m, z_m`` of its middle, ``stiffness_ratio`` (updated
        over nominal), ``stiffness_ratio_low, stiffness_ratio_high`` (90 % band; NaN where it is read back). Empty for
        a model without parts, and where measured shapes were expanded.
    """
    if len(updated.parts):
        return updated.parts
    if updated.expansion is not None:  # measured shapes are no change of the stiffness
        return pd.DataFrame(columns=COLUMNS)
    basis = make_structural_basis(fe_model, updated.nominal)
    if not basis.regions:
        return pd.DataFrame(columns=COLUMNS)
    changes = _relative_changes(updated.nominal, np.concatenate([basis.stiffness, [_stiffness_change(updated)]]))
    by_parts, change = changes[:-1].T, changes[-1]
    root = np.hstack([term.std * term.root for term in basis.terms])
    size = max(np.abs(change).max(), np.finfo(float).tiny)
    noise = TargetNoise(common=np.zeros((len(change), 0)), blocks=(READ_BACK**2 * np.ones((1, 1)),) * len(change))
    theta = root @ solve_step(linearise([by_parts @ root / size], change / size, noise), np.ones(1)).mean
    return part_table(basis.regions, 1 + theta[: len(basis.regions)])


def part_table(regions: Sequence[Region], ratios: FloatArray, draws: FloatArray | None = None) -> pd.DataFrame:
    """Make the table of `change_along_structure`.

    Parameters
    ----------
    regions : sequence of Region
        The parts.
    ratios : (n,) array
        Stiffness of each, updated over nominal.
    draws : (m, n) array, optional
        The same of models drawn from the posterior.

    Returns
    -------
    DataFrame
        One row a part.
    """
    low, high = np.full((2, len(regions)), np.nan)
    if draws is not None and len(draws):
        low, high = np.quantile(draws, BAND, axis=0)
    positions = np.array([region.coordinates_m for region in regions]).reshape(-1, 3)
    values = (
        [region.kind for region in regions],
        [region.name for region in regions],
        [" ".join(str(node) for node in region.nodes) for region in regions],
        *positions.T,
        ratios,
        low,
        high,
    )
    return pd.DataFrame(dict(zip(COLUMNS, values, strict=True)))


def notable_changes(parts: pd.DataFrame) -> tuple[str, ...]:
    """Describe the segments whose stiffness differs from the model beyond the band, the largest change first.

    Parameters
    ----------
    parts : DataFrame
        From `change_along_structure`.

    Returns
    -------
    tuple of str
        One sentence a segment of neighbouring rows; none where every band holds 1, or there are no bands.
    """
    ratio = parts["stiffness_ratio"].to_numpy(float)
    low, high = parts["stiffness_ratio_low"].to_numpy(float), parts["stiffness_ratio_high"].to_numpy(float)
    sign = np.where(high < 1, -1, np.where(low > 1, 1, 0))
    ends = np.flatnonzero(np.diff(sign)) + 1
    segments = [rows for rows in np.split(np.arange(len(sign)), ends) if len(rows) and sign[rows[0]]]
    segments.sort(key=lambda rows: -np.abs(np.log(ratio[rows])).max())
    return tuple(_sentence(parts, rows, int(sign[rows[0]])) for rows in segments)


def _sentence(parts: pd.DataFrame, rows: np.ndarray, sign: int) -> str:
    ratio = parts["stiffness_ratio"].to_numpy(float)
    largest = parts.iloc[int(rows[np.argmax(np.abs(np.log(ratio[rows])))])]
    first, last = parts.iloc[int(rows[0])], parts.iloc[int(rows[-1])]
    where = f"{first['name']}" if len(rows) == 1 else f"{first['name']} to {last['name']}"
    most = f"most at {largest['name']}: " if len(rows) > 1 else ""
    change, *ends = (
        f"{100 * (largest[name] - 1):+.2g}"
        for name in ("stiffness_ratio", "stiffness_ratio_low", "stiffness_ratio_high")
    )
    return (
        f"{where} (nodes {first['nodes'].split()[0]} to {last['nodes'].split()[-1]}): {SIGNS[sign]} than modelled, "
        f"{most}{change} % (90 %: {ends[0]} to {ends[1]} %)"
    )


def _stiffness_change(updated: UpdatedModel) -> FloatArray:
    change = updated.model.stiffness - updated.nominal.stiffness
    return np.asarray((change + change.T) / 2)


def _relative_changes(model: ReducedModel, matrices: FloatArray) -> FloatArray:
    """Upper triangles of changes, relative to ``omega_i omega_j`` in the model's modes: (n, k)."""
    poles = undamped_poles(model.mass, model.stiffness)
    shapes, squares = poles.right_vectors.real, np.maximum(poles.values.real, 0.0)
    elastic = squares > 1e-9 * squares.max()  # rigid-body modes have no stiffness to be relative to
    scaled = shapes[:, elastic] / np.sqrt(squares[elastic])
    modal = scaled.T @ matrices @ scaled
    return np.asarray(modal[:, *np.triu_indices(modal.shape[1])])
