"""Measured modes and zeros that the model has, and what those cost that it lacks.

A mode or a zero without a counterpart counts by what the model misses there. Where the model meets the measured FRFs
about its frequency to within what a controller does not feel, it hardly shows, as a zero far from the imaginary axis,
or is a false one of the fit.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.assessment.assessment import Check, Verdict
from frf_ipz.assessment.deviations import worst_median
from frf_ipz.control_margins import GAIN_MARGIN_DB, SIXTH
from frf_ipz.pairing.pairs import PairVerdict

if TYPE_CHECKING:
    from frf_ipz.arrays import IntArray
    from frf_ipz.assessment.evidence import Evidence
    from frf_ipz.pairing.pairs import Pair

HARMLESS = f" all the same: less than {SIXTH * GAIN_MARGIN_DB:g} dB is nothing to a controller"
MOST_MISSING = 0.5  # of the measured modes: the model is one of another machine


def modes(evidence: Evidence) -> Iterator[Check]:
    """Count the measured modes that the model lacks.

    Parameters
    ----------
    evidence : Evidence
        The run.

    Yields
    ------
    Check
        One, where modes were measured.
    """
    count, missing = evidence.pairs.count("pole"), _missing(evidence, "pole")
    if not count.measured:
        return
    off_db = [_off_at_mode(evidence, row) for row in missing]
    worst = max(off_db, default=0.0)
    felt = _felt(missing, off_db)
    verdict = Verdict.USABLE
    if felt:
        is_other = len(felt) > MOST_MISSING * (count.paired + len(felt))
        verdict = Verdict.NOT_USABLE if is_other else Verdict.WITH_CARE
    says = count.text
    if missing:
        says += f"; missing: {_frequencies(missing)}, where the model is off by up to {worst:.2g} dB"
        says += "" if felt else HARMLESS
    yield Check(
        name="modes with a counterpart",
        verdict=verdict,
        figure=count.share,
        limit=1.0,
        unit="1",
        where=_frequencies(felt or missing),
        says=says,
        advice="look for what the model leaves out, or whether such a mode is false" if felt else "",
    )


def zeros(evidence: Evidence) -> Iterator[Check]:
    """Count the identified zeros that the model lacks.

    Parameters
    ----------
    evidence : Evidence
        The run.

    Yields
    ------
    Check
        One, where zeros were identified.
    """
    count, missing = evidence.pairs.count("zero"), _missing(evidence, "zero")
    if not count.measured:
        return
    felt = _felt(missing, [_off_at_zero(evidence, row) for row in missing])
    many = len(felt) > MOST_MISSING * (count.paired + len(felt))
    says = count.text
    if missing and not felt:
        says += f"; the model meets the FRFs there{HARMLESS}"
    yield Check(
        name="zeros with a counterpart",
        verdict=Verdict.WITH_CARE if many else Verdict.USABLE,
        figure=count.share,
        limit=1 - MOST_MISSING,
        unit="1",
        where=str(evidence.pairs.labels[(felt or missing)[0].frf]) if missing else "",
        says=says,
        advice="zeros depend on where sensors and excitation are: check the dofs of the test" if many else "",
    )


def _off_at_mode(evidence: Evidence, row: Pair) -> float:
    """How far the model is from the FRF that it meets worst, in the median over the half-power band of a mode, dB."""
    off, frf = worst_median(evidence.decibels(evidence.updated)[_lines_about(evidence, row.measured_value)])
    return off if frf >= 0 else 0.0


def _off_at_zero(evidence: Evidence, row: Pair) -> float:
    """How far the model is from the fitted FRF that has a zero, in the median over the half width of the zero, dB.

    What was measured is no measure there: noise fills what a zero takes away.
    """
    near = _lines_about(evidence, row.measured_value)
    column = evidence.frfs.labels.index(evidence.pairs.labels[row.frf])
    fitted = evidence.fit.model(evidence.frfs.s[evidence.lines[near]])[:, column]
    with np.errstate(divide="ignore"):  # a zero may lie on a line
        return float(np.median(np.abs(20 * np.log10(np.abs(evidence.updated[near, column]) / np.abs(fitted)))))


def _lines_about(evidence: Evidence, root: complex) -> IntArray:
    """Lines within the half width of a root, or the one next to it."""
    distance = np.abs(2 * np.pi * evidence.frfs.frequency_hz[evidence.lines] - abs(root.imag))
    return np.flatnonzero(distance <= max(abs(root.real), distance.min(initial=np.inf)))


def _felt(rows: list[Pair], off_db: list[float]) -> list[Pair]:
    return [row for row, off in zip(rows, off_db, strict=True) if off > SIXTH * GAIN_MARGIN_DB]


def _frequencies(rows: list[Pair]) -> str:
    return ", ".join(f"{abs(row.measured_value) / (2 * np.pi):.4g}" for row in rows) + " Hz" * bool(rows)


def _missing(evidence: Evidence, kind: str) -> list[Pair]:
    rows = evidence.pairs.rows
    return [row for row in rows if row.kind == kind and row.verdict is PairVerdict.MISSING_IN_MODEL]
