"""The first screen of a fleet."""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.fleet.fleet_file import MODEL
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

MOST_NAMED = 8  # machines, modes or findings


def summarise(fleet: pd.DataFrame, poles: pd.DataFrame, findings: pd.DataFrame) -> str:
    """Sum up a fleet.

    Parameters
    ----------
    fleet, poles, findings : DataFrame
        Its tables.

    Returns
    -------
    str
        At most a screen of text.
    """
    lines = [("machines", f"{len(fleet)}: {_counts(fleet['status'])}")]
    failed = fleet[fleet["status"] == "failed"]
    reasons = zip(failed["machine"], failed["message"], strict=True)
    lines += _titled("failed", [f"{machine}: {message}" for machine, message in reasons])
    assessed = fleet["assessment"][fleet["assessment"] != ""]
    lines += [("assessment", _counts(assessed))] if len(assessed) else []
    lines += _titled("poles", [_spread(str(mode), group["frequency_hz"]) for mode, group in poles.groupby("mode")])
    off = fleet["machine"][fleet["outlier"]].tolist()
    more = f" and {len(off) - MOST_NAMED} more" if len(off) > MOST_NAMED else ""
    lines.append(("outliers", ", ".join(off[:MOST_NAMED]) + more if off else "none"))
    whose = zip(findings["effect"], findings["location"], findings["of"], strict=True)
    lines += _titled(
        "findings",
        [
            f"{effect.replace('_', ' ')} at {location}: {'all machines, so the model' if of == MODEL else of}"
            for effect, location, of in whose
        ],
    )
    return "\n".join(f"{title:<12}{text}" for title, text in lines)


def _counts(values: pd.Series) -> str:
    return ", ".join(f"{count} {value}" for value, count in values.value_counts().items())


def _titled(title: str, texts: Sequence[str]) -> list[tuple[str, str]]:
    shown = [(title if place == 0 else "", text) for place, text in enumerate(texts[:MOST_NAMED])]
    return [*shown, ("", f"and {len(texts) - MOST_NAMED} more")] if len(texts) > MOST_NAMED else shown


def _spread(mode: str, frequency_hz: pd.Series) -> str:
    mean, count = float(frequency_hz.mean()), len(frequency_hz)
    if count == 1:
        return f"mode {mode}: {mean:.5g} Hz in one machine"
    return (
        f"mode {mode}: {mean:.5g} Hz +-{100 * float(frequency_hz.std()) / mean:.2g} % over {counted(count, 'machine')}"
    )
