"""How strong the noise on measured FRFs is, where the recordings do not say so.

Noise differs from line to line, a response does not: third differences are those of the noise. Their median over some
lines is not moved by the few lines on which a narrow peak does vary.
"""

from __future__ import annotations

from math import comb, log

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray

DIFFERENCE = 3  # order of the differences: a parabola over four lines is no noise
BLOCK_LINES = 48  # lines behind one estimate: its scatter is then some 20 %
TINY = 1e-200  # so that logarithms and squared weights of a dead channel stay finite


def rough_variance(values: ComplexArray) -> FloatArray:
    """Estimate the noise variance from the differences between lines.

    Parameters
    ----------
    values : (n_lines, n_frfs) complex array
        FRFs.

    Returns
    -------
    (n_lines, n_frfs) array
        E of the squared modulus of the noise, smooth over the lines.
    """
    return smooth_level(squared_differences(values))


def misfit_variance(misfit: ComplexArray, size: FloatArray) -> FloatArray:
    """Estimate the variance of the noise in a misfit.

    Noise of the response is as strong on a peak as beside it, noise that comes with the force follows the response.
    Each block of lines takes the law that explains its differences better.

    Parameters
    ----------
    misfit : (n_lines, n_frfs) complex array
        Measured minus model.
    size : (n_lines, n_frfs) array
        Modulus of the FRFs.

    Returns
    -------
    (n_lines, n_frfs) array
        E of the squared modulus of the noise.
    """
    return law_of_squares(squared_differences(misfit), size)


def law_of_squares(squares: FloatArray, size: FloatArray) -> FloatArray:
    """Smooth squares by the law, constant or in proportion to the FRF, that suits each block of lines better.

    Parameters
    ----------
    squares : (n_lines, n_frfs) array
        Squared moduli of noise.
    size : (n_lines, n_frfs) array
        Modulus of the FRFs.

    Returns
    -------
    (n_lines, n_frfs) array
        E of the squares.
    """
    constant_level = smooth_level(squares)
    power = np.maximum(size**2, TINY)
    proportional_level = smooth_level(squares / power) * power
    block = np.minimum(np.arange(len(squares)) // BLOCK_LINES, max(0, len(squares) // BLOCK_LINES - 1))
    starts = np.flatnonzero(np.diff(block, prepend=-1))
    # minus the logarithm of the likelihood of exponentially distributed squares
    costs = [
        np.log(np.maximum(level, TINY)) + squares / np.maximum(level, TINY)
        for level in (constant_level, proportional_level)
    ]
    is_proportional = np.add.reduceat(costs[1] - costs[0], starts, axis=0) < 0
    return np.asarray(np.where(is_proportional[block], proportional_level, constant_level))


def smooth_level(squares: FloatArray) -> FloatArray:
    """Smooth level of exponentially distributed squares, by medians over blocks of lines.

    Parameters
    ----------
    squares : (n_lines, n_frfs) array
        Squared moduli of complex Gaussian numbers.

    Returns
    -------
    (n_lines, n_frfs) array
        Their expectation.
    """
    n_lines = len(squares)
    edges = np.linspace(0, n_lines, max(1, n_lines // BLOCK_LINES) + 1).astype(int)
    block_lines = edges[:-1, None] + np.arange(np.diff(edges).min())
    # an exponential distribution has ln 2 times its mean at the median
    blocks = np.median(squares[block_lines], axis=1) / log(2)
    middles = (edges[:-1] + edges[1:] - 1) / 2
    levels = np.log(np.maximum(blocks, TINY))
    lines = np.arange(n_lines)
    return np.asarray(np.exp(np.stack([np.interp(lines, middles, level) for level in levels.T], axis=1)))


def squared_differences(values: ComplexArray) -> FloatArray:
    """Give squares of what differs from line to line.

    Parameters
    ----------
    values : (n_lines, n_frfs) complex array
        FRFs, or what a model leaves of them.

    Returns
    -------
    (n_lines, n_frfs) array
        Of third differences: their expectation is that of the noise.
    """
    weights = np.array([(-1) ** k * comb(DIFFERENCE, k) for k in range(DIFFERENCE + 1)])
    weights = weights / np.linalg.norm(weights)
    count = len(values) - DIFFERENCE
    squares = np.abs(sum(weight * values[k : k + count] for k, weight in enumerate(weights))) ** 2
    before = DIFFERENCE // 2
    return np.pad(squares, ((before, DIFFERENCE - before), (0, 0)), mode="edge")
