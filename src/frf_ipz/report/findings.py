"""What a diagnosis says, in the few words that the first screen and the drawing need."""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.diagnosis.result import confidence
from frf_ipz.visible_text import written_out

if TYPE_CHECKING:
    from frf_ipz.diagnosis.result import Diagnosis

SENTENCES = {
    "consistent": "Nothing significant is missing from the model.",
    "unexplained": "Something is missing from the model that nothing in the catalogue explains.",
    "damping": "With the measured damping, the model explains the measurement.",
    "explained": "What is missing from the model has been found.",
}


def verdict_of(diagnosis: Diagnosis) -> tuple[str, str]:
    """Give the verdict as a sentence.

    Parameters
    ----------
    diagnosis : Diagnosis
        The result of the diagnosis.

    Returns
    -------
    pair of str
        The verdict, or what was found first; and the findings' other statements.
    """
    statements = [typeset(finding.statement) for finding in diagnosis.findings if finding.statement]
    if diagnosis.verdict == "explained" and statements:
        return statements[0], " ".join(statements[1:])
    if diagnosis.verdict == "unexplained" and diagnosis.is_explained:  # with the measured damping
        sentence, *rest = statements or [SENTENCES["damping"]]
        return sentence, " ".join([*rest, *map(typeset, diagnosis.statements)])
    additions = [f"What is not explained: {typeset(diagnosis.unexplained_part)}."] if diagnosis.unexplained_part else []
    additions += statements
    return SENTENCES.get(diagnosis.verdict, ""), " ".join([*additions, *mismatch_sentence(diagnosis)])


def mismatch_sentence(diagnosis: Diagnosis) -> list[str]:
    """State where the cause of an unexplained mismatch seems to sit.

    Parameters
    ----------
    diagnosis : Diagnosis
        The result of the diagnosis.

    Returns
    -------
    list of str
        A sentence; empty where no location is known.
    """
    if diagnosis.is_explained or not diagnosis.mismatch_location:
        return []
    return [f"An unknown force at {diagnosis.mismatch_location.words} would explain most of the mismatch."]


def typeset(text: str) -> str:
    """Set signs and numbers as people write them in a text that was made for a terminal.

    Parameters
    ----------
    text : str
        With ``+-`` and numbers such as ``1.2e+02``.

    Returns
    -------
    str
        With the sign for plus or minus, and 120.
    """
    return written_out(text.replace("+-", "±"))


def card_texts(diagnosis: Diagnosis) -> tuple[str, str]:
    """Give the figure and the text of the card on the first screen.

    Parameters
    ----------
    diagnosis : Diagnosis
        The result of the diagnosis.

    Returns
    -------
    pair of str
        What, and how sure.
    """
    effects = [finding.effect.replace("_", " ") for finding in diagnosis.findings]
    counts = {effect: effects.count(effect) for effect in effects}
    names = " and ".join(effect if count == 1 else f"{effect} ({count})" for effect, count in counts.items())
    if not diagnosis.is_explained:
        part = f"; a part looks like {names}" if names else ""
        return "unknown", f"nothing in the catalogue explains it{part}"
    if not names:
        return (
            "nothing",
            "but damping, which is as measured" if diagnosis.statements else "within the stated tolerances",
        )
    damping = "; damping is as measured" if diagnosis.statements else ""
    return names, confidence(min(finding.probability for finding in diagnosis.findings)) + damping
