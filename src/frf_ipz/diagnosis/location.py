"""Where something sits: one value for effects and force laws, for their search, the report and the tables.

What it says in words, what lies beside it and what `diagnosis.json` says of it follow from its fields alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields

from frf_ipz.dofs import Dof

WRITTEN = ("end", "channels", "nodes", "elements", "springs", "groups")  # in `diagnosis.json`, in this order


@dataclass(frozen=True, slots=True, kw_only=True, order=True, repr=False)
class Location(Mapping[str, object]):
    """A node, a DOF, a pair of nodes, a segment of elements, a spring, an end, channels, a group; or the whole machine.

    Locations are ordered by their fields. As a mapping it holds what `diagnosis.json` says of it, and equals it.

    Parameters
    ----------
    end : str
        ``left`` or ``right``, of a beam; its node is among the nodes.
    channels : tuple of str
        Of the measuring chain.
    nodes : tuple of int
        One, or the two between which something acts.
    elements : tuple of int
        The first and the last one of a segment.
    springs, groups : tuple of str
        Parts of the model, by name.
    directions : tuple of str
        Of the motions of the nodes.
    sign : int
        -1 for a channel that is turned round.
    form : str
        What else distinguishes effects at one place: the kind of a filter.

    Examples
    --------
    >>> import frf_ipz
    >>> location = frf_ipz.Location.at_node(3, "x")
    >>> location, dict(location), location.text
    (Location(nodes=(3,), directions=('x',)), {'nodes': [3]}, 'node 3')
    """

    end: str = ""
    channels: tuple[str, ...] = ()
    nodes: tuple[int, ...] = ()
    elements: tuple[int, ...] = ()
    springs: tuple[str, ...] = ()
    groups: tuple[str, ...] = ()
    directions: tuple[str, ...] = ()
    sign: int = 1
    form: str = ""

    @classmethod
    def at_node(cls, node: int, direction: str = "") -> Location:
        """Make the location of a node, or of one of its DOFs."""
        return cls(nodes=(node,), directions=(direction,) if direction else ())

    @classmethod
    def on_channel(cls, channel: str, *, sign: int = 1, form: str = "") -> Location:
        """Make the location of something in the measuring chain."""
        return cls(channels=(channel,), sign=sign, form=form)

    @property
    def node(self) -> int:
        """Its only node, or the first one."""
        return self.nodes[0]

    @property
    def direction(self) -> str:
        """The direction of its motion."""
        return self.directions[0]

    @property
    def dof(self) -> Dof:
        """The DOF that moves there."""
        return Dof(self.node, self.direction)

    @property
    def channel(self) -> str:
        """Its only channel, or the first one."""
        return self.channels[0]

    @property
    def place(self) -> Location:
        """What `diagnosis.json` says of it: without directions, sign and form."""
        return Location(**{name: getattr(self, name) for name in WRITTEN})

    @property
    def text(self) -> str:
        """For a table: ``channel acc_1; node 3``."""
        return "; ".join(self._items_as_text())

    @property
    def words(self) -> str:
        """For a sentence: ``channel acc_1 and node 3``."""
        return " and ".join(self._items_as_text())

    def is_near(self, other: Location, reach: int) -> bool:
        """Tell whether another location is the same but for a sign, and for nodes or elements this near."""
        numbers, others = (*self.nodes, *self.elements), (*other.nodes, *other.elements)
        return (
            len(numbers) == len(others)
            and self._named == other._named
            and all(abs(a - b) <= reach for a, b in zip(numbers, others, strict=True))
        )

    @property
    def _named(self) -> tuple[object, ...]:
        return self.end, self.channels, self.springs, self.groups, self.directions, self.form

    def _items_as_text(self) -> list[str]:
        """Name each entry, one of several as such; a segment by its ends."""
        return [
            f"{name if len(self._ends(name)) > 1 else name.removesuffix('s')} "
            f"{(' to ' if name == 'elements' else ', ').join(map(str, self._ends(name)))}"
            for name in self
        ]

    def _ends(self, name: str) -> Sequence[object]:
        """Give the items of an entry, an end as one, a segment of one element too."""
        items: str | tuple[object, ...] = getattr(self, name)
        if isinstance(items, str):
            return (items,)
        return items[:1] if name == "elements" and len(set(items)) == 1 else items

    def __getitem__(self, key: str) -> object:
        """Give an entry of `diagnosis.json`: text for an end, a list for all others."""
        value = getattr(self, key, ()) if key in WRITTEN else ()
        if not value:
            raise KeyError(key)
        return list(value) if isinstance(value, tuple) else value

    def __iter__(self) -> Iterator[str]:
        """Go through the entries that apply."""
        return (name for name in WRITTEN if getattr(self, name))

    def __len__(self) -> int:
        """Count the entries that apply; 0 for the whole machine."""
        return sum(1 for _ in self)

    def __eq__(self, other: object) -> bool:
        """Compare all fields with those of a location, the entries with another mapping."""
        if isinstance(other, Location):
            return all(getattr(self, item.name) == getattr(other, item.name) for item in fields(self))
        return Mapping.__eq__(self, other)

    def __repr__(self) -> str:
        """Give the fields that say something."""
        stated = [item for item in fields(self) if getattr(self, item.name) != item.default]
        return f"Location({', '.join(f'{item.name}={getattr(self, item.name)!r}' for item in stated)})"
