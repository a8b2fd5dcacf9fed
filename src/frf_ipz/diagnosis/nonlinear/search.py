"""The nonlinear branch: is it linear at all, and if not, which law sits where, and how much of the misfit it explains.

The recordings of all levels are asked first (`assess_linearity`). If no linear system explains them, every law is tried
at every place on the first part of each blow, or on stretches of records. What is held out takes no part in that.

Log evidence is half the drop of the weighted sum of squares against the linear model with its tolerances, less the
Occam factor of the law. A law is needed if it explains how records of different levels disagree, which nothing linear
can (`nonlinear_evidence`). If none explains it, the location is looked for at which some force, of whatever law, would.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.measured.preprocessing.dispersion import excess_delay_s
from frf_ipz.diagnosis.nonlinear.findings import findings_of, gain_of, is_told
from frf_ipz.diagnosis.nonlinear.fitting.candidates import FRESH, find_candidates, is_explained
from frf_ipz.diagnosis.nonlinear.fitting.fitted_segments import FINE, ROUGH, WEAK, FittedSegments
from frf_ipz.diagnosis.nonlinear.fitting.force_localisation import TIE
from frf_ipz.diagnosis.nonlinear.fitting.output_error_fit import gain_of_further
from frf_ipz.diagnosis.nonlinear.fitting.rescoring import tell_apart
from frf_ipz.diagnosis.nonlinear.fitting.simple_laws import (
    MANY_TURNS,
    AnyForce,
    find_place,
    fit_anything,
    simple_forces,
)
from frf_ipz.diagnosis.nonlinear.law_in_time import show_law
from frf_ipz.diagnosis.nonlinear.laws.finder import select_laws
from frf_ipz.diagnosis.nonlinear.linear.modal_model import make_modal_model
from frf_ipz.diagnosis.nonlinear.linearity import Linearity, assess_linearity
from frf_ipz.diagnosis.nonlinear.nonlinear_evidence import agreement_with
from frf_ipz.diagnosis.nonlinear.proof import prove, relative_misfit, working_range
from frf_ipz.diagnosis.nonlinear.recorded.noise import read_noise
from frf_ipz.diagnosis.result import describe_location_set
from frf_ipz.progress import silent

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.nonlinear.fitting.candidates import LawFitProgress
    from frf_ipz.diagnosis.nonlinear.fitting.refine import LawFit
    from frf_ipz.diagnosis.nonlinear.laws.law import Law
    from frf_ipz.diagnosis.nonlinear.linear.modal_model import ModalModel
    from frf_ipz.diagnosis.nonlinear.linear.nuisance_prior import NuisancePrior
    from frf_ipz.diagnosis.nonlinear.nonlinear_evidence import Agreement
    from frf_ipz.diagnosis.observations import Observations
    from frf_ipz.diagnosis.options import DiagnoseOptions
    from frf_ipz.diagnosis.result import Finding, LawInTime, Misfit
    from frf_ipz.progress import Progress
    from frf_ipz.structure import StructuralModel

LINEAR, EXPLAINED, UNEXPLAINED = "linear", "explained", "unexplained"
DISAGREE = "Weak and strong blows disagree"
FIRST = 40.0  # periods of the top of the band: length of stretches from which a rough start leads to a strong law
LEAST_TO_HOLD = 3  # blows at a place: one of them is held out
MOST_MISFIT = 1.5  # mean square over the expected one, of a law that explains the recordings
CLOSE = 0.01  # or so much of the response: a place that is held makes modes of its own, which may be off as well
CLOSE_MOVING = 0.015  # the same where stretches start in motion: how they start is known in the first modes only
MOST_APART = 9.0  # mean square of what blows disagree in besides the law, over the expected one
BENT_NATS = 250.0  # evidence that forces of other kinds at the place of a law may gain
BENT = 0.1, 0.01  # and parts of what is left, and of what the law explains
BENT_MOVING = 0.33, 0.05  # the same where stretches start in motion: right laws leave up to 0.25
NEAR, MOST_NEAR = 5.0, 4  # times the smallest cost: laws at whose places an unknown one may sit, and how many
SMALL = 0.5  # of the cost: what forces besides a law promise more than that is not small, and no promise
PROMISED = 0.7  # times the cost of any force alone: what a small force besides a law may promise less surely
NEARLY = 0.02  # or so much of the response is left
MOST_LEFT = 0.1  # of the response: with more, noise hides much of how another law bends, and any bend is too much
MIN_LOG_BAYES_FACTOR = 65.0  # evidence that a law needs, and needs beyond anything linear
WEAK_NATS = 2000.0  # evidence below which the model's errors may hide where a law sits
EXPLAINED_FIRST = 1.0  # misfit of the first moments that leaves nothing to explain, where later ones are not reached
PLACED, HALVED = 4.0, 0.5  # most misfit, and most of the linear model's, that an unknown law at its place leaves
MOSTLY = 0.05  # or so much of the linear model's: what the forces lack is then their law, not their place
LARGELY = 0.2  # or so much, where some force there, whatever it does, would leave no more than can be expected
NEARLY_ALL = 0.05  # of what the linear model leaves of first moments: a law that leaves no more explains them
UNDISPERSED = 0.9  # of the cost: what a law may leave where a dispersion of the converters is to be believed
LATER = 2.0**0.5, 2.0  # times as long as short stretches: first moments by which a law may be told better


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LawSearch:
    """What the nonlinear branch found.

    Parameters
    ----------
    verdict : str
        ``linear``, ``explained`` (by the first finding) or ``unexplained`` (not linear, and no law explains it).
    linearity : Linearity
        What the recordings say without a model.
    findings : tuple of Finding
        The best place of each law, the most probable first; empty for a linear system.
    nonlinear_evidence : float
        Evidence of the first finding beyond anything linear, nats; NaN where stretches start in motion.
    before, updated, after : Misfit
        Of the nominal model, of the same with its tolerances, and with the first finding.
    statement : str
        The verdict in a sentence or two.
    modal_model : ModalModel, optional
        The structure that the law sits on; None for a linear system, as what follows.
    fit : LawFit, optional
        The best law at its place.
    nuisance_prior : NuisancePrior, optional
        Unknowns of the linear model that it was fitted with; `simulate` needs them.
    location : mapping
        Where a force sits whose law is not known, as in `diagnosis.json`; empty where that was not asked or not found.
    dispersion_rad : float
        What was taken back of the converters' dispersion before the law was fitted, see `remove_dispersion`; rad.
    is_early : bool
        The law explains first moments only: what it misses later grows from small errors of the model.
    law_in_time : LawInTime, optional
        The best law in time, to be drawn.
    """

    verdict: str
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
    location: Mapping[str, object] = field(default_factory=dict)
    dispersion_rad: float = 0.0
    is_early: bool = False
    law_in_time: LawInTime | None = None

    @property
    def is_nonlinear(self) -> bool:
        """No linear system explains the recordings."""
        return self.verdict != LINEAR

    @property
    def nuisance_chi2(self) -> float:
        """Mean square of the lasting unknowns that the law was fitted with, in tolerances; 0 without a law."""
        if self.fit is None or self.nuisance_prior is None:
            return 0.0
        return float(np.mean(self.fit.unknowns[: self.nuisance_prior.n_lasting] ** 2))


def search_laws(
    model: StructuralModel,
    observations: Observations,
    options: DiagnoseOptions,
    *,
    folder: Path = Path(),
    progress: Progress = silent,
    linearity: Linearity | None = None,
) -> LawSearch:
    """Find the nonlinear law that explains recordings of different levels, and its place.

    Parameters
    ----------
    model : StructuralModel
        The nominal model, with damping.
    observations : Observations
        Blows or records, of different levels; they need not start at rest.
    options : DiagnoseOptions
        Tolerances, and what may be missing.
    folder : Path
        Where paths of users' own laws start.
    progress : Progress
        Told how far it is.
    linearity : Linearity, optional
        What `assess_linearity` said of the recordings, where it was asked already.

    Returns
    -------
    LawSearch
        Verdict, findings and proof.

    Raises
    ------
    InputError
        If the model lacks a DOF that was measured, recordings differ in their sampling rate, or a law is not known.
    """
    progress(0.0, "comparing weak and strong blows")
    linearity = assess_linearity(observations) if linearity is None else linearity
    if not linearity.is_nonlinear:
        return LawSearch(
            verdict=LINEAR, linearity=linearity, statement="Blows of all levels agree with one linear system."
        )
    laws = select_laws(options, folder)
    if not laws:
        return LawSearch(verdict=UNEXPLAINED, linearity=linearity, statement=f"{DISAGREE}; no law was looked for.")
    progress(0.1, "looking for a nonlinear law")
    training, held_out = _divide(observations)
    modal_model, noise = make_modal_model(model, observations), read_noise(observations)
    recordings = FittedSegments(
        training=training, held_out=held_out, modal_model=modal_model, noise=noise, options=options
    )
    look = _look(recordings, linearity, laws)
    if look.found.fit is not None and (look.found.verdict == UNEXPLAINED or not is_explained(look.found.fit)):
        progress(0.4, "looking whether converters turned the phase")
        look = _without_dispersion(look, linearity, laws)
    found = look.found
    if found.verdict == UNEXPLAINED:
        progress(0.6, "looking for the place of an unknown law")
        best = _anywhere(look)
        found = _with_place(found, modal_model, best, LARGELY if _can_explain(look.long, best.place) else MOSTLY)
    if found.fit is None:
        return found
    progress(0.9, "proving on what was not fitted")
    before, updated, after = prove(look.long, look.recordings.held_out_as(look.long), found.fit)
    law_in_time = show_law(look.recordings, look.long, found.fit)
    nuisance_prior = look.long.linear.nuisance_prior
    return replace(
        found, nuisance_prior=nuisance_prior, before=before, updated=updated, after=after, law_in_time=law_in_time
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Look:
    """What laws say of recordings: the stretches, all fits, and what was found."""

    recordings: FittedSegments
    short: LawFitProgress
    long: LawFitProgress
    fits: list[LawFit]
    bend_of: Callable[[LawFit], float]
    found: LawSearch


def _look(recordings: FittedSegments, linearity: Linearity, laws: Sequence[Law]) -> _Look:
    """Try every law at every place, and judge the best."""
    short, long = recordings.tracks()

    def track_of(duration_s: float, floor: float) -> LawFitProgress:
        return replace(recordings.track(duration_s, floor, loudest=False), where=long.where)

    first = partial(track_of, FIRST / recordings.training.band_hz[1], ROUGH) if short.missed > WEAK else None
    fits, bend_of = find_candidates(short, long, laws, first=first), cache(partial(_bend, long))
    found = replace(
        _judge(long, linearity, recordings.modal_model, fits, bend_of), dispersion_rad=recordings.dispersion_rad
    )
    later = [times * short.duration_s for times in LATER if times * short.duration_s < long.duration_s]
    firsts = (track_of(duration, FINE) for duration in later)
    if found.fit is not None and found.verdict == UNEXPLAINED and _explains_first(chain([short], firsts), found.fit):
        grown = "It explains their first moments; what it misses later grows from small errors of the model."
        found = replace(found, verdict=EXPLAINED, is_early=True, statement=f"{found.findings[0].statement} {grown}")
    return _Look(recordings=recordings, short=short, long=long, fits=fits, bend_of=bend_of, found=found)


def _without_dispersion(look: _Look, linearity: Linearity, laws: Sequence[Law]) -> _Look:
    """Look again without the dispersion of the converters, where a law explains more without it."""
    fit = look.found.fit
    dispersion = 0.0 if fit is None else look.recordings.best_dispersion(look.long, fit)
    if fit is None or not dispersion:
        return look
    again = _look(look.recordings.without(dispersion), linearity, laws)
    better = again.found.fit
    if better is None or better.cost > UNDISPERSED * fit.cost:
        return look
    if 0.5 * (fit.cost - better.cost) / max(1.0, better.cost / better.n_rows) < MIN_LOG_BAYES_FACTOR:
        return look
    late = excess_delay_s(dispersion, look.recordings.training.band_hz[1], look.long.stretches.step_s)
    said = f"The converters delay the top of the band by {late:.2g} s more than low frequencies, which was taken back."
    return replace(again, found=replace(again.found, statement=f"{again.found.statement} {said}"))


def _anywhere(look: _Look) -> AnyForce:
    """Find the place of an unknown law: where any force explains most, or where one does besides a law."""
    short, long, fits, bend_of = look.short, look.long, look.fits, look.bend_of
    near = [fit for fit in fits if fit.cost < NEAR * fits[0].cost and fit.place in long.where.equal][:MOST_NEAR]
    small = [fit for fit in near if bend_of(fit) < SMALL * fit.cost]
    bent = [AnyForce.on(long, fit.place, fit.cost - bend_of(fit)) for fit in small]
    of_each_law = {fit.law.name: fit.place for fit in reversed(fits)}
    found, first = find_place(short, long, of_each_law.values())
    best = min((one for one in bent if one.cost < PROMISED * found.cost), key=lambda one: one.cost, default=found)
    if best.left < PLACED or first.left > EXPLAINED_FIRST or _can_explain(long, best.place):
        return best
    early = fit_anything(short, best.place, MANY_TURNS)
    return early if early.cost < first.cost + TIE else first


def _can_explain(track: LawFitProgress, place: int) -> bool:
    """Say whether sensors tell that some force at a place, whatever it does, explains what nothing linear does."""
    least = min((free.cost for free in track.where.forces if free.place == place), default=np.inf)
    return least < min(track.linear.n_rows, HALVED * track.linear.cost)


def _bend(track: LawFitProgress, fit: LawFit) -> float:
    """Drop of the cost by forces of other kinds at the place of a law."""
    return gain_of_further(track.stretches, track.linear.nuisance_prior, fit.start(), simple_forces)


def _with_place(found: LawSearch, modal_model: ModalModel, best: AnyForce, part: float) -> LawSearch:
    """Say where an unknown law sits, if a force at one place explains most of what a linear system does not."""
    left = best.left
    if left > max(min(PLACED, HALVED * best.missed), part * best.missed):
        return found
    place = modal_model.places[best.place]
    where = (
        f"A force of another kind at {place.words} would: {np.sqrt(left):.2g} times the expected misfit is then left."
    )
    doubt = describe_location_set([modal_model.places[i].location for i in best.alike])
    return replace(found, location=dict(place.location), statement=f"{found.statement} {where}{doubt}")


def _divide(observations: Observations) -> tuple[Observations, Observations]:
    """Hold out one blow at each place that has enough: the second strongest, whose level others enclose."""
    held = []
    if observations.kind == "hammer":
        groups = [observations.records_at(dof) for dof in observations.input_dofs]
        held = [group[1] for group in groups if len(group) >= LEAST_TO_HOLD]
    kept = tuple(record for record in observations.records if not any(record is other for other in held))
    return replace(observations, records=kept), replace(observations, records=tuple(held))


def _judge(
    track: LawFitProgress,
    linearity: Linearity,
    modal_model: ModalModel,
    fits: list[LawFit],
    bend_of: Callable[[LawFit], float],
) -> LawSearch:
    if not fits:
        return LawSearch(
            verdict=UNEXPLAINED,
            linearity=linearity,
            modal_model=modal_model,
            statement=f"{DISAGREE}; no law explains it.",
        )
    fits, drops = _ranked(track, fits)
    best = fits[0]
    scale = max(1.0, best.cost / best.n_rows)
    gains = np.array(
        [gain_of(fit, drop / scale, len(modal_model.places), scale) for fit, drop in zip(fits, drops, strict=True)]
    )
    weights = np.exp(gains - gains.max())
    findings = findings_of(modal_model, fits, gains, weights / weights.sum(), scale)
    agreement = agreement_with(track.stretches, track.linear.nuisance_prior, best)
    why = _complaint(track, best, agreement, float(gains[0]), bend_of)
    return LawSearch(
        verdict=UNEXPLAINED if why else EXPLAINED,
        linearity=linearity,
        findings=findings,
        nonlinear_evidence=agreement.gain,
        statement=f"{DISAGREE}, and no law of the catalogue explains how: the best one ({findings[0].effect}) {why}."
        if why
        else f"{findings[0].statement} {working_range(best, modal_model)}",
        modal_model=modal_model,
        fit=best,
    )


def _ranked(track: LawFitProgress, fits: list[LawFit]) -> tuple[list[LawFit], FloatArray]:
    """Order fits by their evidence, which is given too: half the drop of the cost.

    Where that is little, how blows disagree counts besides, which the model's errors do not hide. What explains alike
    is compared once more, see `tell_apart`.
    """
    drops = np.array([0.5 * (track.linear.cost - fit.cost) for fit in fits])
    if drops[0] < WEAK_NATS and not track.stretches.moving.any():
        drops += [agreement_with(track.stretches, track.linear.nuisance_prior, fit).gain for fit in fits]
    scale = max(1.0, fits[0].cost / fits[0].n_rows)
    near, behind = tell_apart(track, fits)
    fits = near + fits[len(near) :]
    if behind.any():
        drops[: len(near)] = drops[: len(near)].max() - scale * behind
    order = np.argsort(-drops, kind="stable")
    return [fits[i] for i in order], drops[order]


def _complaint(
    track: LawFitProgress, best: LawFit, agreement: Agreement, gain: float, bend_of: Callable[[LawFit], float]
) -> str:
    """Say what is wrong with a law; nothing where it explains the recordings."""
    if np.fmin(gain, agreement.gain) < MIN_LOG_BAYES_FACTOR:
        return "gains no more than a linear system could"
    left = best.cost / best.n_rows
    if not is_told(best, max(1.0, left)):
        return "has numbers that the recordings do not tell from zero"
    part = relative_misfit(track.stretches, best.misfit)
    if left > MOST_MISFIT and part > (CLOSE_MOVING if track.stretches.moving.any() else CLOSE):
        return f"leaves {np.sqrt(left):.3g} times the expected misfit"
    if agreement.left > MOST_APART and part > NEARLY:
        return f"leaves blows that disagree {np.sqrt(agreement.left):.3g} times more than noise explains"
    bent = bend_of(best)
    if _is_bent(track, best, bent, least=0.0 if part > MOST_LEFT else BENT_NATS):
        return f"is bent: forces of other kinds at its place would gain {0.5 * bent:.0f} nats more"
    return ""


def _explains_first(firsts: Iterable[LawFitProgress], fit: LawFit) -> bool:
    """Say whether a law explains all but little of first moments; later, errors of the model may have grown."""
    return any(_explains_most(first, fit) for first in firsts)


def _explains_most(track: LawFitProgress, fit: LawFit) -> bool:
    again = min(track.fit_output_error(fit, FRESH), track.fit_output_error_afresh(fit, FRESH), key=lambda one: one.cost)
    if again.cost > NEARLY_ALL * track.linear.cost:
        return False
    agreement = agreement_with(track.stretches, track.linear.nuisance_prior, again)
    gain = 0.5 * (track.linear.cost - again.cost) / max(1.0, again.cost / again.n_rows)
    bent = _bend(track, again)
    return bent < _bend_of_errors(track, again, BENT) and not _complaint(track, again, agreement, gain, lambda _: bent)


def _is_bent(track: LawFitProgress, fit: LawFit, drop: float, *, least: float) -> bool:
    """Other forces at the place of a law explain more than errors of the model imitate, and so many nats at least."""
    parts = BENT_MOVING if track.stretches.moving.any() else BENT
    return drop > _bend_of_errors(track, fit, parts) and 0.5 * drop / max(1.0, fit.cost / fit.n_rows) > least


def _bend_of_errors(track: LawFitProgress, fit: LawFit, parts: tuple[float, float]) -> float:
    """Drop of the cost by forces of other kinds that errors of the model imitate."""
    of_cost, of_gain = parts
    return max(of_cost * fit.cost, of_gain * (track.linear.cost - fit.cost))
