"""Words that analysers write for columns, in English, German, French, Dutch, Italian and Spanish.

The one answer to what a name means, so that no name is taken for a unit: 'Re' is the real part, not 1e27 electrons.
Accented letters are found as they are, without their accents, and in an encoding that was not told: 'Réel' stands in
files as 'Reel', or with one or two odd letters in the place of 'é'.
"""

from __future__ import annotations

import re
import unicodedata
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

FREQUENCY = "frequency"
ACCENTED = {  # letters, and how they are written without accents
    "ä": "ae|a",
    "ö": "oe|o",
    "ü": "ue|u",
    "á": "a",
    "é": "e",
    "ë": "e",
    "í": "i",
    "ó": "o",
    "ú": "u",
}
ODD = "[^ -~]{1,2}|[?]"  # what an accented letter becomes in another encoding


def _spelled(words: str) -> re.Pattern[str]:
    """Compile words, with each accented letter in all ways in which files write it."""
    ways = {letter: f"(?:{bare}|{ODD})" for letter, bare in ACCENTED.items()}
    return re.compile("".join(ways.get(letter, letter) for letter in words), re.IGNORECASE)


ANGULAR = _spelled(
    r"w|ω|omega\w*|om|rad_?s|w_?(vec|axis)\w*|(angular|circular) freq\w*|(kreis|winkel)freq\w*|hoekfreq\w*|"
    r"pulsatie|pulsation|pulsazione|pulsación|fréquence angulaire|frecuencia angular|frequenza angolare"
)
MODULUS = "mag|amp|abs|modul|módul|betrag"
ANGLE = "pha|fase|angle|ángul|angolo|winkel|hoek|déphasage|^arg|^phi|φ"
ROLES = (  # of a column, by its name; the first that fits
    (FREQUENCY, _spelled(r"fr(e|é)(q|c|k)|^f$|^f ?\[|(?<![a-z])k?hz(?![a-z])|^w ?\[|^w$|omega|^ω|^pulsa[ctz]i")),
    ("coherence", _spelled("coh|kohä|coer|gamma|γ")),
    ("imag", _spelled(r"imm?ag|(?<![a-z])im(?![a-z])")),
    ("real", _spelled(r"real|réel|reëel|(?<![a-z])re(?![a-z])")),
    ("phase_rad", _spelled(rf"({ANGLE}).*(?<![a-z])rad")),
    ("phase_deg", _spelled(ANGLE)),
    ("magnitude_db", _spelled(rf"({MODULUS}|mod|gain|pegel|verstärkung).*db|^db")),
    ("magnitude", _spelled(rf"{MODULUS}|^mod$")),
)
LEVEL = re.compile(  # decibels, and the word before what they are relative to
    r"(?<![a-z])db(?![a-z])(?:[\s_,;:()\[\]]*(?P<reference>ref?|rel)(?![a-z])[\s.:_]*)?", re.IGNORECASE
)
DEGREES = _spelled(r"deg|degré|gradi(?!e)|grados|graden|°|º|[\[(/] ?(ø|¡)")  # ° of DOS, of Macs
GRAD = re.compile(
    r"(?<![a-z])grad(?![a-z])", re.IGNORECASE
)  # degrees in German, a hundredth of a right angle elsewhere
OTHER_ANGLE = "other"
RADIANS = re.compile(r"rad[a-z]*", re.IGNORECASE)
SCALED_ANGLE = _spelled(  # a unit of angles with a factor: pi rad, mrad, 0.1 deg, rad/pi
    r"(?<![a-z])(pi|π)[\s*×·]*(rad|deg|°)|(?<!\w)\d([\d.,e^+-]*\d)?[\s*×·x]*(rad|deg|°)|"
    r"(?<![a-z])([mµμunck]|(milli|mikro|micro|centi|zenti|kilo)[ -]?)(rad|deg|°)|(rad|deg|°)\w*\s*([/*×·]|pi|π)"
)
GERMAN = _spelled(r"frequenz(?!a)|betrag|winkel|kohärenz")
NO_SCALE = _spelled(  # what stands in the place of a unit where values have none that can be converted
    r"(raw|adc|a/d|digital|roh)?[ _-]*(counts?|cnts?|lsbs?|ticks?|codes?|digits?|bits?|steps?|werte?)|raw|eu|e\.u\.|"
    r"eng(ineering|\.)?[ _-]*units?|user[ _-]*units?|skt\.?|skalenteile|inkremente?|"
    r"(a\.?u|u\.?a|w\.?e|b\.?e)\.?|arb(itrary|itr|\.)?([ _-]*units?)?|willk(ürlich|\.).*|"
    r"unités? arbitraires?|unidades? arbitrarias?|unità arbitrarie|"
    r"(%|percent|per ?cent|prozent|pct)([ _-]*(of)?[ _-]*(fs|full[ _-]*scale))?|fs|full[ _-]*scale"
)
TIME = _spelled(
    r"^(elapsed|relative|abs(olute)?|verstrichene)?[ _]*"
    r"(t|time|zeit|uhrzeit|messzeit|zeitpunkt|zeitstempel|temps|heure|horodatage|tempo|ora|orario|tiempo|hora|"
    r"tid|tijd|tijdstip|tijdstempel|x[ _-]?value|x[ _-]?axis|x[ _-]?achse|seconds?|secs?|timestamp|date ?time|"
    r"milliseconds?|microseconds?|millis|micros)(?![a-z])"
)


def stated_phase(name: str, names: Sequence[str]) -> str:
    """Say what a column of phases states its values to be in.

    Parameters
    ----------
    name : str
        As its header writes it, with its unit; or that unit alone.
    names : sequence of str
        Of all columns: 'Grad' are degrees in German.

    Returns
    -------
    str
        ``phase_deg``, ``phase_rad``; `OTHER_ANGLE` where a factor stands with it; empty where it states none of them.

    Examples
    --------
    >>> [stated_phase(name, ()) for name in ("Phase [°]", "arg (rad)", "Phase [pi rad]", "mrad", "Phase")]
    ['phase_deg', 'phase_rad', 'other', 'other', '']
    """
    if SCALED_ANGLE.search(name):
        return OTHER_ANGLE
    if frf_role(name) == "phase_rad" or RADIANS.fullmatch(name.strip(" []()")):
        return "phase_rad"
    is_german = GRAD.search(name) and any(map(GERMAN.search, names))
    return "phase_deg" if DEGREES.search(name) or is_german else ""


def frf_role(name: str) -> str:
    """Say what a column of an FRF is by its name.

    Parameters
    ----------
    name : str
        As its header writes it.

    Returns
    -------
    str
        As `columns` of ``[[frf]]`` says it; `FREQUENCY` for a frequency in the unit that the header states; empty for a
        name that says nothing.

    Examples
    --------
    >>> [frf_role(name) for name in ("Re", "Imaginärteil", "Réel [m/s²/N]", "Betrag [dB re 1 g/N]", "Fase", "V/V")]
    ['real', 'imag', 'real', 'magnitude_db', 'phase_deg', '']
    """
    composed = LEVEL.sub("dB ", unicodedata.normalize("NFC", name))  # 're' of 'dB re 1 g/N' is no real part
    return next((role for role, pattern in ROLES if pattern.search(composed)), "")
