"""The mistake that most likely explains a mismatch of measured and computed modes.

Every kind of mistake, that there is none, and that it is something else have the same probability beforehand, which the
causes of a kind share. What a diagnosis found competes with them on the same evidence, as a kind of its own: the modes
of the model with that in it. A new kind is one more function in `KINDS`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np
from scipy.special import logsumexp

from frf_ipz.assessment.assessment import LikelyCause
from frf_ipz.assessment.causes import gains, materials, places, supports
from frf_ipz.assessment.causes.cause import NO_MISTAKE, Cause, Situation, explains, log_evidence
from frf_ipz.assessment.causes.cost_bounds import bound_costs
from frf_ipz.assessment.causes.modal_comparison import unrelated_log_likelihood
from frf_ipz.assessment.causes.places import ExchangedSensors, MisplacedSensors

if TYPE_CHECKING:
    from collections.abc import Iterable

    from frf_ipz.assessment.causes.cause import Causes, FindCauses
    from frf_ipz.assessment.causes.modal_comparison import ComputedModes

KINDS: tuple[FindCauses, ...] = (
    gains.of_all_outputs,
    gains.of_the_force,
    gains.of_one_output,
    gains.of_signs,
    gains.of_derivatives,
    places.exchanged_sensors,
    places.exchanged_inputs,
    places.misplaced_sensor,
    places.mirrored,
    materials.wrong_units,
    materials.wrong_values,
    materials.time_unit,
    supports.other_supports,
)
MORE_LIKELY_THAN_NOT = 0.5
NEGLIGIBLE = 1e-6  # probability of all causes together that are left out


def find_likely_cause(situation: Situation, explained: ComputedModes | None = None) -> LikelyCause | None:
    """Say what most likely has to be corrected.

    Parameters
    ----------
    situation : Situation
        Measurement and model.
    explained : ComputedModes, optional
        Those of the model with what a diagnosis found, where that explains the measurement.

    Returns
    -------
    LikelyCause or None
        None where no mistake is more likely than not.
    """
    if not len(situation.measured.frequency_hz) or not len(situation.computed.frequency_hz):
        return None
    nothing = log_evidence(NO_MISTAKE, situation)
    others = [nothing, unrelated_log_likelihood(situation.measured)]
    if explained is not None:
        others.append(log_evidence(replace(NO_MISTAKE, computed=explained), situation))
    causes, of_causes = _log_evidences(situation, others)
    if not causes:
        return None
    logs = np.array([*others, *of_causes])
    probability = np.exp(logs - logsumexp(logs))[len(others) :]
    if probability.sum() <= MORE_LIKELY_THAN_NOT or not explains(causes[int(np.argmax(probability))], situation):
        return None
    return _worded(causes, probability)


def _log_evidences(situation: Situation, others: list[float]) -> tuple[list[Cause], list[float]]:
    """Give the causes that may matter, and the log evidence of each; none where all together are the less likely."""
    kinds = [_listed(kind(situation)) for kind in KINDS]
    counts = [len(causes) for causes in kinds]
    bounds, negligible = bound_costs(situation), np.log(NEGLIGIBLE / max(sum(counts), 1))
    largest_logs = np.concatenate([bounds.largest_logs(causes, least=max(others) + negligible) for causes in kinds])
    whose = np.repeat(np.arange(len(kinds)), counts)
    number = np.concatenate([np.arange(count) for count in counts])
    order = np.argsort(-largest_logs, kind="stable")
    rest = np.logaddexp.accumulate(largest_logs[order][::-1])[::-1]  # of each cause and all after it, together
    found: list[Cause] = []
    logs: list[float] = []
    nothing, total = logsumexp(others), -np.inf
    for place, of_rest in zip(order.tolist(), rest.tolist(), strict=True):
        if np.logaddexp(total, of_rest) <= nothing:
            return [], []
        if largest_logs[place] < max([*others, *logs]) + negligible:
            break
        found.append(kinds[whose[place]][int(number[place])])
        logs.append(bounds.log_evidence(found[-1]))
        total = np.logaddexp(total, logs[-1])
    return found, logs


def _listed(causes: Iterable[Cause] | Causes) -> Causes:
    return causes if isinstance(causes, (ExchangedSensors, MisplacedSensors)) else list(cast("Iterable[Cause]", causes))


def agrees(situation: Situation) -> bool:
    """Tell whether measured and computed modes agree as they stand, as those of a nearly right model do.

    Parameters
    ----------
    situation : Situation
        Measurement and model.

    Returns
    -------
    bool
        True where nothing has to be corrected to make them agree.
    """
    return explains(NO_MISTAKE, situation)


def _worded(causes: list[Cause], probability: np.ndarray) -> LikelyCause:
    """Put the best cause into words, with the others that are nearly as likely and stand elsewhere."""
    order = np.argsort(-probability)
    best = causes[order[0]]
    alike = [
        causes[place]
        for place in order[1:]
        if probability[place] > probability[order[0]] / np.e and causes[place].line_or_key != best.line_or_key
    ]
    keys = {cause.line_or_key: cause.file for cause in (best, *alike)}
    total = sum(probability[place] for place, cause in enumerate(causes) if cause.line_or_key in keys)
    says = best.says + "".join(f"; or {cause.says}" for cause in alike)
    files = list(keys.values())
    named = ["" if file == before else f"{file}, " for before, file in zip([best.file, *files], files, strict=False)]
    places = "; or ".join(file + key for file, key in zip(named, keys, strict=True))
    return LikelyCause(says=says, file=best.file, line_or_key=places, probability=float(min(total, 1.0)))
