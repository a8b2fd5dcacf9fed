"""The laws and places that explain best: screened, refined, simulated, and their neighbours too.

Short stretches first: within them even strongly nonlinear motion is predictable, and a rough start is good enough. What
is best there is then fitted on the long ones, the best of all until it settles. The stronger a law, the shorter the
stretches from which a rough start leads to it: where even the first moments are nonlinear, they come first.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.nonlinear.fitting.force_localisation import neighbours, start_at
from frf_ipz.diagnosis.nonlinear.fitting.output_error_fit import fit_output_error
from frf_ipz.diagnosis.nonlinear.fitting.refine import LawFit, Start, refine
from frf_ipz.diagnosis.nonlinear.fitting.score_test import LinearFit, linear_motion_of_place, score_laws
from frf_ipz.diagnosis.nonlinear.linear.modal_model import respond

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from frf_ipz.diagnosis.nonlinear.fitting.force_localisation import Whereabouts
    from frf_ipz.diagnosis.nonlinear.laws.law import Law
    from frf_ipz.diagnosis.nonlinear.recorded.segments import SegmentSet

OF_EACH_LAW = 3  # places that are refined
OF_ALL = 5
FEW = 4  # places that nothing but a law tells apart: with more, what explains at one of them may be surpassed
READ = 2  # places at which laws are read from the force itself
SIMULATED = 2  # places of each law that are simulated on short stretches
TURNS = 6  # of the refinement
FIRST, MORE = 2, 6  # steps of the fit by simulation: of all, and of those that are not hopeless
HOPELESS, HOPELESS_LATE = 10.0, 4.0  # times the smallest cost, on short and on long stretches
HOPELESS_NEAR = 1.5  # times the cost of a neighbour that is good already
FINALISTS = 3  # that are simulated on long stretches
FAR_OFF = 4.0  # mean square over the expected one: with more, laws are simulated as they were read
MOST_LEFT = 0.5  # of what a linear model leaves of the first moments: with more, they say little of a law
BETTER = 0.02  # relative drop of the cost that is worth more: by another start, or places beside to be fitted again
NEIGHBOURS = 3  # places beside one: near an end that moves freely the two most alike are both nearer to the end
LEAST_RATIO = 0.01  # of the motions of two places: with less they are no neighbours, and a law would grow without end
CLIMBS = 8  # steps to better neighbours
EXCHANGED, LIKELY = 2, 2.0  # places of the best law that are fitted from its numbers, and times its cost at most
EXCHANGES = 3  # times that this may lead to a better place
TIED = 20.0  # of the cost: fits that close to the best must be settled before they are compared
ROUNDS, FRESH = 4, 12  # of further steps that the best fit may take until it settles, and steps of a fresh one


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LawFitProgress:
    """SegmentSet of one length, and the linear model fitted to them.

    Parameters
    ----------
    stretches : SegmentSet
        The data.
    linear : LinearFit
        The linear model.
    where : Whereabouts
        Where a force may sit.
    """

    stretches: SegmentSet
    linear: LinearFit
    where: Whereabouts

    @property
    def missed(self) -> float:
        """Mean square that the linear model leaves, over the expected one."""
        return self.linear.cost / self.linear.n_rows

    @property
    def duration_s(self) -> float:
        """How long the stretches are, s."""
        return self.stretches.duration_s

    def beside(self, place: int) -> list[int]:
        """Possible places among the few that move most like a place."""
        near = neighbours(self.linear.nuisance_prior.modal_model, place, NEIGHBOURS)
        return [other for other in near if other in self.where.possible]

    def fit_output_error(self, fit: LawFit, iterations: int) -> LawFit:
        """Fit a law by simulation, from a fit to these or other stretches."""
        known = self.linear.nuisance_prior.n_lasting
        unknowns = fit.unknowns
        if len(unknowns) != len(self.linear.unknowns) or fit.n_rows != self.linear.n_rows:
            unknowns = np.concatenate([fit.unknowns[:known], self.linear.unknowns[known:]])
        return fit_output_error(self.stretches, self.linear.nuisance_prior, fit.start(unknowns), iterations=iterations)

    def fit_output_error_afresh(self, fit: LawFit, iterations: int) -> LawFit:
        """Fit a law by simulation from its numbers, with the linear model as it starts without a law."""
        start = fit.start(self.linear.as_stated)
        return fit_output_error(self.stretches, self.linear.nuisance_prior, start, iterations=iterations)


def find_candidates(
    short: LawFitProgress,
    long: LawFitProgress,
    laws: Sequence[Law],
    *,
    first: Callable[[], LawFitProgress] | None = None,
) -> list[LawFit]:
    """Find the laws and places that explain stretches best.

    Parameters
    ----------
    short, long : LawFitProgress
        The data.
    laws : sequence of Law
        To be tried.
    first : callable, optional
        Gives still shorter stretches. They are asked where nothing explains the long ones as well as can be expected.

    Returns
    -------
    list of LawFit
        Fits to the long stretches, the smallest cost first.
    """
    late = sorted(_refined(long, laws) + _read(long, laws), key=lambda fit: fit.cost)
    is_placed = len(long.where.equal) <= FEW and _explain(late)
    known = _finished(long, [fit for law in laws for fit in _of(law, late)[:1]]) if is_placed else []
    if _explain(known):
        return known
    rough = _refined(short, laws)
    told = [fit for fit in late if fit.place in [free.place for free in long.where.forces[:READ]]]
    early = _climbed(
        short, [fit for law in laws for fit in _of(law, rough)[:SIMULATED] + _of(law, late)[:1] + _of(law, told)]
    )
    finalists = early[:FINALISTS] + [_of(law, early)[0] for law in laws if _of(law, early)] + late[:1]
    fits = _best_of_each(known + _finished(long, finalists))
    if fits and fits[0].cost > FAR_OFF * fits[0].n_rows:
        fits = _best_of_each(fits + _finished(long, _as_read(long, laws)))
    if first is None or _explain(fits):
        return fits
    again = _climbed(short, _first(first(), laws))
    if not again or again[0].cost > max(again[0].n_rows, (1 - BETTER) * early[0].cost if early else np.inf):
        return fits
    return _best_of_each(fits + _finished(long, _others(again[:FINALISTS], fits[:1])))


def is_explained(fit: LawFit) -> bool:
    """Tell whether a fit leaves no more than can be expected."""
    return fit.cost < fit.n_rows


def _explain(fits: Sequence[LawFit]) -> bool:
    return bool(fits) and is_explained(fits[0])


def _first(track: LawFitProgress, laws: Sequence[Law]) -> list[LawFit]:
    """Fit the first moments, and keep of each law what explains most of what nothing linear does."""
    refined = _refined(track, laws)
    fits = _climbed(track, [fit for law in laws for fit in _of(law, refined)[:SIMULATED]])
    kept = [fit for fit in fits if fit.cost < min(MOST_LEFT * track.linear.cost, HOPELESS * fits[0].cost)]
    return [fit for law in laws for fit in _of(law, kept)[:SIMULATED]]


def _others(fits: Sequence[LawFit], known: Sequence[LawFit]) -> list[LawFit]:
    """Leave out laws at places that are known, which were fitted afresh already; all, if the best is one of them."""
    had = {(fit.law.name, fit.place) for fit in known}
    new = [fit for fit in fits if (fit.law.name, fit.place) not in had]
    return new if new[:1] == list(fits[:1]) else []


def _climbed(track: LawFitProgress, starts: Iterable[LawFit]) -> list[LawFit]:
    """Fit by simulation, and the neighbours of the best too; the smallest cost first."""
    fits = _simulated(track, _different(starts))
    _climb(track, fits)
    return sorted(fits, key=lambda fit: fit.cost)


def _finished(track: LawFitProgress, finalists: Iterable[LawFit]) -> list[LawFit]:
    """Fit to the long stretches, the best until it settles; the smallest cost first."""
    fits = _simulated(track, _different(finalists), hopeless=HOPELESS_LATE)
    _climb(track, fits)
    if fits:
        climbed = min(fit.cost for fit in fits)
        _settle(track, fits)
        has_moved = min(fit.cost for fit in fits) < (1 - BETTER) * climbed
        for _ in range(EXCHANGES):
            if not _exchange(track, fits, beside=has_moved):
                break
            _settle(track, fits)
            has_moved = True
        _settle_ties(track, fits)
    return sorted(fits, key=lambda fit: fit.cost)


def _best_of_each(fits: Iterable[LawFit]) -> list[LawFit]:
    """Keep the best fit of each law and place; the smallest cost first."""
    return _different(sorted(fits, key=lambda fit: fit.cost))


def _of(law: Law, fits: Iterable[LawFit]) -> list[LawFit]:
    return [fit for fit in fits if fit.law is law]


def _different(fits: Iterable[LawFit]) -> list[LawFit]:
    """Keep the first of each law and place that does something."""
    found: dict[tuple[str, int], LawFit] = {}
    for fit in fits:
        if fit.strength != 0:
            found.setdefault((fit.law.name, fit.place), fit)
    return list(found.values())


def _refined(track: LawFitProgress, laws: Sequence[Law]) -> list[LawFit]:
    guesses = score_laws(track.stretches, track.linear, laws, places=track.where.possible)
    unknowns = track.linear.as_stated
    chosen = [guess for law in laws for guess in [g for g in guesses if g.law is law][:OF_EACH_LAW]]
    chosen += [guess for guess in guesses[:OF_ALL] if guess not in chosen]
    fits = []
    for guess in chosen:
        start = Start(law=guess.law, place=guess.place, strength=guess.strength, shape=guess.shape, unknowns=unknowns)
        fit = refine(track.stretches, track.linear.nuisance_prior, start, n_turns=TURNS, known=False)
        fits.append(fit if fit.strength else replace(fit, strength=guess.strength, shape=guess.shape))
    return sorted(fits, key=lambda fit: fit.cost)


def _read(track: LawFitProgress, laws: Sequence[Law]) -> list[LawFit]:
    """Fit the laws from numbers that are read from the force."""
    return [
        refine(track.stretches, track.linear.nuisance_prior, start, n_turns=TURNS) for start in _starts(track, laws)
    ]


def _as_read(track: LawFitProgress, laws: Sequence[Law]) -> list[LawFit]:
    """Simulate the laws with the numbers read, which refining may have led astray."""
    return [
        fit_output_error(track.stretches, track.linear.nuisance_prior, start, iterations=FIRST)
        for start in _starts(track, laws)
    ]


def _starts(track: LawFitProgress, laws: Sequence[Law]) -> list[Start]:
    """Read the laws from the force itself at the likeliest places, whatever its law."""
    starts = [start_at(track.stretches, track.linear, free, law) for free in track.where.forces[:READ] for law in laws]
    return [start for start in starts if start.strength]


def _simulated(
    track: LawFitProgress, fits: Sequence[LawFit], *, hopeless: float = HOPELESS, least: float = np.inf
) -> list[LawFit]:
    """Fit by simulation; those that stay hopeless after a few steps, against the least cost, only so far."""
    found = [track.fit_output_error(fit, FIRST) for fit in fits]
    least = min(least, *(fit.cost for fit in found)) if found else least
    return [fit if fit.settled or fit.cost > hopeless * least else track.fit_output_error(fit, MORE) for fit in found]


def _settle(track: LawFitProgress, fits: list[LawFit]) -> None:
    """Fit the best law further, as long as it gets better, and once more with the linear model as at first."""
    best, is_fresh = min(range(len(fits)), key=lambda i: fits[i].cost), False
    for _ in range(ROUNDS):
        fit = fits[best]
        if not fit.settled:
            fits[best] = track.fit_output_error(fit, MORE)
        elif is_fresh or fit.cost < fit.n_rows:
            return
        else:  # what is strongly nonlinear has other minima, in which starts of stretches are taken for the law
            again, is_fresh = track.fit_output_error_afresh(fit, FRESH), True
            fits[best] = min(fit, again, key=lambda one: one.cost)


def _settle_ties(track: LawFitProgress, fits: list[LawFit]) -> None:
    """Fit further what comes so close to the best fit that where it was given up might decide between the two."""
    least = min(fit.cost for fit in fits)
    for number, fit in enumerate(fits):
        if not fit.settled and fit.cost < least + TIED:
            fits[number] = min(fit, track.fit_output_error(fit, MORE), key=lambda one: one.cost)


def _exchange(track: LawFitProgress, fits: list[LawFit], *, beside: bool) -> bool:
    """Fit a law once more at its next best places, and at those beside the best if asked, from its numbers there.

    They were fitted from numbers that were less good, and may have been led astray. True if one is better than all.
    """
    best = min(fits, key=lambda fit: fit.cost)
    likely = [fit for fit in fits if fit.law is best.law and best.cost < fit.cost < LIKELY * best.cost]
    others = [fit.place for fit in sorted(likely, key=lambda fit: fit.cost)[:EXCHANGED]]
    others += [place for place in (track.beside(best.place) if beside else []) if place not in others]
    again = _simulated(track, [_moved(track, best, place) for place in others], least=best.cost)
    fits[:] = _best_of_each(fits + again)
    return fits[0] is not best


def _climb(track: LawFitProgress, fits: list[LawFit]) -> None:
    """Fit the neighbours of the best fit, as long as one of them is better."""
    done = {(fit.law.name, fit.place) for fit in fits}
    for _ in range(CLIMBS if fits else 0):
        best = min(fits, key=lambda fit: fit.cost)
        new = [place for place in track.beside(best.place) if (best.law.name, place) not in done]
        if not new:
            return
        done |= {(best.law.name, place) for place in new}
        moved = [_moved(track, best, place) for place in new]
        hopeless = HOPELESS_NEAR if best.cost < best.n_rows else HOPELESS
        fits += _simulated(track, moved, hopeless=hopeless, least=best.cost)


def _moved(track: LawFitProgress, fit: LawFit, place: int) -> LawFit:
    """Bring a law to another place, where it moves as much and does as much work as at its own."""
    nuisance_prior = track.linear.nuisance_prior
    here, there = nuisance_prior.modal_model.at_places.shapes[[fit.place, place]]
    moved = replace(fit, place=place, unknowns=nuisance_prior.of_no_place(fit.unknowns))
    if abs(float(here @ there)) < LEAST_RATIO * max(float(np.linalg.norm(here)), 1e-300) ** 2:
        return moved
    ratio = _size(track, moved) / max(_size(track, fit), 1e-300)
    return replace(moved, shape=fit.shape * ratio, strength=fit.strength / ratio**fit.law.degree)


def _size(track: LawFitProgress, fit: LawFit) -> float:
    """How much the place of a law moves in all stretches, with the linear model of its fit but without its force."""
    stretches, nuisance_prior = track.stretches, track.linear.nuisance_prior
    response = respond(nuisance_prior.modal_model, stretches.s, nuisance_prior.deviations(fit.unknowns, fit.place))
    _, motion = linear_motion_of_place(stretches, nuisance_prior, fit.unknowns, response, fit.place)
    return float(np.linalg.norm(motion))
