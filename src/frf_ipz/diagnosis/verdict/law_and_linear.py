"""A nonlinear law and a linear effect together: the one is taken out of the recordings, and the other is searched for.

The linear effect goes first where no law explains by itself; the law, where it explains but needs a large nuisance chi2
of the nominal model, or where the linear effect first led to nothing and the law follows the recordings all the same.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.measured.preprocessing.chain_effects import undo_chain_effects
from frf_ipz.diagnosis.measured.preprocessing.dispersion import remove_dispersion
from frf_ipz.diagnosis.model.change import with_change
from frf_ipz.diagnosis.nonlinear.simulate import subtract_law
from frf_ipz.diagnosis.result import DiagnosisVerdict
from frf_ipz.diagnosis.search.component_search import fit_null_model, search_component
from frf_ipz.diagnosis.verdict.decision import log_bayes_factor
from frf_ipz.diagnosis.verdict.findings import is_significant, make_finding, rank_effects
from frf_ipz.diagnosis.verdict.goodness import assess_goodness, required_log_bayes_factor

if TYPE_CHECKING:
    from collections.abc import Callable

    from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem
    from frf_ipz.diagnosis.nonlinear.search import LawSearch
    from frf_ipz.diagnosis.observations import Observations
    from frf_ipz.diagnosis.result import Finding
    from frf_ipz.diagnosis.verdict.decision import Decision
    from frf_ipz.structure import StructuralModel

MAX_COST_LEFT = 1 / 3  # of the linear cost: a law's own traces are not explained so well by one linear effect
MAX_NUISANCE_CHI2 = 10.0  # of a law, per parameter: laws alone need up to 6
MAX_MISFIT = 1.3  # misfit over noise of a law that follows the recordings, whatever the nuisance chi2
MAX_GROWTH = 100.0  # times the largest response: no structure moves so much more without a law
NUISANCE_REDUCTION = 0.5  # times the nuisance chi2: what it must come down to beside a linear effect


def search_beside_linear(
    problem: InferenceProblem,
    linear: Decision,
    alone: LawSearch,
    model: StructuralModel,
    observations: Observations,
    search_laws: Callable[[StructuralModel, Observations], LawSearch],
) -> tuple[LawSearch, Finding] | None:
    """Search for a law beside the linear effect that explains most.

    Parameters
    ----------
    problem : InferenceProblem
        Data, model and linear effects.
    linear : Decision
        Decision of the linear search; where none was made, it is made here.
    alone : LawSearch
        Result of the search for a law with the nominal model.
    model : StructuralModel
        The nominal model.
    observations : Observations
        What was measured.
    search_laws : callable
        From a model and what was measured to a law.

    Returns
    -------
    tuple of LawSearch and Finding, or None
        The law and the linear effect, where two of three hold: the effect explains most of the misfit, the law the
        rest, and beside the effect the law needs no large nuisance chi2. None where less holds, or where a force of
        unknown law explains all.
    """
    if _is_force_alone(alone):
        return None
    null = linear.null
    is_strained = alone.nuisance_chi2 >= MAX_NUISANCE_CHI2
    good_cost = np.inf if is_strained else 0.0  # where it is not, only what explains most of all counts
    ranking = linear.ranking if linear.ranking.fits else search_component(problem, null, good_cost=good_cost)
    best = ranking.best
    is_most = best.cost <= MAX_COST_LEFT * null.cost
    if best is null or not (is_most or is_strained) or not is_significant(best, -1):
        return None
    if (
        log_bayes_factor(best, null) < required_log_bayes_factor(problem, assess_goodness(problem, null))
        or best.hypothesis.components[-1].effect.has_dynamics
    ):
        return None  # resonators and dampers follow the traces of laws
    change = best.hypothesis.change(best.values)
    laws = search_laws(with_change(model, change), undo_chain_effects(observations, change))
    is_reduced = laws.fit is not None and laws.nuisance_chi2 < MAX_NUISANCE_CHI2 and _reduces_nuisance(laws, alone)
    if sum((is_most, laws.verdict == DiagnosisVerdict.EXPLAINED, is_reduced)) < 2:
        return None
    scale = max(1.0, best.mean_misfit)
    return laws, make_finding(rank_effects(ranking.fits, scale)[0], log_bayes_factor(best, null), scale)


def search_beside_law(
    pose_with_observations: Callable[[Observations], InferenceProblem],
    laws: LawSearch,
    model: StructuralModel,
    observations: Observations,
    search_laws: Callable[[StructuralModel, Observations], LawSearch],
) -> tuple[LawSearch, Finding] | None:
    """Search for a linear effect beside a law with a large nuisance chi2, whether it explains by itself or not.

    Parameters
    ----------
    pose_with_observations : callable
        Poses the problem of the nominal model and what was measured.
    laws : LawSearch
        The law that was found with the nominal model.
    model : StructuralModel
        The nominal model.
    observations : Observations
        What was measured.
    search_laws : callable
        From a model and what was measured to a law.

    Returns
    -------
    tuple of LawSearch and Finding, or None
        The law and the linear effect, which both explain; None where its nuisance chi2 was small, where it did
        not even follow the recordings, where no effect reduces it, or where the law explains first moments
        only, with the effect as without it.
    """
    remaining = None if _is_force_alone(laws) else _remove_law(observations, laws)
    if remaining is None:
        return None
    explains, problem = laws.verdict == DiagnosisVerdict.EXPLAINED, pose_with_observations(remaining)
    null = fit_null_model(problem)
    ranking = search_component(problem, null)
    best = ranking.best
    if (
        best is null
        or log_bayes_factor(best, null) < required_log_bayes_factor(problem, assess_goodness(problem, null))
        or not is_significant(best, -1)
    ):
        return None
    follows_traces = best.hypothesis.components[-1].effect.has_dynamics
    if any(best.hypothesis.implausibilities(best.values)) or (follows_traces and not explains):
        return None
    change = best.hypothesis.change(best.values)
    laws_beside = search_laws(with_change(model, change), undo_chain_effects(observations, change))
    if (
        laws_beside.verdict != DiagnosisVerdict.EXPLAINED
        or not _reduces_nuisance(laws_beside, laws)
        or not (explains or laws_beside.nuisance_chi2 < MAX_NUISANCE_CHI2)
    ):
        return None
    if laws.is_early and laws_beside.is_early:  # what the law misses later is no better explained
        return None
    scale = max(1.0, best.mean_misfit)
    return laws_beside, make_finding(rank_effects(ranking.fits, scale)[0], log_bayes_factor(best, null), scale)


def _is_force_alone(laws: LawSearch) -> bool:
    """Say whether a force of unknown law leaves nothing, not even a large nuisance chi2, to a linear effect."""
    force = laws.unknown_force
    return force is not None and force.explains_all and force.nuisance_chi2 < MAX_NUISANCE_CHI2


def _remove_law(observations: Observations, laws: LawSearch) -> Observations | None:
    """Subtract a law of large nuisance chi2; None where it is small, or where the rest is no linear system."""
    if (
        laws.nuisance_chi2 < MAX_NUISANCE_CHI2
        or laws.fit is None
        or laws.nuisance_prior is None
        or len(laws.nuisance_prior.moving)
    ):
        return None
    if laws.verdict != DiagnosisVerdict.EXPLAINED and (laws.after is None or laws.after.training_noise > MAX_MISFIT):
        return None
    with np.errstate(all="ignore"):  # it was fitted to the first moments, and may run away later
        linear = subtract_law(remove_dispersion(observations, laws.dispersion_rad), laws.nuisance_prior, laws.fit)
    sizes = [
        [np.abs(record.responses).max(initial=0.0) for record in pair]
        for pair in zip(linear.records, observations.records, strict=True)
    ]
    runs_away = not all(remaining <= MAX_GROWTH * measured for remaining, measured in sizes)
    return None if runs_away else linear


def _reduces_nuisance(beside: LawSearch, alone: LawSearch) -> bool:
    """Say whether the nuisance chi2 of a law is large, and much smaller beside a linear effect."""
    return alone.nuisance_chi2 >= MAX_NUISANCE_CHI2 and beside.nuisance_chi2 <= NUISANCE_REDUCTION * alone.nuisance_chi2
