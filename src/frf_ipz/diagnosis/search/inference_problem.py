"""Everything a search works with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.catalogue.effect import Effect
from frf_ipz.diagnosis.search.fit import Data, Fit
from frf_ipz.diagnosis.search.hypothesis import Cause, Hypothesis, suppose
from frf_ipz.diagnosis.search.map_fit import polish, same_modes

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.measured.transfer_functions import TransferFunctions
    from frf_ipz.diagnosis.physics.nuisance import Nuisance

LAST_STEPS = 90  # along a bent valley many are small


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InferenceProblem:
    """Everything a search works with.

    Parameters
    ----------
    specimen : ModelContext
        What is tested.
    nuisance : Nuisance
        What cannot be known.
    effects : mapping of str to Effect
        What is looked for.
    coarse, middle : TransferFunctions
        Transfer functions far from the axis, and on the way to it.
    data : Data
        Those near the axis, with their errors.
    early : Data
        The same, with larger errors: for first steps.
    thin : Data
        Fewer points near the axis: for a first look at small effects.
    kind : str
        What was looked at: blows of a ``hammer``, ``random`` records from rest, ``running`` ones, or ``frf``.
    """

    specimen: ModelContext
    nuisance: Nuisance
    effects: Mapping[str, Effect]
    coarse: TransferFunctions
    middle: TransferFunctions
    data: Data
    early: Data
    thin: Data
    kind: str

    def suppose(self, causes: tuple[Cause, ...], *, exact: bool = True) -> Hypothesis:
        """Make a hypothesis."""
        return suppose(self.specimen, self.nuisance, causes, exact=exact)

    def fit(self, causes: tuple[Cause, ...], values: FloatArray, *, bar: float = np.inf) -> Fit:
        """Fit causes, from values of their parameters; given up where the cost does not come below a bar."""
        return self.fit_from(self.fit_early(causes, values), bar=bar)

    def fit_early(self, causes: tuple[Cause, ...], values: FloatArray, unknown: FloatArray | None = None) -> Fit:
        """Fit causes with large errors, from values of their parameters, and from some scatter if it is known."""
        return polish(self.suppose(causes), self.early, values, unknown=unknown, iterations=6, tolerance=1.0)

    def fit_from(self, fit: Fit, *, bar: float = np.inf) -> Fit:
        """Fit exactly, from a fit with large errors; given up where the cost does not come below a bar."""
        freely = replace(self.data, is_bounded=False)  # costs no more than with bounds
        near = polish(fit.hypothesis, freely, fit.values, unknown=fit.unknown, iterations=16, bar=bar)
        iterations = 12 if near.cost < bar else 0
        return polish(fit.hypothesis, self.data, near.values, unknown=near.unknown, iterations=iterations, bar=bar)

    def fit_beside(self, hypothesis: Hypothesis, values: FloatArray, base: Fit, *, bar: float = np.inf) -> Fit:
        """Fit a small effect exactly, with the scatter of a fit without it or with that fit's frequencies.

        It is given up where the cost does not come below a bar.
        """
        inside, unknown = self.nearest(hypothesis, (values,), base)
        return polish(hypothesis, self.data, inside, unknown=unknown, iterations=8, tolerance=0.2, bar=bar)

    def nearest(self, hypothesis: Hypothesis, starts: Sequence[FloatArray], fit: Fit) -> tuple[FloatArray, FloatArray]:
        """Choose the start that is nearest to the data, with the scatter of a fit or with its frequencies."""
        inside = [hypothesis.physical(hypothesis.start_at(values)) for values in starts]
        both = [(at, unknown) for at in inside for unknown in (fit.unknown, same_modes(hypothesis, at, fit))]
        return min(both, key=lambda start: self._cost(hypothesis, *start))

    def _cost(self, hypothesis: Hypothesis, values: FloatArray, unknown: FloatArray) -> float:
        white = self.data.misfit(hypothesis.respond(values, unknown, self.data.measured.s))
        pulls, _ = self.nuisance.pulls(unknown)
        return float(white @ white + pulls @ pulls)

    def go_on(self, fit: Fit) -> Fit:
        """Go on with a fit that has not converged."""
        return polish(fit.hypothesis, self.data, fit.values, unknown=fit.unknown, iterations=LAST_STEPS)


def weights_of(measured: TransferFunctions, error: float) -> FloatArray:
    """Weigh squared misfits, line by line.

    Parameters
    ----------
    measured : TransferFunctions
        Transfer functions.
    error : float
        Relative error of the model.

    Returns
    -------
    (n_points, n_frfs) array
        One over the expected square.
    """
    noise = np.array([np.diag(covariance).real for covariance in measured.covariance]).T
    return np.asarray(1 / ((error * measured.size) ** 2 + noise))
