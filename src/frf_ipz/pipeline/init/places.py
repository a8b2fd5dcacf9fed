"""DOFs to start from: as the names of files say where the model has such a DOF, else free ones of the model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from frf_ipz.dofs import Dof
from frf_ipz.errors import FrfIpzError
from frf_ipz.fe.model_file import read_model

if TYPE_CHECKING:
    from pathlib import Path

DIRECTIONS = ("z", "y", "x")  # the one that a hand finds first


@dataclass(frozen=True, slots=True, kw_only=True)
class Places:
    """Where sensors and impacts may be.

    Parameters
    ----------
    free : tuple of Dof
        Translations of the model that are free; empty where there is no model.
    """

    free: tuple[Dof, ...] = ()

    @staticmethod
    def of_model(path: Path) -> Places:
        """Take the free DOFs of a model; none where it cannot be read as it stands.

        Parameters
        ----------
        path : Path
            ``model.toml``; there may be none.

        Returns
        -------
        Places
            Its free translations.
        """
        try:
            dofs = read_model(path).dofs
        except FrfIpzError:
            return Places()
        along = next((axis for axis in DIRECTIONS if any(dof.direction == axis for dof in dofs)), "")
        return Places(free=tuple(dof for dof in dofs if dof.direction == along))

    def of_sensor(self, number: int) -> str:
        """Give a DOF for a sensor: each has its own.

        Parameters
        ----------
        number : int
            1 for the first.

        Returns
        -------
        str
            The label.
        """
        if not self.free:
            return f"{number}:+z"
        return str(_positive(self.free[min(number, len(self.free)) - 1]))

    def of_impact(self, node: int) -> str:
        """Give the DOF of an impact at a node; another where the model has no such node or holds it.

        Parameters
        ----------
        node : int
            As the file's name says.

        Returns
        -------
        str
            The label.
        """
        if not self.free:
            return f"{node}:+z"
        return str(_positive(next((dof for dof in self.free if dof.node == node), self.free[0])))


def _positive(dof: Dof) -> Dof:
    return Dof(dof.node, dof.direction, 1)
