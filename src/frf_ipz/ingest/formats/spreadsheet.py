"""Spreadsheets (XLSX) as text: the largest sheet, with tabs between the cells, is read as any text file is."""

from __future__ import annotations

import datetime
import io
import zipfile
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import lazy_loader

from frf_ipz.errors import FileFormatError
from frf_ipz.foreign_errors import errors_of_reader
from frf_ipz.ingest.formats.file_arrays import MOST_EXPANDED
from frf_ipz.input_files import require_expanded

if TYPE_CHECKING:
    from pathlib import Path

openpyxl = lazy_loader.load("openpyxl")

KIND = "a spreadsheet"
ZIP, PARTS = b"PK\x03\x04", b"xl/"  # how the file begins; the folder of its sheets
LOCAL_NAMES = 1 << 16  # bytes at the start of a file in which a name of a part stands
LOSSES = ("invalid specification",)  # of the messages of openpyxl: a sheet that it leaves out
MOST_COLUMNS = 1024  # a recording has no more channels
MOST_CELLS = 50_000_000


def is_spreadsheet(data: bytes) -> bool:
    """Tell whether a file is a spreadsheet.

    Parameters
    ----------
    data : bytes
        Its first bytes.

    Returns
    -------
    bool
        True for XLSX.
    """
    return data.startswith(ZIP) and (PARTS in data[:LOCAL_NAMES] or b"[Content_Types].xml" in data[:LOCAL_NAMES])


def spreadsheet_text(path: Path, data: bytes) -> bytes:
    """Give the largest sheet of a spreadsheet as text.

    Parameters
    ----------
    path : Path
        The file, for messages.
    data : bytes
        Its content.

    Returns
    -------
    bytes
        Lines of cells with tabs between them, UTF-8; line n is row n of the sheet.

    Raises
    ------
    FileFormatError
        If it is damaged, too large, or holds no cells.
    """
    return _text(path, data)


@lru_cache(maxsize=4)  # a file is opened several times before its numbers are read
def _text(path: Path, data: bytes) -> bytes:
    with errors_of_reader(path, KIND, losses=LOSSES):
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = archive.infolist()
            require_expanded(
                path, sum(member.file_size for member in members), file_bytes=len(data), most_bytes=MOST_EXPANDED
            )
            for member in members:
                if member.filename.endswith((".xml", ".rels")):
                    with archive.open(member) as part:
                        head = part.read(LOCAL_NAMES)
                    if b"<!DOCTYPE" in head or b"<!ENTITY" in head:
                        raise FileFormatError(path, f"its part {member.filename} defines entities; save it again")
        book = openpyxl.load_workbook(io.BytesIO(data), read_only=True, data_only=True, keep_links=False)
        texts = [_sheet(path, sheet) for sheet in book.worksheets]
        book.close()
    largest = max(texts, key=len, default=b"")
    if not largest.strip():
        raise FileFormatError(path, "is a spreadsheet without cells that hold values; save it again from its program")
    return largest


def _sheet(path: Path, sheet: Any) -> bytes:  # noqa: ANN401 - openpyxl has no types
    sheet.reset_dimensions()  # those that a file states may be any
    lines: list[str] = []
    n_cells = 0
    for row in sheet.iter_rows(max_col=MOST_COLUMNS, values_only=True):
        n_cells += len(row)
        if n_cells > MOST_CELLS:
            raise FileFormatError(path, f"has more than {MOST_CELLS} cells; export it as CSV")
        cells = [_cell(value) for value in row]
        while cells and not cells[-1]:
            cells.pop()
        lines.append("\t".join(cells))
    return "\n".join(lines).encode("utf-8", "replace") + b"\n"


def _cell(value: object) -> str:
    if value is None or isinstance(value, bool):
        return "" if value is None else str(value)
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, (datetime.datetime, datetime.time)):
        return value.isoformat(" ") if isinstance(value, datetime.datetime) else value.isoformat()
    return " ".join(str(value).split())
