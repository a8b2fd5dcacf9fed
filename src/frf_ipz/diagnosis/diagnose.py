"""The diagnosis: measure, fit the nominal model, search for what is missing, judge, prove.

Detection and naming rest on the evidence of each hypothesis; the verdict on what the best of them leaves unexplained.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arguments import as_path, require_each, require_type
from frf_ipz.diagnosis.catalogue.effect import Effect
from frf_ipz.diagnosis.deadline import NO_LIMIT, Deadline, DeadlineError
from frf_ipz.diagnosis.effect_selection import EffectCatalogue
from frf_ipz.diagnosis.evidence.inference_problem import make_data, pose_problem
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.measured.data_split import split_data
from frf_ipz.diagnosis.measured.group_spectra import group_records
from frf_ipz.diagnosis.measured.levels import MIN_RECORDS
from frf_ipz.diagnosis.measured.preprocessing.dc_offset import remove_dc_offset
from frf_ipz.diagnosis.measured.preprocessing.hum import remove_hum
from frf_ipz.diagnosis.measured.preprocessing.noise_levels import measure_noise_levels
from frf_ipz.diagnosis.measured.preprocessing.residual_motion import remove_residual_motion
from frf_ipz.diagnosis.nonlinear.laws.law import Law
from frf_ipz.diagnosis.nonlinear.linearisation import linearise
from frf_ipz.diagnosis.nonlinear.linearity import assess_linearity
from frf_ipz.diagnosis.nonlinear.search import MIN_LOG_BAYES_FACTOR as LAW_NATS
from frf_ipz.diagnosis.nonlinear.search import search_laws
from frf_ipz.diagnosis.observations import Observations, observe_from
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.diagnosis.result import NOT_DETECTABLE, Ambiguity, Diagnosis, DiagnosisVerdict, as_appearance
from frf_ipz.diagnosis.search.component_search import fit_null_model
from frf_ipz.diagnosis.verdict.data_checks import list_warnings, run_data_checks
from frf_ipz.diagnosis.verdict.decision import (
    decide,
    decide_without_search,
    drop_last_component,
    fit_without_component,
    log_bayes_factor,
)
from frf_ipz.diagnosis.verdict.findings import describe_component, make_finding, probability_of_need, rank_effects
from frf_ipz.diagnosis.verdict.goodness import required_log_bayes_factor
from frf_ipz.diagnosis.verdict.identifiability import find_best_sensor, find_detectable_sizes
from frf_ipz.diagnosis.verdict.law_and_linear import search_beside_law, search_beside_linear
from frf_ipz.diagnosis.verdict.mismatch import describe_mismatch, localise_mismatch
from frf_ipz.diagnosis.verdict.out_of_catalogue import (
    describe_damping,
    describe_implausibility,
    drop_damping_effects,
    free_damping,
    is_damping_dominant,
    is_damping_only,
)
from frf_ipz.diagnosis.verdict.proof import prove
from frf_ipz.diagnosis.verdict.unnamed_force import describe_unnamed_force, find_unnamed_force
from frf_ipz.frf import FrfSet
from frf_ipz.ingest.campaign import VibrationTest
from frf_ipz.ingest.estimate import estimate_from
from frf_ipz.ingest.options import IngestOptions
from frf_ipz.ingest.recording_files import RecordingFiles
from frf_ipz.numerics.one_thread import on_one_thread
from frf_ipz.progress import silent
from frf_ipz.structure import StructuralModel

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from frf_ipz.diagnosis.evidence.fit import Data
    from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem
    from frf_ipz.diagnosis.nonlinear.linearity import Linearity
    from frf_ipz.diagnosis.nonlinear.search import LawSearch
    from frf_ipz.diagnosis.result import DataCheck, Finding
    from frf_ipz.diagnosis.verdict.decision import Decision
    from frf_ipz.diagnosis.verdict.findings import RankedEffect
    from frf_ipz.diagnosis.verdict.proof import Proof
    from frf_ipz.identification.options import FitOptions
    from frf_ipz.progress import Progress

CLEARLY_NONLINEAR = 4.0  # times the limit of linearity: below, a linear explanation that leaves nothing comes first
AMBIGUOUS = 5.0  # log Bayes factor: effects nearer to the best than that are not distinguished
MAX_ALTERNATIVES = 6
# What was not looked at, where the time was over before that step was done
NO_TIME_FOR_LAWS = "all force laws at all locations"
DISAGREEING = "weak and strong records disagree"
NO_TIME_BESIDE_LAW = "a linear effect beside a force law"
NOT_WITH_STATED_DAMPING = "effects that would explain the damping"
NOT_UNNAMED = "forces that are not in the catalogue"
SEED_WARNING = "[diagnose] seed has no effect: nothing in a diagnosis is drawn at random; leave it out"


def diagnose(
    data: VibrationTest | FrfSet | Observations,
    fe_model: StructuralModel,
    *,
    frfs: FrfSet | None = None,
    options: DiagnoseOptions | None = None,
    effects: Sequence[Effect | Law] = (),
    ingest: IngestOptions | None = None,
    fit: FitOptions | None = None,
    folder: str | Path = ".",
    progress: Progress = silent,
) -> Diagnosis:
    """Find out whether something is missing from a nominal model, what, where, and how much.

    Parameters
    ----------
    data : VibrationTest, FrfSet or Observations
        What was measured. Only recordings show what depends on the level of excitation.
    fe_model : StructuralModel
        The nominal model, with damping.
    frfs : FrfSet, optional
        FRFs of the test, where they have been estimated already.
    options : DiagnoseOptions, optional
        Tolerances, and what may be missing.
    effects : sequence of Effect or Law
        Effects and force laws of your own that are looked for too.
    ingest : IngestOptions, optional
        How the recordings of a test are used.
    fit : FitOptions, optional
        Says which band to analyse, and which parts of it not; without a band, the one that carries signal is taken.
    folder : str or Path
        Where paths of users' own effects in `options` start.
    progress : Progress
        Receives the progress.

    Returns
    -------
    Diagnosis
        Verdict, findings and proof.

    Raises
    ------
    InputError
        If the model lacks a DOF that was measured, or an effect is not known.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> stiffness = 1e5 * np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    >>> dofs = ["1:x", "2:x", "3:x"]
    >>> masses = np.diag([2.0, 1.0, 1.0])
    >>> model = frf_ipz.StructuralModel.from_matrices(masses, stiffness, dofs=dofs, modal_damping=0.01)
    >>> heavier = frf_ipz.StructuralModel.from_matrices(
    ...     masses + np.diag([0.0, 0.0, 0.2]), stiffness, dofs=dofs, modal_damping=0.01
    ... )
    >>> lines = np.arange(5, 100.0, 0.5)
    >>> first, accelerance = frf_ipz.Dof(1, "x"), frf_ipz.FrfQuantity.ACCELERANCE
    >>> labels = [frf_ipz.FrfLabel(frf_ipz.parse_dof(dof), first, accelerance) for dof in dofs]
    >>> values = frf_ipz.compute_frfs(heavier, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=dofs, inputs=["1:x"], variance=np.full(values.shape, 2e-6)
    ... )
    >>> options = frf_ipz.DiagnoseOptions(effects=("added_mass",))
    >>> diagnosis = frf_ipz.diagnose(frfs, model, options=options)
    >>> diagnosis.verdict
    'explained'
    >>> diagnosis.findings[0].parameters["mass_kg"].in_words("g", 1e3), diagnosis.findings[0].confidence
    ('200.0 g (95 %: 198.8 to 201.2)', 'probability above 0.999')
    """
    require_type("data", data, VibrationTest, FrfSet, Observations)
    require_type("fe_model", fe_model, StructuralModel)
    require_type("frfs", frfs, FrfSet, optional=True)
    require_type("options", options, DiagnoseOptions, optional=True)
    require_each("effects", effects, Effect, Law)
    catalogue = EffectCatalogue(options=options or DiagnoseOptions(), folder=as_path(folder), own=tuple(effects))
    deadline = Deadline(seconds=catalogue.options.seconds)
    observations = _as_observations(data, frfs, ingest, fit)
    return find_causes(fe_model, observations, catalogue, deadline=deadline, progress=progress)


@on_one_thread
def find_causes(
    fe_model: StructuralModel,
    observations: Observations,
    catalogue: EffectCatalogue,
    *,
    deadline: Deadline = NO_LIMIT,
    only_where_they_differ: bool = False,
    progress: Progress = silent,
) -> Diagnosis:
    """Find what is missing from a nominal model, within a time.

    Parameters
    ----------
    fe_model : StructuralModel
        The nominal model, with damping.
    observations : Observations
        What was measured.
    catalogue : EffectCatalogue
        Tolerances and effects.
    deadline : Deadline
        When no further hypothesis is tried.
    only_where_they_differ : bool
        Search only where model and measurement differ by more than noise and tolerances.
    progress : Progress
        Receives the progress.

    Returns
    -------
    Diagnosis
        Verdict, findings and proof.
    """
    diagnosis = _diagnose(
        fe_model, observations, catalogue, deadline, progress, only_where_they_differ=only_where_they_differ
    )
    if catalogue.options.seed is None:
        return diagnosis
    return replace(diagnosis, warnings=(*diagnosis.warnings, SEED_WARNING))


def _as_observations(
    data: VibrationTest | FrfSet | Observations,
    frfs: FrfSet | None,
    ingest: IngestOptions | None,
    fit: FitOptions | None,
) -> Observations:
    if isinstance(data, Observations):
        return data
    test = VibrationTest.from_frfs(data) if isinstance(data, FrfSet) else data
    files = RecordingFiles(test=test)
    known = estimate_from(files, ingest or IngestOptions()).frfs if frfs is None else frfs
    return observe_from(files, frfs=known, ingest=ingest, fit=fit)


def _diagnose(
    model: StructuralModel,
    observations: Observations,
    catalogue: EffectCatalogue,
    deadline: Deadline,
    progress: Progress,
    *,
    only_where_they_differ: bool,
) -> Diagnosis:
    options = catalogue.options
    progress(0.0, "comparing weak and strong records")
    observations, linearity = _clean_and_assess(observations)
    scale = "none" if observations.frfs is None else observations.frfs.unknown_scale
    progress(0.05, "measuring transfer functions")
    source = split_data(observations)
    effects = _select_identifiable(catalogue.effects(), scale)
    pose_with = partial(pose_problem, model, source, observations.band_hz, effects=effects, free_gains=scale)
    problem = pose_with(options)
    data_checks = run_data_checks(source, linearity)
    laws = catalogue.laws()
    excess = linearity.score / linearity.limit if linearity and laws else 0.0
    is_clearly_nonlinear = excess > CLEARLY_NONLINEAR
    progress(0.2, "fitting the nominal model")
    nothing = decide_without_search(problem)
    detectable_sizes = _find_detectable_sizes(problem, nothing, deadline)  # before a search uses up the time
    is_searched = bool(problem.effects) and not is_clearly_nonlinear
    is_searched &= not (only_where_they_differ and nothing.verdict == DiagnosisVerdict.CONSISTENT)
    found = _Found(problem=problem, decision=nothing, shortfall=_shortfall(nothing))
    if is_searched:
        found = _search(problem, nothing, pose_with, options, deadline, progress)
    problem, decision = found.problem, found.decision
    if decision.null is not nothing.null:  # damping was freed: less shows
        detectable_sizes = _find_detectable_sizes(problem, decision, deadline) or detectable_sizes
    progress(0.9, "proving on what was not fitted")
    held_out = make_data(source.held_out, options, free_gains=scale)
    decision, proof = _prove_and_prune(problem, held_out, decision)
    linear = _make_linear_diagnosis(problem, decision, proof, data_checks, held_out_kind=source.held_out_kind)
    damping = describe_damping(decision.final, options) if decision.final.explains_nearly_all else ""
    linear = replace(
        linear,
        findings=_appearing(linear.findings) if found.shortfall else linear.findings,
        statements=(damping,) if damping else (),
        unexplained_part=found.shortfall,
        not_searched="; ".join(
            filter(None, [decision.not_searched, "" if detectable_sizes is not None else NOT_DETECTABLE])
        ),
        detectability=detectable_sizes or {},
        warnings=list_warnings(source, data_checks),
    )
    linear = replace(linear, statement=_write_statement(linear, decision, is_searched=is_searched))
    if excess <= 1:
        return linear
    laws_of = partial(search_laws, options=options, laws=laws, progress=_late_progress(progress), deadline=deadline)
    try:
        law_search = laws_of(model, observations, linearity=linearity)
    except DeadlineError:
        return replace(
            linear,
            verdict=DiagnosisVerdict.UNEXPLAINED,
            findings=linear.findings if linear.unexplained_part else _appearing(linear.findings),
            not_searched=NO_TIME_FOR_LAWS,
            statement=f"Weak and strong records disagree. Stopped before all was tried: {NO_TIME_FOR_LAWS}.",
            unexplained_part=DISAGREEING,
        )
    if is_clearly_nonlinear or not effects or decision.verdict == DiagnosisVerdict.UNEXPLAINED:
        pose_with_observations = partial(_pose_with_observations, model, options, effects, scale)
        limited = replace(problem, deadline=deadline)
        try:
            return _diagnose_nonlinear(
                linear, limited, pose_with_observations, decision, model, observations, law_search, laws_of
            )
        except DeadlineError:
            return replace(_add_law(linear, law_search), not_searched=NO_TIME_BESIDE_LAW)
    return _prefer_proven_law(linear, law_search)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Found:
    """What a search has found, with the problem that it was found with, and what nothing explains."""

    problem: InferenceProblem
    decision: Decision
    shortfall: str


def _search(
    problem: InferenceProblem,
    nothing: Decision,
    pose_with: Callable[[DiagnoseOptions], InferenceProblem],
    options: DiagnoseOptions,
    deadline: Deadline,
    progress: Progress,
) -> _Found:
    """Decide what is missing; where damping alone has no explanation, with free damping.

    In a limited time what frees the damping comes first where damping is most of the mismatch: it is found sooner.
    """
    limited = replace(problem, deadline=deadline)
    is_first = deadline.seconds is not None and is_damping_dominant(problem, nothing.null)
    freed = _search_with_free_damping(pose_with, options, deadline, progress) if is_first else None
    if freed is not None and deadline.is_over:
        return freed
    decision = decide(limited, progress, null=nothing.null)
    if is_damping_only(problem, decision):
        freed = freed or (None if is_first else _search_with_free_damping(pose_with, options, deadline, progress))
        if freed is not None:
            complete = decision.not_searched or freed.decision.not_searched
            return replace(freed, decision=replace(freed.decision, not_searched=complete))
    return _refuse_implausible(limited, decision)


def _search_with_free_damping(
    pose_with: Callable[[DiagnoseOptions], InferenceProblem],
    options: DiagnoseOptions,
    deadline: Deadline,
    progress: Progress,
) -> _Found | None:
    """Search with damping ratios as measured; None where that does not explain all."""
    problem = drop_damping_effects(pose_with(free_damping(options)))
    limited = replace(problem, deadline=deadline)
    try:
        null = fit_null_model(limited)
    except DeadlineError:
        return None
    decision = decide(limited, progress, null=null)
    if not decision.goodness.is_good:
        return None
    rest = decision.not_searched or (NOT_WITH_STATED_DAMPING if deadline.is_over else "")
    return _Found(
        problem=problem,
        decision=replace(decision, verdict=DiagnosisVerdict.UNEXPLAINED, not_searched=rest),
        shortfall="",
    )


def _refuse_implausible(limited: InferenceProblem, decision: Decision) -> _Found:
    """Refuse an explanation where one outside the catalogue explains more, or its numbers are hardly possible."""
    problem, unnamed_force = replace(limited, deadline=NO_LIMIT), None
    if decision.final.explains_nearly_all:
        try:
            unnamed_force = find_unnamed_force(limited, decision)
        except DeadlineError:
            decision = replace(decision, not_searched=decision.not_searched or NOT_UNNAMED)
    if unnamed_force is not None:
        decision = replace(decision, verdict=DiagnosisVerdict.UNEXPLAINED, unnamed_force=unnamed_force)
        return _Found(problem=problem, decision=decision, shortfall=describe_unnamed_force(unnamed_force))
    if decision.verdict == DiagnosisVerdict.EXPLAINED and (reason := describe_implausibility(decision.final)):
        return _Found(
            problem=problem, decision=replace(decision, verdict=DiagnosisVerdict.UNEXPLAINED), shortfall=reason
        )
    return _Found(problem=problem, decision=decision, shortfall=_shortfall(decision))


def _shortfall(decision: Decision) -> str:
    return decision.goodness.shortfall if decision.verdict == DiagnosisVerdict.UNEXPLAINED else ""


def _find_detectable_sizes(
    problem: InferenceProblem, decision: Decision, deadline: Deadline
) -> dict[str, dict[str, float]] | None:
    """Find how small an effect of each kind would show; None where there is no time for it."""
    limited = replace(problem, deadline=deadline)
    try:
        return find_detectable_sizes(limited, decision.null, required_log_bayes_factor(limited, decision.null_goodness))
    except DeadlineError:
        return None


def _prove_and_prune(problem: InferenceProblem, held_out: Data, decision: Decision) -> tuple[Decision, Proof]:
    """Prove, and drop what explains a part only and makes worse what was not fitted."""
    proof = prove(problem, held_out, decision.null, decision.final)
    while decision.verdict == DiagnosisVerdict.UNEXPLAINED and proof.after.held_out > proof.before.held_out:
        if decision.final is decision.null:  # the nominal model goes on
            nominal_curves = replace(proof.curves, explained=proof.curves.nominal)
            return decision, replace(proof, after=proof.before, curves=nominal_curves)
        decision = drop_last_component(problem, decision)
        proof = prove(problem, held_out, decision.null, decision.final)
    return decision, proof


def _make_linear_diagnosis(
    problem: InferenceProblem,
    decision: Decision,
    proof: Proof,
    data_checks: tuple[DataCheck, ...],
    *,
    held_out_kind: str,
) -> Diagnosis:
    """Gather what a linear model explains, still without a statement."""
    mismatch = describe_mismatch(problem, decision.null, proof.curves)
    ranked_effects = rank_effects(decision.ranking.fits, max(1.0, decision.goodness.misfit))
    findings = _make_findings(problem, decision, ranked_effects)
    return Diagnosis(
        verdict=decision.verdict,
        findings=findings,
        alternatives=_make_alternatives(decision, ranked_effects),
        mismatch_hz=mismatch[0],
        mismatch_where=mismatch[1],
        mismatch_location=_locate_mismatch(problem, decision, findings),
        mismatch=mismatch[2],
        before=proof.before,
        updated=proof.updated,
        after=proof.after,
        held_out_kind=held_out_kind,
        ambiguity=_find_ambiguity(problem, decision, ranked_effects),
        data_checks=data_checks,
        curves=proof.curves,
        numbers=_collect_numbers(decision),
    )


def _clean_and_assess(observations: Observations) -> tuple[Observations, Linearity | None]:
    """Remove hum, residual motion and offsets, and compare records of several levels.

    Offsets are read from what records of one linear system do not share, or, where they are of none, at rest.
    """
    observations = measure_noise_levels(remove_hum(observations))
    linear = remove_residual_motion(observations)
    linearity = _assess_linearity(linear)
    if linearity is None or not linearity.is_nonlinear:
        return linear, linearity
    without_offset = remove_dc_offset(observations)
    return without_offset, _assess_linearity(without_offset)


def _assess_linearity(observations: Observations) -> Linearity | None:
    """Compare records of several levels; None where no point was excited twice."""
    counts = [len(records) for records in group_records(observations)]
    return None if max(counts, default=0) < MIN_RECORDS else assess_linearity(observations)


def _late_progress(progress: Progress) -> Progress:
    """Progress of what comes after the linear model."""
    return lambda part, text: progress(0.9 + 0.1 * part, text)


def _pose_with_observations(
    model: StructuralModel,
    options: DiagnoseOptions,
    effects: Mapping[str, Effect],
    free_gains: str,
    observations: Observations,
) -> InferenceProblem:
    """Pose the problem of the model and changed recordings."""
    return pose_problem(model, split_data(observations), observations.band_hz, options, effects, free_gains=free_gains)


def _diagnose_nonlinear(
    linear: Diagnosis,
    problem: InferenceProblem,
    pose_with_observations: Callable[[Observations], InferenceProblem],
    decision: Decision,
    model: StructuralModel,
    observations: Observations,
    laws: LawSearch,
    laws_of: Callable[[StructuralModel, Observations], LawSearch],
) -> Diagnosis:
    """Search for a linear effect beside a law, where that has a large nuisance chi2 or none explains by itself."""
    beside = None
    if problem.effects and laws.verdict == DiagnosisVerdict.UNEXPLAINED:
        beside = search_beside_linear(problem, decision, laws, model, observations, laws_of)
    if problem.effects and beside is None:
        beside = search_beside_law(pose_with_observations, laws, model, observations, laws_of)
    if beside is not None:
        law, component = beside
        diagnosis = _add_law(linear, law)
        (component,) = (component,) if diagnosis.is_explained else _appearing((component,))
        findings = tuple(sorted((*diagnosis.findings, component), key=lambda finding: -finding.log_evidence_gain))
        return replace(diagnosis, findings=findings, statement=f"{diagnosis.statement} {component.statement}")
    diagnosis = _add_law(linear, laws)
    if laws.verdict != DiagnosisVerdict.UNEXPLAINED or diagnosis.findings or not linear.findings:
        return diagnosis
    appearing = linear.findings if linear.unexplained_part else _appearing(linear.findings)
    return replace(
        linear,
        verdict=DiagnosisVerdict.UNEXPLAINED,
        findings=appearing,
        statement=" ".join([laws.statement, *(finding.statement for finding in appearing)]),
        unexplained_part=linear.unexplained_part or DISAGREEING,
    )


def _prefer_proven_law(linear: Diagnosis, laws: LawSearch) -> Diagnosis:
    """Keep a linear explanation that leaves nothing, unless a law explains how records disagree: nothing linear can."""
    is_proven = laws.verdict == DiagnosisVerdict.EXPLAINED and laws.nonlinear_evidence > LAW_NATS
    return _add_law(linear, laws) if is_proven else linear


def _add_law(linear: Diagnosis, laws: LawSearch) -> Diagnosis:
    """Put what a law explains into a diagnosis, with the linear model about the amplitudes of the test."""
    findings = tuple(finding for finding in laws.findings if finding.log_evidence_gain > LAW_NATS)
    before, updated, after = laws.before or linear.before, laws.updated or linear.updated, laws.after or linear.updated
    is_needed = bool(findings) and float(np.fmin(findings[0].log_evidence_gain, laws.nonlinear_evidence)) > LAW_NATS
    is_worse = laws.verdict == DiagnosisVerdict.UNEXPLAINED and after.held_out > updated.held_out
    n_findings = 1 if is_needed and not is_worse else 0
    linearised = linearise(laws.fit, laws.modal_model) if n_findings and laws.fit and laws.modal_model else None
    return replace(
        linear,
        verdict=laws.verdict,
        findings=findings[:n_findings]
        if laws.verdict == DiagnosisVerdict.EXPLAINED
        else _appearing(findings[:n_findings]),
        alternatives=findings[n_findings:],
        before=before,
        updated=updated,
        after=after if n_findings else updated,
        mismatch_location=laws.location or (findings[0].location if n_findings else Location()),
        ambiguity=(),
        statement=laws.statement if linearised is None else f"{laws.statement} {linearised.statement}",
        linearised_law=linearised,
        law_in_time=None if linearised is None else laws.law_in_time,
        unexplained_part=DISAGREEING if laws.verdict == DiagnosisVerdict.UNEXPLAINED else "",
    )


def _locate_mismatch(problem: InferenceProblem, decision: Decision, findings: tuple[Finding, ...]) -> Location:
    """Locate what was found, or what remains unexplained."""
    if decision.unnamed_force is not None:
        return decision.unnamed_force.hypothesis.components[-1].location
    if decision.verdict == DiagnosisVerdict.UNEXPLAINED:
        return localise_mismatch(problem, decision.null)
    return findings[0].location if findings else Location()


def _select_identifiable(effects: dict[str, Effect], scale: str) -> dict[str, Effect]:
    """Leave out gains that are unknown: they are fitted, not diagnosed."""
    return effects if scale == "none" else {name: effect for name, effect in effects.items() if name != "sensor_gain"}


def _make_findings(
    problem: InferenceProblem, decision: Decision, ranked_effects: list[RankedEffect]
) -> tuple[Finding, ...]:
    components = decision.final.hypothesis.components
    scale = max(1.0, decision.goodness.misfit)
    if not components:
        return ()
    if not decision.further_rankings:
        only = make_finding(ranked_effects[0], log_bayes_factor(decision.final, decision.null), scale)
        is_needed = decision.verdict == DiagnosisVerdict.EXPLAINED  # nothing explains without it
        return (replace(only, is_significant=only.is_significant or is_needed),)
    competing = rank_effects(decision.further_rankings[-1].fits, scale)
    newest = make_finding(competing[0], log_bayes_factor(decision.final, decision.further_rankings[-1].base), scale)
    older = [
        describe_component(
            decision.final,
            number,
            min(newest.probability, probability_of_need(gain, scale)),
            gain,
            scale,
            location_set=(components[number].location.place,),
        )
        for number in range(len(components) - 1)
        for gain in [log_bayes_factor(decision.final, fit_without_component(problem, decision.final, number))]
    ]
    return tuple(sorted((*older, newest), key=lambda finding: -finding.log_evidence_gain))


def _make_alternatives(decision: Decision, ranked_effects: list[RankedEffect]) -> tuple[Finding, ...]:
    scale = max(1.0, decision.goodness.misfit)
    if decision.further_rankings:
        ranked_effects, base = (
            rank_effects(decision.further_rankings[-1].fits, scale),
            decision.further_rankings[-1].base,
        )
    else:
        base = decision.null
    remaining = ranked_effects if decision.final is decision.null else ranked_effects[1:]
    return tuple(
        make_finding(effect, log_bayes_factor(effect.best, base), scale) for effect in remaining[:MAX_ALTERNATIVES]
    )


def _find_ambiguity(
    problem: InferenceProblem, decision: Decision, ranked_effects: list[RankedEffect]
) -> tuple[Ambiguity, ...]:
    """Find effects that explain the same nearly as well."""
    if decision.final is decision.null or len(decision.final.hypothesis.components) > 1:
        return ()
    ambiguity_set = [effect for effect in ranked_effects if log_bayes_factor(decision.final, effect.best) < AMBIGUOUS]
    if len(ambiguity_set) < 2:
        return ()
    return (
        Ambiguity(
            effects=tuple(effect.name for effect in ambiguity_set),
            log_bayes_factor=log_bayes_factor(decision.final, ambiguity_set[-1].best),
            resolve_by=find_best_sensor(problem, ambiguity_set[0].best, ambiguity_set[1].best),
        ),
    )


def _write_statement(diagnosis: Diagnosis, decision: Decision, *, is_searched: bool) -> str:
    """Write the causes first, then what was measured, and what was not looked at."""
    found = " ".join(finding.statement for finding in diagnosis.findings)
    rest = f"The time was over before all was looked at: {diagnosis.not_searched} (no limit: frf-ipz diagnose)."
    sentences = [
        _judge(diagnosis, decision, found, is_searched=is_searched),
        *diagnosis.statements,
        "" if diagnosis.is_complete else rest,
    ]
    return " ".join(filter(None, sentences))


def _appearing(findings: tuple[Finding, ...]) -> tuple[Finding, ...]:
    """Say of findings what they look like: where something remains that nothing explains, they are no facts."""
    return tuple(replace(finding, statement=as_appearance(finding.statement)) for finding in findings)


def _judge(diagnosis: Diagnosis, decision: Decision, found: str, *, is_searched: bool) -> str:
    """Say what the verdict means: a part that is found where something remains unexplained is no fact."""
    if diagnosis.verdict == DiagnosisVerdict.CONSISTENT:
        reason = (
            "the nominal model explains the measurement within noise and its tolerances (it leaves "
            f"{np.sqrt(decision.null_goodness.misfit):.2g} times the expected misfit)"
        )
        if is_searched:
            return f"Nothing is missing: {reason}."
        return f"Nothing missing was seen: {reason}; so no cause was searched for."
    if diagnosis.verdict == DiagnosisVerdict.EXPLAINED:
        return f"{found} With that, the model explains the measurement."
    if not diagnosis.unexplained_part:  # all but damping, which is as measured
        if found:
            return f"{found} With that and the measured damping, the model explains the measurement."
        return "With the measured damping, the model explains the measurement."
    partly = f" {found}" if found else ""
    looked_at = "of what was looked at" if decision.not_searched else "in the catalogue"
    return f"Something is missing that nothing {looked_at} explains: {diagnosis.unexplained_part}.{partly}"


def _collect_numbers(decision: Decision) -> dict[str, float]:
    return {
        "log_bayes_factor": log_bayes_factor(decision.ranking.best, decision.null),
        "hypotheses": float(decision.ranking.n_tried),
        "null_misfit": decision.null_goodness.misfit,
        "null_nuisance_chi2": decision.null_goodness.nuisance_chi2,
        "null_worst_subband": decision.null_goodness.worst_subband,
        "misfit": decision.goodness.misfit,
        "nuisance_chi2": decision.goodness.nuisance_chi2,
        "worst_subband": decision.goodness.worst_subband,
    }
