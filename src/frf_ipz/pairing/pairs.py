"""What pairing gives: every measured pole and zero against its counterpart in the model, with the reason."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from frf_ipz.display import Drawn, Tabulated
from frf_ipz.frf import FrfLabel


class PairVerdict(Enum):
    """Result of pairing a pole or zero."""

    PAIRED = "paired"
    MISSING_IN_MODEL = "missing in the model"
    MISSING_IN_MEASUREMENT = "missing in the measurement"
    AMBIGUOUS = "ambiguous"


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """One measured pole or zero and its counterpart.

    Parameters
    ----------
    kind : str
        ``pole`` or ``zero``.
    frf : int
        Which FRF a zero belongs to; -1 for poles.
    measured, computed : int
        Index among the fit's poles or zeros, and among the model's (by ascending modulus, per FRF for zeros); -1 where
        there is none.
    measured_value, computed_value : complex
        rad/s; NaN where there is none.
    distance : float
        Cost that the assignment minimised: of the frequency, and of the mode shape or the slope.
    verdict : PairVerdict
        Result of the pairing.
    reason : str
        Why, in words.
    """

    kind: str
    frf: int
    measured: int
    computed: int
    measured_value: complex
    computed_value: complex
    distance: float
    verdict: PairVerdict
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Pairs(Tabulated, Drawn):
    """All poles and zeros of measurement and model.

    Parameters
    ----------
    rows : tuple of Pair
        Poles first, then the zeros FRF by FRF.
    labels : tuple of FrfLabel
        What the FRFs connect to which zeros belong.
    warnings : tuple of str
        What the user has to know.
    """

    rows: tuple[Pair, ...]
    labels: tuple[FrfLabel, ...] = ()
    warnings: tuple[str, ...] = ()

    def __repr__(self) -> str:
        counts = []
        for kind in ("pole", "zero"):
            measured = [row for row in self.rows if row.kind == kind and row.measured >= 0]
            paired = sum(row.verdict is PairVerdict.PAIRED for row in measured)
            counts.append(f"{paired} of {len(measured)} measured {kind}s")
        return f"Pairs: {', '.join(counts)} have a counterpart in the model"

    @property
    def targets(self) -> tuple[Pair, ...]:
        """The paired ones, which updating has to meet."""
        return tuple(row for row in self.rows if row.verdict is PairVerdict.PAIRED)
