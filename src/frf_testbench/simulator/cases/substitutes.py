"""Other effects that may explain the data of a case as well as the true one does.

Each effect has its known imitators, at its place and next to it. They are fitted to the exact FRFs of the case. What
comes closer than `EQUIVALENT` is accepted as right; the closest of the others is the runner-up, and its distance says
how decidable the case is.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from frf_testbench.simulator.cases.nuisance import Ruler
from frf_testbench.simulator.cases.world import World, make_world
from frf_testbench.simulator.effects.effect import Bench, Effect, unchanged
from frf_testbench.simulator.effects.imitators import Substitute, imitators

FloatArray = NDArray[np.float64]

EQUIVALENT = 3.0  # nats: no data of this size could tell them apart
EVALUATIONS = 25  # of each fit


def compare(bench: Bench, world: World, ruler: Ruler) -> dict[str, Any]:
    """Fit all imitators of the only effect of a case.

    Parameters
    ----------
    bench : Bench
        The specimen on its test bench.
    world : World
        With the effect.
    ruler : Ruler
        From its FRFs.

    Returns
    -------
    dict
        ``equivalents`` and ``runner_up`` (lists, closest first); ``separation_nats`` from the closest other effect and
        ``place_separation_nats`` from the closest other place, None where there is none.
    """
    fits = sorted((_fit(one, world, ruler) for one in imitators(bench, world.effects[0])), key=lambda fit: fit["nats"])
    name = world.effects[0].name
    return {
        "equivalents": [{**fit, "class": "practical"} for fit in fits if fit["nats"] < EQUIVALENT],
        "runner_up": [fit for fit in fits if fit["nats"] >= EQUIVALENT][:2],
        "separation_nats": min((fit["nats"] for fit in fits if fit["effect"] != name), default=None),
        "place_separation_nats": min((fit["nats"] for fit in fits if fit["effect"] == name), default=None),
    }


class _Trial:
    """FRFs of a world with another effect; the structure is solved again only where it changes."""

    def __init__(self, world: World, effect: Effect) -> None:
        self.world = world
        self.template = self._made(replace(effect, damping_factor=1.0, modulus=None))

    def _made(self, effect: Effect) -> World:
        return make_world(self.world.specimen, self.world.set_up, self.world.scatter, (effect,))

    def frf(self, effect: Effect, frequencies_hz: FloatArray) -> NDArray[np.complex128]:
        """(n, n_sensors, n_struck) FRFs with the effect."""
        if effect.change is not unchanged or effect.moved:
            return self._made(effect).measured_frf(frequencies_hz)
        model = self.template.receptance
        ratio = model.damping_ratio.copy()
        ratio[self.template.structure.n_rigid :] *= effect.damping_factor
        attached = tuple(
            replace(old, stiffness=mount.stiffness) for old, mount in zip(model.attachments, effect.mounts, strict=True)
        )
        model = replace(model, damping_ratio=ratio, modulus=effect.modulus, attachments=attached)
        return replace(self.template, receptance=model, effects=(effect,)).measured_frf(frequencies_hz)


def _fit(substitute: Substitute, world: World, ruler: Ruler) -> dict[str, Any]:
    """Fit one imitator; what is left is measured by the ruler."""
    names = list(substitute.start)
    start = np.log([abs(substitute.start[name]) for name in names])
    signs = np.sign([substitute.start[name] for name in names])
    trial = _Trial(world, substitute.build(substitute.start))

    def values(logs: FloatArray) -> dict[str, float]:
        return dict(zip(names, (signs * np.exp(logs)).tolist(), strict=True))

    def residuals(logs: FloatArray) -> FloatArray:
        return ruler.residuals(trial.frf(substitute.build(values(logs)), ruler.frequencies_hz))

    best = start
    if names:
        bounds = (start - 7, start + 7)
        best = least_squares(residuals, start, bounds=bounds, diff_step=1e-4, max_nfev=EVALUATIONS, xtol=1e-5).x
    nats = ruler.nats(trial.frf(substitute.build(values(best)), ruler.frequencies_hz))
    return {
        "effect": substitute.name,
        "location": substitute.location,
        "parameters": {name: float(f"{value:.4g}") for name, value in values(best).items()} | substitute.fixed,
        "nats": float(f"{nats:.4g}"),
    }
