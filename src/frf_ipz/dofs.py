"""Degrees of freedom: which node, which direction, which sign."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from frf_ipz.errors import InputError

TRANSLATIONS = ("x", "y", "z")
DIRECTIONS = (*TRANSLATIONS, "rx", "ry", "rz")
GENERALISED = "q"  # the amplitude of a mode or of a super-element's motion, which has no direction
_LABEL = re.compile(r"^\s*([0-9]{1,18})\s*:\s*([+-]?)\s*(r?[xyz])\s*$")
_DIRECTION = re.compile(r"[+-]?r?[xyz]")


@dataclass(frozen=True, slots=True, order=True)
class Dof:
    """One direction of one node; the sign is that of the sensor or of the excitation.

    Parameters
    ----------
    node : int
        Node number; 0 is the ground.
    direction : str
        One of x, y, z, rx, ry, rz; or q, a generalised DOF inside a model, which no label of a test names.
    sign : int
        +1 or -1.

    Examples
    --------
    >>> import frf_ipz
    >>> dof = frf_ipz.Dof(18, "z", -1)
    >>> str(dof), dof.name, str(dof.unsigned)
    ('18:-z', '18:z', '18:+z')
    """

    node: int
    direction: str
    sign: int = 1

    def __str__(self) -> str:
        return f"{self.node}:{'+' if self.sign > 0 else '-'}{self.direction}"

    @property
    def unsigned(self) -> Dof:
        """The same DOF in the positive direction, as a model has it."""
        return replace(self, sign=1)

    @property
    def name(self) -> str:
        """The label without a sign, as in ``101:z``."""
        return f"{self.node}:{self.direction}"


def as_dof(dof: Dof | str) -> Dof:
    """Take a DOF, or read its label.

    Parameters
    ----------
    dof : Dof or str
        A DOF, or a label such as ``18:+z``.

    Returns
    -------
    Dof
        The DOF.

    Raises
    ------
    InputError
        If a text is no such label.

    Examples
    --------
    >>> as_dof("18:z") == as_dof(Dof(18, "z"))
    True
    """
    return dof if isinstance(dof, Dof) else parse_dof(dof)


def as_dofs(dofs: Sequence[Dof | str], *, name: str = "points") -> tuple[Dof, ...]:
    """Take some DOFs, or read their labels.

    Parameters
    ----------
    dofs : sequence of Dof or str
        DOFs, or labels such as ``18:+z``.
    name : str
        What they are, for the message.

    Returns
    -------
    tuple of Dof
        The DOFs.

    Raises
    ------
    InputError
        If it is no sequence, or a text in it is no label.

    Examples
    --------
    >>> [dof.name for dof in as_dofs(["18:z", Dof(20, "z")])]
    ['18:z', '20:z']
    """
    if isinstance(dofs, str | Dof) or not isinstance(dofs, Iterable):
        raise InputError(f"{name} = {dofs!r} is no list of DOFs; give one such as ['18:+z']")
    return tuple(as_dof(dof) for dof in dofs)


def parse_dof(text: str) -> Dof:
    """Read a label such as ``18:+z``, ``20:-z`` or ``7:rz``.

    Parameters
    ----------
    text : str
        ``NODE:SIGN DIRECTION`` without the blank; without a sign it is ``+``.

    Returns
    -------
    Dof
        The DOF.

    Raises
    ------
    InputError
        If the text is no such label.

    Examples
    --------
    >>> str(parse_dof("18:z"))
    '18:+z'
    """
    match = _LABEL.match(text) if isinstance(text, str) else None
    if match is None:
        raise InputError(f"'{text}' is no DOF label; expected NODE:SIGN DIRECTION as in '18:+z', '20:-z' or '7:rz'")
    node, sign, direction = match.groups()
    return Dof(int(node), direction, -1 if sign == "-" else 1)


def as_direction(text: str) -> str:
    """Check a direction that stands without a node.

    Parameters
    ----------
    text : str
        ``z``, ``+z``, ``-rx`` and the like, or nothing.

    Returns
    -------
    str
        The same.

    Raises
    ------
    InputError
        If it is none.

    Examples
    --------
    >>> as_direction("-z")
    '-z'
    """
    if text and _DIRECTION.fullmatch(text) is None:
        raise InputError(
            f"'{text}' is no direction; expected is one of {', '.join(DIRECTIONS)}, with a sign or without"
        )
    return text
