"""Spectra of records of a running test without the transients at both ends.

On the lines of a whole record, without a window, ``X = G F + T`` exactly: T holds the motion that comes in at the
beginning and goes out at the end. G and T have the poles of the structure, so near a line both are ratios with one
denominator, ``X D = N F + M``, which is linear in the coefficients of D, N and M. A random force is rough from line to
line and M is smooth, so that the two are separable however narrow the resonance is, even if it is narrower than the
spacing of the lines. The transient ``T = M / D`` is subtracted; all of G stays in the spectra.

A sweep is smooth from line to line at the frequencies that it passes near its beginning and its end: N F looks like M
there, and separating them multiplies the noise. Such lines are given less weight.

[McKelvey2012]: T. McKelvey, G. Guerin, Non-parametric frequency response estimation using a local rational model, IFAC
Proceedings Volumes 45(16) (2012) 49-54 (doi:10.3182/20120711-3-BE-2027.00299), the method.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray

if TYPE_CHECKING:
    from collections.abc import Iterator

SIDE = 8  # lines to each side that a fit takes in
DEGREE = 2  # of the three polynomials
BLOCK = 1024  # lines that are fitted at a time
RIDGE = 1e-12  # of the trace: the equations stay solvable where there is no force
ROUGH = 0.3  # information on G that remains beside M, over that without M: random forces have more on every line

# A row of lines times _OFF_SMOOTH is the row times each power of x, all that is smooth projected out; times _MIDDLE it
# is the smooth part of each at the middle line.
_X = np.arange(-SIDE, SIDE + 1) / SIDE
_POWERS = _X[:, None] ** np.arange(DEGREE + 1)
_BASIS, _UPPER = np.linalg.qr(_POWERS)
_OFF_SMOOTH = (_POWERS[:, :, None] * (np.eye(len(_X)) - _BASIS @ _BASIS.T)[:, None]).reshape(len(_X), -1)
_MIDDLE = _POWERS * np.linalg.solve(_UPPER, _BASIS.T)[0][:, None]


def transform_without_transients(
    force: FloatArray, responses: FloatArray, lines: IntArray | None = None, *, between: float = 0.0
) -> tuple[ComplexArray, ComplexArray]:
    """Transform a record of a running test, and subtract what does not come from its force.

    Parameters
    ----------
    force : (n_samples,) or (n_inputs, n_samples) array
        Random, N; several forces that act at once are fitted together.
    responses : (n_outputs, n_samples) array
        SI.
    lines : (n_lines,) int array, optional
        Which lines of the record; all from 0 Hz to half of the sampling rate where it is left out.
    between : float
        How far above the lines to transform, 0 to 1 of their spacing: T differs there, and is as smooth.

    Returns
    -------
    force : (n_lines,) or (n_inputs, n_lines) complex array
        Its transform, ``sum f(t) exp(-s t)``, times the weight of its line, at most 1.
    responses : (n_outputs, n_lines) complex array
        Those of the responses less their transients: the FRF times that of the force.
    """
    n = force.shape[-1]
    turn = np.exp(-2j * np.pi * between * np.arange(n) / n)
    F, X = np.fft.fft(force * turn), np.fft.fft(responses * turn)
    lines = np.arange(n // 2 + 1) if lines is None else lines
    if n < 2 * len(_X):
        return F[..., lines], X[:, lines]
    blocks = [lines[start : start + BLOCK] for start in range(0, len(lines), BLOCK)]
    parts = [_fit_transients(np.atleast_2d(F), X, block) for block in blocks]
    transients, weights = (np.concatenate(part, axis=-1) for part in zip(*parts, strict=True))
    return F[..., lines] * weights, (X[:, lines] - transients) * weights


def transform_subrecords(
    force: FloatArray, responses: FloatArray, length: int, lines: IntArray | None = None, *, between: float = 0.0
) -> Iterator[tuple[ComplexArray, ComplexArray]]:
    """Cut a record into sub-records, one behind the other, and transform each without its transients.

    Parameters
    ----------
    force : (n_samples,) or (n_inputs, n_samples) array
        N.
    responses : (n_outputs, n_samples) array
        SI.
    length : int
        Samples of a sub-record; a shorter remainder at the end is not used.
    lines, between
        As for `transform_without_transients`.

    Yields
    ------
    force, responses : complex arrays
        As `transform_without_transients` gives them.
    """
    for start in range(0, force.shape[-1] - length + 1, length):
        samples = slice(start, start + length)
        yield transform_without_transients(force[..., samples], responses[:, samples], lines, between=between)


def _fit_transients(F: ComplexArray, X: ComplexArray, lines: IntArray) -> tuple[ComplexArray, FloatArray]:
    """T at some lines, (n_outputs, n), and their weights; M is projected out first, then N and D are fitted."""
    n_outputs, n, width, terms = len(X), len(lines), len(_X), DEGREE + 1
    around = (lines[:, None] + np.arange(-SIDE, SIDE + 1)) % F.shape[1]  # lines below 0 Hz are those from the other end
    forces, responses = np.moveaxis(F[:, around], 0, 1), np.moveaxis(X[:, around], 0, 1)
    rough_forces = (forces @ _OFF_SMOOTH).reshape(n, len(F) * terms, width)
    rough_responses = (responses @ _OFF_SMOOTH).reshape(n, n_outputs * terms, width)
    numerators = _fit_rows(rough_forces, rough_responses)
    misfits = (rough_responses - numerators @ rough_forces).reshape(n, n_outputs, terms, width)
    power = np.maximum(np.sum(np.abs(misfits[:, :, 0]) ** 2, axis=2), np.finfo(float).tiny)
    rows = np.moveaxis(misfits / np.sqrt(power)[:, :, None, None], 1, 2).reshape(n, terms, n_outputs * width)
    denominator = np.concatenate([np.ones((n, 1)), -_fit_rows(rows[:, 1:], rows[:, :1])[:, 0]], axis=1)
    smooth = responses @ _MIDDLE - (numerators @ (forces @ _MIDDLE).reshape(n, -1, 1)).reshape(n, n_outputs, terms)
    return np.asarray((smooth @ denominator[:, :, None])[:, :, 0].T), _line_weights(forces, rough_forces)


def _line_weights(forces: ComplexArray, rough_forces: ComplexArray) -> FloatArray:
    """(n,) roots of the weights of lines: the information on G beside M over that without M, over `ROUGH`.

    Of several forces the one counts of which least is known.
    """
    n, n_inputs = forces.shape[:2]
    all_forces = (forces[:, :, None] * _POWERS.T).reshape(n, -1, len(_X))
    ratios = []
    for first in range(0, n_inputs * (DEGREE + 1), DEGREE + 1):
        with_transient, without_transient = _information(rough_forces, first), _information(all_forces, first)
        ratios.append(with_transient / (ROUGH * np.maximum(without_transient, np.finfo(float).tiny)))
    return np.asarray(np.sqrt(np.clip(np.min(ratios, axis=0), np.finfo(float).eps, 1.0)))


def _information(rows: ComplexArray, place: int) -> FloatArray:
    """(n,) squared norm of the part of one row, (n, p, width), that is orthogonal to the others."""
    first_row, further_rows = rows[:, place : place + 1], np.delete(rows, place, axis=1)
    return np.asarray(np.sum(np.abs(first_row - _fit_rows(further_rows, first_row) @ further_rows) ** 2, axis=(1, 2)))


def _fit_rows(rows: ComplexArray, targets: ComplexArray) -> ComplexArray:
    """Least-squares coefficients, (n, q, p), of rows, (n, p, width), for each target row, (n, q, width)."""
    adjoint = rows.conj().swapaxes(1, 2)
    normal = rows @ adjoint
    ridge = RIDGE * np.trace(normal, axis1=1, axis2=2).real + np.finfo(float).tiny
    normal = normal + ridge[:, None, None] * np.eye(rows.shape[1])
    return np.asarray(np.linalg.solve(normal.swapaxes(1, 2), (targets @ adjoint).swapaxes(1, 2)).swapaxes(1, 2))
