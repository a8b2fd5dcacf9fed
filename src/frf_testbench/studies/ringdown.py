"""How frequency and damping of modes depend on amplitude, from responses that ring down on their own.

Within a short window a mode decays as exp(lambda t) with the pole lambda of its amplitude there; from window to window
the amplitude falls and the pole moves. No force, no model and no level of impacts is needed. Each window is fitted by a
sum of damped sinusoids (Gauss-Newton steps on the poles; amplitudes are linear), the noise is what is left.

What the poles do with amplitude A tells families of laws apart: a cubic spring moves the frequency with A^2 and leaves
damping alone; Coulomb friction adds damping with 1/A; slip in joints lowers the frequency and raises the damping; drag
raises damping with A [WordenTomlinson2001].

[WordenTomlinson2001] K. Worden and G. R. Tomlinson, Nonlinearity in Structural Dynamics, IoP Publishing 2001,
doi:10.1887/0750303565.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.errors import InputError
from frf_ipz.numerics.least_squares import scale_columns, solve_scaled_columns

WINDOWS_APART = 0.5  # of a window: from one to the next
STEPS = 12
CUT = 1e-13  # of the largest singular value of sinusoids and their slopes
SETTLED = 1e-9  # relative change of the poles
SLOWEST, FASTEST = 1e-5, 0.2  # damping ratios that are believed
FARTHEST = 0.03  # relative: a frequency that runs away from its mode
STANDS_OUT = 5.0  # standard deviations: a weaker amplitude is noise
LARGEST_MISFIT = 0.1  # of the signal: a window that is fitted worse shows something else
ROUNDS = 3  # of weights
HOLDS = 0.33  # of the scatter about a constant: what a law by amplitude may leave
POWERS = np.concatenate([np.arange(-1.0, -0.2, 0.05), np.arange(0.25, 3.05, 0.05)])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingdownTrack:
    """A mode along one ring-down.

    Parameters
    ----------
    time_s : (n_windows,) array
        Middle of each window.
    amplitude : (n_windows,) array
        Of the mode in the middle of the window, in the unit of the signal.
    frequency_hz, damping_ratio : (n_windows,) array
        Undamped natural frequency, and decay rate over it.
    frequency_std_hz, damping_ratio_std : (n_windows,) array
        Standard deviations by what the fit leaves.
    """

    time_s: FloatArray
    amplitude: FloatArray
    frequency_hz: FloatArray
    damping_ratio: FloatArray
    frequency_std_hz: FloatArray
    damping_ratio_std: FloatArray

    def above(self, amplitude: float) -> RingdownTrack:
        """Keep the windows from the first one on until the mode falls to an amplitude."""
        low = np.flatnonzero(self.amplitude <= amplitude)
        windows = slice(0, int(low[0]) if len(low) else len(self.amplitude))
        return RingdownTrack(**{part.name: getattr(self, part.name)[windows] for part in fields(self)})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AmplitudeLaw:
    """A quantity as offset + change A^power, over all ring-downs.

    Parameters
    ----------
    offset : float
        At vanishing amplitude, or, for a negative power, at a large one.
    change : float
        Times A^power.
    power, power_low, power_high : float
        Best one and its 95 % interval, by leaving out one ring-down at a time.
    misfit : float
        Median of what the law leaves, times 1.48: the standard deviation of a normal distribution.
    misfit_of_constant : float
        The same for a quantity that does not depend on amplitude.
    """

    offset: float
    change: float
    power: float
    power_low: float
    power_high: float
    misfit: float
    misfit_of_constant: float

    @property
    def holds(self) -> bool:
        """The quantity depends on the amplitude of this mode, and on little else."""
        return self.misfit < HOLDS * self.misfit_of_constant

    def at(self, amplitude: FloatArray) -> FloatArray:
        """Evaluate at amplitudes."""
        return np.asarray(self.offset + self.change * amplitude**self.power)


def track_ringdown(
    signal: FloatArray, step_s: float, frequencies_hz: Sequence[float], window_s: float
) -> list[RingdownTrack]:
    """Follow modes along a ring-down.

    Parameters
    ----------
    signal : (n_samples,) array
        Displacement, velocity or acceleration.
    step_s : float
        s.
    frequencies_hz : sequence of float
        About where the modes are: all those that the signal shows.
    window_s : float
        Length of a window: a few periods of the distances between the modes.

    Returns
    -------
    list of RingdownTrack
        One for each mode; windows where the mode drowns in noise are left out.

    Raises
    ------
    InputError
        If the window is longer than the signal, or too short to tell the modes apart.
    """
    n = round(window_s / step_s)
    start = np.array([-1e-3 + 1j]) * 2 * np.pi * np.asarray(frequencies_hz, float)[:, None]
    poles = start[:, 0]
    if n > len(signal):
        raise InputError(f"a window of {window_s:g} s is longer than the ring-down of {len(signal) * step_s:g} s")
    if n < 8 * len(poles) or window_s * np.min(np.diff(np.sort([0.0, *frequencies_hz]))) < 2:
        raise InputError(f"a window of {window_s:g} s is too short to tell the modes apart; take a longer one")
    rows = []
    for first in range(0, len(signal) - n + 1, max(round(WINDOWS_APART * n), 1)):
        fit = _fit(np.asarray(signal[first : first + n], float), step_s, poles)
        is_close = np.abs(fit.poles.imag / start[:, 0].imag - 1) < FARTHEST
        poles = np.where(is_close, fit.poles, start[:, 0])
        rows.append(((first + (n - 1) / 2) * step_s, fit, is_close))
    return [_track(rows, mode) for mode in range(len(poles))]


def fit_amplitude_law(tracks: Sequence[RingdownTrack], quantity: str) -> AmplitudeLaw:
    """Fit how frequency or damping depends on amplitude, over all ring-downs of a mode.

    Parameters
    ----------
    tracks : sequence of RingdownTrack
        One mode in ring-downs of the same structure, two at least.
    quantity : str
        ``frequency_hz`` or ``damping_ratio``.

    Returns
    -------
    AmplitudeLaw
        Its interval is that of the ring-downs' scatter, which is wider than what single windows say.

    Raises
    ------
    InputError
        If there are fewer than two ring-downs.
    """
    if len(tracks) < 2:
        raise InputError("how a mode depends on amplitude needs two ring-downs at least, to see how far they agree")
    std = {"frequency_hz": "frequency_std_hz", "damping_ratio": "damping_ratio_std"}[quantity]
    sets = [(track.amplitude, getattr(track, quantity), getattr(track, std)) for track in tracks]
    offset, change, power, misfit, misfit_of_constant = _fit_power_law(sets)
    powers = np.array([_fit_power_law(sets[:i] + sets[i + 1 :])[2] for i in range(len(sets))])
    spread = 1.96 * np.sqrt((len(sets) - 1) * np.mean((powers - powers.mean()) ** 2))  # jackknife
    return AmplitudeLaw(
        offset=offset,
        change=change,
        power=power,
        power_low=power - spread,
        power_high=power + spread,
        misfit=misfit,
        misfit_of_constant=misfit_of_constant,
    )


def name_family(frequency: AmplitudeLaw, damping: AmplitudeLaw) -> str:
    """Say which family of laws moves a mode like that.

    Parameters
    ----------
    frequency, damping : AmplitudeLaw
        Of one mode.

    Returns
    -------
    str
        A few words; what is consistent with a family is no proof of it.
    """
    moves = np.sign(frequency.change * frequency.power) if frequency.holds else 0.0
    damps = np.sign(damping.change * damping.power) if damping.holds else 0.0
    families = {
        (0.0, 0.0): "neither follows the amplitude of this mode alone",
        (1.0, 0.0): "hardening as of a cubic spring or a closing gap",
        (-1.0, 0.0): "softening without damping, as of a preload or a softening spring",
        (-1.0, 1.0): "softening with more damping, as of slip in a joint",
        (0.0, 1.0): "damping that grows, as of drag",
        (0.0, -1.0): "damping that falls, as of Coulomb friction",
        (1.0, -1.0): "sticking less the more it moves, as of Coulomb friction beside a hardening spring",
    }
    return families.get((float(moves), float(damps)), "none of the simple families alone")


def _fit_power_law(
    sets: Sequence[tuple[FloatArray, FloatArray, FloatArray]],
) -> tuple[float, float, float, float, float]:
    """Fit offset, change and power; the misfits of the law and of a constant count beside the errors of the values."""
    amplitude, values, std = (np.concatenate(parts) for parts in zip(*sets, strict=True))
    misfit_of_constant = _robust_std(values - np.median(values))
    best, misfit = (float(np.median(values)), 0.0, 1.0), misfit_of_constant
    for _ in range(ROUNDS):
        weight = 1 / np.hypot(std, misfit)
        costs = []
        for power in POWERS:
            columns = np.stack([np.ones_like(amplitude), amplitude**power], 1) * weight[:, None]
            solution, *_ = np.linalg.lstsq(columns, values * weight, rcond=None)
            cost = float(np.sum((values * weight - columns @ solution) ** 2))
            costs.append((cost, *solution.tolist(), float(power)))
        _, *numbers = min(costs)
        best = (numbers[0], numbers[1], numbers[2])
        misfit = _robust_std(values - best[0] - best[1] * amplitude ** best[2])
    return (*best, misfit, misfit_of_constant)


def _robust_std(values: FloatArray) -> float:
    return float(1.48 * np.median(np.abs(values)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Window:
    poles: ComplexArray
    amplitude: FloatArray
    amplitude_std: float
    covariance: FloatArray
    misfit: float


def _fit(signal: FloatArray, step_s: float, poles: ComplexArray) -> _Window:
    """Fit damped sinusoids, whose amplitudes are those in the middle of the window."""
    time = np.asarray(step_s * (np.arange(len(signal)) - (len(signal) - 1) / 2), float)
    for _ in range(STEPS):
        columns, amplitudes = _fit_amplitudes(signal, time, poles)
        slopes = _differentiate_by_poles(time, poles, amplitudes)
        misfit = signal - columns @ amplitudes
        step = solve_scaled_columns(np.hstack([columns, slopes]), misfit, CUT)[columns.shape[1] :]
        change = step[: len(poles)] + 1j * step[len(poles) :]
        decay = np.clip(-(poles + change).real / np.abs(poles), SLOWEST, FASTEST) * np.abs(poles)
        poles = -decay + 1j * (poles + change).imag
        if np.abs(change).max() < SETTLED * np.abs(poles).max():
            break
    columns, amplitudes = _fit_amplitudes(signal, time, poles)
    all_columns = np.hstack([columns, _differentiate_by_poles(time, poles, amplitudes)])
    misfit = signal - columns @ amplitudes
    variance = float(misfit @ misfit) / max(len(signal) - all_columns.shape[1], 1)
    scaled, sizes = scale_columns(all_columns)
    covariance = variance * np.linalg.pinv(scaled.T @ scaled, hermitian=True) / sizes / sizes[:, None]
    return _Window(
        poles=poles,
        amplitude=np.hypot(*amplitudes[: 2 * len(poles)].reshape(2, -1)),
        amplitude_std=float(np.sqrt(2 * variance / len(signal))),
        covariance=covariance[columns.shape[1] :, columns.shape[1] :],
        misfit=float(np.sqrt(variance) / max(signal.std(), 1e-300)),
    )


def _fit_amplitudes(signal: FloatArray, time: FloatArray, poles: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Fit the amplitudes of cosines, sines and a constant to a signal; the columns come with them."""
    turning = np.exp(np.outer(time, poles))
    columns = np.hstack([turning.real, turning.imag, np.ones((len(time), 1))])
    return columns, solve_scaled_columns(columns, signal, CUT)


def _differentiate_by_poles(time: FloatArray, poles: ComplexArray, amplitudes: FloatArray) -> FloatArray:
    """Differentiate the signal by real and imaginary parts of the poles."""
    n = len(poles)
    complex_amplitudes = amplitudes[:n] - 1j * amplitudes[n : 2 * n]
    slopes = np.exp(np.outer(time, poles)) * complex_amplitudes * time[:, None]
    return np.hstack([slopes.real, -slopes.imag])


def _track(rows: list[tuple[float, _Window, FloatArray]], mode: int) -> RingdownTrack:
    windows = [
        (time, fit)
        for time, fit, is_close in rows
        if is_close[mode] and fit.amplitude[mode] > STANDS_OUT * fit.amplitude_std and fit.misfit < LARGEST_MISFIT
    ]
    poles = np.array([fit.poles[mode] for _, fit in windows])
    n = len(rows[0][1].poles)
    size = np.abs(poles)
    decay_std, turn_std = (
        np.sqrt([fit.covariance[row, row] for _, fit in windows]) if windows else np.zeros(0)
        for row in (mode, n + mode)
    )
    return RingdownTrack(
        time_s=np.array([time for time, _ in windows]),
        amplitude=np.array([fit.amplitude[mode] for _, fit in windows]),
        frequency_hz=size / (2 * np.pi),
        damping_ratio=-poles.real / size,
        frequency_std_hz=turn_std / (2 * np.pi),
        damping_ratio_std=decay_std / size,
    )
