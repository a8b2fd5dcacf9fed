"""How likely a mistake can be at most, for next to nothing: of thousands of places of a sensor few need a closer look.

A mistake that moves one sensor changes the FRFs of that sensor alone. The costs of all others are those of the model as
it stands, and are summed once. What is left out is what the assignment of modes costs beside the best of each.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.assessment.causes.modal_comparison import cost_of_frequency, cost_of_products, costs_of_absence

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.assessment.causes.cause import Cause, Situation
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

    def largest_logs(self, causes: Sequence[Cause]) -> FloatArray:
        """Give what `log_evidence` of each cause is at most.

        Parameters
        ----------
        causes : sequence of Cause
            The causes.

        Returns
        -------
        (n_causes,) array
            Infinity for one that changes more than where one sensor sits.
        """
        logs = np.full(len(causes), np.inf)
        places: dict[AnyDof, list[int]] = defaultdict(list)
        for number, cause in enumerate(causes):
            if _moves_sensors_only(cause) and len(cause.moved_outputs) == 1 and np.all(cause.gain == 1):
                places[next(iter(cause.moved_outputs))].append(number)
            elif _moves_sensors_only(cause) and len(cause.moved_outputs) == 2:
                logs[number] = self._exchanged(cause)
        for sensor, numbers in places.items():
            for first in range(0, len(numbers), PLACES_AT_ONCE):
                some = numbers[first : first + PLACES_AT_ONCE]
                moved = [causes[number].moved_outputs[sensor] for number in some]
                frfs = self._frfs_of(sensor)
                kept = self.whole - self.by_frf[:, frfs].sum(axis=1)
                logs[some] = -self._least(kept + self._costs_at(moved, frfs))
        return np.asarray(logs + np.array([cause.log_prior for cause in causes]))

    def _exchanged(self, cause: Cause) -> float:
        costs = self.whole[None].copy()
        for sensor, place in cause.moved_outputs.items():
            frfs = self._frfs_of(sensor)
            gain = cause.gain[frfs] if isinstance(cause.gain, np.ndarray) else cause.gain
            costs += self._costs_at([place], frfs, gain) - self.by_frf[:, frfs].sum(axis=1)
        return -float(self._least(costs)[0])

    def _frfs_of(self, sensor: AnyDof) -> IntArray:
        return np.array([number for number, dof in enumerate(self.outputs) if dof == sensor], np.int64)

    def _costs_at(self, places: Sequence[AnyDof], frfs: IntArray, gain: complex | ComplexArray = 1.0) -> FloatArray:
        """Costs of some FRFs where their sensor sits elsewhere, (n_places, n_pairs)."""
        shapes = self.situation.computed.shapes
        at_inputs = np.stack([shapes[self.inputs[frf]] for frf in frfs.tolist()], axis=1)
        at_places = np.stack([shapes[place] for place in places])[:, self.columns, None]
        products = np.asarray(at_places * at_inputs[self.columns] * gain, np.complex128)
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


def _moves_sensors_only(cause: Cause) -> bool:
    return cause.computed is None and cause.frequency_factor == 1 and not cause.power and not cause.moved_inputs
