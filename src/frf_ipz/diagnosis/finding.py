"""One thing that is missing from the nominal model: what, where, how much, and how sure."""

from __future__ import annotations

from collections.abc import Mapping
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
