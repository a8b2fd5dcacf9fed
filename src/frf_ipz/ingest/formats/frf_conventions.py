"""What FRFs of files are by convention: one-sided, complex, for exp(+i omega t), with a coherence from 0 to 1.

What breaks a convention and can be brought to it without doubt is, with a note; the rest is refused with what to write.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import FileFormatError
from frf_ipz.ingest.formats.registry import read_frf_file
from frf_ipz.ingest.formats.transmissibility import over_force
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray
    from frf_ipz.ingest.formats.decibels import with_reference
    from frf_ipz.ingest.formats.frf_file import FrfSource, MeasuredFrf
else:
    with_reference = import_late("frf_ipz.ingest.formats.decibels", "with_reference")

PRINTED = 1e-3  # relative: what few printed digits make of two equal numbers
ROUNDING = 1e-12  # relative: sine of pi in double precision, and of 180 degrees
LARGEST_PHASES = (180.0, 360.0, np.pi, 2.0 * np.pi)  # in degrees and radians
NEAR = 0.9  # of the largest phase: an FRF with a mode turns by half a turn
FEWEST_LINES = 16  # on fewer, noise may turn either way
CLEARLY = 0.5  # of the turning, weighted by the power: three quarters of it go against causality
OFTEN, FLAT = 0.05, 0.1  # share of lines near the largest angle; median of levels over the largest
SURELY = 0.9  # of the turning: of one FRF, on lines that resolve its peaks
RESOLVED = 4.0  # lines that carry the turning: on fewer, its sense is chance
PER_CENT = 10.0  # a coherence above this is one in per cent


def read_frf_source(source: FrfSource) -> tuple[MeasuredFrf, ...]:
    """Read the FRFs of a file and bring them to the conventions of the program.

    Parameters
    ----------
    source : FrfSource
        The file as the test describes it.

    Returns
    -------
    tuple of MeasuredFrf
        At least one; each with notes on what was changed.

    Raises
    ------
    FileFormatError
        If it cannot be read, holds magnitudes only, or is conjugated.
    """
    frfs = [_check_coherence(_one_sided(_as_stated(with_reference(frf)))) for frf in read_frf_file(source)]
    if source.reference is not None:
        frfs = over_force(source, frfs, read_frf_source(source.reference))
    for frf in frfs:
        _refuse_magnitudes(frf)
    _refuse_conjugated(frfs)
    return tuple(frfs)


def _as_stated(frf: MeasuredFrf) -> MeasuredFrf:
    frf = _reciprocal(frf) if frf.source.is_reciprocal else frf
    if not frf.source.is_conjugated:
        return frf
    note = f"{frf.source.path.name}: its FRFs are conjugated, as 'conjugated' asks for"
    return replace(frf, values=np.conj(frf.values), notes=(*frf.notes, note))


def _reciprocal(frf: MeasuredFrf) -> MeasuredFrf:
    """Take the FRF of a force over a response: the response over the force, where no other force acts."""
    is_zero = frf.values == 0.0
    at_rest = is_zero & (frf.frequency_hz == 0.0)  # a free structure has none there
    if (is_zero & ~at_rest).any():
        hertz = frf.frequency_hz[is_zero & ~at_rest][0]
        problem = f"the force over the response of {frf.label} is zero at {hertz:g} Hz, and has no reciprocal there"
        raise FileFormatError(frf.source.path, f"{problem}; correct the file")
    name = f"{frf.source.path.name}, {frf.label}"
    note = f"{name}: the reciprocal of force over response, which is the FRF where a single force acts"
    if at_rest.any():
        frf = _select(frf, ~at_rest, f"{name}: zero at 0 Hz: left out")
    unit = f"1/({frf.unit})" if frf.unit else ""
    source = replace(frf.source, unit=f"1/({frf.source.unit})" if frf.source.unit else "", is_reciprocal=False)
    return replace(
        frf,
        source=source,
        values=1.0 / frf.values,
        variance=None if frf.variance is None else frf.variance / np.abs(frf.values) ** 4,
        unit=unit,
        notes=(*frf.notes, note),
    )


def _one_sided(frf: MeasuredFrf) -> MeasuredFrf:
    """Keep the half of a two-sided spectrum that says everything."""
    frequency_hz, values, name = frf.frequency_hz, frf.values, f"{frf.source.path.name}, {frf.label}"
    negative = frequency_hz < 0.0
    if negative.any():
        used = ~negative
        if used.sum() <= 1:
            problem = f"the FRF {frf.label} has lines at negative frequencies only; export those from 0 Hz"
            raise FileFormatError(frf.source.path, problem)
        note = f"{name}: two-sided; the {int(negative.sum())} lines at negative frequencies are left out"
        return _select(frf, used, note)
    for first in (0, 1):
        half = values[first:]
        n_lines = len(half)
        if n_lines < FEWEST_LINES or not _is_even(frequency_hz[first:]):
            continue
        mirror = np.conj(half[::-1])
        if np.linalg.norm(half - mirror) <= PRINTED * np.linalg.norm(half):
            used = np.arange(len(values)) < first + (n_lines + 1) // 2
            note = f"{name}: two-sided; the upper half from {frequency_hz[used][-1]:g} Hz mirrors the lower: left out"
            return _select(frf, used, note)
    return frf


def _is_even(frequency_hz: FloatArray) -> bool:
    steps = np.diff(frequency_hz)
    return bool(np.ptp(steps) <= PRINTED * np.abs(steps).max())


def _select(frf: MeasuredFrf, used: BoolArray, note: str) -> MeasuredFrf:
    return replace(
        frf,
        frequency_hz=frf.frequency_hz[used],
        values=frf.values[used],
        coherence=None if frf.coherence is None else frf.coherence[used],
        variance=None if frf.variance is None else frf.variance[used],
        notes=(*frf.notes, note),
    )


def _check_coherence(frf: MeasuredFrf) -> MeasuredFrf:
    """Bring a coherence in per cent to 0 to 1; leave out one that is above 1, or 0 all over."""
    coherence = frf.coherence
    if coherence is None:
        return frf
    name = f"{frf.source.path.name}, {frf.label}"
    if (coherence == 0.0).all():
        note = f"{name}: the coherence is 0 on all lines, as where none was computed: left out"
        return replace(frf, coherence=None, notes=(*frf.notes, note))
    if not (coherence > 1.0).any():
        return frf
    largest = float(np.nanmax(coherence))
    if largest <= 1.0 + PRINTED:
        return replace(frf, coherence=np.minimum(coherence, 1.0))
    if PER_CENT < largest <= 100.0 * (1.0 + PRINTED) and np.nanmedian(coherence) > 1.0:
        note = f"{name}: the coherence goes up to {largest:g}: taken as per cent"
        return replace(frf, coherence=np.minimum(coherence / 100.0, 1.0), notes=(*frf.notes, note))
    hertz = frf.frequency_hz[np.nanargmax(coherence)]
    note = f"{name}: the coherence goes up to {largest:g}, at {hertz:g} Hz, and none is above 1: left out"
    return replace(frf, coherence=None, notes=(*frf.notes, note))


def _refuse_magnitudes(frf: MeasuredFrf) -> None:
    real, imag = frf.values.real, frf.values.imag
    largest = float(np.abs(frf.values).max(initial=0.0))
    if largest == 0.0:
        raise FileFormatError(frf.source.path, f"the FRF {frf.label} is zero on all lines; export it again")
    way_out = "export real and imaginary part, or magnitude and phase"
    for part, name in ((imag, "imaginary"), (real, "real")):
        if np.abs(part).max() <= ROUNDING * largest:
            problem = f"all {name} parts of the FRF {frf.label} are zero: these are magnitudes only, without a phase"
            raise FileFormatError(frf.source.path, f"{problem}; {way_out}")
    if len(real) < FEWEST_LINES or not _looks_like_phase(imag):
        return
    problem = f"the FRF {frf.label} looks like magnitude and phase where real and imaginary part are expected"
    columns = "columns = ['frequency_hz', '{}', 'phase_deg']"
    if (real >= 0.0).all() and not (frf.source.quantity.power == 1 and _looks_like_circles(real, imag)):
        text = f"{problem}: no real part is negative; {way_out} with {columns.format('magnitude')}"
        raise FileFormatError(frf.source.path, text)
    if _looks_like_level(real, imag):
        text = (
            f"{problem}: one part is a level in dB, the other an angle; {way_out} with {columns.format('magnitude_db')}"
        )
        raise FileFormatError(frf.source.path, text)


def _looks_like_phase(imag: FloatArray) -> bool:
    """Tell whether numbers reach a half turn, in degrees or radians, and no more."""
    largest = float(np.abs(imag).max())
    return any(NEAR * phase <= largest <= phase * (1.0 + PRINTED) for phase in LARGEST_PHASES)


def _looks_like_circles(real: FloatArray, imag: FloatArray) -> bool:
    """Tell whether parts may be those of a mobility that no mode turns round: of circles on the positive real axis.

    So are driving points, of which no real part is negative (Ewins 2000, section 2.4). The largest imaginary part of a
    circle is half of its largest real part; angles have nothing to do with the size of magnitudes.
    """
    return bool(real.max() / 4.0 <= np.abs(imag).max() <= real.max())


def _looks_like_level(real: FloatArray, imag: FloatArray) -> bool:
    """Tell whether numbers are levels and angles: levels have no high peaks, angles stay at a half turn for long."""
    sizes, angles = np.abs(real), np.abs(imag)
    stays = np.mean(angles > NEAR * angles.max()) > OFTEN
    return bool(stays and np.median(sizes) > FLAT * sizes.max())


def _refuse_conjugated(frfs: Sequence[MeasuredFrf]) -> None:
    counted = [frf for frf in frfs if len(frf.values) >= FEWEST_LINES]
    turnings = np.array([_turning(frf.values) for frf in counted])
    if not len(counted):
        return
    source = counted[0].source
    if float(turnings.mean()) > CLEARLY:
        if source.is_conjugated:
            problem = "with 'conjugated' these FRFs look conjugated: their phase rises through resonances; leave it out"
        else:
            problem = "these FRFs look conjugated: their phase rises through resonances, as for exp(-i omega t)"
            problem += "; give their [[frf]] conjugated = true, or export their complex conjugate"
        raise FileFormatError(source.path, problem)
    for weighted in ([frf.values for frf in counted], [_as_acceleration(frf) for frf in counted]):
        against = _turning_against(weighted)
        if against.any():
            names = [str(frf.label) for frf, turns in zip(counted, against, strict=True) if turns]
            problem = f"{', '.join(names)} looks conjugated beside the other FRFs: its phase rises through resonances"
            raise FileFormatError(source.path, f"{problem}; export all FRFs by one convention")


def _as_acceleration(frf: MeasuredFrf) -> ComplexArray:
    """Weigh an FRF by frequency, as an accelerance is: in a receptance the lowest peak holds nearly all power."""
    power = 2 - frf.source.quantity.power
    return np.asarray(frf.values * frf.frequency_hz**power)


def _turning_against(values: Sequence[ComplexArray]) -> BoolArray:
    """Find the FRFs that surely turn against causality, where others surely turn by it."""
    turnings = np.array([_turning(column) for column in values])
    against = (turnings > SURELY) & [_resolves(column) for column in values]
    return np.asarray(against & (turnings < -SURELY).any())


def _resolves(values: ComplexArray) -> bool:
    """Tell whether an FRF turns over several lines, not from one to the next."""
    steps = np.abs(np.imag(values[1:] * np.conj(values[:-1])))
    return float(steps.sum()) ** 2 > RESOLVED * float(np.sum(steps**2))


def _turning(values: ComplexArray) -> float:
    """Give the sense in which an FRF turns with frequency, weighted by its power: -1 for a causal one, 1 against it.

    The mean of -d(phase)/d(omega), weighted by power, is the mean time of the impulse response, which is positive.
    """
    steps = np.imag(values[1:] * np.conj(values[:-1]))
    total = float(np.abs(steps).sum())
    return float(steps.sum()) / total if total else 0.0
