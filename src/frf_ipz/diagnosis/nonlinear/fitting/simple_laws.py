"""Where a force sits whose law is not known: a sum of many simple laws at one place, free in all their strengths.

Powers of the motion and of the velocity, dead zones on either side and friction bend into nearly any law that has no
memory; springs that slip, at once or more and more (Bouc 1967, Wen 1976), into many a hysteresis. Such a sum says
nothing about the law, but only at the right place does it reach all sensors as it should.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.nonlinear.fitting.candidates import LawFitProgress
from frf_ipz.diagnosis.nonlinear.fitting.force_localisation import TIE
from frf_ipz.diagnosis.nonlinear.fitting.motion import Clock
from frf_ipz.diagnosis.nonlinear.fitting.normal_equations import step_to
from frf_ipz.diagnosis.nonlinear.fitting.refine import Start, motion_at
from frf_ipz.diagnosis.nonlinear.fitting.score_test import LinearFit, as_real, linear_motion
from frf_ipz.diagnosis.nonlinear.laws.cubic_stiffness import CubicStiffness

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from frf_ipz.diagnosis.nonlinear.linear.modal_model import ModalResponse
    from frf_ipz.diagnosis.nonlinear.recorded.segments import SegmentSet

DEAD_ZONES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)  # parts of the largest motion
YIELDS = (0.02, 0.05, 0.1, 0.2, 0.4)  # parts of the largest motion: a spring slips beyond, at once or more and more
STEEP = 3e-3  # of the largest velocity: below, friction grows with it
FEW_TURNS, MANY_TURNS = 3, 8
FINALISTS = 4  # places that are fitted on long stretches
CLIMBERS, CLIMBS = 3, 24  # places from which better neighbours are looked for, and steps: few, unless it is far off
RIDGE = 1e-6  # of a column's own square: many of the laws are nearly alike
SETTLED = 1e-3  # relative change of the cost between turns


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AnyForce:
    """The best sum of simple laws at a place.

    Parameters
    ----------
    place : int
        Index in `Plant.places`.
    cost : float
        Weighted sum of squared misfits, and of squared unknowns.
    left, missed : float
        The cost, and that of the linear model, over the number of data.
    alike : tuple of int
        Places at which such sums explain as much, with itself, the best first; empty where others were not compared.
    """

    place: int
    cost: float
    left: float
    missed: float
    alike: tuple[int, ...] = ()

    @classmethod
    def on(cls, track: LawFitProgress, place: int, cost: float) -> AnyForce:
        """Put down what a force at a place leaves."""
        return cls(place=place, cost=cost, left=cost / track.linear.n_rows, missed=track.missed)


def find_place(short: LawFitProgress, long: LawFitProgress, likely: Iterable[int]) -> tuple[AnyForce, AnyForce]:
    """Find the place of a force whose law is not known, among those at which any force explains as much.

    Parameters
    ----------
    short, long : LawFitProgress
        The data.
    likely : iterable of int
        Places that are fitted to the long stretches, whatever the short ones say.

    Returns
    -------
    on_long, on_short : AnyForce
        The best place by the long stretches, and by the short ones, on which any force is known better.
    """
    equal = long.where.equal
    rough = sorted((fit_anything(short, place, FEW_TURNS) for place in equal), key=lambda one: one.cost)
    done = {*(place for place in likely if place in equal), *(one.place for one in rough[:FINALISTS])}
    fits = [fit_anything(long, place, MANY_TURNS) for place in sorted(done)]
    for _ in range(CLIMBS):
        best = sorted(fits, key=lambda one: one.cost)[:CLIMBERS]
        near = {place for one in best for place in long.beside(one.place) if place in equal} - done
        if not near:
            break
        done |= near
        fits += [fit_anything(long, place, MANY_TURNS) for place in near]
    return _with_alike(fits), fit_anything(short, rough[0].place, MANY_TURNS)


def _with_alike(fits: Sequence[AnyForce]) -> AnyForce:
    """Take the best, with places that may be it as well: where less is left than expected, less tells them apart."""
    best_first = sorted(fits, key=lambda one: one.cost)
    best = best_first[0]
    most = best.cost + TIE * min(best.left, 1.0)
    return replace(best, alike=tuple(one.place for one in best_first if one.cost <= most))


def fit_anything(track: LawFitProgress, place: int, n_turns: int) -> AnyForce:
    """Fit a sum of simple laws at a place.

    Parameters
    ----------
    track : LawFitProgress
        The data, and the linear model.
    place : int
        Index in `Plant.places`.
    n_turns : int
        At most: motion, force and linear model are found in turns.

    Returns
    -------
    AnyForce
        The best turn.
    """
    stretches, linear = track.stretches, track.linear
    clock, nuisance_prior = Clock(stretches), linear.nuisance_prior
    unknowns = linear.as_stated
    force: ComplexArray | None = None
    best = np.inf
    for _ in range(n_turns):
        start = Start(law=CubicStiffness(), place=place, strength=0.0, shape=0.0, unknowns=unknowns)
        response, w, v = motion_at(stretches, nuisance_prior, start, clock, force)
        forces = clock.at_lines(simple_forces(w, v))
        rows, misfit = _rows(stretches, linear, response, start, forces, force)
        step, _ = step_to(rows, misfit, unknowns, RIDGE)
        left = misfit - step @ rows
        n = len(unknowns)
        unknowns = unknowns + step[:n]
        force = np.tensordot(step[n:], forces, 1)
        before, best = best, min(best, float(left @ left + unknowns @ unknowns))
        if best > (1 - SETTLED) * before:
            break
    return AnyForce.on(track, place, best)


def simple_forces(w: FloatArray, v: FloatArray) -> FloatArray:
    """Give forces of many kinds, none of them above one.

    Parameters
    ----------
    w, v : (n_blows, n_times) array
        Motion and velocity of a place, m and m/s.

    Returns
    -------
    (n_kinds, n_blows, n_times) array
        N.
    """
    x, y = w / max(float(np.abs(w).max()), 1e-300), v / max(float(np.abs(v).max()), 1e-300)
    forces = [x * x, x**3, x**5, x * np.abs(x), y * np.abs(y), y**3, x * x * y, np.tanh(y / STEEP)]
    for part in DEAD_ZONES:
        forces += [np.maximum(sign * x - part, 0.0) for sign in (1, -1)]
    return np.concatenate([np.array(forces), _slipping(x)])


def _slipping(x: FloatArray) -> FloatArray:
    """(2 n_yields, n_blows, n_times) stretches of springs that slip beyond a limit, or the more the nearer it is.

    The latter is a model of Bouc and Wen, dz = dx (1 - |z| / limit) while it is loaded and dx while it is unloaded.
    Both are known in closed form from one turn of the motion to the next.
    """
    limits = np.array(YIELDS)[:, None]
    found = np.zeros((len(x), 2, len(limits), x.shape[1]))
    for path, (at_once, gradual) in zip(np.pad(x, ((0, 0), (1, 0))), found, strict=True):
        ways = np.where(np.diff(path) < 0, -1.0, 1.0)
        stretch = bent = np.zeros_like(limits)
        for first, last in pairwise([0, *(np.flatnonzero(np.diff(ways)) + 1), len(ways)]):
            way, here = ways[first], slice(first, last)
            gone = way * (path[first + 1 : last + 1] - path[first])
            at_once[:, here] = way * np.minimum(way * stretch + gone, limits)
            loaded, unloaded = np.maximum(way * bent, 0.0), np.minimum(way * bent, 0.0) + gone
            ahead = limits - (limits - loaded) * np.exp(-np.maximum(unloaded, 0.0) / limits)
            gradual[:, here] = way * np.where(unloaded < 0, unloaded, ahead)
            stretch, bent = at_once[:, last - 1 : last], gradual[:, last - 1 : last]
    return np.concatenate((found / limits).transpose(1, 2, 0, 3))


def _rows(
    stretches: SegmentSet,
    linear: LinearFit,
    response: ModalResponse,
    start: Start,
    forces: ComplexArray,
    force: ComplexArray | None,
) -> tuple[FloatArray, FloatArray]:
    """Derive by unknowns and strengths, and give the misfit without any force; weighted, (.., n_rows)."""
    nuisance_prior, used = linear.nuisance_prior, stretches.used
    weight = 1 / np.sqrt(stretches.variance[:, :, used])
    shown = linear_motion(stretches, nuisance_prior, response)
    shown[nuisance_prior.moving] += nuisance_prior.sensor_starts(start.unknowns, response)
    misfit = as_real((stretches.motion - shown)[:, :, used] * weight)
    on_place = np.zeros((stretches.n_records, len(used)), complex) if force is None else -force[:, used]
    by_unknowns = as_real(nuisance_prior.columns(stretches, response.on(used), on_place, start.place))
    to_sensors = response.to_sensors(start.place)[:, used]
    return np.concatenate([by_unknowns, as_real(-to_sensors * forces[:, :, None, used] * weight)]), misfit
