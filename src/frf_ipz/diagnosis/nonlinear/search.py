"""Search for a nonlinear law: is the structure linear, and if not, which law acts where, and how well it explains.

The records of all levels come first (`assess_linearity`). If no linear system explains them, every law is tried at
every location on the first part of each impact, or on segments of a shaker's records. Records held out take no part.

Log evidence is half the drop of the weighted sum of squares against the linear model with its tolerances, less the
Occam factor of the law. A law is needed if it explains how records of different levels disagree, which nothing linear
can (`nonlinear_evidence`). If none does, the force is localised without a law: where any force would explain it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.deadline import NO_LIMIT, Deadline
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.measured.preprocessing.dispersion import excess_delay_s
from frf_ipz.diagnosis.nonlinear.channel_noise import read_noise
from frf_ipz.diagnosis.nonlinear.findings import is_determined, log_evidence_gains, make_findings
from frf_ipz.diagnosis.nonlinear.fitting.candidates import FRESH_STEPS, find_candidates, is_explained
from frf_ipz.diagnosis.nonlinear.fitting.force_localisation import INDISTINGUISHABLE
from frf_ipz.diagnosis.nonlinear.fitting.output_error_fit import gain_of_added_forces
from frf_ipz.diagnosis.nonlinear.fitting.problem import FINE, ROUGH, WEAK, LawFitData
from frf_ipz.diagnosis.nonlinear.fitting.rescoring import rescore, select_contenders
from frf_ipz.diagnosis.nonlinear.fitting.simple_laws import (
    MANY_ROUNDS,
    SimpleLawsFit,
    fit_simple_laws,
    locate_unknown_law,
    simple_forces,
)
from frf_ipz.diagnosis.nonlinear.fitting.time_steps import resolve_in_time
from frf_ipz.diagnosis.nonlinear.law_in_time import simulate_law_in_time
from frf_ipz.diagnosis.nonlinear.laws.finder import select_laws
from frf_ipz.diagnosis.nonlinear.linearity import Linearity, assess_linearity
from frf_ipz.diagnosis.nonlinear.model.modal_model import make_modal_model
from frf_ipz.diagnosis.nonlinear.nonlinear_evidence import assess_agreement
from frf_ipz.diagnosis.nonlinear.predictive_check import compare_misfits, describe_working_range, relative_misfit
from frf_ipz.diagnosis.result import DiagnosisVerdict, describe_location_set
from frf_ipz.progress import silent

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.nonlinear.fitting.alternating_fit import LawFit
    from frf_ipz.diagnosis.nonlinear.fitting.problem import LawFitProblem
    from frf_ipz.diagnosis.nonlinear.laws.law import Law
    from frf_ipz.diagnosis.nonlinear.model.modal_model import ModalModel
    from frf_ipz.diagnosis.nonlinear.model.nuisance_prior import NuisancePrior
    from frf_ipz.diagnosis.nonlinear.nonlinear_evidence import Agreement
    from frf_ipz.diagnosis.observations import Observations
    from frf_ipz.diagnosis.options import DiagnoseOptions
    from frf_ipz.diagnosis.result import Finding, LawInTime, Misfit
    from frf_ipz.progress import Progress
    from frf_ipz.structure import StructuralModel

DISAGREE = "Weak and strong records disagree"
FIRST_PERIODS = 40.0  # of the top of the band: length of segments from which a rough start leads to a strong law
MIN_RECORDS = 3  # of an excited point: one of them is held out
MAX_MEAN_MISFIT = 1.5  # mean square over the expected one, of a law that explains the records
CLOSE = 0.01  # or so much of the response: a location that sticks makes modes of its own, whose errors count as well
CLOSE_MOVING = 0.015  # the same where segments start in motion: their initial state is fitted in the first modes only
MAX_DISAGREEMENT = 9.0  # mean square of the disagreement of records beside the law, over the expected one
MAX_SHAPE_EVIDENCE = 250.0  # log evidence that other forces at the location of a law may gain
ERROR_PARTS = 0.1, 0.01  # of a law's cost, and of its drop of the cost: gain of other forces by errors of the model
ERROR_PARTS_MOVING = 0.33, 0.05  # the same where segments start in motion: right laws leave up to 0.25
NEAR_BEST, MAX_NEAR_BEST = 5.0, 4  # times the smallest cost: laws whose locations an unknown one may share; how many
SMALL_GAIN = 0.5  # of the cost: up to there, the gain of other forces may be linearised
LESS_CERTAIN = 0.7  # of the cost of a fitted sum of simple laws: what a linearised gain must fall below
NEARLY_ALL_OF_RESPONSE = 0.02  # or so much of the response is left
NOISY_MISFIT = 0.1  # of the response: with more, noise hides how another law differs, and any gain is too much
MIN_LOG_BAYES_FACTOR = 65.0  # of a law against the linear model, and beyond anything linear
WEAK_EVIDENCE = 2000.0  # log evidence below which the model's errors may hide the location of a law
FIRST_EXPLAINED = 1.0  # mean misfit of the first moments that leaves nothing to explain, where later ones do not
LOCATED, HALVED = 4.0, 0.5  # mean misfit, and part of the linear model's, that an unknown law at its location leaves
MOSTLY = 0.05  # or so much of the linear model's: simple forces then have the wrong law, not the wrong location
LARGELY = 0.2  # or so much, where a free force there would leave no more than expected
NEARLY_ALL = 0.05  # of the linear model's cost of first moments: a law that leaves no more explains them
WITHOUT_DISPERSION = 0.9  # of the cost: what a law may leave where a dispersion of the converters is credible
LATER = 2.0**0.5, 2.0  # times as long as short segments: first moments by which a law may be recognised better


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LawSearch:
    """Result of the search for a nonlinear law.

    Parameters
    ----------
    verdict : DiagnosisVerdict
        ``consistent`` (with one linear system), ``explained`` (by the first finding) or ``unexplained`` (not linear,
        and no law explains it).
    linearity : Linearity
        Test of the records without a model.
    findings : tuple of Finding
        The best location of each law, the most probable first; empty for a linear system.
    nonlinear_evidence : float
        Log evidence of the first finding beyond anything linear; NaN where segments start in motion.
    before, updated, after : Misfit
        Of the nominal model, of the same with its tolerances, and with the first finding.
    statement : str
        The verdict in a sentence or two.
    modal_model : ModalModel, optional
        The structure that the law acts on; None for a linear system, as what follows.
    fit : LawFit, optional
        The best law at its location.
    nuisance_prior : NuisancePrior, optional
        That it was fitted with; `simulate` needs it.
    location : Location
        Where a force of unknown law acts, as in `diagnosis.json`; empty where that was not searched or not found.
    unknown_force : SimpleLawsFit, optional
        The best force of unknown law, where no law explains.
    dispersion_rad : float
        Dispersion of the converters that was removed before the law was fitted, see `remove_dispersion`; rad.
    is_early : bool
        The law explains first moments only: its later misfit grows from small errors of the model.
    law_in_time : LawInTime, optional
        The best law in time, for a figure.
    """

    verdict: DiagnosisVerdict
    linearity: Linearity
    findings: tuple[Finding, ...] = ()
    nonlinear_evidence: float = np.nan
    before: Misfit | None = None
    updated: Misfit | None = None
    after: Misfit | None = None
    statement: str = ""
    modal_model: ModalModel | None = None
    fit: LawFit | None = None
    nuisance_prior: NuisancePrior | None = None
    location: Location = field(default_factory=Location)
    unknown_force: SimpleLawsFit | None = None
    dispersion_rad: float = 0.0
    is_early: bool = False
    law_in_time: LawInTime | None = None

    @property
    def is_nonlinear(self) -> bool:
        """No linear system explains the records."""
        return self.verdict != DiagnosisVerdict.CONSISTENT

    @property
    def nuisance_chi2(self) -> float:
        """Mean square of the structure's nuisance parameters, in prior standard deviations; 0 without a law."""
        if self.fit is None or self.nuisance_prior is None:
            return 0.0
        return float(np.mean(self.fit.nuisance[: self.nuisance_prior.n_structural] ** 2))


def search_laws(
    model: StructuralModel,
    observations: Observations,
    options: DiagnoseOptions,
    *,
    laws: Sequence[Law] | None = None,
    progress: Progress = silent,
    linearity: Linearity | None = None,
    deadline: Deadline = NO_LIMIT,
) -> LawSearch:
    """Find the nonlinear law that explains records of different levels, and its location.

    Parameters
    ----------
    model : StructuralModel
        The nominal FE model, with damping.
    observations : Observations
        Records of different levels; they need not start at rest.
    options : DiagnoseOptions
        Tolerances, and which effects may be missing.
    laws : sequence of Law, optional
        What is searched for; the shipped laws that the options ask for where it is left out.
    progress : Progress
        Called with the part that is done.
    linearity : Linearity, optional
        Result of `assess_linearity` for the records, where it is known already.
    deadline : Deadline
        When no further law is tried.

    Returns
    -------
    LawSearch
        Verdict, findings and predictive check.

    Raises
    ------
    InputError
        If the model lacks a DOF that was measured, records differ in their sampling rate, or a law is not known.
    DeadlineError
        If the time was over before all was tried.
    """
    progress(0.0, "comparing weak and strong records")
    linearity = assess_linearity(observations) if linearity is None else linearity
    if not linearity.is_nonlinear:
        return LawSearch(
            verdict=DiagnosisVerdict.CONSISTENT,
            linearity=linearity,
            statement="Records of all levels agree with one linear system.",
        )
    laws = tuple(select_laws(options) if laws is None else laws)
    if not laws:
        return LawSearch(
            verdict=DiagnosisVerdict.UNEXPLAINED, linearity=linearity, statement=f"{DISAGREE}; no law was searched for."
        )
    progress(0.1, "searching for a nonlinear law")
    training, held_out = _hold_out(observations)
    modal_model, noise = make_modal_model(model, observations), read_noise(observations)
    data = LawFitData(
        training=training, held_out=held_out, modal_model=modal_model, noise=noise, options=options, deadline=deadline
    )
    state = _search_catalogue(data, linearity, laws)
    located = None
    if state.result.verdict == DiagnosisVerdict.UNEXPLAINED:
        progress(0.4, "locating a force of unknown law")
        located = _locate_unknown_force(state)
    fit = state.result.fit
    if fit is not None and not (is_explained(fit) if located is None else located.explains_all):
        progress(0.6, "checking for a dispersion of the converters")
        corrected = _search_without_dispersion(state, linearity, laws)
        if corrected is not state and corrected.result.verdict == DiagnosisVerdict.UNEXPLAINED:
            located = _locate_unknown_force(corrected)
        state = corrected
    result = state.result
    if located is not None and result.verdict == DiagnosisVerdict.UNEXPLAINED:
        part = LARGELY if _free_force_explains(state.long, located.location) else MOSTLY
        result = replace(_with_location(result, modal_model, located, part), unknown_force=located)
    if result.fit is None:
        return result
    progress(0.9, "checking the prediction of held-out records")
    before, updated, after = compare_misfits(state.long, state.data.held_out_segments(state.long), result.fit)
    return replace(
        result,
        nuisance_prior=state.long.linear.nuisance_prior,
        before=before,
        updated=updated,
        after=after,
        law_in_time=simulate_law_in_time(state.data, state.long, result.fit),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _SearchState:
    """Data, problems, all fits, the gain of other forces at the location of a fit, and the result."""

    data: LawFitData
    short: LawFitProblem
    long: LawFitProblem
    fits: list[LawFit]
    gain_of_others: Callable[[LawFit], float]
    result: LawSearch


def _search_catalogue(data: LawFitData, linearity: Linearity, laws: Sequence[Law]) -> _SearchState:
    """Try every law at every location, and judge the best."""
    short, long = data.make_problems()

    def make_problem(duration_s: float, floor: float) -> LawFitProblem:
        problem = data.make_problem(duration_s, floor, loudest=False).with_steps(long.segments.steps_per_sample)
        return replace(problem, localisation=long.localisation)

    is_strong = short.mean_misfit > WEAK
    first = partial(make_problem, FIRST_PERIODS / data.training.band_hz[1], ROUGH) if is_strong else None
    fits: list[LawFit] | None = None
    while fits is None:
        short = short.with_steps(long.segments.steps_per_sample)
        long, fits = resolve_in_time(long, find_candidates(short, long, laws, first=first))
    gain_of_others = cache(partial(_gain_of_other_forces, long))
    judge = partial(_judge, long, linearity, data.modal_model, fits, gain_of_others)
    result = replace(judge(), dispersion_rad=data.dispersion_rad)
    later = [times * short.duration_s for times in LATER if times * short.duration_s < long.duration_s]
    in_steps = short.with_steps(long.segments.steps_per_sample)
    first_moments = chain([in_steps], (make_problem(duration, FINE) for duration in later))
    if (
        result.fit is not None
        and result.verdict == DiagnosisVerdict.UNEXPLAINED
        and _explains_first_moments(first_moments, result.fit)
    ):
        early = "It explains their first moments; its later misfit grows from small errors of the model."
        result = replace(judge(always_rescores=True), dispersion_rad=data.dispersion_rad)
        statement = f"{result.findings[0].statement} {early}"
        result = replace(result, verdict=DiagnosisVerdict.EXPLAINED, is_early=True, statement=statement)
    return _SearchState(data=data, short=short, long=long, fits=fits, gain_of_others=gain_of_others, result=result)


def _search_without_dispersion(state: _SearchState, linearity: Linearity, laws: Sequence[Law]) -> _SearchState:
    """Search once more without the dispersion of the converters, where a law explains more without it."""
    fit = state.result.fit
    dispersion = 0.0 if fit is None else state.data.best_dispersion(state.long, fit)
    if fit is None or not dispersion:
        return state
    corrected = _search_catalogue(state.data.without_dispersion(dispersion), linearity, laws)
    better = corrected.result.fit
    if better is None or better.cost > WITHOUT_DISPERSION * fit.cost:
        return state
    if 0.5 * (fit.cost - better.cost) / max(1.0, better.cost / better.n_rows) < MIN_LOG_BAYES_FACTOR:
        return state
    late = excess_delay_s(dispersion, state.data.training.band_hz[1], state.long.segments.step_s)
    remark = f"The converters delay the top of the band by {late:.2g} s more than low frequencies, which was corrected."
    return replace(corrected, result=replace(corrected.result, statement=f"{corrected.result.statement} {remark}"))


def _locate_unknown_force(state: _SearchState) -> SimpleLawsFit:
    """Locate an unknown law: where simple forces alone explain most, or where they do beside a law."""
    short, long, fits, gain_of_others = state.short, state.long, state.fits, state.gain_of_others
    near_best = [
        fit for fit in fits if fit.cost < NEAR_BEST * fits[0].cost and fit.location in long.localisation.equivalent
    ][:MAX_NEAR_BEST]
    small = [fit for fit in near_best if gain_of_others(fit) < SMALL_GAIN * fit.cost]
    beside_law = [
        SimpleLawsFit.of_problem(long, fit.location, fit.cost - gain_of_others(fit), fit.nuisance) for fit in small
    ]
    of_each_law = {fit.law.name: fit.location for fit in reversed(fits)}
    alone, by_first_moments = locate_unknown_law(short, long, of_each_law.values())
    best = min(
        (fit for fit in beside_law if fit.cost < LESS_CERTAIN * alone.cost), key=lambda fit: fit.cost, default=alone
    )
    is_located = best.mean_misfit < LOCATED or _free_force_explains(long, best.location)
    if is_located or by_first_moments.mean_misfit > FIRST_EXPLAINED:
        return best
    early = fit_simple_laws(short, best.location, MANY_ROUNDS)
    return early if early.cost < by_first_moments.cost + INDISTINGUISHABLE else by_first_moments


def _free_force_explains(problem: LawFitProblem, location: int) -> bool:
    """Tell whether a free force at a location explains what nothing linear does."""
    least = min((free.cost for free in problem.localisation.forces if free.location == location), default=np.inf)
    return least < min(problem.linear.n_rows, HALVED * problem.linear.cost)


def _gain_of_other_forces(problem: LawFitProblem, fit: LawFit) -> float:
    """Drop of the cost by simple forces beside a law at its location."""
    return gain_of_added_forces(
        problem.segments, problem.linear.nuisance_prior, fit.start(), simple_forces, known=fit.simulation
    )


def _with_location(result: LawSearch, modal_model: ModalModel, located: SimpleLawsFit, part: float) -> LawSearch:
    """Add the location of an unknown law, if a force at one location explains most of what a linear system does not."""
    misfit = located.mean_misfit
    if misfit > max(min(LOCATED, HALVED * located.linear_mean_misfit), part * located.linear_mean_misfit):
        return result
    where = modal_model.describe_location(located.location)
    remark = f"A force of another law at {where} would: it leaves {np.sqrt(misfit):.2g} times the expected misfit."
    doubt = describe_location_set([modal_model.locations[i] for i in located.ambiguity_set])
    return replace(
        result, location=modal_model.locations[located.location], statement=f"{result.statement} {remark}{doubt}"
    )


def _hold_out(observations: Observations) -> tuple[Observations, Observations]:
    """Hold out one impact of each excited point that has enough: the second strongest, between other levels."""
    held_out = []
    if observations.kind == "hammer":
        groups = [observations.records_at(dof) for dof in observations.input_dofs]
        held_out = [group[1] for group in groups if len(group) >= MIN_RECORDS]
    training = tuple(record for record in observations.records if not any(record is held for held in held_out))
    return replace(observations, records=training), replace(observations, records=tuple(held_out))


def _judge(
    problem: LawFitProblem,
    linearity: Linearity,
    modal_model: ModalModel,
    fits: list[LawFit],
    gain_of_others: Callable[[LawFit], float],
    *,
    always_rescores: bool = False,
) -> LawSearch:
    """Judge the best of fits; those that explain equally well are rescored where one of them may explain all."""
    if not fits:
        return LawSearch(
            verdict=DiagnosisVerdict.UNEXPLAINED,
            linearity=linearity,
            modal_model=modal_model,
            statement=f"{DISAGREE}; no law explains it.",
        )
    fits, drops = _rank(problem, fits, gain_of_others, always_rescores=always_rescores)
    best = fits[0]
    scale = max(1.0, best.cost / best.n_rows)
    gains = log_evidence_gains(fits, drops / scale, len(modal_model.locations), scale)
    weights = np.exp(gains - gains.max())
    findings = make_findings(modal_model, fits, gains, weights / weights.sum(), scale)
    agreement = assess_agreement(problem.segments, problem.linear.nuisance_prior, best)
    objection = _find_objection(problem, best, agreement, float(gains[0]), gain_of_others)
    if objection:
        effect = findings[0].effect
        statement = f"{DISAGREE}, and no law of the catalogue explains how: the best one ({effect}) {objection}."
    else:
        statement = f"{findings[0].statement} {describe_working_range(best, modal_model)}"
    return LawSearch(
        verdict=DiagnosisVerdict.UNEXPLAINED if objection else DiagnosisVerdict.EXPLAINED,
        linearity=linearity,
        findings=findings,
        nonlinear_evidence=agreement.gain,
        statement=statement,
        modal_model=modal_model,
        fit=best,
    )


def _rank(
    problem: LawFitProblem, fits: list[LawFit], gain_of_others: Callable[[LawFit], float], *, always_rescores: bool
) -> tuple[list[LawFit], FloatArray]:
    """Order fits by their evidence, and give it: half the drop of the cost.

    Where that is little, the disagreement of records counts besides, which the model's errors do not hide. Fits that
    explain equally well are rescored, see `rescore`, where one of them may explain all: which of several laws that do
    not is the best needs no such care.
    """
    drops = np.array([0.5 * (problem.linear.cost - fit.cost) for fit in fits])
    if drops[0] < WEAK_EVIDENCE and not problem.segments.moving.any():
        drops += [assess_agreement(problem.segments, problem.linear.nuisance_prior, fit).gain for fit in fits]
    scale = max(1.0, fits[0].cost / fits[0].n_rows)
    contenders = select_contenders(fits)
    if len(contenders) > 1 and (
        always_rescores
        or any(
            _may_explain(problem, fit, drop / scale, gain_of_others)
            for fit, drop in zip(contenders, drops, strict=False)
        )
    ):
        rescored, behind = rescore(problem, contenders)
        fits = rescored + fits[len(rescored) :]
        drops[: len(rescored)] = drops[: len(rescored)].max() - scale * behind
    order = np.argsort(-drops, kind="stable")
    return [fits[i] for i in order], drops[order]


def _may_explain(problem: LawFitProblem, fit: LawFit, gain: float, gain_of_others: Callable[[LawFit], float]) -> bool:
    """Tell whether nothing speaks against a law: its shape is wrong, if at all, with any variance of the data."""
    agreement = assess_agreement(problem.segments, problem.linear.nuisance_prior, fit)
    return not _find_objection(problem, fit, agreement, gain, gain_of_others)


def _find_objection(
    problem: LawFitProblem,
    best: LawFit,
    agreement: Agreement,
    gain: float,
    gain_of_others: Callable[[LawFit], float],
) -> str:
    """Say what is wrong with a law; empty where it explains the records."""
    if np.fmin(gain, agreement.gain) < MIN_LOG_BAYES_FACTOR:
        return "explains no more than a linear system could"
    misfit = best.cost / best.n_rows
    if not is_determined(best, max(1.0, misfit)):
        return "has parameters that the records do not distinguish from zero"
    part = relative_misfit(problem.segments, best.misfit)
    if misfit > MAX_MEAN_MISFIT and part > (CLOSE_MOVING if problem.segments.moving.any() else CLOSE):
        return f"leaves {np.sqrt(misfit):.3g} times the expected misfit"
    if agreement.mean_misfit > MAX_DISAGREEMENT and part > NEARLY_ALL_OF_RESPONSE:
        return f"leaves records that disagree {np.sqrt(agreement.mean_misfit):.3g} times more than noise explains"
    other_gain = gain_of_others(best)
    if _has_wrong_shape(problem, best, other_gain, least=0.0 if part > NOISY_MISFIT else MAX_SHAPE_EVIDENCE):
        return (
            f"has the wrong shape: other forces at its location would raise the log evidence by {0.5 * other_gain:.0f}"
        )
    return ""


def _explains_first_moments(problems: Iterable[LawFitProblem], fit: LawFit) -> bool:
    """Tell whether a law explains all but little of first moments; later, errors of the model may have grown."""
    return any(_explains_nearly_all(problem, fit) for problem in problems)


def _explains_nearly_all(problem: LawFitProblem, fit: LawFit) -> bool:
    best, enough = problem.fit_output_error(fit, FRESH_STEPS), NEARLY_ALL * problem.linear.cost
    if best.cost > enough or not is_explained(best):
        best = min(best, problem.fit_output_error_afresh(fit, FRESH_STEPS), key=lambda refit: refit.cost)
    if best.cost > enough:
        return False
    agreement = assess_agreement(problem.segments, problem.linear.nuisance_prior, best)
    gain = 0.5 * (problem.linear.cost - best.cost) / max(1.0, best.cost / best.n_rows)
    other_gain = _gain_of_other_forces(problem, best)
    is_in_shape = other_gain < _gain_by_model_errors(problem, best, ERROR_PARTS)
    return is_in_shape and not _find_objection(problem, best, agreement, gain, lambda _: other_gain)


def _has_wrong_shape(problem: LawFitProblem, fit: LawFit, other_gain: float, *, least: float) -> bool:
    """Tell whether other forces at the location of a law gain more than errors of the model, and some log evidence."""
    parts = ERROR_PARTS_MOVING if problem.segments.moving.any() else ERROR_PARTS
    log_evidence = 0.5 * other_gain / max(1.0, fit.cost / fit.n_rows)
    return other_gain > _gain_by_model_errors(problem, fit, parts) and log_evidence > least


def _gain_by_model_errors(problem: LawFitProblem, fit: LawFit, parts: tuple[float, float]) -> float:
    """Drop of the cost by other forces that errors of the model may cause."""
    of_cost, of_gain = parts
    return max(of_cost * fit.cost, of_gain * (problem.linear.cost - fit.cost))
