"""How likely a mistake can be at most, for next to nothing: of thousands of places of a sensor few need a closer look.

A mistake that moves a sensor changes the FRFs of that sensor alone. The costs of all others are those of the model as
it stands, and are summed once. Of other mistakes, most do not even bring the frequencies near. What is left out is what
the assignment of modes costs beside the best of each.

What a mistake costs in the end is computed in the same way: of the FRFs that it does not change, and of frequencies
that are off by a common factor, the costs are known. So one sensor costs the same however many others there are.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.assessment.causes.cause import log_evidence
from frf_ipz.assessment.causes.modal_comparison import (
    absence_of,
    assigned_log_likelihood,
    cost_of_frequency,
    cost_of_products,
    costs_of_absence,
    log_likelihood,
    visibility,
)
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
    by_output, by_input : dict of Dof to (k,) int array
        The FRFs of each.
    products : (n_computed, n_frfs) array
        Of the model's shapes, 1/kg.
    shapes : (n_modes, n_computed) array
        What all products of shapes cost, of each pair of modes, near or not.
    floor : (n_modes, 1) array
        Size of each measured mode.
    visible : (n_computed, n_frfs) array
        How visible the model's modes are in each FRF.
    log_visible : (n_computed,) array
        Sum over the FRFs of ``log(1 + v^2)``.
    most_visible : (n_computed, n_frfs) int array
        FRFs from that which shows a mode best.
    """

    situation: Situation
    rows: IntArray
    columns: IntArray
    by_frf: FloatArray
    whole: FloatArray
    alone: FloatArray
    outputs: tuple[AnyDof, ...]
    inputs: tuple[AnyDof, ...]
    by_output: dict[AnyDof, IntArray]
    by_input: dict[AnyDof, IntArray]
    products: FloatArray
    shapes: FloatArray
    floor: FloatArray
    visible: FloatArray
    log_visible: FloatArray
    most_visible: IntArray

    def log_evidence(self, cause: Cause) -> float:
        """Give the log evidence of a cause from what is known of the model as it stands.

        Parameters
        ----------
        cause : Cause
            The cause.

        Returns
        -------
        float
            As `cause.log_evidence` has it, to rounding.
        """
        if np.ndim(cause.gain):  # of each FRF its own
            return log_evidence(cause, self.situation)
        frfs = self._changed_frfs(cause)
        changes_all = cause.power != 0 or (cause.gain != 1.0 and cause.gained is None)
        if cause.computed is None and not len(frfs):
            return (self._of_all_frfs(cause) if changes_all else self._of_frequencies(cause)) + cause.log_prior
        is_of_few = 2 * len(frfs) <= len(self.outputs) and cause.frequency_factor == 1.0
        if cause.computed is None and is_of_few and not changes_all:
            return self._of_frfs(cause, frfs) + cause.log_prior
        return log_evidence(cause, self.situation)

    def _changed_frfs(self, cause: Cause) -> IntArray:
        """FRFs of moved sensors and excitations, and of channels with another gain."""
        moved = [self.by_output.get(dof) for dof in cause.moved_outputs]
        moved += [self.by_input.get(dof) for dof in cause.moved_inputs]
        if cause.gained is not None and cause.gain != 1.0:
            moved.append(np.flatnonzero(cause.gained))
        return np.unique(np.concatenate([np.zeros(0, np.int64), *(frfs for frfs in moved if frfs is not None)]))

    def _of_all_frfs(self, cause: Cause) -> float:
        """Log likelihood where a cause changes all FRFs by one factor, and frequencies by another."""
        hertz = self.situation.computed.frequency_hz * cause.frequency_factor
        if cause.power == 0 and not np.iscomplexobj(cause.gain):  # moduli of real numbers cost less
            return log_likelihood(self.situation.measured, hertz, self.products * np.asarray(cause.gain, np.float64))
        factor = np.asarray(cause.gain * (2j * np.pi * hertz[:, None]) ** cause.power, np.complex128)
        return log_likelihood(self.situation.measured, hertz, np.asarray(self.products * factor, np.complex128))

    def _of_frequencies(self, cause: Cause) -> float:
        """Log likelihood where a cause changes frequencies alone, or nothing."""
        measured, hertz = self.situation.measured, self.situation.computed.frequency_hz * cause.frequency_factor
        near, costs = cost_of_frequency(measured.frequency_hz, hertz)
        absent = absence_of(self.log_visible, self._largest(np.zeros(0, np.int64)), len(self.outputs))
        return assigned_log_likelihood(measured, hertz, np.where(near, costs + self.shapes, np.inf), self.alone, absent)

    def _of_frfs(self, cause: Cause, frfs: IntArray) -> float:
        """Log likelihood where a cause changes some FRFs."""
        measured, computed = self.situation.measured, self.situation.computed
        labels = tuple(measured.labels[frf] for frf in frfs.tolist())
        gains = cause.gain if cause.gained is None else np.where(cause.gained[frfs], cause.gain, 1.0)
        products = np.asarray(computed.products(labels, cause.moved_outputs, cause.moved_inputs) * gains, np.complex128)
        own = cost_of_products(
            measured.products[np.ix_(self.rows, frfs)],
            products[self.columns],
            measured.deviations[np.ix_(self.rows, frfs)],
            self.floor[self.rows],
        )
        costs = np.full((len(measured.frequency_hz), len(computed.frequency_hz)), np.inf)
        costs[self.rows, self.columns] = self.whole - self.by_frf[:, frfs].sum(axis=1) + own.sum(axis=1)
        visible = visibility(measured, products, frfs)
        logs = self.log_visible - np.log1p(self.visible[:, frfs] ** 2).sum(axis=1) + np.log1p(visible**2).sum(axis=1)
        absent = absence_of(logs, np.maximum(self._largest(frfs), visible.max(axis=1)), len(self.outputs))
        return assigned_log_likelihood(measured, computed.frequency_hz, costs, self.alone, absent)

    def _largest(self, without: IntArray) -> FloatArray:
        """Largest visibility of each of the model's modes in all FRFs but some."""
        best = self.most_visible[:, : len(without) + 1]
        place = np.argmin(np.isin(best, without), axis=1)
        return np.asarray(self.visible[np.arange(len(best)), best[np.arange(len(best)), place]])

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
        return self.by_output.get(sensor, np.zeros(0, np.int64))

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
                self.floor[self.rows],
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
    floor = np.sqrt(np.mean(np.abs(measured.products) ** 2, axis=1))[:, None]
    by_frf = cost_of_products(measured.products[rows], products[columns], measured.deviations[rows], floor[rows])
    modes = list(zip(measured.products, measured.deviations, floor, strict=True))
    visible = visibility(measured, products)
    outputs = tuple(label.output_dof.unsigned for label in measured.labels)
    inputs = tuple(label.input_dof.unsigned for label in measured.labels)
    return CostBounds(
        situation=situation,
        rows=rows,
        columns=columns,
        by_frf=by_frf,
        whole=of_frequency[rows, columns] + by_frf.sum(axis=1),
        alone=costs_of_absence(measured, measured.products),
        outputs=outputs,
        inputs=inputs,
        by_output=_places(outputs),
        by_input=_places(inputs),
        products=products,
        shapes=np.stack(
            [cost_of_products(mode, products, deviations, size).sum(1) for mode, deviations, size in modes]
        ),
        floor=floor,
        visible=visible,
        log_visible=np.log1p(visible**2).sum(axis=1),
        most_visible=np.argsort(-visible, axis=1, kind="stable"),
    )


def _places(ends: tuple[AnyDof, ...]) -> dict[AnyDof, IntArray]:
    """Which FRFs have a DOF at one of their ends."""
    found: dict[AnyDof, list[int]] = defaultdict(list)
    for number, end in enumerate(ends):
        found[end].append(number)
    return {end: np.array(numbers, np.int64) for end, numbers in found.items()}
