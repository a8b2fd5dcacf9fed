"""Poles and shapes of a lightly damped model in the modes of the undamped one.

In those modes ``(p^2 I + p C + diag(w^2)) x = 0``, where C is nearly diagonal. Row by row that is a fixed point, which
is reached by a few products of matrices: Jacobi's method, with the own component of each mode held at 1. Its result is
that of the eigenvalue problem of twice the order to rounding. Modes so close that damping mixes them, or that are
damped heavily, it does not find: theirs is the eigenvalue problem of what is orthogonal to all others. Where that
fails, and of so few modes that it costs no more, the whole problem is solved.
"""

from __future__ import annotations

import numpy as np

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray, IntArray

STEPS = 80  # of the iteration: of the few modes that take so many, the work is below that of the eigenvalue problem
FEW = 16  # modes, up to which the eigenvalue problem costs less
ROUNDING = 64 * np.finfo(float).eps  # relative step from which a mode counts as found
UNDAMPED = 1e-9  # of the largest rate: below it damping leaves a mode alone, as it does rigid-body modes
SOFT = 1e-3  # of the lowest frequency of interest, to rigid-body modes: their double poles at 0 have no residues
COUPLED = 1e-9  # relative coupling of two modes that were found: they are not orthogonal, so one was found twice


def damped_modes(squares: FloatArray, rates: FloatArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Poles and their vectors without the conjugates.

    Parameters
    ----------
    squares : (n,) array
        Squared natural frequencies without damping, (rad/s)^2.
    rates : (n, n) array
        Damping in mass-normalised modes, rad/s.

    Returns
    -------
    poles : (k,) array
        Those with an imaginary part above 0, then the real ones, rad/s.
    vectors : (n, k) array
        In the undamped modes.
    left_vectors : (n, k) array
        So scaled that the sum of ``vectors left_vectors^T / (s - poles)``, with the conjugates of those poles that are
        not real, is the receptance.
    """
    sizes = np.abs(rates).max(axis=1, initial=0.0)
    alone = np.flatnonzero((sizes <= UNDAMPED * sizes.max(initial=0.0)) & (squares > 0.0))
    if not len(alone):
        return _of_damped(squares, rates)
    own = 1j * np.sqrt(squares[alone])
    unit = np.eye(len(squares), dtype=complex)
    others = np.delete(np.arange(len(squares)), alone)
    poles, vectors, left_vectors = _of_damped(squares[others], rates[np.ix_(others, others)])
    return (
        np.concatenate([own, poles]),
        np.concatenate([unit[:, alone], unit[:, others] @ vectors], axis=1),
        np.concatenate([unit[:, alone] / (2 * own), unit[:, others] @ left_vectors], axis=1),
    )


def softly_held(squares: FloatArray, lowest_rad_s: float) -> FloatArray:
    """Give rigid-body modes a frequency far below those of interest, so that their poles have residues.

    Parameters
    ----------
    squares : (..., n) array
        Squared natural frequencies without damping, (rad/s)^2.
    lowest_rad_s : float
        Lowest frequency of interest.

    Returns
    -------
    (..., n) array
        The same, but for those of rigid-body modes.
    """
    return np.maximum(squares, (SOFT * lowest_rad_s) ** 2)


def receptance_roots(
    squares: FloatArray, shapes: FloatArray, damping: FloatArray
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Poles of a model, and the vectors whose products are the residues of its receptance.

    Parameters
    ----------
    squares : (n,) array
        Squared natural frequencies without damping, above 0, (rad/s)^2.
    shapes : (r, n) array
        Mass-normalised shapes.
    damping : (r, r) array
        Symmetric, N s/m.

    Returns
    -------
    poles : (k,) array
        Without conjugates, rad/s.
    right, left : (r, k) array
        Those of real poles are halved, so that each sum with its conjugate is whole.
    """
    rates = shapes.T @ damping @ shapes
    poles, right, left = damped_modes(squares, (rates + rates.T) / 2)
    return poles, shapes @ right, shapes @ left * np.where(poles.imag > 0, 1.0, 0.5)


def _of_damped(squares: FloatArray, rates: FloatArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    found = _from_undamped(squares, rates) if len(squares) > FEW else None
    if found is None:
        return _by_eigenvalues(squares, rates)
    places, poles, vectors = found
    slope = 2 * poles * np.sum(vectors**2, axis=0) + np.sum(vectors * (rates @ vectors), axis=0)
    if len(places) == len(squares):
        return poles, vectors, vectors / slope
    rest = _beside_found(squares, rates, (poles, vectors, slope), np.delete(np.arange(len(squares)), places))
    if rest is None:
        return _by_eigenvalues(squares, rates)
    return (
        np.concatenate([poles, rest[0]]),
        np.concatenate([vectors, rest[1]], axis=1),
        np.concatenate([vectors / slope, rest[2]], axis=1),
    )


def _from_undamped(squares: FloatArray, rates: FloatArray) -> tuple[IntArray, ComplexArray, ComplexArray] | None:
    """Iterate: the modes that come to an end, each once, with their poles and vectors; None where there is none."""
    own_rates = np.diag(rates)
    columns = np.flatnonzero(squares > own_rates**2 / 4)
    if not len(columns) or not np.array_equal(rates, rates.T):
        return None
    coupling = rates - np.diag(own_rates)
    order = len(squares)
    poles, vectors = np.zeros(order, complex), np.eye(order, dtype=complex)
    is_found = np.zeros(order, bool)
    moving = np.ascontiguousarray(vectors[:, columns])
    for _ in range(STEPS):
        forces = (coupling @ moving.view(float)).view(complex)
        own = columns, np.arange(len(columns))
        half = (own_rates[columns] + forces[own]) / 2
        root = np.sqrt(half**2 - squares[columns])
        latest = np.where(root.imag < 0, -root, root) - half
        stiffnesses = latest * (latest + own_rates[:, None]) + squares[:, None]
        stiffnesses[own] = 1.0
        forces *= -latest
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # of two modes that are one there is no end
            forces /= stiffnesses
            forces[own] = 1.0
            steps = np.abs((forces - moving).view(float)).max(axis=0).reshape(-1, 2).max(axis=1)
        vectors[:, columns], poles[columns] = forces, latest
        is_open = ~(steps <= ROUNDING)
        is_found[columns] = ~is_open
        if not is_open.any():
            break
        columns, moving = columns[is_open], np.ascontiguousarray(forces[:, is_open])
    places = np.flatnonzero(is_found & (poles.imag > 0))
    places = places[_are_different(poles[places], np.ascontiguousarray(vectors[:, places]), rates)]
    return (places, poles[places], np.ascontiguousarray(vectors[:, places])) if len(places) else None


def _are_different(poles: ComplexArray, vectors: ComplexArray, rates: FloatArray) -> BoolArray:
    """Tell which modes were found once: the others are not orthogonal to all."""
    inertial = vectors.T @ vectors
    damped = vectors.T @ (rates @ vectors.view(float)).view(complex)
    products = np.abs((poles[:, None] + poles) * inertial + damped)
    slopes = np.diag(products)
    off = products - np.diag(slopes)
    return np.asarray((off <= COUPLED * np.sqrt(slopes[:, None] * slopes)).all(axis=1))


def _beside_found(
    squares: FloatArray,
    rates: FloatArray,
    found: tuple[ComplexArray, ComplexArray, ComplexArray],
    others: IntArray,
) -> tuple[ComplexArray, ComplexArray, ComplexArray] | None:
    """Poles and vectors of the modes that are not found, from what is orthogonal to all that are; None if that is not.

    With ``v = (x, p x)`` the problem is ``A v = p v``, and ``S = ((C, I), (I, 0))`` makes A symmetric: v of different
    poles are orthogonal under S. What is orthogonal to the v that are known has the order of the others.
    """
    top = float(squares.max())
    scale, count = np.sqrt(top), len(others)
    poles, vectors, slope = found[0] / scale, found[1], found[2] / scale
    damping, stiffness = rates / scale, squares / top
    known = np.concatenate([vectors, poles * vectors])
    by_place = np.concatenate([(poles * vectors + damping @ vectors)[others], vectors[others]])
    free = -2 * (known @ (by_place / slope).T).real
    free[others, np.arange(count)] += 1.0
    free[len(squares) + others, count + np.arange(count)] += 1.0
    motion, velocity = free[: len(squares)], free[len(squares) :]
    mixed = motion.T @ velocity
    metric = motion.T @ damping @ motion + mixed + mixed.T
    try:
        values, turned = np.linalg.eig(
            np.linalg.solve(metric, velocity.T @ velocity - motion.T @ (stiffness[:, None] * motion))
        )
        left = np.linalg.inv(metric @ turned)
    except np.linalg.LinAlgError:
        return None
    chosen = np.concatenate([np.flatnonzero(values.imag > 0), np.flatnonzero(values.imag == 0)])
    own = values[chosen].astype(complex)
    right = (motion @ turned[:, chosen]).astype(complex)
    elastic, inertial, damped = stiffness[:, None] * right, own**2 * right, own * (damping @ right)
    size = sum(np.linalg.norm(part, axis=0) for part in (elastic, inertial, damped))
    if not (np.linalg.norm(elastic + inertial + damped, axis=0) <= COUPLED * size).all():
        return None
    return own * scale, right, (motion @ left[chosen].T).astype(complex) / scale


def _by_eigenvalues(squares: FloatArray, rates: FloatArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    count = len(squares)
    top = max(float(np.abs(squares).max(initial=0.0)), np.finfo(float).tiny)
    scale = np.sqrt(top)
    state = np.zeros((2 * count, 2 * count))
    state[:count, count:] = np.eye(count)
    state[count:, :count] = np.diag(-squares / top)
    state[count:, count:] = -rates / scale
    values, vectors = np.linalg.eig(state)
    chosen = np.concatenate([np.flatnonzero(values.imag > 0), np.flatnonzero(values.imag == 0)])
    left_vectors = np.linalg.inv(vectors)[chosen, count:].T / scale  # not those of the other side where roots repeat
    poles = values[chosen].astype(complex) * scale
    return poles, vectors[:count, chosen].astype(complex), left_vectors.astype(complex)
