"""The lines and FRFs that are fitted, as receptances, with the variance of their noise."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from frf_ipz.errors import InputError
from frf_ipz.identification.noise import BLOCK_LINES, law_of_squares, misfit_variance, rough_variance

if TYPE_CHECKING:
    from collections.abc import Callable

    from frf_ipz.frf import ForceNoise, FrfSet
    from frf_ipz.identification.options import FitOptions
    from frf_ipz.numerics.line_sums import LineSums

LEAST_COHERENCE = 0.3  # of the median FRF on a line: below, the line says nothing of the structure
LEAST_NOISE = 1e-6  # of an FRF's own modulus: no measurement is better, and a variance of zero weighs infinitely
MODEL_ERROR = 1e-3  # the same where the noise was not measured: few structures are linear to less
FEWEST_LINES = 16  # what the fit of a single mode needs
ENOUGH_LINES = 48  # what start poles of order 24 need: four lines to each complex coefficient
SIGNAL = 3.0  # times the noise, in modulus: where the median FRF is above, the band carries signal
SHARED_SPREAD = 0.15  # rms relative deviation of weights from profile times gain that costs less than 3 % of efficiency


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WeighedSums:
    """What the likelihood needs of weighted lines and smooth terms, whatever the poles are.

    Parameters
    ----------
    sums : LineSums
        The weighted lines, by intervals.
    of_powers : (n_systems, n_powers, n) array
        Products of the powers with powers and FRFs.
    of_squares : (n_frfs,) array
        Weighted sum of squares of each FRF.
    """

    sums: LineSums
    of_powers: FloatArray
    of_squares: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WeightedLines:
    """Receptances and the weights of their lines, as the likelihood takes them.

    Parameters
    ----------
    s : (n_lines,) complex array
        rad/s.
    receptance : (n_lines, n_frfs) complex array
        FRFs as receptances, m/N.
    profile : (n_lines,) array
        Weight of a line that all FRFs share.
    gain : (n_frfs,) array
        Weight of an FRF: one over the standard deviation of each part of its noise is profile times gain, N/m.
    full : (n_lines, n_frfs) array or None
        Weights where profile times gain is not good enough.
    real_modes : bool
        Residues of receptances are imaginary, as those of normal modes.
    force : (n_frfs,) int array or None
        Which FRFs share a force, by its number.
    force_noise : ForceNoise or None
        What is known of the noise of the force.
    sums : dict
        What the compression has made of the lines, by the powers and the scale of the smooth terms.
    """

    s: ComplexArray
    receptance: ComplexArray
    profile: FloatArray
    gain: FloatArray
    full: FloatArray | None = None
    real_modes: bool = False
    force: IntArray | None = None
    force_noise: ForceNoise | None = None
    sums: dict[tuple[tuple[int, ...], float], WeighedSums] = field(default_factory=dict, init=False, repr=False)

    @property
    def is_shared(self) -> bool:
        """One basis serves all FRFs."""
        return self.full is None

    @property
    def weight(self) -> FloatArray:
        """Weight of each line and FRF, (n_lines, n_frfs) array."""
        return self.profile[:, None] * self.gain if self.full is None else self.full

    def with_real_modes(self) -> WeightedLines:
        """Take residues for those of normal modes; what the compression has made of the lines stays."""
        normal = replace(self, real_modes=True)
        normal.sums.update(self.sums)
        return normal


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeasuredLines:
    """The lines and FRFs that are fitted, with their noise.

    Parameters
    ----------
    frequency_hz : (n_lines,) array
        Lines of the band that are used, Hz.
    s : (n_lines,) complex array
        Where the FRFs were measured, rad/s.
    receptance : (n_lines, n_frfs) complex array
        The FRFs over s to the power of their quantity.
    variance : (n_lines, n_frfs) array
        E of the squared modulus of their error, as far as it is noise.
    known : (n_frfs,) bool array
        True where the variance comes with the recordings.
    used : (n_all_lines,) bool array
        Which lines of the FrfSet these are.
    powers : (n_frfs,) int array
        Power of s that makes each FRF out of a receptance.
    force : (n_frfs,) int array
        Which FRFs share a force, by its number.
    force_noise : ForceNoise or None
        The part of the variance that neighbouring lines share, where it is known.
    missing_force : (n_lines, n_frfs) complex array or None
        What records lack of the force, over what they hold of it, where they begin within its pulse.
    gain_variance : (n_lines, n_frfs) array or None
        The part of the variance by relative errors that change slowly with frequency.
    overlap : float
        Lines that stand for one independent line: the variance is so much larger than the noise of one line.
    """

    frequency_hz: FloatArray
    s: ComplexArray
    receptance: ComplexArray
    variance: FloatArray
    known: BoolArray
    used: BoolArray
    powers: IntArray
    force: IntArray
    force_noise: ForceNoise | None = None
    missing_force: ComplexArray | None = None
    gain_variance: FloatArray | None = None
    overlap: float = 1.0

    @property
    def band_hz(self) -> tuple[float, float]:
        """Lowest and highest line, Hz."""
        return float(self.frequency_hz[0]), float(self.frequency_hz[-1])

    @property
    def line_hz(self) -> float:
        """Distance of lines, Hz."""
        return float(np.median(np.diff(self.frequency_hz)))

    def advanced(self, delay_s: FloatArray) -> MeasuredLines:
        """Take delays off.

        Parameters
        ----------
        delay_s : (n_frfs,) array
            Of each FRF, s.

        Returns
        -------
        MeasuredLines
            The FRFs as they are without the delays.
        """
        return replace(self, receptance=self.receptance * np.exp(self.s[:, None] * delay_s))

    def weighted(self, *, shared: bool = False) -> WeightedLines:
        """Weight each line by one over the standard deviation of each part of its noise.

        Parameters
        ----------
        shared : bool
            Allow one profile of weights for all FRFs, which costs a little efficiency and saves much time.

        Returns
        -------
        WeightedLines
            With a profile that all FRFs share where that is asked for and good enough.
        """
        log_weight = -0.5 * np.log(self.variance / 2)
        gain = log_weight.mean(axis=0)
        profile = (log_weight - gain).mean(axis=1)
        spread = log_weight - gain - profile[:, None]
        full = np.exp(log_weight) if not shared and np.sqrt(np.mean(spread**2)) > SHARED_SPREAD else None
        return WeightedLines(
            s=self.s,
            receptance=self.receptance,
            profile=np.exp(profile),
            gain=np.exp(gain),
            full=full,
            force=self.force,
            force_noise=self.force_noise,
        )


def measured_lines(frfs: FrfSet, options: FitOptions) -> MeasuredLines:
    """Choose the lines to fit, and find the noise of FRFs whose variance is not known.

    Parameters
    ----------
    frfs : FrfSet
        Measured FRFs.
    options : FitOptions
        Band, and bands to leave out.

    Returns
    -------
    MeasuredLines
        The lines to fit.

    Raises
    ------
    InputError
        If too few lines remain, or a pole is pinned or rejected outside of them.
    """
    known = np.asarray(np.isfinite(frfs.variance).any(axis=0), bool)
    usable = _usable(frfs, known)
    noise = np.where(known, frfs.variance, np.nan)
    if not known.all():
        noise[:, ~known] = rough_variance(frfs.values[:, ~known])
    band = options.band_hz or _signal_band(frfs, noise, usable, has_variance=bool(known.all()))
    in_band = usable & frfs.in_band(band, options.exclude_hz)
    step = frfs.correlated_lines
    if known.all():  # a variance that is found on the lines themselves holds no overlap
        step = max(1, min(step, int(in_band.sum()) // ENOUGH_LINES))
    taken = np.arange(frfs.n_lines) % step == 0
    used = in_band & taken
    if used.sum() < FEWEST_LINES:
        if options.band_hz is None and usable.sum() >= FEWEST_LINES:
            raise InputError(
                f"only {int(used.sum())} of {int(usable.sum())} frequency lines carry a signal above the noise, from "
                f"{band[0]:g} to {band[1]:g} Hz; a fit needs {FEWEST_LINES}: check the measurement and its channels, "
                "or set [fit] band_hz to where there is a signal"
            )
        excluded = int((usable & taken & frfs.in_band(band)).sum()) >= FEWEST_LINES
        way_out = "exclude less of it by [fit] exclude_hz" if excluded else "set a wider [fit] band_hz"
        raise InputError(
            f"only {int(used.sum())} usable frequency lines remain in the band {band[0]:g} to {band[1]:g} Hz; "
            f"a fit needs {FEWEST_LINES}: {way_out}{'' if excluded else ', or record longer for finer lines'}"
        )
    lines = frfs.select_lines(used)
    options.require_within((float(lines.frequency_hz[0]), float(lines.frequency_hz[-1])))
    powers = np.array([label.quantity.power for label in frfs.labels])
    if not known.all():  # once more in the band alone: the noise outside may be of another size
        noise[np.ix_(used, ~known)] = rough_variance(lines.values[:, ~known])
    variance = noise[used] + (np.where(known, LEAST_NOISE, MODEL_ERROR) * np.abs(lines.values)) ** 2
    overlap = frfs.correlated_lines / step
    variance = np.maximum(overlap * variance, np.finfo(float).tiny * 1e40)
    to_receptance = lines.s[:, None] ** powers
    return MeasuredLines(
        frequency_hz=lines.frequency_hz,
        s=lines.s,
        receptance=lines.values / to_receptance,
        variance=variance / np.abs(to_receptance) ** 2,
        known=known,
        used=used,
        powers=powers,
        force=np.unique([str(label.input_dof) for label in frfs.labels], return_inverse=True)[1],
        force_noise=lines.force_noise,
        missing_force=lines.missing_force,
        gain_variance=None if lines.gain_variance is None else lines.gain_variance / np.abs(to_receptance) ** 2,
        overlap=overlap,
    )


def with_misfit_noise(lines: MeasuredLines, misfit: ComplexArray) -> MeasuredLines:
    """Take the noise of FRFs whose variance is not known from the misfit of a model.

    Parameters
    ----------
    lines : MeasuredLines
        The lines that are fitted.
    misfit : (n_lines, n_frfs) complex array
        Measured minus model, as receptances.

    Returns
    -------
    MeasuredLines
        With a better variance: peaks that a model follows are no noise.
    """
    if lines.known.all():
        return lines
    variance = lines.variance.copy()
    noise = _in_measured_quantity(lines, misfit, misfit_variance) + (MODEL_ERROR * np.abs(lines.receptance)) ** 2
    variance[:, ~lines.known] = noise[:, ~lines.known]
    return replace(lines, variance=variance)


def misfit_square(lines: MeasuredLines, misfit: ComplexArray) -> FloatArray:
    """Give the mean square of the misfit of a model, smooth over the lines as noise is.

    Parameters
    ----------
    lines : MeasuredLines
        The lines that are fitted.
    misfit : (n_lines, n_frfs) complex array
        Measured minus model, as receptances.

    Returns
    -------
    (n_lines, n_frfs) array
        As receptances, (m/N)^2: noise, and what the model does not follow.
    """
    square = _in_measured_quantity(lines, misfit, lambda values, size: law_of_squares(np.abs(values) ** 2, size))
    return np.asarray(square + (LEAST_NOISE * np.abs(lines.receptance)) ** 2)


def _in_measured_quantity(
    lines: MeasuredLines, misfit: ComplexArray, law: Callable[[ComplexArray, FloatArray], FloatArray]
) -> FloatArray:
    """Find squares that are even over the lines in the quantity that was measured; as receptances.

    As a receptance, such noise falls by 12 dB an octave.
    """
    to_measured = np.abs(lines.s[:, None]) ** lines.powers
    return law(misfit * to_measured, np.abs(lines.receptance) * to_measured) / to_measured**2


def _usable(frfs: FrfSet, known: BoolArray) -> BoolArray:
    usable = frfs.frequency_hz > 0  # sensors have an offset there, whatever an exponential window makes of it
    usable &= (np.isfinite(frfs.variance) | ~known).all(axis=1)
    coherent = np.isfinite(frfs.coherence)
    if coherent.any():
        usable &= ~(np.nanmedian(np.where(coherent, frfs.coherence, 1.0), axis=1) < LEAST_COHERENCE)
    return np.asarray(usable)


def _signal_band(frfs: FrfSet, noise: FloatArray, usable: BoolArray, *, has_variance: bool) -> tuple[float, float]:
    """Find the band that carries signal, where the user gives none."""
    lines_hz = frfs.frequency_hz[usable]
    if not has_variance and 0 < len(lines_hz) < 2 * BLOCK_LINES:  # too few to tell noise from peaks without a model
        return float(lines_hz[0]), float(lines_hz[-1])
    is_known = np.isfinite(noise) & (noise > 0)
    ratio = np.divide(np.abs(frfs.values) ** 2, noise, out=np.zeros(frfs.values.shape), where=is_known)
    carries = np.median(ratio[usable], axis=0) > SIGNAL**2 if usable.any() else np.zeros(frfs.n_frfs, bool)
    of_signal = ratio[:, carries] if carries.any() else ratio  # FRFs that hold noise only say nothing of the band
    has_signal = usable & (np.median(of_signal, axis=1) > SIGNAL**2)
    if not has_signal.any():
        raise InputError("no frequency line carries a signal above the noise; check the recordings and their channels")
    share = np.cumsum(has_signal) / has_signal.sum()
    first, last = np.searchsorted(share, [1e-9, 1 - 1e-9])
    return float(frfs.frequency_hz[first]), float(frfs.frequency_hz[min(last, frfs.n_lines - 1)])
