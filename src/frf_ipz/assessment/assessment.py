"""What an assessment says: the verdict, its checks, and what most likely has to be corrected."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from enum import Enum

import numpy as np

from frf_ipz.assessment.deviations import FrfDeviation
from frf_ipz.display import Tabulated


class Verdict(Enum):
    """Whether a result can be used; the values are the words of `run.json`.

    Examples
    --------
    >>> import frf_ipz
    >>> frf_ipz.Verdict("with care") is frf_ipz.Verdict.WITH_CARE
    True
    """

    USABLE = "usable"
    WITH_CARE = "with care"
    NOT_USABLE = "not usable"

    @property
    def severity(self) -> int:
        """0 for usable, rising."""
        return list(Verdict).index(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One question that was asked of a run.

    Parameters
    ----------
    name : str
        What was looked at.
    verdict : Verdict
        What follows for the result.
    figure, limit : float
        What was found, and from where on it costs the verdict; NaN where there is no number.
    unit : str
        Of both.
    where : str
        Where it is worst: an FRF, a mode, a part.
    says : str
        What was found, with the reason for the limit.
    advice : str
        What to do; empty where there is nothing to be done.
    is_answered : bool
        False where nothing was looked at: it costs nothing then, and speaks for nothing either.

    Examples
    --------
    >>> import frf_ipz
    >>> check = frf_ipz.Check(
    ...     name="amplitude at the measured points", verdict=frf_ipz.Verdict.USABLE, figure=0.04, limit=1.0, unit="dB",
    ...     where="20:+z / 18:+z", says="the updated model is 0.04 dB off", advice="",
    ... )
    >>> check.verdict.value
    'usable'
    """

    name: str
    verdict: Verdict
    figure: float = float("nan")
    limit: float = float("nan")
    unit: str = ""
    where: str = ""
    says: str = ""
    advice: str = ""
    is_answered: bool = True

    @property
    def outcome(self) -> str:
        """The verdict in words, and that there is none of what was not looked at."""
        return self.verdict.value if self.is_answered else "no answer"


@dataclass(frozen=True, slots=True, kw_only=True)
class LikelyCause:
    """What a user most likely has to correct.

    Parameters
    ----------
    says : str
        The mistake, and what to write instead.
    file : str
        The file in which it stands.
    line_or_key : str
        The key or line in it.
    probability : float
        That it is this, given what was measured.

    Examples
    --------
    >>> import frf_ipz
    >>> cause = frf_ipz.LikelyCause(
    ...     says="every response is in g", file="test.toml", line_or_key="[[channel]] unit", probability=0.99
    ... )
    >>> cause.file
    'test.toml'
    """

    says: str
    file: str
    line_or_key: str
    probability: float

    @property
    def place(self) -> str:
        """Where to correct, and how sure that is, for people."""
        return f"{self.file}, {self.line_or_key}; probability {self.probability:.2f}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Assessment(Tabulated):
    """Whether the result of a run can be used.

    Parameters
    ----------
    verdict : Verdict
        The worst of all checks.
    checks : tuple of Check
        The worst first.
    likely_cause : LikelyCause, optional
        What most likely has to be corrected; None where no mistake is more likely than not.
    deviations : tuple of FrfDeviation
        How far the models are from what was measured, at the points of interest first, where something was.

    Examples
    --------
    >>> import frf_ipz
    >>> assessment = frf_ipz.Assessment.of_checks([frf_ipz.Check(name="fit", verdict=frf_ipz.Verdict.WITH_CARE)])
    >>> assessment.verdict.value
    'with care'
    """

    verdict: Verdict
    checks: tuple[Check, ...]
    likely_cause: LikelyCause | None = None
    deviations: tuple[FrfDeviation, ...] = ()

    def __repr__(self) -> str:
        costly = [check.name for check in self.costly]
        return f"Assessment: {self.verdict.value}" + (f", because of {', '.join(costly)}" if costly else "")

    @property
    def costly(self) -> tuple[Check, ...]:
        """The checks that cost the verdict, the worst first."""
        return tuple(check for check in self.checks if check.verdict is not Verdict.USABLE)

    @classmethod
    def of_checks(
        cls,
        checks: list[Check],
        likely_cause: LikelyCause | None = None,
        *,
        deviations: tuple[FrfDeviation, ...] = (),
    ) -> Assessment:
        """Draw the verdict from checks.

        Parameters
        ----------
        checks : list of Check
            In any order.
        likely_cause : LikelyCause, optional
            What most likely has to be corrected: with it, a result is used with care at best.
        deviations : tuple of FrfDeviation
            How far the models are from what was measured.

        Returns
        -------
        Assessment
            With the worst check first.
        """
        order = sorted(checks, key=lambda check: -check.verdict.severity)
        least = Verdict.USABLE if likely_cause is None else Verdict.WITH_CARE
        verdict = max([least, *(check.verdict for check in checks)], key=lambda verdict: verdict.severity)
        return cls(verdict=verdict, checks=tuple(order), likely_cause=likely_cause, deviations=deviations)

    def to_json(self) -> dict[str, object]:
        """Give what stands in `run.json`: plain values, null for what is not a number.

        Returns
        -------
        dict
            ``verdict, checks, likely_cause, deviations``.
        """
        checks = [
            {
                **{name: value for name, value in asdict(check).items() if name not in ("verdict", "figure", "limit")},
                "verdict": check.verdict.value,
                "figure": _number(check.figure),
                "limit": _number(check.limit),
            }
            for check in self.checks
        ]
        cause = None if self.likely_cause is None else asdict(self.likely_cause)
        return {
            "verdict": self.verdict.value,
            "checks": checks,
            "likely_cause": cause,
            "deviations": [deviation.to_json() for deviation in self.deviations],
        }


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
