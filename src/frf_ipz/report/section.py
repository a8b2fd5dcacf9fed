"""A section of the page as plain data: a heading, a few sentences, pictures, tables and forms.

What a section holds are its blocks; ``report/templates/macros.html`` draws each by its ``kind``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, TypeAlias

from frf_ipz.plotting.registry import run_pictures

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from frf_ipz.plotting.picture import Picture
    from frf_ipz.runs.results import Results

MOST_ROWS = 400  # of a table on the page; all rows stand in the Parquet file beside it


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table with a caption.

    Parameters
    ----------
    caption : str
        What it holds.
    columns : tuple of str
        Heads, with units.
    rows : sequence of sequence of str
        Cells as text.
    marked : frozenset of int
        Rows that need attention.
    file : str
        File of the run that holds all of it.
    """

    kind: ClassVar[str] = "table"

    caption: str
    columns: tuple[str, ...]
    rows: Sequence[Sequence[str]]
    marked: frozenset[int] = frozenset()
    file: str = ""

    @property
    def shown_rows(self) -> Sequence[Sequence[str]]:
        """The rows that the page shows."""
        return self.rows[:MOST_ROWS]

    @property
    def n_left_out(self) -> int:
        """How many rows the page does not show."""
        return max(len(self.rows) - MOST_ROWS, 0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Figure:
    """A picture with its caption, and the numbers behind it.

    Parameters
    ----------
    picture : Picture
        What is drawn.
    hint : str
        What can be done with it on a page; stands behind its note.
    table : Table, optional
        The numbers.
    """

    kind: ClassVar[str] = "figure"

    picture: Picture
    hint: str = ""
    table: Table | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Choice:
    """Pictures of one kind of which the reader chooses one.

    Parameters
    ----------
    name : str
        Of the place where it is drawn: letters, digits and hyphens.
    label : str
        What is chosen.
    pictures : mapping of str to Picture
        By what the reader chooses among; the first one is drawn at first.
    """

    kind: ClassVar[str] = "choice"

    name: str
    label: str
    pictures: Mapping[str, Picture]


@dataclass(frozen=True, slots=True)
class Card:
    """One number with its name and what it means."""

    title: str
    figure: str
    meaning: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Headline:
    """The verdict of a run.

    Parameters
    ----------
    sentence : str
        The verdict.
    addition : str
        What there is to add; may be empty.
    """

    kind: ClassVar[str] = "headline"

    sentence: str
    addition: str


@dataclass(frozen=True, slots=True)
class Cards:
    """The numbers that carry a verdict.

    Parameters
    ----------
    cards : tuple of Card
        Side by side.
    """

    kind: ClassVar[str] = "cards"

    cards: tuple[Card, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Listing:
    """A long text that is folded away.

    Parameters
    ----------
    title : str
        What it is.
    text : str
        Shown as it stands, line by line.
    """

    kind: ClassVar[str] = "listing"

    title: str
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Form:
    """What a template of its own draws: forms and lists by which the user changes a run.

    Parameters
    ----------
    template : str
        Its name in the environment.
    data : mapping
        What it draws, as ``block.data``.
    """

    kind: ClassVar[str] = "form"

    template: str
    data: Mapping[str, object] = field(default_factory=dict)


Block: TypeAlias = "Figure | Choice | Table | Headline | Cards | Listing | Form"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Section:
    """One section.

    Parameters
    ----------
    anchor : str
        Its name in links.
    title : str
        Heading.
    lead : str
        What came out, in a sentence or two.
    blocks : tuple
        What it shows, in order.
    notes : tuple of str
        What the user has to know.
    choices : tuple of str
        What the program chose by itself.
    """

    anchor: str
    title: str
    lead: str
    blocks: tuple[Block, ...] = ()
    notes: tuple[str, ...] = ()
    choices: tuple[str, ...] = ()


def run_figures(
    run: Results, *names: str, hints: Mapping[str, str] | None = None, tables: Mapping[str, Table] | None = None
) -> list[Figure]:
    """Show those pictures that a run has something to show in.

    Parameters
    ----------
    run : Results
        What the run holds.
    *names : str
        Names of pictures, as `plotting.registry` has them.
    hints : mapping of str to str, optional
        What can be done with a picture on a page, by the picture's own name.
    tables : mapping of str to Table, optional
        The numbers behind a picture, likewise.

    Returns
    -------
    list of Figure
        In the order of the names.
    """
    hints, tables = hints or {}, tables or {}
    return [
        Figure(picture=picture, hint=hints.get(picture.name, ""), table=tables.get(picture.name))
        for picture in run_pictures(run, *names)
    ]


def pictures_of(sections: Sequence[Section]) -> list[tuple[Picture, int]]:
    """All pictures of some sections, and of how many the reader chooses one.

    Parameters
    ----------
    sections : sequence of Section
        The sections.

    Returns
    -------
    list of pairs of Picture and int
        In order.
    """
    pictures: list[tuple[Picture, int]] = []
    for block in (block for section in sections for block in section.blocks):
        if isinstance(block, Figure):
            pictures.append((block.picture, 1))
        elif isinstance(block, Choice):
            pictures += [(picture, len(block.pictures)) for picture in block.pictures.values()]
    return pictures
