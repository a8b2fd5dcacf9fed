"""Pairing with the model after a first update, where that settles which mode is which.

Modes that lie close change places and mix with little change of a model: with the nominal one a measured mode may
have two counterparts, or that of a neighbour. The sure pairs alone bring the model nearer, and with it frequencies and
shapes of the others. Where the measured poles then have other counterparts, or more of them a sure one, the pairs of
that model are targets of a further update, which goes on from there. It is kept if it is nearer to all measured FRFs,
which neither set of targets holds whole.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.pairing.model_roots import model_poles, model_zeros
from frf_ipz.pairing.pair import NO_ROOT, pair_roots, sure_partners
from frf_ipz.pairing.pairs import Pair, Pairs, PairVerdict
from frf_ipz.pairing.poles import measured_amplitudes, pair_poles
from frf_ipz.updating.fall_back import median_deviation_db

if TYPE_CHECKING:
    from collections.abc import Callable

    from frf_ipz.arrays import ComplexArray
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.structure import ReducedModel
    from frf_ipz.updating.problem import UpdateProblem

ROUNDS = 3  # of pairing again: each must bring the model nearer to the FRFs
SAME = 1e-6  # relative distance below which two poles of a model are one


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PairingAgain:
    """Pairs with models that have been updated.

    Parameters
    ----------
    fit : ModalFit
        The fitted model.
    pairs : Pairs
        With the nominal model.
    make_problem : callable
        Gives the targets of some pairs with a model.
    """

    fit: ModalFit
    pairs: Pairs
    make_problem: Callable[[Pairs, ReducedModel], UpdateProblem]

    def with_model(
        self, problem: UpdateProblem, model: ReducedModel, pairs: Pairs, values: ComplexArray
    ) -> tuple[Pairs, UpdateProblem] | None:
        """Pair with an updated model.

        Parameters
        ----------
        problem : UpdateProblem
            Of the update that made the model.
        model : ReducedModel
            The updated model.
        pairs : Pairs
            Whose targets it met.
        values : (n_targets,) complex array
            Where it has them, rad/s.

        Returns
        -------
        tuple of Pairs and UpdateProblem, or None
            Named by the roots of the updated model; None where all measured poles keep their counterparts.
        """
        if self.fit.modes_given is not None or not measured_amplitudes(self.fit)[0].any():
            return None  # poles and zeros without shapes say no more than before
        poles = model_poles(model, self.fit.labels)
        sure = sure_partners(pair_poles(self.fit, poles))
        met = {
            pair.measured: complex(value)
            for pair, value in zip(pairs.targets, values, strict=True)
            if pair.kind == "pole"
        }
        if sure.keys() == met.keys() and all(
            abs(poles.values[sure[mode]] - value) < SAME * abs(value) for mode, value in met.items()
        ):
            return None
        again = pair_roots(self.fit, model)
        if not any(pair.kind == "pole" for pair in again.targets):
            return None
        return again, replace(self.make_problem(again, model), model=problem.model, pair_again=self)

    def deviation_db(self, model: ReducedModel) -> float:
        """Tell how far a model is from the measured FRFs.

        Parameters
        ----------
        model : ReducedModel
            The model.

        Returns
        -------
        float
            dB, as `fall_back` judges it.
        """
        return median_deviation_db(self.fit, model)

    def named_before(self, again: Pairs, nominal: ReducedModel, values: ComplexArray) -> Pairs:
        """Name pairs with an updated model by the roots of the model before.

        Parameters
        ----------
        again : Pairs
            With the updated model.
        nominal : ReducedModel
            Before updating.
        values : (n_targets,) complex array
            Where it has the targets, rad/s.

        Returns
        -------
        Pairs
            Roots that are no targets stand as they were named before.
        """
        roots = [model_poles(nominal, self.fit.labels).values]
        roots += [zeros.values for zeros in model_zeros(nominal, self.fit.labels)]
        target_values = iter(values.tolist())
        before = {(pair.kind, pair.measured): pair for pair in self.pairs.rows if pair.measured >= 0}
        rows = [
            _named(pair, roots[pair.frf + 1], next(target_values))
            if pair.verdict is PairVerdict.PAIRED
            else _as_before(pair, before.get((pair.kind, pair.measured)))
            for pair in again.rows
            if pair.measured >= 0
        ]
        taken = {(pair.frf, pair.computed) for pair in rows if pair.verdict is PairVerdict.PAIRED}
        rows = [
            replace(pair, computed=-1, computed_value=NO_ROOT, distance=float("nan"))
            if pair.verdict is not PairVerdict.PAIRED and (pair.frf, pair.computed) in taken
            else pair
            for pair in rows
        ]
        rows += [pair for pair in self.pairs.rows if pair.measured < 0 and (pair.frf, pair.computed) not in taken]
        return replace(again, rows=tuple(sorted(rows, key=lambda pair: (pair.frf, pair.measured < 0))))


def _named(pair: Pair, roots: ComplexArray, value: complex) -> Pair:
    """Name a pair by the root nearest to a value."""
    nearest = int(np.argmin(np.abs(roots - value)))
    return replace(pair, computed=nearest, computed_value=complex(roots[nearest]))


def _as_before(pair: Pair, before: Pair | None) -> Pair:
    """Name what is no target by the root that it had."""
    if before is None or pair.computed < 0 or before.computed < 0:
        return replace(pair, computed=-1, computed_value=NO_ROOT, distance=float("nan"))
    return replace(pair, computed=before.computed, computed_value=before.computed_value)
