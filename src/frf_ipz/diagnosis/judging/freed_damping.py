"""Damping that nothing in the catalogue explains: what else is missing is searched with the damping left free.

A nominal model's damping ratios are often no more than a guess, and those of single modes may be wrong by a factor. The
tolerance of damping then hides everything else that is wrong. What is found beside it is found with damping ratios that
may be anything; the verdict remains that something is not explained.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.judging.decision import UNEXPLAINED
from frf_ipz.diagnosis.judging.verdict import goodness

if TYPE_CHECKING:
    from frf_ipz.diagnosis.judging.decision import Decision
    from frf_ipz.diagnosis.options import DiagnoseOptions
    from frf_ipz.diagnosis.search.fit import Fit
    from frf_ipz.diagnosis.search.inference_problem import InferenceProblem

OF_MODES = ("damping_level", "structural_damping")
ANY = 20.0  # relative tolerance of damping ratios: more than a factor of ten
MOSTLY = 0.5  # of all pulls


def is_damping_alone(bench: InferenceProblem, found: Decision) -> bool:
    """Tell whether damping ratios are what the tolerances do not allow.

    Parameters
    ----------
    bench : InferenceProblem
        Data and model.
    found : Decision
        Unexplained.

    Returns
    -------
    bool
        Then damping is worth to be left free.
    """
    if found.verdict != UNEXPLAINED:
        return False
    suspects = (found.final,) if found.final.is_nearly_all else (found.final, found.null)
    return any(_is_of_damping(bench, fit) for fit in suspects)


def _is_of_damping(bench: InferenceProblem, fit: Fit) -> bool:
    pulls, _ = bench.nuisance.pulls(fit.unknown)
    own = float(np.sum(pulls[bench.nuisance.damping_places] ** 2))
    return own > max(goodness(bench, fit).most_pull, MOSTLY * fit.pull)


def with_any_damping(options: DiagnoseOptions) -> DiagnoseOptions:
    """Leave the damping of modes free.

    Parameters
    ----------
    options : DiagnoseOptions
        Tolerances.

    Returns
    -------
    DiagnoseOptions
        The others.
    """
    return replace(options, damping_tolerance=max(ANY, options.damping_tolerance))


def without_level(bench: InferenceProblem) -> InferenceProblem:
    """Leave out what damping ratios that may be anything stand for.

    Parameters
    ----------
    bench : InferenceProblem
        With damping left free.

    Returns
    -------
    InferenceProblem
        Without the effects of modal damping.
    """
    kept = {name: effect for name, effect in bench.effects.items() if name not in OF_MODES}
    return replace(bench, effects=kept)


def complain(fit: Fit, options: DiagnoseOptions) -> str:
    """Say which damping ratios are not those of the model.

    Parameters
    ----------
    fit : Fit
        With damping left free.
    options : DiagnoseOptions
        The tolerances as stated.

    Returns
    -------
    str
        In words that follow "Something is missing that nothing in the catalogue explains: ".
    """
    nuisance, modes = fit.hypothesis.nuisance, fit.hypothesis.modes(fit.values, fit.unknown)
    changes = fit.unknown[nuisance.damping_places] * nuisance.damping_std
    beyond = np.flatnonzero((np.abs(changes) > options.damping_tolerance) & nuisance.is_stated)
    said = [
        f"{100 * stated * (1 + change):.2g} % instead of {100 * stated:.2g} % at {omega / (2 * np.pi):.4g} Hz"
        for stated, change, omega in zip(
            modes.stated_ratio[beyond], np.maximum(changes[beyond], -1), modes.omega[beyond], strict=True
        )
    ]
    return f"damping ratios are not those of the model ({', '.join(said)})"
