"""Which changes there are, and how one is read from what the page sends."""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.errors import InputError, did_you_mean
from frf_ipz.show.changes.fit_changes import Band, Leave, Pin, Reject
from frf_ipz.show.changes.ingest_changes import RecordChoice, Sensor
from frf_ipz.show.changes.model_changes import Point, Retain
from frf_ipz.toml_files import to_options

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from frf_ipz.show.changes.change import Change

KINDS: Mapping[str, type[Change]] = {
    "pin": Pin,
    "strike": Reject,
    "leave": Leave,
    "band": Band,
    "record": RecordChoice,
    "sensor": Sensor,
    "point": Point,
    "retain": Retain,
}


def to_change(wish: object, path: Path) -> Change:
    """Read what the page sends.

    Parameters
    ----------
    wish : object
        A table with its ``kind`` and what that kind takes.
    path : Path
        The pipeline file, for messages.

    Returns
    -------
    Change
        Checked.

    Raises
    ------
    InputError
        If it is no change.
    """
    if not isinstance(wish, dict) or wish.get("kind") not in KINDS:
        kind = str(wish.get("kind")) if isinstance(wish, dict) else str(wish)
        raise InputError(f"there is no change '{kind}'; {did_you_mean(kind, KINDS)}")
    table = {str(key): value for key, value in wish.items() if key != "kind"}
    return to_options(table, KINDS[wish["kind"]], path)
