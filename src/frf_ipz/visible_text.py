"""Text that people read: what a terminal would obey is written out, and so are numbers of a few digits.

Names come from files. An escape sequence in one could clear the screen, write to the clipboard or hide a line, a
bidirectional control could show a name as another, and a line feed could add a line that nobody said.
"""

from __future__ import annotations

import re
import unicodedata

JOINERS = frozenset("\u200c\u200d\u00ad")  # of scripts and pictographs; they move nothing
OBEYED = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})  # controls, formats, half a pair of code units, ends of lines
ROUNDED = re.compile(r"(?<![\w.])\d(?:\.\d+)?e\+0[1-5](?!\w|\.\w)")  # to few digits, and short when written out


def one_line(text: str) -> str:
    r"""Write out whatever a terminal would not show as a letter of the same line.

    Parameters
    ----------
    text : str
        Any text.

    Returns
    -------
    str
        With ``\x1b``, ``\n`` and the like as these letters.

    Examples
    --------
    >>> one_line("beam\x1b[2J\n\u202egood")
    'beam\\x1b[2J\\n\\u202egood'
    >>> one_line("Träger 梁 \U0001f528")
    'Träger 梁 🔨'
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(_shown(letter) for letter in text)


def lines(text: str) -> str:
    r"""Write out whatever a terminal would not show as a letter; lines stay lines.

    Parameters
    ----------
    text : str
        Any text.

    Returns
    -------
    str
        The text, its line feeds and tabs kept.

    Examples
    --------
    >>> lines("first\r\x07\n\tsecond")
    'first\\r\\x07\n\tsecond'
    """
    return "\n".join("\t".join(map(one_line, line.split("\t"))) for line in text.split("\n"))


def written_out(text: str) -> str:
    """Write out numbers that were rounded to a few digits.

    Parameters
    ----------
    text : str
        With numbers such as ``1.2e+02``.

    Returns
    -------
    str
        With ``120``.

    Examples
    --------
    >>> written_out("420 dB is 4.2e+02 dB; 4.2e+09 N/m stays")
    '420 dB is 420 dB; 4.2e+09 N/m stays'
    """
    return ROUNDED.sub(lambda match: f"{float(match[0]):.0f}", text)


def _shown(letter: str) -> str:
    if letter in JOINERS or unicodedata.category(letter) not in OBEYED:
        return letter
    return letter.encode("unicode_escape").decode("ascii")


def counted(count: int, noun: str, plural: str = "") -> str:
    """Write how many there are.

    Parameters
    ----------
    count : int
        How many.
    noun, plural : str
        What; the plural ends in s where it is not given.

    Returns
    -------
    str
        The count, and the noun in its number.

    Examples
    --------
    >>> counted(1, "pole"), counted(2, "pole"), counted(2, "entry", "entries")
    ('1 pole', '2 poles', '2 entries')
    """
    return f"{count} {noun if count == 1 else plural or noun + 's'}"
