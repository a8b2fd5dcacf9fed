"""How likely a mistake can be at most, for next to nothing: of thousands of places of a sensor few need a closer look.

A mistake that moves a sensor changes the FRFs of that sensor alone. The costs of all others are those of the model as
it stands, and are summed once. Of other mistakes, most do not even bring the frequencies near. What is left out is what
the assignment of modes costs beside the best of each.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.assessment.causes.modal_comparison import cost_of_frequency, cost_of_products, costs_of_absence
from frf_ipz.assessment.causes.places import ExchangedSensors, MisplacedSensors

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.assessment.causes.cause import Cause, Causes, Situation
    from frf_ipz.dofs import AnyDof

PLACES_AT_ONCE = 256


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CostBounds:
    """Costs of the model as it stands, by pair of a measured and a computed mode, and by FRF.

    Parameters
    ----------
    situation : Situation
        Measurement and model.
    rows, columns : (n_pairs,) int array
        Pairs of measured and computed modes that are near in frequency.
    by_frf : (n_pairs, n_frfs) array
        Their costs in each FRF.
    whole : (n_pairs,) array
        With that of the frequency.
    alone : (n_modes,) array
        What a measured mode without a counterpart costs.
    outputs, inputs : tuple of Dof
        Of each FRF, unsigned.
    """

    situation: Situation
    rows: IntArray
    columns: IntArray
    by_frf: FloatArray
    whole: FloatArray
    alone: FloatArray
    outputs: tuple[AnyDof, ...]
    inputs: tuple[AnyDof, ...]

    def largest_logs(self, causes: Causes, *, least: float = -np.inf) -> FloatArray:
        """Give what `log_evidence` of each cause is at most.

        Parameters
        ----------
        causes : Causes
            Of one kind.
        least : float
            What is below it does not matter, and may be said to be minus infinity.

        Returns
        -------
        (n_causes,) array
            By the FRFs of the sensors that are moved, and by the frequencies alone for other kinds.
        """
        prior = -float(np.log(max(len(causes), 1)))
        if isinstance(causes, MisplacedSensors):
            moves = zip(causes.sensors, causes.places, strict=False)
            logs = [self._misplaced(sensor, nodes, least - prior) for sensor, nodes in moves]
            return np.concatenate([*logs, np.zeros(0)]) + prior
        if isinstance(causes, ExchangedSensors):
            return self._exchanged(causes, least - prior) + prior
        every = [causes[number] for number in range(len(causes))]
        return np.array([self._by_frequencies(cause) + cause.log_prior for cause in every])

    def _by_frequencies(self, cause: Cause) -> float:
        """Give what is left where all products of shapes agree."""
        computed = cause.computed or self.situation.computed
        hertz = computed.frequency_hz * cause.frequency_factor
        near, costs = cost_of_frequency(self.situation.measured.frequency_hz, hertz)
        best = np.where(near, costs, np.inf).min(axis=1, initial=np.inf)
        return -float(np.minimum(best, self.alone).sum())

    def _misplaced(self, sensor: AnyDof, places: Sequence[AnyDof], least: float) -> FloatArray:
        frfs = self._frfs_of(sensor)
        kept = self.whole - self.by_frf[:, frfs].sum(axis=1)
        logs = np.full(len(places), -np.inf)
        if -self._least(kept[None])[0] < least:  # wherever it is
            return logs
        for first in range(0, len(places), PLACES_AT_ONCE):
            some = slice(first, first + PLACES_AT_ONCE)
            logs[some] = -self._least(kept + self._costs_at(places[some], frfs))
        return logs

    def _exchanged(self, causes: ExchangedSensors, least: float) -> FloatArray:
        sensors, signs = causes.sensors, causes.signs
        frfs = [self._frfs_of(sensor) for sensor in sensors]
        own = np.array([self.by_frf[:, some].sum(axis=1) for some in frfs]).reshape(len(sensors), len(self.whole))
        logs = np.full(len(causes), -np.inf)
        for start in range(0, len(causes), PLACES_AT_ONCE):
            some = slice(start, start + PLACES_AT_ONCE)
            logs[some] = -self._least(self.whole - own[causes.first[some]] - own[causes.second[some]])
        open_ones = np.flatnonzero(logs >= least)
        logs[logs < least] = -np.inf
        costs = np.tile(self.whole, (len(open_ones), 1))
        ends = causes.first[open_ones], causes.second[open_ones]
        for here, there in (ends, ends[::-1]):
            for number in np.unique(here).tolist():
                mine = np.flatnonzero(here == number)
                others = there[mine]
                gain = signs[number] * signs[others][:, None, None]
                costs[mine] += self._costs_at([sensors[other] for other in others], frfs[number], gain) - own[number]
        logs[open_ones] = -self._least(costs)
        return logs

    def _frfs_of(self, sensor: AnyDof) -> IntArray:
        return np.array([number for number, dof in enumerate(self.outputs) if dof == sensor], np.int64)

    def _costs_at(self, places: Sequence[AnyDof], frfs: IntArray, gain: float | FloatArray = 1.0) -> FloatArray:
        """Costs of some FRFs where their sensor sits elsewhere, (n_places, n_pairs)."""
        shapes = self.situation.computed.shapes
        at_inputs = np.stack([shapes[self.inputs[frf]] for frf in frfs.tolist()], axis=1)
        at_places = np.stack([shapes[place] for place in places])[:, self.columns, None]
        products = at_places * at_inputs[self.columns] * gain
        measured = self.situation.measured
        return np.asarray(
            cost_of_products(
                measured.products[np.ix_(self.rows, frfs)],
                products,
                measured.deviations[np.ix_(self.rows, frfs)],
                np.sqrt(np.mean(np.abs(measured.products) ** 2, axis=1))[self.rows, None],
            ).sum(axis=2)
        )

    def _least(self, costs: FloatArray) -> FloatArray:
        """At least this is what an assignment costs: each mode has its best partner, even if two have the same."""
        best = np.tile(self.alone, (len(costs), 1))
        np.minimum.at(best.T, self.rows, costs.T)
        return np.asarray(best.sum(axis=1))


def bound_costs(situation: Situation) -> CostBounds:
    """Sum the costs of the model as it stands.

    Parameters
    ----------
    situation : Situation
        Measurement and model.

    Returns
    -------
    CostBounds
        By pair of modes and FRF.
    """
    measured, computed = situation.measured, situation.computed
    near, of_frequency = cost_of_frequency(measured.frequency_hz, computed.frequency_hz)
    rows, columns = np.nonzero(near)
    products = computed.products(measured.labels, {}, {})
    by_frf = cost_of_products(
        measured.products[rows],
        products[columns],
        measured.deviations[rows],
        np.sqrt(np.mean(np.abs(measured.products) ** 2, axis=1))[rows, None],
    )
    return CostBounds(
        situation=situation,
        rows=rows,
        columns=columns,
        by_frf=by_frf,
        whole=of_frequency[rows, columns] + by_frf.sum(axis=1),
        alone=costs_of_absence(measured, measured.products),
        outputs=tuple(label.output_dof.unsigned for label in measured.labels),
        inputs=tuple(label.input_dof.unsigned for label in measured.labels),
    )
