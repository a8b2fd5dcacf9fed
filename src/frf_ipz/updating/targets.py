"""Targets of an update: measured poles and zeros, and where the model has them before and after."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.rational import damping_ratio, natural_frequency_hz

if TYPE_CHECKING:
    from frf_ipz.pairing.pairs import Pairs
    from frf_ipz.updating.updated_model import UpdatedModel


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """One target.

    Parameters
    ----------
    name : str
        Which pole or zero.
    kind : str
        ``pole`` or ``zero``.
    measured_hz, before_hz, after_hz : float
        Modulus over 2 pi, Hz.
    measured_damping, before_damping, after_damping : float
        Damping ratios.
    """

    name: str
    kind: str
    measured_hz: float
    before_hz: float
    after_hz: float
    measured_damping: float
    before_damping: float
    after_damping: float

    @property
    def before(self) -> float:
        """Relative error of the frequency before updating."""
        return self.before_hz / self.measured_hz - 1

    @property
    def after(self) -> float:
        """Relative error of the frequency after updating."""
        return self.after_hz / self.measured_hz - 1


def target_rows(updated: UpdatedModel, pairs: Pairs) -> list[Target]:
    """Give all targets of an update.

    Parameters
    ----------
    updated : UpdatedModel
        The update.
    pairs : Pairs
        What it aimed at.

    Returns
    -------
    list of Target
        Poles first; empty where pairs and update do not belong together.
    """
    targets = pairs.targets
    if len(targets) != len(updated.after):
        return []
    values = np.stack([[pair.measured_value for pair in targets], updated.before, updated.after])
    hertz, ratios = natural_frequency_hz(values.astype(complex)), damping_ratio(values.astype(complex))
    return [
        Target(
            name=root_name(pair.kind, pair.measured, str(pairs.labels[pair.frf]) if pair.frf >= 0 else ""),
            kind=pair.kind,
            measured_hz=float(hertz[0, place]),
            before_hz=float(hertz[1, place]),
            after_hz=float(hertz[2, place]),
            measured_damping=float(ratios[0, place]),
            before_damping=float(ratios[1, place]),
            after_damping=float(ratios[2, place]),
        )
        for place, pair in enumerate(targets)
    ]


def root_name(kind: str, number: int, label: str) -> str:
    """Name a pole or zero for people.

    Parameters
    ----------
    kind : str
        ``pole`` or ``zero``.
    number : int
        Its place, from 0; -1 where it has none.
    label : str
        The FRF of a zero.

    Returns
    -------
    str
        For example ``pole 2`` or ``zero of 101:+z / 89:+z``.
    """
    if kind == "pole":
        return f"pole {number + 1}" if number >= 0 else "pole"
    return f"zero of {label}"
