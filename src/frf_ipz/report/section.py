"""A section of the page: a heading, a few sentences, pictures and tables."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, TypeAlias

from frf_ipz.report.picture import Picture

if TYPE_CHECKING:
    from collections.abc import Sequence

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

    caption: str
    columns: tuple[str, ...]
    rows: Sequence[Sequence[str]]
    marked: frozenset[int] = frozenset()
    file: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Markup:
    """Some HTML that a section has made itself.

    Parameters
    ----------
    html : str
        Text of others in it is escaped.
    """

    html: str


Block: TypeAlias = "Picture | Table | Markup"


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
        Pictures, tables and markup in order.
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


def render_section(section: Section) -> str:
    """Write a section as HTML.

    Parameters
    ----------
    section : Section
        The section.

    Returns
    -------
    str
        HTML; the pictures are empty until the page's script draws them.
    """
    heading = f'<h2 id="{section.anchor}-title">{escape(section.title)}</h2>'
    parts = [f'<section id="{section.anchor}" aria-labelledby="{section.anchor}-title">', heading]
    parts += [f'<p class="lead">{escape(section.lead)}</p>'] if section.lead else []
    parts += [_items(section.notes, "notes", "To know")]
    parts += [_render(block) for block in section.blocks]
    parts += [_items(section.choices, "choices", "Chosen by the program")]
    return "\n".join([*filter(None, parts), "</section>"])


def pictures_of(sections: Sequence[Section]) -> list[Picture]:
    """All pictures of some sections.

    Parameters
    ----------
    sections : sequence of Section
        The sections.

    Returns
    -------
    list of Picture
        In order.
    """
    return [block for section in sections for block in section.blocks if isinstance(block, Picture)]


def _render(block: Block) -> str:
    if isinstance(block, Markup):
        return block.html
    return _render_table(block) if isinstance(block, Table) else _render_picture(block)


def _render_picture(picture: Picture) -> str:
    note = f'<p class="note">{escape(picture.note)}</p>' if picture.note else ""
    table = ""
    if picture.table is not None:
        table = f"<details><summary>The numbers as a table</summary>{_render_table(picture.table)}</details>"
    frequency = " data-frequency" if picture.is_over_frequency else ""
    return (
        f'<figure id="{picture.name}"{frequency}><figcaption>{escape(picture.title)}</figcaption>'
        f'<div class="plot" tabindex="0" role="group" aria-roledescription="picture" '
        f'aria-label="{escape(picture.alt)}" '
        f'style="height:{picture.height_px}px"></div>{note}{table}</figure>'
    )


def _items(texts: Sequence[str], kind: str, title: str) -> str:
    if not texts:
        return ""
    items = "".join(f"<li>{escape(text)}</li>" for text in texts)
    return f'<aside class="{kind}" aria-label="{title}"><h3>{title}</h3><ul>{items}</ul></aside>'


def _render_table(table: Table) -> str:
    """Write a table as HTML.

    Parameters
    ----------
    table : Table
        The table.

    Returns
    -------
    str
        HTML.
    """
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in table.columns)
    body = "".join(_row(row, marked=number in table.marked) for number, row in enumerate(table.rows[:MOST_ROWS]))
    left_out = len(table.rows) - MOST_ROWS
    ellipsis = f"; {left_out} more rows" if left_out > 0 else ""
    file = f" <span class='file'>{escape(table.file)}</span>" if table.file else ""
    caption = f"<caption>{escape(table.caption)}{ellipsis}{file}</caption>"
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(table.caption)}">'
        f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )


def _row(cells: Sequence[str], *, marked: bool) -> str:
    kind = ' class="marked"' if marked else ""
    heading, *entries = cells
    text = "".join(f"<td{' class=n' if _is_number(cell) else ''}>{escape(cell)}</td>" for cell in entries)
    return f'<tr{kind}><th scope="row">{escape(heading)}</th>{text}</tr>'


def _is_number(text: str) -> bool:
    return bool(text) and (text[0].isdigit() or text[0] in "+-−.±")
