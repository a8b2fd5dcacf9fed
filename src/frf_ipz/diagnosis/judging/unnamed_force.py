"""A force at one place that no effect of the catalogue describes, where it explains more than what was found."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, cast

from frf_ipz.diagnosis.judging.forces.local_force import LocalForce, where_of
from frf_ipz.diagnosis.judging.forces.negative_spring import NegativeSpring
from frf_ipz.diagnosis.judging.forces.power_law import PowerLaw
from frf_ipz.diagnosis.judging.verdict import LIMITS
from frf_ipz.diagnosis.search.global_scan.grid_scan import wide_search
from frf_ipz.diagnosis.search.global_scan.starts import bring_closer, refine_far
from frf_ipz.diagnosis.search.neighbourhood_search import climb_all
from frf_ipz.diagnosis.search.search import ranked

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.diagnosis.judging.decision import Decision
    from frf_ipz.diagnosis.search.fit import Fit
    from frf_ipz.diagnosis.search.global_scan.signatures import Start
    from frf_ipz.diagnosis.search.global_scan.starts import Supposed
    from frf_ipz.diagnosis.search.inference_problem import InferenceProblem

KINDS: tuple[LocalForce, ...] = (PowerLaw(), NegativeSpring())
FITTED = 5  # places with large errors
FAR_BEHIND = 300.0  # nats, with large errors: such a force is not fitted exactly


def find_unnamed_force(bench: InferenceProblem, found: Decision) -> Fit | None:
    """Look for one force that explains more than what was found, or as much as several causes.

    Parameters
    ----------
    bench : InferenceProblem
        Data and model.
    found : Decision
        With one cause or more.

    Returns
    -------
    Fit or None
        Of a force; None where what was found explains as much, or is one cause that has no dynamics of its own.
    """
    causes = found.final.hypothesis.causes
    are_dynamic = bool(causes) and all(cause.effect.has_dynamics for cause in causes)
    kinds = [kind for kind in KINDS if are_dynamic or (kind.rivals_several and len(causes) > 1)]
    if not kinds:
        return None
    bar = bench.fit_early(causes, found.final.values).cost + FAR_BEHIND
    fits = [fit for kind in kinds if (fit := _best_of(bench, found.null, kind, bar)) is not None]
    needed = found.final.log_evidence + (LIMITS[bench.kind].beside_nats if len(causes) == 1 else 0.0)
    return max((fit for fit in fits if fit.log_evidence > needed), key=lambda fit: fit.log_evidence, default=None)


def _best_of(bench: InferenceProblem, null: Fit, kind: LocalForce, bar: float) -> Fit | None:
    """Fit a kind of force at its best place; none where its cost with large errors is above a bar."""
    only = replace(bench, effects={kind.name: kind})
    refined = refine_far(only, null, wide_search(only, null))
    early = [only.fit_early((*known, start.cause), start.values) for known, start in _closer(only, refined)]
    best = min(early, key=lambda fit: fit.cost)
    if best.cost > bar:
        return None
    exact = only.fit_from(best)
    fits = {exact.hypothesis.causes[-1].key: exact}
    climb_all(only, null, fits)
    return ranked(only, fits.values())[0]


def describe_unnamed_force(fit: Fit) -> str:
    """Say what explains more than the catalogue.

    Parameters
    ----------
    fit : Fit
        Of a force.

    Returns
    -------
    str
        In words that follow "Something is missing that nothing in the catalogue explains: ".
    """
    (cause,) = fit.hypothesis.causes
    kind = cast("LocalForce", cause.effect)
    return kind.words(where_of(fit.hypothesis.specimen, cause.place), float(fit.values[-1]))


def _closer(bench: InferenceProblem, refined: Sequence[Start]) -> list[Supposed]:
    return bring_closer(bench, [((), start) for start in refined[:FITTED]])
