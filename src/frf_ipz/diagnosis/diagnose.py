"""The diagnosis: measure, fit the nominal model, search for what is missing, judge, prove.

Detection and naming rest on the evidence of each hypothesis; the verdict on what the best of them leaves unexplained.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from threadpoolctl import threadpool_limits

from frf_ipz.diagnosis.effect_selection import select_effects
from frf_ipz.diagnosis.evidence.inference_problem import make_data, pose_problem
from frf_ipz.diagnosis.measured.data_split import split_data
from frf_ipz.diagnosis.measured.group_spectra import group_records
from frf_ipz.diagnosis.measured.preprocessing.dc_offset import remove_dc_offset
from frf_ipz.diagnosis.measured.preprocessing.residual_motion import remove_residual_motion
from frf_ipz.diagnosis.nonlinear.laws.finder import select_laws
from frf_ipz.diagnosis.nonlinear.linearisation import linearise
from frf_ipz.diagnosis.nonlinear.linearity import assess_linearity
from frf_ipz.diagnosis.nonlinear.search import MIN_LOG_BAYES_FACTOR as LAW_NATS
from frf_ipz.diagnosis.nonlinear.search import search_laws
from frf_ipz.diagnosis.result import Ambiguity, Diagnosis
from frf_ipz.diagnosis.verdict.data_checks import list_warnings, run_data_checks
from frf_ipz.diagnosis.verdict.decision import (
    CONSISTENT,
    EXPLAINED,
    UNEXPLAINED,
    decide,
    decide_without_search,
    drop_last_component,
    fit_without_component,
    log_bayes_factor,
)
from frf_ipz.diagnosis.verdict.findings import describe_component, make_finding, rank_effects
from frf_ipz.diagnosis.verdict.identifiability import find_best_sensor, find_detectable_sizes
from frf_ipz.diagnosis.verdict.law_and_linear import search_beside_law, search_beside_linear
from frf_ipz.diagnosis.verdict.mismatch import describe_mismatch, localise_mismatch
from frf_ipz.diagnosis.verdict.out_of_catalogue import (
    describe_damping,
    describe_implausibility,
    drop_damping_effects,
    free_damping,
    is_damping_only,
)
from frf_ipz.diagnosis.verdict.proof import prove
from frf_ipz.diagnosis.verdict.unnamed_force import describe_unnamed_force, find_unnamed_force
from frf_ipz.progress import silent

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from frf_ipz.diagnosis.catalogue.effect import Effect
    from frf_ipz.diagnosis.evidence.fit import Data
    from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem
    from frf_ipz.diagnosis.nonlinear.linearity import Linearity
    from frf_ipz.diagnosis.nonlinear.search import LawSearch
    from frf_ipz.diagnosis.observations import Observations
    from frf_ipz.diagnosis.options import DiagnoseOptions
    from frf_ipz.diagnosis.result import DataCheck, Finding
    from frf_ipz.diagnosis.verdict.decision import Decision
    from frf_ipz.diagnosis.verdict.findings import RankedEffect
    from frf_ipz.diagnosis.verdict.proof import Proof
    from frf_ipz.progress import Progress
    from frf_ipz.structure import StructuralModel

CERTAIN = 4.0  # times the limit of linearity: below, a linear explanation that leaves nothing comes first
ENOUGH_TO_COMPARE = 2  # blows at a place
ALIKE_NATS = 5.0  # effects nearer to each other than that are not told apart
MOST_ALTERNATIVES = 6


def diagnose(
    model: StructuralModel,
    observations: Observations,
    options: DiagnoseOptions,
    *,
    folder: Path = Path(),
    progress: Progress = silent,
) -> Diagnosis:
    """Find out whether something is missing from a nominal model, what, where, and how much.

    Parameters
    ----------
    model : StructuralModel
        The nominal model, with damping.
    observations : Observations
        What was measured.
    options : DiagnoseOptions
        Tolerances, and what may be missing.
    folder : Path
        Where paths of users' own effects start.
    progress : Progress
        Told how far it is.

    Returns
    -------
    Diagnosis
        Verdict, findings and proof.

    Raises
    ------
    InputError
        If the model lacks a DOF that was measured, or an effect is not known.
    """
    with threadpool_limits(limits=1, user_api="blas"):  # on small matrices threads only wait for each other
        return _diagnose(model, observations, options, folder, progress)


def _diagnose(
    model: StructuralModel, observations: Observations, options: DiagnoseOptions, folder: Path, progress: Progress
) -> Diagnosis:
    progress(0.0, "comparing weak and strong blows")
    observations, linearity = _without_constants(observations)
    scale = "none" if observations.frfs is None else observations.frfs.unknown_scale
    progress(0.05, "measuring transfer functions")
    source = split_data(observations)
    kept = _identifiable(select_effects(options, folder), scale)
    pose_with = partial(pose_problem, model, source, observations.band_hz, effects=kept, free_gains=scale)
    problem = pose_with(options)
    gates = run_data_checks(source, linearity)
    excess = linearity.score / linearity.limit if linearity and select_laws(options, folder) else 0.0
    certain = excess > CERTAIN
    problem, found, shortfall = _decide(problem, pose_with, options, progress, is_certain=certain)
    progress(0.9, "proving on what was not fitted")
    held_out = make_data(source.held_out, options, free_gains=scale)
    found, proof = _proven(problem, held_out, found)
    linear = _linear(problem, found, proof, gates, held_out_kind=source.held_out_kind)
    statement = _statement(found, linear.findings, shortfall)
    linear = replace(linear, statement=statement, unexplained_part=shortfall, warnings=list_warnings(source, gates))
    if excess <= 1:
        return linear
    laws_of = partial(search_laws, options=options, folder=folder, progress=_late(progress))
    laws = laws_of(model, observations, linearity=linearity)
    if certain or not kept or found.verdict == UNEXPLAINED:
        pose_with_observations = partial(_pose_with_observations, model, options, kept, scale)
        return _nonlinear(linear, problem, pose_with_observations, found, model, observations, laws, laws_of)
    return _unless_a_law(linear, laws)


def _decide(
    problem: InferenceProblem,
    pose_with: Callable[[DiagnoseOptions], InferenceProblem],
    options: DiagnoseOptions,
    progress: Progress,
    *,
    is_certain: bool,
) -> tuple[InferenceProblem, Decision, str]:
    """Decide what is missing, unless a law is; where damping alone has no explanation, once more with damping free."""
    is_searched = bool(problem.effects) and not is_certain
    found = decide(problem, progress) if is_searched else decide_without_search(problem)
    if is_searched and is_damping_only(problem, found):
        freed = drop_damping_effects(pose_with(free_damping(options)))
        again = decide(freed, progress)
        if again.goodness.is_good:
            return freed, replace(again, verdict=UNEXPLAINED), describe_damping(again.final, options)
    unnamed_force = find_unnamed_force(problem, found) if found.final.explains_nearly_all else None
    if unnamed_force is not None:
        return (
            problem,
            replace(found, verdict=UNEXPLAINED, unnamed_force=unnamed_force),
            describe_unnamed_force(unnamed_force),
        )
    if found.verdict == EXPLAINED and (rather := describe_implausibility(found.final)):
        return problem, replace(found, verdict=UNEXPLAINED), rather
    return problem, found, found.goodness.shortfall if found.verdict == UNEXPLAINED else ""


def _proven(problem: InferenceProblem, held_out: Data, found: Decision) -> tuple[Decision, Proof]:
    """Prove, and leave out what explains a part only and makes worse what was not fitted."""
    proof = prove(problem, held_out, found.null, found.final)
    while found.verdict == UNEXPLAINED and proof.after.held_out > proof.before.held_out:
        if found.final is found.null:  # the model goes on as it is
            as_it_is = replace(proof.curves, explained=proof.curves.nominal)
            return found, replace(proof, after=proof.before, curves=as_it_is)
        found = drop_last_component(problem, found)
        proof = prove(problem, held_out, found.null, found.final)
    return found, proof


def _linear(
    problem: InferenceProblem, found: Decision, proof: Proof, gates: tuple[DataCheck, ...], *, held_out_kind: str
) -> Diagnosis:
    """Gather what a linear model explains; it is not said yet."""
    where = describe_mismatch(problem, found.null, proof.curves)
    weighed = rank_effects(found.ranking.fits, max(1.0, found.goodness.misfit))
    findings = _findings(problem, found, weighed)
    return Diagnosis(
        verdict=found.verdict,
        findings=findings,
        alternatives=_alternatives(found, weighed),
        mismatch_hz=where[0],
        mismatch_where=where[1],
        mismatch_location=_mismatch_location(problem, found, findings),
        mismatch=where[2],
        before=proof.before,
        updated=proof.updated,
        after=proof.after,
        held_out_kind=held_out_kind,
        ambiguity=_ambiguity(problem, found, weighed),
        data_checks=gates,
        detectability=find_detectable_sizes(problem, found.null, found.null_goodness.required_log_bayes_factor),
        curves=proof.curves,
        numbers=_numbers(found),
    )


def _without_constants(observations: Observations) -> tuple[Observations, Linearity | None]:
    """Take off what no structure does, and compare blows of several levels.

    Constants are read from what blows of one linear system do not share, or, where they are of none, at rest.
    """
    linear = remove_residual_motion(observations)
    linearity = _linearity(linear)
    if linearity is None or not linearity.is_nonlinear:
        return linear, linearity
    quiet = remove_dc_offset(observations)
    return quiet, _linearity(quiet)


def _linearity(observations: Observations) -> Linearity | None:
    """Compare blows of several levels; None where no place has two."""
    counts = [len(records) for records in group_records(observations)]
    return None if max(counts, default=0) < ENOUGH_TO_COMPARE else assess_linearity(observations)


def _late(progress: Progress) -> Progress:
    """Progress of what comes after the linear model."""
    return lambda part, text: progress(0.9 + 0.1 * part, text)


def _pose_with_observations(
    model: StructuralModel,
    options: DiagnoseOptions,
    effects: Mapping[str, Effect],
    free_gains: str,
    observations: Observations,
) -> InferenceProblem:
    """Bring the model and changed recordings together."""
    return pose_problem(model, split_data(observations), observations.band_hz, options, effects, free_gains=free_gains)


def _nonlinear(
    linear: Diagnosis,
    problem: InferenceProblem,
    pose_with_observations: Callable[[Observations], InferenceProblem],
    decision: Decision,
    model: StructuralModel,
    observations: Observations,
    laws: LawSearch,
    laws_of: Callable[[StructuralModel, Observations], LawSearch],
) -> Diagnosis:
    """Look for a linear cause beside a law, where that strains the model or none explains by itself."""
    beside = None
    if problem.effects and laws.verdict == UNEXPLAINED:
        beside = search_beside_linear(problem, decision, laws, model, observations, laws_of)
    if problem.effects and beside is None:
        beside = search_beside_law(pose_with_observations, laws, model, observations, laws_of)
    if beside is not None:
        law, component = beside
        found = _with_law(linear, law)
        findings = tuple(sorted((*found.findings, component), key=lambda finding: -finding.log_evidence_gain))
        return replace(found, findings=findings, statement=f"{found.statement} {component.statement}")
    found = _with_law(linear, laws)
    if laws.verdict != UNEXPLAINED or found.findings or not linear.findings:
        return found
    return replace(linear, verdict=UNEXPLAINED, statement=f"{laws.statement} {linear.statement}")


def _unless_a_law(linear: Diagnosis, laws: LawSearch) -> Diagnosis:
    """Keep a linear explanation that leaves nothing, unless a law says how blows disagree, which nothing linear can."""
    is_proven = laws.verdict == EXPLAINED and laws.nonlinear_evidence > LAW_NATS
    return _with_law(linear, laws) if is_proven else linear


def _with_law(linear: Diagnosis, laws: LawSearch) -> Diagnosis:
    """Say what a law explains; the linear model about the amplitudes of the test stays beside."""
    found = tuple(finding for finding in laws.findings if finding.log_evidence_gain > LAW_NATS)
    before, updated, after = laws.before or linear.before, laws.updated or linear.updated, laws.after or linear.updated
    is_needed = bool(found) and float(np.fmin(found[0].log_evidence_gain, laws.nonlinear_evidence)) > LAW_NATS
    is_worse = laws.verdict == UNEXPLAINED and after.held_out > updated.held_out
    n_findings = 1 if is_needed and not is_worse else 0
    linearised = linearise(laws.fit, laws.modal_model) if n_findings and laws.fit and laws.modal_model else None
    return replace(
        linear,
        verdict=laws.verdict,
        findings=found[:n_findings],
        alternatives=found[n_findings:],
        before=before,
        updated=updated,
        after=after if n_findings else updated,
        mismatch_location=laws.location or (found[0].location if n_findings else {}),
        ambiguity=(),
        statement=laws.statement if linearised is None else f"{laws.statement} {linearised.statement}",
        linearised_law=linearised,
        law_in_time=None if linearised is None else laws.law_in_time,
        unexplained_part="",
    )


def _mismatch_location(
    problem: InferenceProblem, found: Decision, findings: tuple[Finding, ...]
) -> Mapping[str, object]:
    """Give the place of what was found, or of what remains unexplained."""
    if found.unnamed_force is not None:
        return found.unnamed_force.hypothesis.components[-1].location.entries
    if found.verdict == UNEXPLAINED:
        return localise_mismatch(problem, found.null)
    return findings[0].location if findings else {}


def _identifiable(effects: dict[str, Effect], scale: str) -> dict[str, Effect]:
    """Gains that nobody knows are fitted, not diagnosed."""
    return effects if scale == "none" else {name: one for name, one in effects.items() if name != "sensor_gain"}


def _findings(problem: InferenceProblem, found: Decision, weighed: list[RankedEffect]) -> tuple[Finding, ...]:
    components = found.final.hypothesis.components
    scale = max(1.0, found.goodness.misfit)
    if not components:
        return ()
    if not found.further_rankings:
        only = make_finding(weighed[0], log_bayes_factor(found.final, found.null), scale)
        is_needed = found.verdict == EXPLAINED  # nothing explains without it
        return (replace(only, is_significant=only.is_significant or is_needed),)
    competing = rank_effects(found.further_rankings[-1].fits, scale)
    newest = make_finding(competing[0], log_bayes_factor(found.final, found.further_rankings[-1].base), scale)
    older = [
        describe_component(
            found.final,
            number,
            newest.probability,
            log_bayes_factor(found.final, fit_without_component(problem, found.final, number)),
            scale,
            location_set=(dict(components[number].location.entries),),
        )
        for number in range(len(components) - 1)
    ]
    return tuple(sorted((*older, newest), key=lambda finding: -finding.log_evidence_gain))


def _alternatives(found: Decision, weighed: list[RankedEffect]) -> tuple[Finding, ...]:
    scale = max(1.0, found.goodness.misfit)
    if found.further_rankings:
        weighed, base = rank_effects(found.further_rankings[-1].fits, scale), found.further_rankings[-1].base
    else:
        base = found.null
    rest = weighed if found.final is found.null else weighed[1:]
    return tuple(make_finding(one, log_bayes_factor(one.best, base), scale) for one in rest[:MOST_ALTERNATIVES])


def _ambiguity(problem: InferenceProblem, found: Decision, weighed: list[RankedEffect]) -> tuple[Ambiguity, ...]:
    """Effects that explain the same nearly as well."""
    if found.final is found.null or len(found.final.hypothesis.components) > 1:
        return ()
    near = [one for one in weighed if log_bayes_factor(found.final, one.best) < ALIKE_NATS]
    if len(near) < 2:
        return ()
    return (
        Ambiguity(
            effects=tuple(one.name for one in near),
            log_bayes_factor=log_bayes_factor(found.final, near[-1].best),
            resolve_by=find_best_sensor(problem, near[0].best, near[1].best),
        ),
    )


def _statement(found: Decision, findings: tuple[Finding, ...], shortfall: str) -> str:
    said = " ".join(finding.statement for finding in findings)
    if found.verdict == CONSISTENT:
        return "The nominal model explains the measurement within noise and its tolerances: nothing is missing."
    if found.verdict == EXPLAINED:
        return f"{said} With that, the model explains the measurement."
    partly = f" A part of it is explained: {said}" if said else ""
    return f"Something is missing that nothing in the catalogue explains: {shortfall}.{partly}"


def _numbers(found: Decision) -> dict[str, float]:
    return {
        "log_bayes_factor": log_bayes_factor(found.ranking.best, found.null),
        "hypotheses": float(found.ranking.n_tried),
        "null_misfit": found.null_goodness.misfit,
        "null_nuisance_chi2": found.null_goodness.nuisance_chi2,
        "null_worst_subband": found.null_goodness.worst_subband,
        "misfit": found.goodness.misfit,
        "nuisance_chi2": found.goodness.nuisance_chi2,
        "worst_subband": found.goodness.worst_subband,
    }
