"""What machines of one kind have in common: mean and covariance of the updated parameters, and models of such machines.

The spread of machines is that of their most probable values and, on top, what each test has left open: the law of total
covariance. The covariance of the values is that of [Chen2010], which few machines already determine: it is shrunk
towards one without correlation by as much as their number asks for.

Models for robust control are drawn with the reduced matrices themselves, which hold all that an update has changed.
Every draw is the mean model, plus a draw from the normal distribution whose covariance is that of the machines'
models, wider by Student's factor where they are few, plus what one machine's test has left open.

[Chen2010] Y. Chen, A. Wiesel, Y. C. Eldar, A. O. Hero, Shrinkage algorithms for MMSE covariance estimation, IEEE
Transactions on Signal Processing 58 (10), 2010, 5016-5029, doi:10.1109/TSP.2010.2053029.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.export.state_space import StateSpaceModel, make_state_space_ensemble

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.export.options import ExportOptions
    from frf_ipz.fleet.machine_record import MachineRecord
    from frf_ipz.runs.results import Results
    from frf_ipz.updating.updated_model import UpdatedModel

FEWEST = 3  # machines: two do not tell how far a third may be
SEED = 0  # of the draws: the same members from the same machines

# Every key of population.json.
JSON_KEYS = {
    "machines": "ids of the machines that it is made of: updated, and not marked as outliers",
    "parameters": "names of the updating parameters that all of them have, as in parameters.parquet",
    "mean": "mean of each over the machines",
    "std": "standard deviation of each over machines, with what the tests leave open",
    "covariance": "covariance matrix, row by row, with what the tests leave open on its diagonal",
    "shrinkage": "0 to 1: how far the covariance over machines was shrunk towards one without correlation",
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Population:
    """Mean and covariance of the updated parameters.

    Parameters
    ----------
    machines : tuple of str
        Those it is made of.
    names : tuple of str
        The parameters.
    mean : (p,) array
        Over the machines.
    covariance : (p, p) array
        Over machines, with what their tests leave open.
    shrinkage : float
        0 to 1.
    """

    machines: tuple[str, ...]
    names: tuple[str, ...]
    mean: FloatArray
    covariance: FloatArray
    shrinkage: float

    @property
    def std(self) -> FloatArray:
        """Standard deviation of each parameter, (p,) array."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    def to_json(self) -> dict[str, Any]:
        """Give the content of ``population.json``.

        Returns
        -------
        dict
            Plain values.
        """
        return {
            "machines": list(self.machines),
            "parameters": list(self.names),
            "mean": self.mean.tolist(),
            "std": self.std.tolist(),
            "covariance": self.covariance.tolist(),
            "shrinkage": self.shrinkage,
        }


def make_population(records: Sequence[MachineRecord]) -> Population:
    """Sum up the updated parameters.

    Parameters
    ----------
    records : sequence of MachineRecord
        Machines of one kind.

    Returns
    -------
    Population
        Of the parameters that all updated machines have; empty for too few machines.
    """
    updated = [record for record in records if record.parameters]
    if len(updated) < FEWEST:
        return Population(machines=(), names=(), mean=np.zeros(0), covariance=np.zeros((0, 0)), shrinkage=0.0)
    names = [name for name in updated[0].parameters if all(name in record.parameters for record in updated)]
    values = np.array([[record.parameters[name][0] for name in names] for record in updated])
    std = np.array([[record.parameters[name][1] for name in names] for record in updated])
    between, shrinkage = shrunk_covariance(values)
    within = np.array(
        [np.mean(column[np.isfinite(column)] ** 2) if np.isfinite(column).any() else 0 for column in std.T]
    )
    return Population(
        machines=tuple(record.machine for record in updated),
        names=tuple(names),
        mean=values.mean(axis=0),
        covariance=between + np.diag(within),
        shrinkage=shrinkage,
    )


def shrunk_covariance(values: FloatArray) -> tuple[FloatArray, float]:
    """Estimate a covariance from few samples, by the oracle approximating shrinkage of [Chen2010], eq. (23).

    The correlations are shrunk, and not the variances: parameters need not be of one size.

    Parameters
    ----------
    values : (n, p) array
        Samples.

    Returns
    -------
    covariance : (p, p) array
        Positive semidefinite.
    shrinkage : float
        0 to 1.

    Examples
    --------
    >>> covariance, shrinkage = shrunk_covariance(np.array([[1.0, 2.0], [2.0, 4.0], [3.0, 6.0], [4.0, 8.5]]))
    >>> 0 < shrinkage < 1, bool(np.linalg.eigvalsh(covariance).min() > 0)
    (True, True)
    """
    n, p = values.shape
    deviations = values - values.mean(axis=0)
    std = deviations.std(axis=0, ddof=1)
    scaled = deviations / np.where(std > 0, std, 1.0)
    correlation = scaled.T @ scaled / (n - 1)
    squared, trace = float(np.sum(correlation**2)), float(np.trace(correlation))
    above = (1 - 2 / p) * squared + trace**2 if p else 0.0
    below = (n + 1 - 2 / p) * (squared - trace**2 / p) if p else 0.0
    shrinkage = 1.0 if below <= 0 else float(np.clip(above / below, 0.0, 1.0))
    shrunk = (1 - shrinkage) * correlation + shrinkage * np.diag(np.diag(correlation))
    return np.asarray(std[:, None] * shrunk * std), shrinkage


def population_models(
    machines: Sequence[Results], *, options: ExportOptions, members: int
) -> tuple[StateSpaceModel, ...]:
    """Draw models of machines of this kind, as state spaces for robust control.

    Parameters
    ----------
    machines : sequence of Results
        Of machines with one and the same reduced model; each is read once.
    options : ExportOptions
        Form of the state spaces.
    members : int
        How many are drawn.

    Returns
    -------
    tuple of StateSpaceModel
        None for too few machines.
    """
    first: Results | None = None
    means, left_open = [], []
    rng = np.random.default_rng(SEED)
    share = -(-members // max(len(machines), 1))
    for results in machines:
        updated = results.updated_model
        if updated is None or results.fit is None or updated.expansion is not None:
            continue  # a model with expanded shapes has modes of its own
        first = first or results
        mean = _matrices(updated)
        means.append(mean)
        drawn = updated.ensemble[:share]  # as many of each machine as the members need
        left_open += [[member - updated.ensemble.mean(axis=0) for member in drawn] or [np.zeros_like(mean)]]
    if first is None or first.updated_model is None or first.fit is None or len(means) < FEWEST:
        return ()
    all_means = np.array(means)
    centre = all_means.mean(axis=0)
    drawn_models = [_draw(rng, all_means - centre, left_open, centre, number) for number in range(members)]
    model = replace(first.updated_model.model, mass=centre[0], damping=centre[1], stiffness=centre[2])
    fleet_model = replace(first.updated_model, model=model, ensemble=np.array(drawn_models))
    return make_state_space_ensemble(
        first.fit, fleet_model, points=first.points, options=replace(options, ensemble=members)
    )


def _matrices(updated: UpdatedModel) -> FloatArray:
    return np.stack([updated.model.mass, updated.model.damping, updated.model.stiffness])


def _draw(
    rng: np.random.Generator, deviations: FloatArray, left_open: list[list[FloatArray]], centre: FloatArray, number: int
) -> FloatArray:
    """Draw mass, damping and stiffness of one more machine."""
    n = len(deviations)
    student = np.sqrt((1 + 1 / n) * (n - 1) / rng.chisquare(n - 1))
    between = np.tensordot(rng.standard_normal(n), deviations, axes=1) / np.sqrt(n - 1)
    tests = left_open[number % n]
    member = centre + student * between + tests[(number // n) % len(tests)]
    return np.stack([_semidefinite(matrix) for matrix in member])


def _semidefinite(matrix: FloatArray) -> FloatArray:
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)
