"""Tables in HTML: numbers under the pictures."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

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


def render_table(table: Table) -> str:
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
    more = f"; {left_out} more rows" if left_out > 0 else ""
    file = f" <span class='file'>{escape(table.file)}</span>" if table.file else ""
    caption = f"<caption>{escape(table.caption)}{more}{file}</caption>"
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(table.caption)}">'
        f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )


def _row(cells: Sequence[str], *, marked: bool) -> str:
    kind = ' class="marked"' if marked else ""
    first, *others = cells
    text = "".join(f"<td{' class=n' if _is_number(cell) else ''}>{escape(cell)}</td>" for cell in others)
    return f'<tr{kind}><th scope="row">{escape(first)}</th>{text}</tr>'


def _is_number(text: str) -> bool:
    return bool(text) and (text[0].isdigit() or text[0] in "+-−.±")
