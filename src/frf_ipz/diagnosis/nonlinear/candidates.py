"""The laws and places worth a closer look: screened, refined, and their neighbours too."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.nonlinear.refine import LawFit, Start, refine
from frf_ipz.diagnosis.nonlinear.screen import LinearFit, screen

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.diagnosis.nonlinear.laws.law import Law
    from frf_ipz.diagnosis.nonlinear.plant import Plant
    from frf_ipz.diagnosis.nonlinear.stretches import Stretches

OF_EACH_LAW = 3  # places that are refined
OF_ALL = 5
NEIGHBOURS = 2
CLIMBS = 6  # steps to better neighbours
TURNS = 6


def find_candidates(stretches: Stretches, linear: LinearFit, laws: Sequence[Law]) -> list[LawFit]:
    """Find the laws and places that explain stretches best.

    Parameters
    ----------
    stretches : Stretches
        The data.
    linear : LinearFit
        The linear model.
    laws : sequence of Law
        To be tried.

    Returns
    -------
    list of LawFit
        The smallest cost first.
    """
    guesses = screen(stretches, linear, laws)
    unknowns = linear.unknowns.copy()
    unknowns[: sum(linear.freedom.sizes[:4])] = 0.0
    chosen = [guess for law in laws for guess in [g for g in guesses if g.law is law][:OF_EACH_LAW]]
    chosen += [guess for guess in guesses[:OF_ALL] if guess not in chosen]
    fits = []
    for guess in chosen:
        start = Start(law=guess.law, place=guess.place, strength=guess.strength, shape=guess.shape, unknowns=unknowns)
        fits.append(refine(stretches, linear.freedom, start, n_turns=TURNS, known=False))
    _climb(stretches, linear, fits)
    return sorted(fits, key=lambda fit: fit.cost)


def _climb(stretches: Stretches, linear: LinearFit, fits: list[LawFit]) -> None:
    """Refine the neighbours of the best fit, as long as one of them is better."""
    done = {(fit.law.name, fit.place) for fit in fits}
    for _ in range(CLIMBS if fits else 0):
        best = min(fits, key=lambda fit: fit.cost)
        near = neighbours(linear.freedom.plant, best.place, NEIGHBOURS)
        new = [place for place in near if (best.law.name, place) not in done]
        if not new:
            return
        for place in new:
            done.add((best.law.name, place))
            start = Start(law=best.law, place=place, strength=best.strength, shape=best.shape, unknowns=best.unknowns)
            fits.append(refine(stretches, linear.freedom, start, n_turns=TURNS, known=True))


def neighbours(plant: Plant, place: int, count: int) -> list[int]:
    """List the places whose mode shapes are most like those of a place.

    Parameters
    ----------
    plant : Plant
        The structure.
    place : int
        Index in `Plant.places`.
    count : int
        How many.

    Returns
    -------
    list of int
        The most alike first.
    """
    shapes = plant.at_places.shapes
    alike = shapes / np.maximum(np.linalg.norm(shapes, axis=1), 1e-300)[:, None]
    return [int(i) for i in np.argsort(np.linalg.norm(alike - alike[place], axis=1))[1 : count + 1]]
