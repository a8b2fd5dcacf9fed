"""Spectra of a stretch of a running test without the motion that comes in at its beginning and goes out at its end.

On the lines of the whole stretch, without a window, ``X = G F + T`` exactly. G and T have the poles of the structure,
so near a line both are ratios with one denominator, ``X D = N F + M``, which is linear in the coefficients of D, N and
M; a random force is rough from line to line, M is smooth, and so the two are told apart, however narrow the resonance
is: it may be narrower than the lines lie apart. ``T = M / D`` is taken off; all that is known of G stays in the
spectra.

A sweep is smooth from line to line at what it does near its beginning and its end: N F looks like M there, and telling
them apart multiplies the noise. Such lines count for less.

[McKelvey2012]: T. McKelvey, G. Guerin, Non-parametric frequency response estimation using a local rational model, IFAC
Proceedings Volumes 45(16) (2012) 49-54 (doi:10.3182/20120711-3-BE-2027.00299), the method.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray

if TYPE_CHECKING:
    from collections.abc import Iterator

SIDE = 8  # lines to each side that a fit sees
DEGREE = 2  # of the three polynomials
BLOCK = 1024  # lines at a time
RIDGE = 1e-12  # of the trace: where there is no force, nothing can be told
ROUGH = 0.3  # of what F tells of G without M, what it tells with M: random forces have more on every line

_X = np.arange(-SIDE, SIDE + 1) / SIDE
_POWERS = _X[:, None] ** np.arange(DEGREE + 1)
_BASIS, _UPPER = np.linalg.qr(_POWERS)
_ROUGH = (_POWERS[:, :, None] * (np.eye(len(_X)) - _BASIS @ _BASIS.T)[:, None]).reshape(len(_X), -1)
_MIDDLE = _POWERS * np.linalg.solve(_UPPER, _BASIS.T)[0][:, None]


def transform_without_transients(
    force: FloatArray, responses: FloatArray, lines: IntArray | None = None, *, between: float = 0.0
) -> tuple[ComplexArray, ComplexArray]:
    """Transform a stretch of a running test, and take off what does not come from its force.

    Parameters
    ----------
    force : (n_samples,) array
        Random, N.
    responses : (n_outputs, n_samples) array
        SI.
    lines : (n_lines,) int array, optional
        Which lines of the stretch; all from 0 Hz to half of the sampling rate where it is left out.
    between : float
        How far above the lines to look, 0 to 1 of their distance: there T is another one, as smooth.

    Returns
    -------
    force : (n_lines,) complex array
        Its transform, ``sum f(t) exp(-s t)``; times less than 1 where its line counts for less.
    responses : (n_outputs, n_lines) complex array
        Those of the responses less what goes on at both ends: the FRF times that of the force.
    """
    n = len(force)
    turn = np.exp(-2j * np.pi * between * np.arange(n) / n)
    F, X = np.fft.fft(force * turn), np.fft.fft(responses * turn)
    wanted = np.arange(n // 2 + 1) if lines is None else lines
    if n < 2 * len(_X):
        return F[wanted], X[:, wanted]
    blocks = [wanted[at : at + BLOCK] for at in range(0, len(wanted), BLOCK)]
    parts = [_transients(F, X, block) for block in blocks]
    transients, counts = (np.concatenate(part, axis=-1) for part in zip(*parts, strict=True))
    return F[wanted] * counts, (X[:, wanted] - transients) * counts


def transform_subrecords(
    force: FloatArray, responses: FloatArray, length: int, lines: IntArray | None = None, *, between: float = 0.0
) -> Iterator[tuple[ComplexArray, ComplexArray]]:
    """Cut a record into pieces, one behind the other, and transform each without its transients.

    Parameters
    ----------
    force : (n_samples,) array
        N.
    responses : (n_outputs, n_samples) array
        SI.
    length : int
        Samples of a piece; what is left at the end is not used.
    lines, between
        As for `transform_without_transients`.

    Yields
    ------
    force, responses : complex arrays
        As `transform_without_transients` gives them.
    """
    for start in range(0, len(force) - length + 1, length):
        piece = slice(start, start + length)
        yield transform_without_transients(force[piece], responses[:, piece], lines, between=between)


def _transients(F: ComplexArray, X: ComplexArray, lines: IntArray) -> tuple[ComplexArray, FloatArray]:
    """T at some lines, (n_outputs, n), and how much they count; M is taken off first, then N and D are fitted."""
    n_outputs, n, width, terms = len(X), len(lines), len(_X), DEGREE + 1
    seen = (lines[:, None] + np.arange(-SIDE, SIDE + 1)) % len(F)  # lines below 0 Hz are those from the other end
    near_force, near = F[seen], np.moveaxis(X[:, seen], 0, 1)
    forced = (near_force @ _ROUGH).reshape(n, terms, width)
    moved = (near @ _ROUGH).reshape(n, n_outputs * terms, width)
    numerators = _nearest(forced, moved)
    left = (moved - numerators @ forced).reshape(n, n_outputs, terms, width)
    size = np.maximum(np.sum(np.abs(left[:, :, 0]) ** 2, axis=2), np.finfo(float).tiny)
    rows = np.moveaxis(left / np.sqrt(size)[:, :, None, None], 1, 2).reshape(n, terms, n_outputs * width)
    denominator = np.concatenate([np.ones((n, 1)), -_nearest(rows[:, 1:], rows[:, :1])[:, 0]], axis=1)
    smooth = near @ _MIDDLE - (numerators @ (near_force @ _MIDDLE)[:, :, None]).reshape(n, n_outputs, terms)
    return np.asarray((smooth @ denominator[:, :, None])[:, :, 0].T), _counts(near_force, forced)


def _counts(near_force: ComplexArray, forced: ComplexArray) -> FloatArray:
    """(n,) root of how much lines count: of what F tells of G in its middle, what is left beside M, over `ROUGH`."""
    told, alone = _information(forced), _information(near_force[:, None] * _POWERS.T)
    return np.sqrt(np.clip(told / (ROUGH * np.maximum(alone, np.finfo(float).tiny)), np.finfo(float).eps, 1.0))


def _information(rows: ComplexArray) -> FloatArray:
    """(n,) square of the part of the first row, (n, p, width), that the others do not reach."""
    first, others = rows[:, :1], rows[:, 1:]
    return np.asarray(np.sum(np.abs(first - _nearest(others, first) @ others) ** 2, axis=(1, 2)))


def _nearest(rows: ComplexArray, wanted: ComplexArray) -> ComplexArray:
    """Coefficients, (n, q, p), of rows, (n, p, width), whose sum is nearest to each wanted row, (n, q, width)."""
    across = rows.conj().swapaxes(1, 2)
    normal = rows @ across
    least = RIDGE * np.trace(normal, axis1=1, axis2=2).real + np.finfo(float).tiny
    normal = normal + least[:, None, None] * np.eye(rows.shape[1])
    return np.asarray(np.linalg.solve(normal.swapaxes(1, 2), (wanted @ across).swapaxes(1, 2)).swapaxes(1, 2))
