"""What a diagnosis says, in the few words that the first screen and the drawing need."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from frf_ipz.diagnosis.diagnosis import Diagnosis
    from frf_ipz.frf import FrfSet

SENTENCES = {
    "consistent": "Nothing significant is missing from the model.",
    "unexplained": "Something is missing from the model that nothing in the catalogue explains.",
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
    statements = [plain_signs(finding.statement) for finding in diagnosis.findings if finding.statement]
    if diagnosis.verdict == "explained" and statements:
        return statements[0], " ".join(statements[1:])
    part = "A part of it is explained: " if statements else ""
    return SENTENCES.get(diagnosis.verdict, ""), part + " ".join(statements)


def plain_signs(text: str) -> str:
    """Set typographic signs in a text that was made for a terminal.

    Parameters
    ----------
    text : str
        With ``+-``.

    Returns
    -------
    str
        With the sign for plus or minus.
    """
    return text.replace("+-", "±")


def said_in_short(diagnosis: Diagnosis) -> tuple[str, str]:
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
    if not diagnosis.findings:
        verdict = diagnosis.verdict
        return (
            ("nothing", "within the stated tolerances") if verdict == "consistent" else ("unknown", SENTENCES[verdict])
        )
    effects = [finding.effect.replace("_", " ") for finding in diagnosis.findings]
    counts = {effect: effects.count(effect) for effect in effects}
    names = " and ".join(effect if count == 1 else f"{effect} ({count})" for effect, count in counts.items())
    if diagnosis.verdict == "unexplained":
        return "unknown", f"nothing in the catalogue explains it; best in part: {names}"
    sure = min(finding.probability for finding in diagnosis.findings)
    return names, f"probability {sure:.3g}" if sure < 0.999 else "probability above 0.999"


def marked_nodes(diagnosis: Diagnosis | None, frfs: FrfSet | None) -> dict[int, str]:
    """Give the nodes at which something is missing.

    Parameters
    ----------
    diagnosis : Diagnosis, optional
        The result of the diagnosis.
    frfs : FrfSet, optional
        Says where channels sit.

    Returns
    -------
    dict of int to str
        What is missing at each node.
    """
    marked: dict[int, str] = {}
    for finding in () if diagnosis is None else diagnosis.findings:
        text = finding.effect.replace("_", " ")
        for node in _nodes(finding.location, frfs):
            marked[node] = text
    return marked


def _nodes(location: Mapping[str, object], frfs: FrfSet | None) -> list[int]:
    nodes, elements = _numbers(location.get("nodes")), _numbers(location.get("elements"))
    if elements:
        nodes += list(range(elements[0], elements[-1] + 2))
    named = location.get("channels")
    channels = set(named) if isinstance(named, tuple | list) else set()
    for label in () if frfs is None or nodes else frfs.labels:
        nodes += [label.output_dof.node] if label.output_channel in channels else []
        nodes += [label.input_dof.node] if label.input_channel in channels else []
    return nodes


def _numbers(value: object) -> list[int]:
    return [int(item) for item in value] if isinstance(value, tuple | list) else []
