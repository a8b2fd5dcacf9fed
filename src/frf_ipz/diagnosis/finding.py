"""One thing that is missing from the nominal model: what, where, how much, and how sure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field


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


def doubt_of_place(places: Sequence[Mapping[str, object]]) -> str:
    """Say between which places a test does not decide.

    Parameters
    ----------
    places : sequence of mapping
        Locations as in `diagnosis.json`, the most probable first.

    Returns
    -------
    str
        A sentence with a space before it; empty for a single place.
    """
    if len(places) < 2:
        return ""
    kinds: dict[str, list[tuple[object, ...]]] = {}
    for place in places:
        told = [item for item in place.items() if any(other.get(item[0]) != item[1] for other in places)]
        for kind, value in told[:1]:
            kinds.setdefault(kind, []).append(tuple(value) if isinstance(value, list | tuple) else (value,))
    words = " or ".join(f"{kind} {_in_words(kind, found)}" for kind, found in kinds.items())
    return f" The test tells its place no closer than {words}."


def _in_words(kind: str, found: list[tuple[object, ...]]) -> str:
    """Single numbers as runs, stretches of elements from their first to their last, others as they are."""
    numbers = sorted(number for (number, *more) in found if isinstance(number, int) and not more)
    if len(numbers) == len(found):
        breaks = [i for i in range(len(numbers)) if i == 0 or numbers[i] > numbers[i - 1] + 1]
        runs = [numbers[a:b] for a, b in zip(breaks, [*breaks[1:], None], strict=True)]
        return ", ".join(f"{run[0]}" if len(run) == 1 else f"{run[0]} to {run[-1]}" for run in runs)
    joined = " to " if kind == "elements" else " and "
    return ", ".join(joined.join(str(part) for part in dict.fromkeys(place)) for place in found)
