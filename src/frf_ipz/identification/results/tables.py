"""Tables of a fit: the modes with their quality, and the misfit of each FRF by bands."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.identification.results.found_again import found_again
from frf_ipz.identification.search.split_half import unconfirmed_reasons
from frf_ipz.late_imports import import_late
from frf_ipz.modes import modal_assurance, modal_phase_collinearity
from frf_ipz.rational import damping_ratio, natural_frequency_hz

if TYPE_CHECKING:
    import pandas as pd

    from frf_ipz.frf import FrfLabel
    from frf_ipz.identification.search.goodness_of_fit import GoodnessOfFit
    from frf_ipz.identification.search.split_half import SplitHalf
else:
    pd = import_late("pandas")

BANDS = 8  # of the misfit table, of equal width
GOOD, FAIR = 0.9, 2 / 3  # probability to be found again above which a mode is good, or fair: two of three fits have it
GOOD_DAMPING = 0.05  # relative standard deviation of the damping
GOOD_SIGNIFICANCE = 5.0  # times what the BIC demands
COLLINEAR = 0.9  # phase collinearity of a mode that looks normal
SAME_SHAPE = 0.9  # MAC between two modes at which the shapes do not distinguish them
FEWEST_FRFS = 3  # whose shapes can differ
CLOSE_MODES = 0.02  # relative distance of two modes whose shapes are compared for it


def mode_table(
    poles: ComplexArray,
    residues: ComplexArray,
    goodness: GoodnessOfFit,
    modes: IntArray,
    halves: SplitHalf | None,
) -> pd.DataFrame:
    """Table of the modes with a quality mark.

    Parameters
    ----------
    poles : (n_modes,) complex array
        rad/s.
    residues : (n_modes, n_frfs) complex array
        Of receptances.
    goodness : GoodnessOfFit
        Of the fit.
    modes : (n_modes,) int array
        Indices of the modes in the goodness.
    halves : SplitHalf or None
        The fits of even and of odd lines, where they were made: a mode that does not come up in both is poor.

    Returns
    -------
    DataFrame
        One row a mode; `quality` says in a word, good, fair or poor, how likely it is to be found again.
    """
    shapes, doubts = residues.T, unconfirmed_reasons(halves, modes)
    assurance = modal_assurance(shapes, shapes)
    np.fill_diagonal(assurance, 0.0)
    is_close = np.abs(np.abs(poles)[:, None] / np.abs(poles) - 1) < CLOSE_MODES
    confused = np.max(assurance * is_close, axis=1, initial=0.0) * (len(shapes) >= FEWEST_FRFS)
    rows = {
        "pole_id": np.arange(1, len(poles) + 1),
        "frequency_hz": natural_frequency_hz(poles),
        "damping_ratio": damping_ratio(poles),
        # residues of normal modes are imaginary in every FRF: a phase common to all of them shows complexity as well
        "mpc": modal_phase_collinearity(shapes) if shapes.shape[0] > 1 else np.ones(len(poles)),
        "highest_mac": np.max(assurance, axis=1, initial=0.0),
        "significance": goodness.significance[modes],
        "damping_std_ratio": goodness.damping_std[modes],
        "misfit_level": _level_at(goodness, poles),
        "found_again": found_again(goodness, modes, halves),
    }
    remarks = [_remarks(rows, number, float(confused[number])) for number in range(len(poles))]
    quality = ["good" if value > GOOD else "fair" if value > FAIR else "poor" for value in rows["found_again"]]
    remarks = [[*text, doubt] if doubt else text for text, doubt in zip(remarks, doubts, strict=True)]
    return pd.DataFrame({**rows, "quality": quality, "remarks": ["; ".join(text) for text in remarks]})


def misfit_table(
    frequency_hz: FloatArray, misfit: ComplexArray, std: FloatArray, labels: tuple[FrfLabel, ...]
) -> pd.DataFrame:
    """Table of the misfit of each FRF by bands.

    Parameters
    ----------
    frequency_hz : (n_lines,) array
        Lines, Hz.
    misfit : (n_lines, n_frfs) complex array
        Measured minus model, in units of the FRF.
    std : (n_lines, n_frfs) array
        Noise: root of E of its squared modulus.
    labels : tuple of FrfLabel
        The FRFs.

    Returns
    -------
    DataFrame
        One row an FRF and band.
    """
    edges = np.linspace(frequency_hz[0], frequency_hz[-1], BANDS + 1)
    band = np.clip(np.searchsorted(edges, frequency_hz, side="right") - 1, 0, BANDS - 1)
    starts = np.flatnonzero(np.diff(band, prepend=-1))
    counts = np.diff(np.append(starts, len(band)))[:, None]
    squares, powers = np.abs(misfit) ** 2, std**2
    columns = [np.sqrt(np.add.reduceat(values, starts) / counts).T for values in (squares, powers, squares / powers)]
    shape = columns[0].shape
    return pd.DataFrame(
        {
            "frf": np.repeat(np.arange(len(labels)), shape[1]),
            "output_dof": np.repeat([str(label.output_dof) for label in labels], shape[1]),
            "input_dof": np.repeat([str(label.input_dof) for label in labels], shape[1]),
            "band_low_hz": np.tile(edges[band[starts]], shape[0]),
            "band_high_hz": np.tile(edges[band[starts] + 1], shape[0]),
            "misfit": columns[0].ravel(),
            "noise": columns[1].ravel(),
            "ratio": columns[2].ravel(),
        }
    )


def _level_at(goodness: GoodnessOfFit, poles: ComplexArray) -> FloatArray:
    lines = np.clip(np.searchsorted(goodness.frequency_hz, natural_frequency_hz(poles)), 0, len(goodness.level) - 1)
    return np.asarray(np.sqrt(np.median(goodness.level[lines], axis=1)))


def _remarks(rows: dict[str, FloatArray], number: int, confused: float) -> list[str]:
    remarks = []
    if rows["damping_std_ratio"][number] > GOOD_DAMPING:
        remarks.append(f"damping uncertain by {100 * rows['damping_std_ratio'][number]:.2g} %")
    if rows["significance"][number] < GOOD_SIGNIFICANCE:
        remarks.append("hardly more than the data ask for")
    if rows["mpc"][number] < COLLINEAR:
        remarks.append("complex shape")
    if confused > SAME_SHAPE:
        remarks.append("same shape as the neighbouring mode")
    return remarks
