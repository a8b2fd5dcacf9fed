"""Degrees of freedom: which node, which direction, which sign; and ports, which are weighted sums of them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite

from frf_ipz.errors import InputError, did_you_mean

TRANSLATIONS = ("x", "y", "z")
DIRECTIONS = (*TRANSLATIONS, "rx", "ry", "rz")
GENERALISED = "q"  # the amplitude of a mode or of a super-element's motion, which has no direction
UNITS = ("m", "rad")
GROUND = 0  # the node that does not move
DOFS_SHOWN = 6
_LABEL = re.compile(r"^\s*([0-9]{1,18})\s*:\s*([+-]?)\s*(r?[xyz])\s*$")
_LABELS_WITHIN = re.compile(r"\d+:[-+]?r?[xyz]")
_PORT = re.compile(r"(?!(r?[xyz]|[0-9]+)$)[^:+\-\s][^:]*")  # no direction or node alone: half of a label
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
        return self if self.sign == 1 else replace(self, sign=1)

    @property
    def name(self) -> str:
        """The label without a sign, as in ``101:z``."""
        return f"{self.node}:{self.direction}"


@dataclass(frozen=True, slots=True, order=True)
class PortDof:
    """The motion that a port measures, or the force that acts in it, by its name; the model knows its weights.

    Parameters
    ----------
    name : str
        Name of the port.
    sign : int
        -1 where the sensor or the actuator is turned round.
    unit : str
        ``m``, or ``rad`` where it measures an angle; two labels of one port are equal whatever is written here.

    Examples
    --------
    >>> import frf_ipz
    >>> dof = frf_ipz.PortDof("tip tilt", -1, "rad")
    >>> str(dof), dof.name, str(dof.unsigned)
    ('-tip tilt', 'tip tilt', 'tip tilt')
    """

    name: str
    sign: int = 1
    unit: str = field(default="m", compare=False)

    def __str__(self) -> str:
        return self.name if self.sign > 0 else f"-{self.name}"

    @property
    def unsigned(self) -> PortDof:
        """The same port as it is defined."""
        return replace(self, sign=1)

    @property
    def direction(self) -> str:
        """``r`` for an angle, else nothing: a port lies along none of the axes."""
        return "r" if self.unit == "rad" else ""


AnyDof = Dof | PortDof
Weights = Mapping[Dof | str, float] | Mapping[Dof, float] | Mapping[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class Port:
    """An input or output that is no single DOF: a tilt, a mean, a point between nodes, a pair of forces.

    As an output it measures the sum of weights times motions. As an input, a force of 1 N (a moment of 1 N m, where its
    unit is rad) puts the force of each weight on its DOF.

    Parameters
    ----------
    name : str
        It may stand wherever a label of a DOF may; it has no colon and does not begin with a sign.
    weights : mapping of Dof or str to float
        Weight of each DOF, SI: m per m (or rad) where the unit is m, rad per m (or rad) where it is rad. DOFs of
        node 0, the ground, do not move.
    unit : str
        ``m`` or ``rad``.

    Raises
    ------
    InputError
        If the name could be that of a DOF, a weight is not finite, a DOF is named twice, or all weights are 0.

    Examples
    --------
    >>> import frf_ipz
    >>> tilt = frf_ipz.Port("tip tilt", {"12:z": 12.5, "14:z": -12.5}, "rad")
    >>> str(tilt.dof), tilt.dof.unit, tilt.weights[frf_ipz.Dof(14, "z")]
    ('tip tilt', 'rad', -12.5)
    """

    name: str
    weights: Mapping[Dof, float]
    unit: str = "m"

    def __init__(self, name: str, weights: Weights, unit: str = "m") -> None:
        if not isinstance(name, str) or _PORT.fullmatch(name) is None or name != name.strip():
            raise InputError(
                f"'{name}' is no name of a port; it has no ':' (that is the mark of a DOF), no sign or blank at its "
                "beginning, no blank at its end, and is no direction or number alone"
            )
        if unit not in UNITS:
            raise InputError(f"the unit of the port '{name}' is '{unit}'; expected is m, or rad for an angle")
        if not isinstance(weights, Mapping):
            raise InputError(f"the weights of the port '{name}' are no table; give them as {{'12:z': 1.0}}")
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "weights", _port_weights(name, weights))
        object.__setattr__(self, "unit", unit)

    @property
    def dof(self) -> PortDof:
        """Its label."""
        return PortDof(self.name, 1, self.unit)

    def __repr__(self) -> str:
        terms = ", ".join(f"{dof.name}: {weight:g}" for dof, weight in list(self.weights.items())[:DOFS_SHOWN])
        return f"Port: {self.name} ({self.unit}), {terms}{', ...' if len(self.weights) > DOFS_SHOWN else ''}"


def _port_weights(name: str, weights: Weights) -> dict[Dof, float]:
    by_dof: dict[Dof, float] = {}
    for key, weight in weights.items():
        try:
            dof = key if isinstance(key, Dof) else parse_dof(key)
        except InputError as error:
            raise InputError(f"the port '{name}': {error}") from None
        if isinstance(weight, bool) or not isinstance(weight, int | float) or not isfinite(weight):
            raise InputError(f"the port '{name}': the weight of {dof.name} is {weight!r}; a finite number is needed")
        if dof.unsigned in by_dof:
            raise InputError(f"the port '{name}' names the DOF {dof.name} twice; add the two weights")
        by_dof[dof.unsigned] = dof.sign * float(weight)
    if not any(by_dof.values()):
        raise InputError(f"the port '{name}' has no weight other than 0; at least one DOF takes part in it")
    return by_dof


def as_dof(dof: AnyDof | Port | str) -> AnyDof:
    """Take a DOF, or read its label or the name of a port.

    Parameters
    ----------
    dof : Dof, PortDof, Port or str
        A DOF, a label such as ``18:+z``, a port, or its name.

    Returns
    -------
    Dof or PortDof
        The DOF.

    Raises
    ------
    InputError
        If a text is no such label, or the DOF is one of the ground.

    Examples
    --------
    >>> as_dof("18:z") == as_dof(Dof(18, "z")), as_dof("-tip tilt")
    (True, PortDof(name='tip tilt', sign=-1, unit='m'))
    """
    if isinstance(dof, Port):
        return dof.dof
    if isinstance(dof, PortDof):
        return dof
    return _require_motion(dof) if isinstance(dof, Dof) else parse_label(dof)


def as_dofs(dofs: Sequence[AnyDof | Port | str], *, name: str = "points") -> tuple[AnyDof, ...]:
    """Take some DOFs, or read their labels.

    Parameters
    ----------
    dofs : sequence of Dof, PortDof, Port or str
        DOFs, labels such as ``18:+z``, ports, or their names.
    name : str
        What they are, for the message.

    Returns
    -------
    tuple of Dof or PortDof
        The DOFs.

    Raises
    ------
    InputError
        If it is no sequence, a text in it is no label, or a DOF is one of the ground.

    Examples
    --------
    >>> [dof.name for dof in as_dofs(["18:z", Dof(20, "z")])]
    ['18:z', '20:z']
    """
    if isinstance(dofs, str | Dof | PortDof | Port) or not isinstance(dofs, Iterable):
        raise InputError(f"{name} = {dofs!r} is no list of DOFs; give one such as ['18:+z']")
    return tuple(as_dof(dof) for dof in dofs)


def node_dofs(dofs: Iterable[AnyDof]) -> tuple[Dof, ...]:
    """Leave ports out, which have no place of their own.

    Parameters
    ----------
    dofs : iterable of Dof or PortDof
        DOFs and ports.

    Returns
    -------
    tuple of Dof
        Those that are at one node, in their order.

    Examples
    --------
    >>> [dof.name for dof in node_dofs([PortDof("tip tilt"), Dof(20, "z")])]
    ['20:z']
    """
    return tuple(dof for dof in dofs if isinstance(dof, Dof))


def parse_label(text: str) -> AnyDof:
    """Read the label of a DOF, or the name of a port.

    Parameters
    ----------
    text : str
        As for `parse_dof`; a text without a colon is the name of a port, with a minus before it where it is turned
        round.

    Returns
    -------
    Dof or PortDof
        The DOF.

    Raises
    ------
    InputError
        If the text is neither, or the DOF is one of the ground.

    Examples
    --------
    >>> str(parse_label("18:z")), str(parse_label("+tip tilt")), str(parse_label("-tip tilt"))
    ('18:+z', 'tip tilt', '-tip tilt')
    """
    stripped = text.strip() if isinstance(text, str) else ""
    name = stripped[1:].strip() if stripped[:1] in ("+", "-") else stripped
    if _PORT.fullmatch(name) is None:
        return _require_motion(parse_dof(text))
    return PortDof(name, -1 if stripped.startswith("-") else 1)


def _require_motion(dof: Dof) -> Dof:
    """Refuse the ground, where nothing moves and no force does anything."""
    if dof.node == GROUND:
        raise InputError(
            f"'{dof}' is at node {GROUND}, which is the ground; name the node of the sensor or of the force"
        )
    return dof


def bind_port(dof: AnyDof, ports: Mapping[PortDof, PortDof]) -> AnyDof:
    """Find the port that a label names, so that its unit is known.

    Parameters
    ----------
    dof : Dof or PortDof
        As it was read.
    ports : mapping of PortDof to PortDof
        Those that the model has, as `StructuralModel.port_dofs` lists them.

    Returns
    -------
    Dof or PortDof
        With the unit of the port; a DOF of a node as it is.

    Raises
    ------
    InputError
        If there is no port of that name.

    Examples
    --------
    >>> tilt = Port("tip tilt", {"12:z": 1.0}, "rad").dof
    >>> bind_port(PortDof("tip tilt", -1), {tilt: tilt})
    PortDof(name='tip tilt', sign=-1, unit='rad')
    """
    if isinstance(dof, Dof):
        return dof
    known = ports.get(dof.unsigned)
    if known is None:
        names = [port.name for port in ports]
        hint = did_you_mean(dof.name, names) if names else "ports are defined by [[port]] in model.toml"
        raise InputError(
            f"'{dof}' is no DOF label; expected NODE:SIGN DIRECTION as in '18:+z', '20:-z' or '7:rz', or the name of a "
            f"port: {hint}"
        )
    return replace(known, sign=dof.sign)


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
        is_sum = len(_LABELS_WITHIN.findall(str(text))) > 1 or ("(" in str(text) and ":" in str(text))
        hint = "; a sum or a multiple of DOFs is a [[port]] of model.toml, and its name stands here"
        expected = "expected NODE:SIGN DIRECTION as in '18:+z', '20:-z' or '7:rz'"
        raise InputError(f"'{text}' is no DOF label; {expected}{hint * is_sum}")
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
