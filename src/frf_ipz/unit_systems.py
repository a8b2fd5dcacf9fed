"""Systems of units of FE models, such as mm-t-s: what their matrices and numbers are in SI.

FE programs know no units; a deck in mm and t and s gives its matrices in them. A model is brought to SI once, where it
comes in, and nothing behind knows of other units. A row of a matrix belongs to a translation, which has a length, or to
a rotation or a generalised DOF, which has none; an entry of the stiffness is an energy per product of two motions.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import sparse

from frf_ipz.dofs import TRANSLATIONS
from frf_ipz.errors import InputError, did_you_mean
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pint

    from frf_ipz.arrays import Matrix
    from frf_ipz.dofs import Dof
else:
    pint = import_late("pint")

SI = "SI"
SYSTEMS: Mapping[str, tuple[float, float, float]] = {  # length, mass, time
    SI: (1.0, 1.0, 1.0),
    "mm-t-s": (1e-3, 1e3, 1.0),
    "mm-kg-ms": (1e-3, 1.0, 1e-3),
    "cm-g-s": (1e-2, 1e-3, 1.0),
    "in-lbf-s": (0.0254, 4.4482216152605 / 0.0254, 1.0),  # pound of force and inch by definition
}
QUANTITIES = {"length": "m", "mass": "kg", "time": "s"}
POWERS_OF_TIME = {"mass": 0, "damping": -1, "stiffness": -2}
DIMENSIONS = {  # powers of length, mass and time of a number, by how its key ends; the longest ending counts
    "_m": (1, 0, 0),
    "_kg": (0, 1, 0),
    "_kgm2": (2, 1, 0),
    "_kg_m3": (-3, 1, 0),
    "_Pa": (-1, 1, -2),
    "_N": (1, 1, -2),
    "_N_m": (0, 1, -2),
    "_Nm_rad": (2, 1, -2),
    "_Ns_m": (0, 1, -1),
    "_s": (0, 0, 1),
    "_1_s": (0, 0, -1),
}
LONGEST = 40  # letters of a unit
UNIT = re.compile(r"[A-Za-z_ */().]*(?:(?:\*\*|\^)[1-4](?![0-9*^])[A-Za-z_ */().]*)*")


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitSystem:
    """Units of length, mass and time that all numbers of a model are in.

    Parameters
    ----------
    name : str
        As the user calls it.
    length_m, mass_kg, time_s : float
        Its units in SI.

    Examples
    --------
    >>> UnitSystem.of("mm-t-s").length_m
    0.001
    """

    name: str
    length_m: float = 1.0
    mass_kg: float = 1.0
    time_s: float = 1.0

    @classmethod
    def of(cls, units: str | Mapping[str, str]) -> UnitSystem:
        """Read a system of units.

        Parameters
        ----------
        units : str or mapping of str to str
            ``SI``, ``mm-t-s``, ``mm-kg-ms``, ``cm-g-s``, ``in-lbf-s``; or the units of ``length``, ``mass`` and
            ``time``, as pint reads them.

        Returns
        -------
        UnitSystem
            The system.

        Raises
        ------
        InputError
            If there is no such system, or a unit cannot be read.

        Examples
        --------
        >>> UnitSystem.of({"length": "mm", "mass": "g", "time": "s"}).mass_kg
        0.001
        """
        if isinstance(units, str):
            if units not in SYSTEMS:
                advice = did_you_mean(units, SYSTEMS)
                table = '{ length = "mm", mass = "t", time = "s" }'
                raise InputError(f"'{units}' is no system of units, nor a table such as {table}; {advice}")
            return cls._of_factors(units, SYSTEMS[units])
        unknown = [key for key in units if key not in QUANTITIES]
        if unknown:
            raise InputError(f"'{unknown[0]}' is no unit of a system; {did_you_mean(unknown[0], QUANTITIES)}")
        texts = {quantity: units.get(quantity, unit) for quantity, unit in QUANTITIES.items()}
        return cls._of_factors("-".join(texts.values()), [_factor(text, key) for key, text in texts.items()])

    @classmethod
    def _of_factors(cls, name: str, factors: Sequence[float]) -> UnitSystem:
        length, mass, time = factors
        return cls(name=name, length_m=length, mass_kg=mass, time_s=time)

    @property
    def is_si(self) -> bool:
        """Whether nothing need be converted."""
        return self.length_m == self.mass_kg == self.time_s == 1.0

    def matrix_in_si(self, what: str, matrix: Matrix, dofs: Sequence[Dof]) -> Matrix:
        """Bring a matrix to SI.

        Parameters
        ----------
        what : str
            ``mass``, ``damping`` or ``stiffness``.
        matrix : (n, n) sparse array
            In this system.
        dofs : sequence of Dof
            Its rows.

        Returns
        -------
        (n, n) sparse array
            kg, N s/m or N/m, and their rotational counterparts.
        """
        if self.is_si:
            return matrix
        motions = np.where([dof.direction in TRANSLATIONS for dof in dofs], 1.0, self.length_m)
        scale = sparse.diags_array(motions)
        factor = self.mass_kg * self.time_s ** POWERS_OF_TIME[what]
        return sparse.csr_array(factor * (scale @ matrix @ scale))

    def options_in_si(self, options: Any) -> Any:  # noqa: ANN401 - a dataclass of any kind of model
        """Bring the numbers of a model file to SI, by the units at the end of their names.

        Parameters
        ----------
        options : dataclass
            Content of ``model.toml``.

        Returns
        -------
        dataclass
            The same, in SI; ``[[port]]``, which is in SI always, as it is.
        """
        if self.is_si:
            return options
        return self._converted("", options)

    def _converted(self, name: str, value: Any) -> Any:  # noqa: ANN401 - any value of an option
        if is_dataclass(value) and not isinstance(value, type):
            return replace(
                value,
                **{
                    field.name: self._converted(field.name, getattr(value, field.name))
                    for field in fields(value)
                    if field.init and field.name not in {"port", "units"}
                },
            )
        if isinstance(value, tuple):
            return tuple(self._converted(name, item) for item in value)
        endings = [ending for ending in DIMENSIONS if name.endswith(ending)]
        if not endings or not isinstance(value, float):
            return value
        length, mass, time = DIMENSIONS[max(endings, key=len)]
        return value * self.length_m**length * self.mass_kg**mass * self.time_s**time


def _factor(text: str, quantity: str) -> float:
    """Give a unit in SI."""
    factor = _pint_factor(text, QUANTITIES[quantity])
    if not (math.isfinite(factor) and factor > 0):
        raise InputError(
            f"'{text}' is no unit of {quantity}; give one that pint reads, such as '{QUANTITIES[quantity]}'"
        )
    return factor


def _pint_factor(text: str, unit: str) -> float:
    """Convert by pint; NaN for what is no unit of that dimension."""
    if len(text) > LONGEST or UNIT.fullmatch(text) is None:
        return math.nan
    try:
        return float((1.0 * pint.application_registry.Unit(text)).to(unit).magnitude)
    except Exception:
        return math.nan
