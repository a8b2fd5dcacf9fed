"""What a user may choose in ``[fit]`` of a pipeline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from frf_ipz.errors import InputError
from frf_ipz.option_types import Count, Frequency, Positive, Truth
from frf_ipz.toml_files import STRICT, check_values

NEAR_PIN = 0.02  # relative distance up to which a pole is the one that was pinned or rejected


@dataclass(frozen=True, slots=True, kw_only=True)
class RejectedPole:
    """A pole that the user has rejected, ``[[fit.strike]]``.

    Parameters
    ----------
    hz : float
        Its frequency, Hz.
    why : str
        The reason, stored with the results.

    Examples
    --------
    >>> import frf_ipz
    >>> frf_ipz.FitOptions(strike=(frf_ipz.RejectedPole(hz=100.0, why="mains"),)).strike[0].hz
    100.0
    """

    __pydantic_config__ = STRICT

    hz: Frequency
    why: str

    def __post_init__(self) -> None:
        check_values(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class PinnedPole:
    """A frequency at which the user says that a mode is.

    Parameters
    ----------
    hz : float
        The frequency, Hz.
    why : str
        The reason, stored with the results; may be empty.

    Examples
    --------
    >>> import frf_ipz
    >>> pin = frf_ipz.PinnedPole(hz=80.3, why="seen in another test")
    >>> frf_ipz.FitOptions(pin_hz=(pin,)).pinned[0].why
    'seen in another test'
    """

    __pydantic_config__ = STRICT

    hz: Frequency
    why: str = ""

    def __post_init__(self) -> None:
        check_values(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Stability:
    """Tolerances of the stabilisation diagram: how near a pole is to one of the next lower order, relative.

    Parameters
    ----------
    frequency : float
        Of the natural frequency.
    damping : float
        Of the damping ratio.
    vector : float
        1 - MAC of the participation vectors.

    Examples
    --------
    >>> import frf_ipz
    >>> frf_ipz.FitOptions(stability=frf_ipz.Stability(frequency=0.005)).stability.damping
    0.05
    """

    __pydantic_config__ = STRICT

    frequency: Positive = 0.01
    damping: Positive = 0.05
    vector: Positive = 0.02

    def __post_init__(self) -> None:
        check_values(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class FitOptions:
    """How poles, residues and zeros are fitted.

    Parameters
    ----------
    band_hz : pair of float, optional
        Band to fit, Hz; without it the whole measured band that carries signal.
    exclude_hz : tuple of pairs of float
        Bands to leave out, Hz: mains lines, low coherence.
    pin_hz : tuple of float or PinnedPole
        Frequencies at which a mode must be, with or without the reason: never dropped.
    strike : tuple of RejectedPole
        Poles that are no modes, and why.
    modes : str
        ``complex`` or ``real`` (normal modes: proportional damping).
    max_order : int, optional
        Highest model order of the stabilisation diagram that the start is taken from; without it chosen from the number
        of references. Too few lines in the band lower it.
    stability : Stability
        Tolerances of the stabilisation diagram. They are for whoever looks at it: the fit does not use them.
    delay : bool, optional
        true: fit a pure delay for each output channel too; false: none. Without it a delay that all responses share is
        tried, and taken where it explains most of what normal modes leave, and then one of each channel by itself.
    gain : tuple of str
        Channels whose constant gain is not known and is estimated; all others are trusted. A gain shows only where two
        FRFs must be equal but for gains: with excitation and sensor exchanged, or recorded by two channels.

    Raises
    ------
    InputError
        If a band ends below its start, or a channel is named twice.

    Examples
    --------
    >>> import frf_ipz
    >>> frf_ipz.FitOptions(band_hz=(10.0, 700.0), pin_hz=(80.3,)).pinned
    (PinnedPole(hz=80.3, why=''),)
    """

    __pydantic_config__ = STRICT

    band_hz: tuple[Frequency, Frequency] | None = None
    exclude_hz: tuple[tuple[Frequency, Frequency], ...] = ()
    pin_hz: tuple[Frequency | PinnedPole, ...] = ()
    strike: tuple[RejectedPole, ...] = ()
    modes: Literal["complex", "real"] = "complex"
    max_order: Count | None = None
    stability: Stability = Stability()
    delay: Truth | None = None
    gain: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_values(self)
        bands = [] if self.band_hz is None else [("band_hz", self.band_hz)]
        for key, (low, high) in (*bands, *(("exclude_hz", pair) for pair in self.exclude_hz)):
            if not 0 <= low < high:
                raise InputError(f"{key} = [{low:g}, {high:g}] is no band; give the lower frequency first")
        for name in self.gain:
            if self.gain.count(name) > 1:
                raise InputError(f"gain names the channel '{name}' twice; name it once")

    @property
    def pinned(self) -> tuple[PinnedPole, ...]:
        """Every pin with its reason, which is empty for a plain number."""
        return tuple(pin if isinstance(pin, PinnedPole) else PinnedPole(hz=pin) for pin in self.pin_hz)

    def require_within(self, band_hz: tuple[float, float]) -> None:
        """Refuse frequencies of poles that lie outside of the band that is fitted, where nothing can show a pole.

        Parameters
        ----------
        band_hz : pair of float
            Its first and last line, Hz.

        Raises
        ------
        InputError
            Names the key. A pole that is as near to the band as `NEAR_PIN` belongs to it.
        """
        low, high = band_hz[0] * (1.0 - NEAR_PIN), band_hz[1] * (1.0 + NEAR_PIN)
        named = [("pin_hz", pin.hz) for pin in self.pinned] + [("strike", pole.hz) for pole in self.strike]
        outside = [f"{key} at {hz:g} Hz" for key, hz in named if not low <= hz <= high]
        if outside:
            raise InputError(
                f"[fit] {', '.join(outside)}: outside of the band that is fitted, {band_hz[0]:g} to {band_hz[1]:g} Hz, "
                "where no line shows a pole; correct the frequency in Hz, take it out, or set [fit] band_hz around it"
            )
