"""A section of the page: a heading, a few sentences, pictures and tables."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, TypeAlias

from frf_ipz.report.picture import Picture
from frf_ipz.report.table import Table, render_table

if TYPE_CHECKING:
    from collections.abc import Sequence


@dataclass(frozen=True, slots=True, kw_only=True)
class Markup:
    """A piece of HTML that a section has made itself.

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
        HTML; the pictures' places are empty until the page's script draws them.
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
    return render_table(block) if isinstance(block, Table) else _render_picture(block)


def _render_picture(picture: Picture) -> str:
    note = f'<p class="note">{escape(picture.note)}</p>' if picture.note else ""
    table = ""
    if picture.table is not None:
        table = f"<details><summary>The numbers as a table</summary>{render_table(picture.table)}</details>"
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
