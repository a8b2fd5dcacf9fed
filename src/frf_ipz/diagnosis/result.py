"""What a diagnosis says: verdict, findings with their certainty, and the figures and curves that prove it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.dofs import Dof
from frf_ipz.frf import FrfLabel


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A number with its uncertainty.

    Parameters
    ----------
    value, std : float
        Most probable value and standard deviation, in the unit that the parameter's name ends with.
    low, high : float
        Ends of the 95 % interval; not symmetric for parameters that are known to a factor.
    """

    value: float
    std: float
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """An effect at its place.

    Parameters
    ----------
    effect : str
        Name in the catalogue.
    location : mapping
        What applies of ``nodes``, ``elements``, ``springs``, ``channels``, ``end``, ``groups``, as in `diagnosis.json`.
    parameters : mapping of str to Estimate or str
        By their names in the contract.
    probability : float
        Of this effect, wherever it is, among all that were tried.
    log_evidence_gain : float
        Natural logarithm of the evidence over that without this effect, nats.
    statement : str
        A sentence for the user.
    location_set : tuple of mapping
        All places that hold 95 % of the effect's probability, the most probable first.
    is_significant : bool
        False where it was detected and lies within the user's tolerances.
    key : tuple
        The place as the effect itself knows it.
    values : tuple of float
        Values of the parameters as the effect itself knows them, in its own order.
    """

    effect: str
    location: Mapping[str, object] = field(default_factory=dict)
    parameters: Mapping[str, Estimate | str] = field(default_factory=dict)
    probability: float = 1.0
    log_evidence_gain: float = 0.0
    statement: str = ""
    location_set: tuple[Mapping[str, object], ...] = ()
    is_significant: bool = True
    key: tuple[object, ...] = ()
    values: tuple[float, ...] = ()


def describe_location_set(locations: Sequence[Mapping[str, object]]) -> str:
    """Say between which places a test does not decide.

    Parameters
    ----------
    locations : sequence of mapping
        Locations as in `diagnosis.json`, the most probable first.

    Returns
    -------
    str
        A sentence with a space before it; empty for a single place.
    """
    if len(locations) < 2:
        return ""
    kinds: dict[str, list[tuple[object, ...]]] = {}
    for location in locations:
        distinct = [
            item for item in location.items() if any(alternative.get(item[0]) != item[1] for alternative in locations)
        ]
        for kind, value in distinct[:1]:
            kinds.setdefault(kind, []).append(tuple(value) if isinstance(value, list | tuple) else (value,))
    words = " or ".join(f"{kind} {_in_words(kind, parts)}" for kind, parts in kinds.items())
    return f" The test tells its place no closer than {words}."


def _in_words(kind: str, parts: list[tuple[object, ...]]) -> str:
    """Single numbers as runs, stretches of elements from their first to their last, others as they are."""
    numbers = sorted(number for (number, *more) in parts if isinstance(number, int) and not more)
    if len(numbers) == len(parts):
        breaks = [i for i in range(len(numbers)) if i == 0 or numbers[i] > numbers[i - 1] + 1]
        runs = [numbers[a:b] for a, b in zip(breaks, [*breaks[1:], None], strict=True)]
        return ", ".join(f"{run[0]}" if len(run) == 1 else f"{run[0]} to {run[-1]}" for run in runs)
    joined = " to " if kind == "elements" else " and "
    return ", ".join(joined.join(str(part) for part in dict.fromkeys(location)) for location in parts)


@dataclass(frozen=True, slots=True, kw_only=True)
class DataCheck:
    """A check of the measurement that needs no model.

    Parameters
    ----------
    name : str
        ``homogeneity``, ``reciprocity`` or ``coherence``.
    value : float
        Mean squared difference over its expected square; NaN where it could not be checked.
    limit : float
        What it stays below where nothing is wrong.
    statement : str
        A sentence for the user.
    """

    name: str
    value: float
    limit: float
    statement: str

    @property
    def passed(self) -> bool:
        """True where nothing is wrong, or nothing could be checked."""
        return not self.value > self.limit


@dataclass(frozen=True, slots=True, kw_only=True)
class Misfit:
    """How far a model is from a measurement.

    Parameters
    ----------
    training, held_out : float
        Norm of measured minus model over the norm of measured, on what was fitted and on what was not.
    training_noise, held_out_noise : float
        The same norms over what noise and tolerances make one expect.
    """

    training: float
    held_out: float
    training_noise: float
    held_out_noise: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Ambiguity:
    """Explanations that these data cannot tell apart.

    Parameters
    ----------
    effects : tuple of str
        Names, the most probable first.
    log_bayes_factor : float
        How much more probable the first is than the last.
    resolve_by : str
        The blow or sensor that would tell them apart.
    """

    effects: tuple[str, ...]
    log_bayes_factor: float
    resolve_by: str

    @property
    def statement(self) -> str:
        """What is not told apart and what would do so, in a sentence or two."""
        *others, last = (effect.replace("_", " ") for effect in self.effects)
        return f"These data cannot tell apart: {', '.join(others)} and {last}. {self.resolve_by}".strip()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Curves:
    """FRFs beside the imaginary axis, to be drawn.

    Parameters
    ----------
    s : (n_points,) complex array
        rad/s.
    labels : tuple of FrfLabel
        One an FRF.
    measured, nominal, updated, explained : (n_points, n_frfs) complex array
        As measured; of the model as it is, with what its tolerances allow, and with the findings.
    expected : (n_points, n_frfs) array
        Standard deviation of noise and of what no parameter of the model stands for.
    """

    s: ComplexArray
    labels: tuple[FrfLabel, ...]
    measured: ComplexArray
    nominal: ComplexArray
    updated: ComplexArray
    explained: ComplexArray
    expected: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearisedLaw:
    """A force law as a spring and a damper, about the amplitudes of the test.

    Parameters
    ----------
    ends : tuple of Dof
        Where it acts: against the ground at one DOF, or between two.
    stiffness, damping : float
        About the motion in all blows together, N/m and N s/m.
    motion_rms_m : (n_blows,) array
        Root mean square motion of the place in each blow, ascending.
    stiffness_each, damping_each : (n_blows,) array
        About the motion in that blow alone, N/m and N s/m.
    """

    ends: tuple[Dof, ...]
    stiffness: float
    damping: float
    motion_rms_m: FloatArray
    stiffness_by_record: FloatArray
    damping_by_record: FloatArray

    @property
    def statement(self) -> str:
        """For which motions a linear model may stand for the law."""
        low, high = (
            f"{self.stiffness_by_record[end]:.3g} N/m and {self.damping_by_record[end]:.3g} N s/m" for end in (0, -1)
        )
        return (
            f"At the level of this test, a spring of {self.stiffness:.3g} N/m and a damper of {self.damping:.3g} N s/m "
            f"stand for it in a linear model; with the level they go from {low} (weakest blow, "
            f"{self.motion_rms_m[0]:.3g} m rms) to {high} (strongest, {self.motion_rms_m[-1]:.3g} m rms)."
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LawInTime:
    """A force law at its place in time, to be drawn.

    Parameters
    ----------
    motion_m, velocity_m_s, force_N : (n_times,) array
        Of the place in the blow that moves it most, as far as the law was fitted to it, and of the law there.
    record : str
        Whose response is shown; empty where all blows start in motion, which is not simulated.
    is_held_out : bool
        That blow was not shown to the fit.
    channel, response, unit : str
        Which sensor, the one in which the law shows most, and what it measures: ``acceleration`` in ``m/s^2``, say.
    time_s : (n_samples,) array
        s from the start.
    measured, without, simulated : (n_samples,) array
        As measured, and of the fitted model without the law and with it, SI.
    """

    motion_m: FloatArray
    velocity_m_s: FloatArray
    force_N: FloatArray  # noqa: N815  a unit
    record: str = ""
    is_held_out: bool = False
    channel: str = ""
    response: str = ""
    unit: str = ""
    time_s: FloatArray = field(default_factory=lambda: np.zeros(0))
    measured: FloatArray = field(default_factory=lambda: np.zeros(0))
    without: FloatArray = field(default_factory=lambda: np.zeros(0))
    simulated: FloatArray = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Diagnosis:
    """What is missing from a nominal model, if anything.

    Parameters
    ----------
    verdict : str
        ``consistent``, ``explained`` or ``unexplained``.
    findings : tuple of Finding
        What is missing, the heaviest first; with ``unexplained``, the part that is explained.
    alternatives : tuple of Finding
        Other explanations, the most probable first.
    mismatch_hz : (n,) array
        Frequencies at which the nominal model disagrees with the measurement, Hz.
    mismatch_where : str
        Which FRFs, bands and DOFs disagree, and by how much.
    mismatch_location : mapping
        Where it sits: of the first finding, or where one unknown dynamic stiffness explains most of it; may be empty.
    mismatch : DataFrame
        One row an FRF and band: ``frf``, ``low_hz``, ``high_hz``, ``before``, ``after``: rms misfit over what noise and
        tolerances explain.
    before, updated, after : Misfit
        Of the model as it is, with what its tolerances allow, and with the findings.
    held_out_kind : str
        What was not shown to the fit: ``records`` or ``lines``.
    ambiguity : tuple of Ambiguity
        What cannot be told apart.
    data_checks : tuple of DataCheck
        Checks of the measurement alone.
    detectability : mapping of str to mapping
        Smallest detectable size of each effect, by parameter, where it shows best.
    statement : str
        The verdict in a few sentences.
    unexplained_part : str
        What nothing explains, in words without a full stop; empty where nothing remains, and beside a force law.
    curves : Curves, optional
        FRFs to draw.
    numbers : mapping of str to float
        What the verdict rests on: evidence, misfits, pulls, hypotheses tried.
    warnings : tuple of str
        What the user has to know.
    linearised_law : Linearised, optional
        The force law among the findings, for linear models.
    law_in_time : LawInTime, optional
        The same in time, to be drawn.
    """

    verdict: str
    findings: tuple[Finding, ...]
    alternatives: tuple[Finding, ...]
    mismatch_hz: FloatArray
    mismatch_where: str
    mismatch: pd.DataFrame
    before: Misfit
    updated: Misfit
    after: Misfit
    held_out_kind: str
    mismatch_location: Mapping[str, object] = field(default_factory=dict)
    ambiguity: tuple[Ambiguity, ...] = ()
    data_checks: tuple[DataCheck, ...] = ()
    detectability: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    statement: str = ""
    unexplained_part: str = ""
    curves: Curves | None = None
    numbers: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    linearised_law: LinearisedLaw | None = None
    law_in_time: LawInTime | None = None

    def to_json(self) -> dict[str, Any]:
        """Give the content of ``diagnosis.json``.

        Returns
        -------
        dict
            Plain values.
        """
        return {
            "verdict": self.verdict,
            "statement": self.statement,
            "findings": [_finding(finding) for finding in self.findings],
            "alternatives": [_finding(finding) for finding in self.alternatives],
            "mismatch": {
                "frequency_hz": [round(float(value), 6) for value in self.mismatch_hz],
                "where": self.mismatch_where,
                "location": _location(self.mismatch_location),
            },
            "fit": {
                "before": _misfit(self.before),
                "updated_without_findings": _misfit(self.updated),
                "after": _misfit(self.after),
                "held_out_is": self.held_out_kind,
            },
            "ambiguity": [
                {
                    "effects": list(one.effects),
                    "log_bayes_factor": _plain(one.log_bayes_factor),
                    "resolve_by": one.resolve_by,
                }
                for one in self.ambiguity
            ],
            "data_checks": [
                {
                    "name": gate.name,
                    "value": _plain(gate.value),
                    "limit": _plain(gate.limit),
                    "passed": gate.passed,
                    "statement": gate.statement,
                }
                for gate in self.data_checks
            ],
            "detectability": {name: _all_plain(sizes) for name, sizes in self.detectability.items()},
            "numbers": _all_plain(self.numbers),
            "warnings": list(self.warnings),
            **({} if self.linearised_law is None else {"linear_model": _linear(self.linearised_law)}),
        }


def _finding(finding: Finding) -> dict[str, Any]:
    return {
        "effect": finding.effect,
        "location": _location(finding.location),
        "parameters": {name: _parameter(value) for name, value in finding.parameters.items()},
        "probability": _plain(finding.probability),
        "log_evidence_gain": _plain(finding.log_evidence_gain),
        "statement": finding.statement,
        "location_set": [_location(location) for location in finding.location_set],
        "significant": finding.is_significant,
    }


def _linear(law: LinearisedLaw) -> dict[str, Any]:
    return {
        "between": [dof.name for dof in law.ends],
        "stiffness_N_m": _plain(law.stiffness),
        "damping_Ns_m": _plain(law.damping),
        "motion_rms_m": [_plain(value) for value in law.motion_rms_m],
        "stiffness_at_N_m": [_plain(value) for value in law.stiffness_by_record],
        "damping_at_Ns_m": [_plain(value) for value in law.damping_by_record],
    }


def _location(location: Mapping[str, object]) -> dict[str, object]:
    return {name: list(value) if isinstance(value, tuple) else value for name, value in location.items()}


def _parameter(value: Estimate | str) -> Any:  # noqa: ANN401 - a text, or numbers by name
    if isinstance(value, str):
        return value
    return {"value": _plain(value.value), "std": _plain(value.std), "ci95": [_plain(value.low), _plain(value.high)]}


def _misfit(misfit: Misfit) -> dict[str, float | None]:
    return {
        "training": _plain(misfit.training),
        "held_out": _plain(misfit.held_out),
        "training_over_noise": _plain(misfit.training_noise),
        "held_out_over_noise": _plain(misfit.held_out_noise),
    }


def _all_plain(values: Mapping[str, float]) -> dict[str, float | None]:
    return {name: _plain(value) for name, value in values.items()}


def _plain(value: float) -> float | None:
    """JSON knows no NaN and no infinity."""
    number = float(value)
    return number if abs(number) < float("inf") else None
