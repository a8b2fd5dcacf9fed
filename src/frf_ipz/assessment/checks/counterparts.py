"""Measured modes and zeros that the model has, with the likeness of their shapes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.assessment.assessment import Check, Verdict
from frf_ipz.pairing.pairs import PairVerdict

if TYPE_CHECKING:
    from frf_ipz.assessment.evidence import Evidence
    from frf_ipz.pairing.pairs import Pair

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
    verdict = Verdict.USABLE
    if missing:
        verdict = Verdict.NOT_USABLE if 1 - count.share > MOST_MISSING else Verdict.WITH_CARE
    where = ", ".join(f"{abs(row.measured_value) / (2 * np.pi):.4g}" for row in missing)
    yield Check(
        name="modes with a counterpart",
        verdict=verdict,
        figure=count.share,
        limit=1.0,
        unit="1",
        where=f"{where} Hz" if missing else "",
        says=count.text + (f"; missing: {where} Hz" if missing else ""),
        advice="look for what the model leaves out, or whether such a mode is false" if missing else "",
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
    many = 1 - count.share > MOST_MISSING
    yield Check(
        name="zeros with a counterpart",
        verdict=Verdict.WITH_CARE if many else Verdict.USABLE,
        figure=count.share,
        limit=1 - MOST_MISSING,
        unit="1",
        where=str(evidence.pairs.labels[missing[0].frf]) if missing else "",
        says=count.text,
        advice="zeros depend on where sensors and excitation are: check the dofs of the test" if many else "",
    )


def _missing(evidence: Evidence, kind: str) -> list[Pair]:
    rows = evidence.pairs.rows
    return [row for row in rows if row.kind == kind and row.verdict is PairVerdict.MISSING_IN_MODEL]
