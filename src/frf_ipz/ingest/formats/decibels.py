"""Magnitudes and levels in decibels with their phase, whatever file they stand in, and what levels are relative to."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import FileFormatError
from frf_ipz.ingest.formats.column_words import LEVEL
from frf_ipz.ingest.formats.text_layout import is_number
from frf_ipz.ingest.units import is_stated
from frf_ipz.text_numbers import parse_number

if TYPE_CHECKING:
    from collections.abc import Mapping

    from frf_ipz.arrays import ComplexArray
    from frf_ipz.ingest.formats.file_arrays import NumericArray
    from frf_ipz.ingest.formats.frf_file import FrfSource, MeasuredFrf

DECIBELS = "magnitude_db"
EMPTY_BRACKETS = re.compile(r"\[\W*\]|\(\W*\)")


def join_polar(path: Path, parts: Mapping[str, NumericArray], *, key: str) -> ComplexArray:
    """Make complex values of magnitudes, or levels in decibels, and their phase.

    Parameters
    ----------
    path : Path
        The file, for the message of an error.
    parts : mapping of str to array
        One of ``magnitude``, `DECIBELS`, and one of ``phase_deg``, ``phase_rad``; of one shape.
    key : str
        Of the test's ``[[frf]]``, which says what stands where.

    Returns
    -------
    complex array
        In the unit that the magnitudes have, or the levels are relative to.

    Raises
    ------
    FileFormatError
        If magnitudes are negative.
    """
    phase = parts["phase_rad"] if "phase_rad" in parts else np.radians(parts["phase_deg"])
    if "magnitude" not in parts:
        return np.asarray(10.0 ** (parts[DECIBELS] / 20.0) * np.exp(1j * phase), np.complex128)
    if (parts["magnitude"] < 0.0).any():
        problem = f"holds negative magnitudes; where they are decibels, call them {DECIBELS} in '{key}'"
        raise FileFormatError(path, problem)
    return np.asarray(parts["magnitude"] * np.exp(1j * phase), np.complex128)


def is_level(text: str) -> bool:
    """Tell whether a unit is one of levels.

    Parameters
    ----------
    text : str
        What stands where the unit should.

    Returns
    -------
    bool
        True for decibels, whatever they are relative to.

    Examples
    --------
    >>> [is_level(text) for text in ("dB", "dB re 1 g/N", "g/N")]
    [True, True, False]
    """
    return LEVEL.search(text) is not None


def reference_of(text: str) -> str:
    """Give what levels are relative to, whatever the order of the words.

    Parameters
    ----------
    text : str
        What stands where the unit should.

    Returns
    -------
    str
        Empty where decibels say nothing of it; the text itself where it has none.

    Examples
    --------
    >>> [reference_of(text) for text in ("dB re 1 g/N", "g/N (dB)", "dB(g/N)", "dB re 1", "dB", "g/N")]
    ['1 g/N', 'g/N', 'g/N', '', '', 'g/N']
    """
    level = LEVEL.search(text)
    if level is None:
        return text
    if level["reference"]:
        reference = closed(text[level.end() :])
    else:
        reference = EMPTY_BRACKETS.sub("", text[: level.start()] + text[level.end() :]).strip(" []")
        reference = reference[1:-1] if re.fullmatch(r"\([^()]*\)", reference) else reference
    return reference if _is_stated_reference(reference) else ""


def closed(text: str) -> str:
    """Take off brackets that were opened before a text.

    Parameters
    ----------
    text : str
        The end of another one.

    Returns
    -------
    str
        Without them.
    """
    for opening, closing in ("[]", "()", "[]"):
        if text.count(closing) > text.count(opening):
            text = text.rstrip().removesuffix(closing)
    return text.strip()


def _is_stated_reference(text: str) -> bool:
    """Tell a reference of decibels from 1, which says nothing."""
    return is_stated(text) and not (is_number(text) and parse_number(text) == 1.0)


def with_reference(frf: MeasuredFrf) -> MeasuredFrf:
    """Take levels relative to what file or test say; where neither does, say what is taken.

    Parameters
    ----------
    frf : MeasuredFrf
        As the file has it.

    Returns
    -------
    MeasuredFrf
        The same values, in the unit that the levels are relative to.

    Raises
    ------
    FileFormatError
        If decibels are stated of values that are no levels.
    """
    source = frf.source
    if not frf.is_level:
        _refuse_decibels(source, frf.unit)
        return frf
    frf = replace(frf, unit=reference_of(frf.unit), source=replace(source, unit=reference_of(source.unit)))
    if frf.unit or frf.source.unit or source.force_dof is not None:  # ratios of responses are relative to 1
        return frf
    unit = source.quantity.unit(frf.output_dof.direction, frf.input_dof.direction)
    reference = f"1/({unit})" if source.is_reciprocal else unit
    note = (
        f"{source.path.name}: its decibels are taken re 1 {reference}, as neither the file nor its [[frf]] says re "
        "what; where they are re another one, write it as 'unit' there"
    )
    return replace(frf, notes=(*frf.notes, note))


def _refuse_decibels(source: FrfSource, stated: str) -> None:
    for text, where in ((stated, ""), (source.unit, "unit")):
        if is_level(text):
            problem = f"its values are said to be in '{text}', and are read as no levels"
            way_out = f"where they are decibels, call them {DECIBELS} in its [[frf]], else export them without dB"
            raise FileFormatError(source.path, f"{problem}; {way_out}", where=where and f"key '{where}'")
