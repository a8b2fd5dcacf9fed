"""The nonlinear branch: is it linear at all, and if not, which law sits where, and how much of the misfit it explains.

The recordings of all levels are asked first (`assess_linearity`). If no linear system explains them, every law is tried
at every place on the first part of each blow, or on stretches of records. What is held out takes no part in that.

Evidence is in nats: half the drop of the weighted sum of squares against the linear model with its tolerances, less
what the freedom of the law costs. Nothing linear can gain more than `linear_limit` on the same data, whatever it is:
a law that gains more is needed besides, or instead of, anything linear.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.finding import Estimate, Finding
from frf_ipz.diagnosis.nonlinear.fitting.candidates import Track, find_candidates
from frf_ipz.diagnosis.nonlinear.fitting.screen import fit_linear
from frf_ipz.diagnosis.nonlinear.laws.finder import chosen_laws
from frf_ipz.diagnosis.nonlinear.linear.freedom import make_freedom
from frf_ipz.diagnosis.nonlinear.linear.plant import make_plant
from frf_ipz.diagnosis.nonlinear.linearity import Linearity, assess_linearity
from frf_ipz.diagnosis.nonlinear.proof import prove, working_range
from frf_ipz.diagnosis.nonlinear.recorded.noise import read_noise
from frf_ipz.diagnosis.nonlinear.recorded.stretches import Window, transform
from frf_ipz.progress import silent

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.diagnosis import Misfit
    from frf_ipz.diagnosis.nonlinear.fitting.refine import LawFit
    from frf_ipz.diagnosis.nonlinear.linear.freedom import Freedom
    from frf_ipz.diagnosis.nonlinear.linear.plant import Plant
    from frf_ipz.diagnosis.nonlinear.recorded.noise import ChannelNoise
    from frf_ipz.diagnosis.nonlinear.recorded.stretches import Stretches
    from frf_ipz.diagnosis.observations import Observations
    from frf_ipz.diagnosis.options import DiagnoseOptions
    from frf_ipz.progress import Progress
    from frf_ipz.structure import StructuralModel

LINEAR, EXPLAINED, UNEXPLAINED = "linear", "explained", "unexplained"
DISAGREE = "Weak and strong blows disagree"
SHORT, LONG = 80.0, 320.0  # periods of the top of the band: lengths of the stretches that are fitted
LONG_SHAKER = 640.0  # of a shaker, which takes time to shake up a structure
ROUGH, FINE = 0.01, 0.005  # of the response: what the model may miss on short and long stretches
LEAST_TO_HOLD = 3  # blows at a place: one of them is held out
MOST_MISFIT = 1.5  # mean square over the expected one, of a law that explains the recordings
FOUND_NATS = 25.0  # evidence that a law needs
LOG_RANGE = np.log(1e6)  # of a law's numbers: uniform over six decades each
NORMAL_95 = 1.96
WIDER = 2.0  # times the standard deviation of the fit: neighbouring lines share the model's errors
MOST_PLACES = 12
LISTED = 0.95


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
    linear_limit : float
        Evidence over the linear model that nothing linear can exceed, nats; NaN where stretches start in motion.
    before, after : Misfit
        Of the linear model with its tolerances, and with the first finding.
    statement : str
        The verdict in a sentence or two.
    plant : Plant, optional
        The structure that the law sits on; None for a linear system, as what follows.
    fit : LawFit, optional
        The best law at its place.
    freedom : Freedom, optional
        Unknowns of the linear model that it was fitted with; `simulate` needs them.
    """

    verdict: str
    linearity: Linearity
    findings: tuple[Finding, ...] = ()
    linear_limit: float = np.nan
    before: Misfit | None = None
    after: Misfit | None = None
    statement: str = ""
    plant: Plant | None = None
    fit: LawFit | None = None
    freedom: Freedom | None = None

    @property
    def is_nonlinear(self) -> bool:
        """No linear system explains the recordings."""
        return self.verdict != LINEAR


def search_laws(
    model: StructuralModel,
    observations: Observations,
    options: DiagnoseOptions,
    *,
    folder: Path = Path(),
    progress: Progress = silent,
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
    linearity = assess_linearity(observations)
    if not linearity.is_nonlinear:
        return LawSearch(
            verdict=LINEAR, linearity=linearity, statement="Blows of all levels agree with one linear system."
        )
    laws = chosen_laws(options, folder)
    if not laws:
        return LawSearch(verdict=UNEXPLAINED, linearity=linearity, statement=f"{DISAGREE}; no law was looked for.")
    progress(0.1, "looking for a nonlinear law")
    training, held_out = _divide(observations)
    plant, noise = make_plant(model, observations), read_noise(observations)
    tracks = []
    long = LONG if observations.kind == "hammer" else LONG_SHAKER
    for periods, floor in ((SHORT, ROUGH), (long, FINE)):
        window = Window(duration_s=periods / observations.band_hz[1], floor=floor)
        stretches = transform(training, plant, noise, window)
        freedom = make_freedom(plant, stretches, observations.band_hz[1], options)
        tracks.append(Track(stretches=stretches, linear=fit_linear(stretches, freedom)))
    fits = find_candidates(tracks[0], tracks[1], laws)
    found = _judge(tracks[1].stretches, linearity, plant, fits, tracks[1].linear.cost)
    if found.fit is None:
        return found
    progress(0.9, "proving on what was not fitted")
    before, after = prove(tracks[1], _held_out(held_out, plant, noise, tracks[1]), found.fit)
    return replace(found, freedom=tracks[1].linear.freedom, before=before, after=after)


def _held_out(held_out: Observations, plant: Plant, noise: ChannelNoise, track: Track) -> Stretches | None:
    """Transform what is held out as what was fitted; nothing where no place has blows to spare."""
    if not held_out.blows:
        return None
    return transform(held_out, plant, noise, Window(duration_s=track.stretches.duration_s, floor=FINE))


def _divide(observations: Observations) -> tuple[Observations, Observations]:
    """Hold out one blow at each place that has enough: the second strongest, whose level others enclose."""
    held = []
    if observations.kind == "hammer":
        groups = [observations.at(dof) for dof in observations.input_dofs]
        held = [group[1] for group in groups if len(group) >= LEAST_TO_HOLD]
    kept = tuple(blow for blow in observations.blows if not any(blow is other for other in held))
    return replace(observations, blows=kept), replace(observations, blows=tuple(held))


def _judge(
    stretches: Stretches, linearity: Linearity, plant: Plant, fits: list[LawFit], linear_cost: float
) -> LawSearch:
    if not fits:
        return LawSearch(verdict=UNEXPLAINED, linearity=linearity, statement=f"{DISAGREE}; no law explains it.")
    best = fits[0]
    scale = max(1.0, best.cost / best.n_rows)
    gains = np.array([_gain(fit, linear_cost, len(plant.places), scale) for fit in fits])
    weights = np.exp(gains - gains.max())
    findings = _findings(plant, fits, gains, weights / weights.sum(), scale)
    limit = _linear_limit(stretches, linear_cost) / scale
    needed = findings[0].log_evidence_gain > np.fmax(FOUND_NATS, limit)
    explained = bool(best.cost <= MOST_MISFIT * best.n_rows and needed)
    left = float(np.sqrt(best.cost / best.n_rows))
    why = (
        f"{left:.3g} times the expected misfit is left by the best one ({findings[0].effect})"
        if needed
        else f"the best one ({findings[0].effect}) gains no more than a linear system could"
    )
    return LawSearch(
        verdict=EXPLAINED if explained else UNEXPLAINED,
        linearity=linearity,
        findings=findings,
        linear_limit=limit,
        statement=f"{findings[0].statement} {working_range(best, plant)}"
        if explained
        else f"{DISAGREE}, and no law of the catalogue explains how: {why}.",
        plant=plant,
        fit=best,
    )


def _gain(fit: LawFit, linear_cost: float, n_places: int, scale: float) -> float:
    numbers = [(fit.strength, fit.covariance[0, 0])]
    if fit.law.shape_name:
        numbers.append((fit.shape, fit.covariance[1, 1]))
    gain = 0.5 * (linear_cost - fit.cost) / scale - np.log(n_places)
    for value, variance in numbers:
        spread = min(np.sqrt(max(variance, 1e-300) * scale) / max(abs(value), 1e-300), LOG_RANGE)
        gain += np.log(np.sqrt(2 * np.pi) * max(spread, 1e-12) / LOG_RANGE)
    return float(gain)


def _findings(
    plant: Plant, fits: list[LawFit], gains: FloatArray, probability: FloatArray, scale: float
) -> tuple[Finding, ...]:
    """Make one finding of each law, at its best place."""
    order = np.argsort(-gains)
    found: dict[str, Finding] = {}
    for index in order:
        fit, place = fits[index], plant.places[fits[index].place]
        if fit.law.name in found:
            continue
        mine = [i for i in order if fits[i].law is fit.law]
        share = np.cumsum(probability[mine]) / max(probability[mine].sum(), 1e-300)
        listed = mine[: min(int(np.searchsorted(share, LISTED)) + 1, MOST_PLACES)]
        numbers = _numbers(fit, scale)
        found[fit.law.name] = Finding(
            effect=fit.law.name,
            location=dict(place.location),
            parameters=numbers,
            probability=float(probability[mine].sum()),
            log_evidence_gain=float(gains[index]),
            statement=f"At {place.words} sits {fit.law.phrase.format(f'{fit.strength:.3g}')} that the model lacks.",
            location_set=tuple(dict(plant.places[fits[i].place].location) for i in listed),
        )
    return tuple(found.values())


def _numbers(fit: LawFit, scale: float) -> dict[str, Estimate]:
    values = {fit.law.strength_name: (fit.strength, fit.covariance[0, 0])}
    if fit.law.shape_name:
        values[fit.law.shape_name] = (fit.shape, fit.covariance[1, 1])
    found = {}
    for name, (value, variance) in values.items():
        std = WIDER * float(np.sqrt(max(variance, 0.0) * scale))
        found[name] = Estimate(value=value, std=std, low=value - NORMAL_95 * std, high=value + NORMAL_95 * std)
    return found


def _linear_limit(stretches: Stretches, linear_cost: float) -> float:
    """Evidence that the best FRF of each line and place would gain, for free."""
    if stretches.moving.any():
        return float(np.nan)
    force, motion = stretches.force[:, stretches.used], stretches.motion[:, :, stretches.used]
    weight = 1 / stretches.variance[:, :, stretches.used]
    cost = 0.0
    for number in np.unique(stretches.input_of):
        mine = stretches.input_of == number
        f, y, w = force[mine, None], motion[mine], weight[mine]
        frf = np.sum(w * y * f.conj(), 0) / np.maximum(np.sum(w * np.abs(f) ** 2, 0), 1e-300)
        cost += float(np.sum(w * np.abs(y - frf * f) ** 2))
    return 0.5 * (linear_cost - cost)
