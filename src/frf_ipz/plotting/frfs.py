"""Measured FRFs, and the fit against them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.plotting.curves import PHASE_LIMITS, confidence_band, magnitude_title, phase_degrees
from frf_ipz.plotting.style import MEASURED, axes_or_new, colour, dash, label_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from frf_ipz.arrays import FloatArray
    from frf_ipz.frf import FrfSet
    from frf_ipz.identification.modal_fit import ModalFit

FREQUENCY = "Frequency, Hz"


def plot_frfs(frfs: FrfSet, *, ax: Axes | None = None) -> Axes:
    """Draw the magnitudes of measured FRFs with their 95 % bands.

    Parameters
    ----------
    frfs : FrfSet
        The FRFs; ``frfs.select_frfs([0, 3])`` and ``frfs.select_lines(...)`` choose.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        With the picture.
    """
    ax = axes_or_new(ax)
    for place, label in enumerate(frfs.labels):
        magnitude, std = np.abs(frfs.values[:, place]), np.sqrt(frfs.variance[:, place] / 2)
        _shade(ax, frfs.frequency_hz, confidence_band(magnitude, std), colour(place))
        ax.semilogy(frfs.frequency_hz, magnitude, dash(place), color=colour(place), linewidth=1, label=str(label))
    return label_axes(ax, FREQUENCY, magnitude_title(frfs.labels))


def plot_phases(frfs: FrfSet, *, ax: Axes | None = None) -> Axes:
    """Draw the phases of measured FRFs.

    Parameters
    ----------
    frfs : FrfSet
        The FRFs.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        With the picture.
    """
    ax = axes_or_new(ax)
    for place, label in enumerate(frfs.labels):
        phase = phase_degrees(frfs.values[:, place])
        ax.plot(frfs.frequency_hz, phase, dash(place), color=colour(place), linewidth=1, label=str(label))
    ax.set_ylim(*PHASE_LIMITS)
    ax.set_yticks([-180, -90, 0, 90])
    return label_axes(ax, FREQUENCY, "Phase, °")


def plot_coherence(frfs: FrfSet, *, ax: Axes | None = None) -> Axes:
    """Draw the coherence of measured FRFs.

    Parameters
    ----------
    frfs : FrfSet
        The FRFs.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        With the picture; FRFs of one record have no coherence.
    """
    ax = axes_or_new(ax)
    for place, label in enumerate(frfs.labels):
        coherence = frfs.coherence[:, place]
        ax.plot(frfs.frequency_hz, coherence, dash(place), color=colour(place), linewidth=1, label=str(label))
    ax.set_ylim(-0.02, 1.05)
    return label_axes(ax, FREQUENCY, "Coherence")


def plot_fit(frfs: FrfSet, fit: ModalFit, *, ax: Axes | None = None) -> Axes:
    """Draw measured FRFs as points, fitted ones as lines, and the 95 % bands of the fit.

    Parameters
    ----------
    frfs : FrfSet
        The FRFs that were fitted, on all their lines.
    fit : ModalFit
        The fit.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        With the picture.
    """
    ax, used = axes_or_new(ax), frfs.select_lines(fit.used_lines)
    fitted = np.abs(fit.model(used.s))
    for place, label in enumerate(used.labels):
        points = {"color": colour(place), "markersize": 2, "alpha": 0.5, "rasterized": used.n_lines > 20_000}
        ax.semilogy(used.frequency_hz, np.abs(used.values[:, place]), ".", **points)
        limits = confidence_band(fitted[:, place], fit.value_std[:, place] / np.sqrt(2))
        _shade(ax, used.frequency_hz, limits, colour(place))
        ax.semilogy(
            used.frequency_hz, fitted[:, place], dash(place), color=colour(place), linewidth=1, label=str(label)
        )
    return label_axes(ax, FREQUENCY, magnitude_title(used.labels))


def plot_misfit(frfs: FrfSet, fit: ModalFit, *, ax: Axes | None = None) -> Axes:
    """Draw the modulus of measurement minus fit, and the standard deviation of the measurement (dotted).

    Parameters
    ----------
    frfs : FrfSet
        The FRFs that were fitted, on all their lines.
    fit : ModalFit
        The fit.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        With the picture.
    """
    ax, used = axes_or_new(ax), frfs.select_lines(fit.used_lines)
    misfit, noise = np.abs(fit.model(used.s) - used.values), np.sqrt(used.variance)
    for place, label in enumerate(used.labels):
        ax.semilogy(used.frequency_hz, misfit[:, place], color=colour(place), linewidth=0.8, label=str(label))
        name = "noise" if place == 0 else None
        ax.semilogy(used.frequency_hz, noise[:, place], ":", color=MEASURED, linewidth=1, label=name)
    return label_axes(ax, FREQUENCY, "Misfit, " + magnitude_title(used.labels).partition(", ")[2])


def _shade(ax: Axes, frequency_hz: FloatArray, limits: tuple[FloatArray, FloatArray], fill: str) -> None:
    ax.fill_between(frequency_hz, *limits, color=fill, alpha=0.25, linewidth=0)
