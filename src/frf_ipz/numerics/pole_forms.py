"""Zeros of many FRFs of one model from its poles: ``H(z) = sum of R_k / (z - p_k) + R / z^2``.

One eigenvalue problem serves all FRFs. A zero that is known nearly follows from a few steps of Newton's method on that
sum, and its vectors from the same fractions, where an eigenvalue problem of each FRF would cost the third power of the
order. ``z`` is the s of a damped model, or the squared frequency of an undamped one.

[Aberth1973] O. Aberth, Iteration methods for finding all zeros of a polynomial simultaneously, Mathematics of
Computation 27, 1973, 339-344, doi:10.1090/S0025-5718-1973-0329236-7.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias, cast

import numpy as np

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from frf_ipz.numerics.damped_modes import damped_modes
from frf_ipz.numerics.pencils import Roots, damped_zeros, undamped_poles, undamped_zeros

if TYPE_CHECKING:
    from collections.abc import Iterator

Numbers: TypeAlias = ComplexArray | FloatArray
FAR = 4.0  # times a limit of squared zeros: poles beyond are so smooth below it that a few can stand for all
STAND_INS = 8  # they leave (1 / FAR)^8 of what the far poles add; zeros begin there, and end at those of all poles
REPULSIONS = 100  # steps of zeros that repel one another, which need more where several meet
GOLDEN = (np.sqrt(5) - 1) / 2  # turns that never repeat
STEPS = 30  # of Newton's method; from near, four are enough
CONVERGED = 1e-12  # relative step from which a zero counts as found
SMALL_RESIDUE = 1e-8  # relative residual of a motion that the poles express well
ROWS_AT_ONCE = 2048
RIGID = 1e-9  # of the largest squared frequency: below it a mode is a rigid-body mode
REAL = 1e-6  # imaginary part over modulus below which a root is real: rounding of a double root
CLOSE = 0.05  # of the modulus: a zero that damping moves farther than the first order says is followed in another way
MERGED = 1e-7  # of the modulus, between two zeros: they are one, or hardly two
SMALLEST_INVERSE = 1e-9  # of the largest: what is smaller is a zero at infinity
SYMMETRIC = 1e-12  # of the largest entry: rounding
UNDAMPED = 1e-9  # of the largest rate: below it damping leaves a mode alone


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PoleForm:
    """A model as a sum over its poles.

    Parameters
    ----------
    poles : (m,) array
        Simple poles; real, as shapes and slopes are, where there is no damping.
    shapes : (r, m) array
        Right vectors, which are the left ones too: the matrices are symmetric.
    slope : (m,) array
        ``x^T P'(p) x``.
    rigid : (r, k) array
        Mass-normalised rigid-body modes that are double poles at 0.
    mass, damping, stiffness : (r, r) array
        The model; no damping where ``z`` is a squared frequency.
    """

    poles: Numbers
    shapes: Numbers
    slope: Numbers
    rigid: FloatArray
    mass: FloatArray
    damping: FloatArray | None
    stiffness: FloatArray

    def all_poles(self) -> Roots:
        """Give the poles with their vectors.

        Returns
        -------
        Roots
            Without those of rigid-body modes.
        """
        shapes = np.asarray(self.shapes, complex)
        return Roots(
            values=np.asarray(self.poles, complex),
            right_vectors=shapes,
            left_vectors=shapes,
            slope=np.asarray(self.slope, complex),
        )

    def zeros(self, outputs: FloatArray, inputs: FloatArray, start: ComplexArray) -> tuple[ComplexArray, BoolArray]:
        """Find a zero of each FRF from near.

        Parameters
        ----------
        outputs, inputs : (n, r) array
            Rows of sensor and excitation.
        start : (n,) complex array
            Where to begin.

        Returns
        -------
        values : (n,) complex array
            Zeros.
        found : (n,) bool array
            False where Newton's method did not end.
        """
        values, found = start.astype(complex), np.zeros(len(start), bool)
        for first in range(0, len(start), ROWS_AT_ONCE):
            part = slice(first, first + ROWS_AT_ONCE)
            residues, double = self._residues(outputs[part], inputs[part])
            values[part], found[part] = _newton(residues, double, self.poles, start[part])
        is_real = np.abs(values.imag) <= CONVERGED * np.abs(values)
        return np.asarray(np.where(is_real, values.real, values)), found

    def roots(self, outputs: FloatArray, inputs: FloatArray, zeros: ComplexArray) -> tuple[Roots, BoolArray]:
        """Give the vectors of zeros.

        Parameters
        ----------
        outputs, inputs : (n, r) array
            Rows of sensor and excitation.
        zeros : (n,) complex array
            Zeros.

        Returns
        -------
        roots : Roots
            With vectors and slopes.
        exact : (n,) bool array
            False where the poles do not express the motion: they are nearly defective.
        """
        order = len(self.mass)
        right, left = np.zeros((order, len(zeros)), complex), np.zeros((order, len(zeros)), complex)
        slope, exact = np.zeros(len(zeros), complex), np.zeros(len(zeros), bool)
        for part in self._alike(zeros):
            sensors, forces = outputs[part], inputs[part]
            z: Numbers = zeros[part]
            if not np.iscomplexobj(self.poles) and not z.imag.any():
                z = z.real
            by_force, by_sensor = _times(forces, self.shapes), _times(sensors, self.shapes)
            residues, double = self._residues(sensors, forces)
            at = _beside_pole(residues, double, self.poles, z)
            pole = (np.arange(len(z)), at.nearest)
            driven = np.abs(by_force[pole]) >= np.abs(by_sensor[pole])
            with np.errstate(divide="ignore", invalid="ignore"):  # a pole that neither end sees is not exact
                gap = np.where(np.abs(at.gap * at.slope) < np.abs(at.rest), -at.own / at.rest, at.gap)
                x_scale, y_scale = np.where(driven, gap, 1.0), np.where(driven, 1.0, gap)
                x_own = np.where(driven, by_force[pole] / self.slope[at.nearest], -at.rest / by_sensor[pole])
                y_own = np.where(driven, -at.rest / by_force[pole], by_sensor[pole] / self.slope[at.nearest])
                x = self._motion(forces, by_force, at, x_scale, x_own, z)
                y = self._motion(sensors, by_sensor, at, y_scale, y_own, z)
                exact[part] = self._is_exact(x, forces * x_scale[:, None], z)
                exact[part] &= self._is_exact(y, sensors * y_scale[:, None], z)
            exact[part] &= at.second > np.finfo(float).eps / SMALL_RESIDUE * np.abs(z)
            right[:, part], left[:, part], slope[part] = x, y, -at.rest - gap * at.slope
        return Roots(values=zeros, right_vectors=right, left_vectors=left, slope=slope), exact

    def _alike(self, zeros: ComplexArray) -> Iterator[IntArray]:
        """Give some at a time: those of an undamped model that are real, which take real numbers, then the others."""
        is_real = (zeros.imag == 0.0) & (not np.iscomplexobj(self.poles))
        for places in (np.flatnonzero(is_real), np.flatnonzero(~is_real)):
            for first in range(0, len(places), ROWS_AT_ONCE):
                yield places[first : first + ROWS_AT_ONCE]

    def _residues(self, outputs: FloatArray, inputs: FloatArray) -> tuple[Numbers, FloatArray]:
        residues = _times(outputs, self.shapes) * _times(inputs, self.shapes) / self.slope
        return residues, np.sum((outputs @ self.rigid) * (inputs @ self.rigid), axis=1)

    def _motion(
        self, loads: FloatArray, by_load: Numbers, at: _BesidePole, scale: Numbers, own: Numbers, z: Numbers
    ) -> Numbers:
        """Motion under scaled loads, (r, n), with that of the nearest pole given."""
        by_pole = scale[:, None] * by_load / self.slope / at.distance
        np.put_along_axis(by_pole, at.nearest[:, None], own[:, None], axis=1)
        motion = _times(self.shapes, by_pole.T)
        if not self.rigid.size:
            return motion
        return motion + self.rigid @ (scale[:, None] * (loads @ self.rigid) / z[:, None] ** 2).T

    def _is_exact(self, motion: Numbers, loads: FloatArray, z: Numbers) -> BoolArray:
        elastic, inertial = _times(self.stiffness, motion), _times(self.mass, motion)
        if self.damping is None:
            force = z * inertial - elastic
        else:
            force = z * (z * inertial + _times(self.damping, motion)) + elastic
        size = np.linalg.norm(elastic, axis=0) + np.linalg.norm(loads, axis=1)
        return np.asarray(np.linalg.norm(force - loads.T, axis=0) < SMALL_RESIDUE * size)


def _times(left: Numbers, right: Numbers) -> Numbers:
    """Multiply; of a real and a complex matrix without making the real one complex."""
    if np.iscomplexobj(left) or not np.iscomplexobj(right):
        return left @ right
    return cast("Numbers", (left @ np.ascontiguousarray(right).view(np.float64)).view(np.complex128))


def undamped_form(mass: FloatArray, stiffness: FloatArray) -> PoleForm:
    """Express an undamped model by its poles.

    Parameters
    ----------
    mass, stiffness : (r, r) array
        Symmetric; the mass positive definite.

    Returns
    -------
    PoleForm
        Of squared frequencies.
    """
    poles = undamped_poles(mass, stiffness)
    return _undamped_form(mass, stiffness, poles.values.real, poles.right_vectors.real)


def _undamped_form(mass: FloatArray, stiffness: FloatArray, squares: FloatArray, shapes: FloatArray) -> PoleForm:
    return PoleForm(
        poles=squares,
        shapes=shapes,
        slope=np.ones(len(squares)),
        rigid=np.zeros((len(mass), 0)),
        mass=mass,
        damping=None,
        stiffness=stiffness,
    )


def damped_form(
    mass: FloatArray, damping: FloatArray, stiffness: FloatArray, *, undamped: PoleForm | None = None
) -> PoleForm:
    """Express a damped model by its poles.

    Parameters
    ----------
    mass, damping, stiffness : (r, r) array
        Symmetric; the mass positive definite.
    undamped : PoleForm, optional
        The model without damping, where it is known.

    Returns
    -------
    PoleForm
        Of s in rad/s.
    """
    modes = undamped_form(mass, stiffness) if undamped is None else undamped
    shapes, squares = modes.shapes.real, modes.poles.real
    rates = shapes.T @ damping @ shapes
    rates = (rates + rates.T) / 2
    top = max(float(np.abs(squares).max(initial=0.0)), np.finfo(float).tiny)
    free = (np.abs(squares) <= RIGID * top) & (np.abs(rates).max(axis=1) <= UNDAMPED * np.abs(rates).max())
    elastic, rates = np.flatnonzero(~free), rates[np.ix_(~free, ~free)]
    upper, vectors, _ = damped_modes(squares[elastic], rates)
    slope = 2 * upper * np.sum(vectors**2, axis=0) + np.sum(vectors * (rates @ vectors), axis=0)
    return _closed_form((mass, damping, stiffness), upper, shapes[:, elastic] @ vectors, slope, shapes[:, free])


def _closed_form(
    matrices: tuple[FloatArray, FloatArray, FloatArray],
    upper: ComplexArray,
    vectors: ComplexArray,
    slope: ComplexArray,
    rigid: FloatArray,
) -> PoleForm:
    """Join poles of the upper half plane, and real ones, with the conjugates of the former."""
    oscillates = upper.imag > 0

    def closed(numbers: ComplexArray) -> ComplexArray:
        return np.concatenate([numbers, numbers[..., oscillates].conj()], axis=-1)

    mass, damping, stiffness = matrices
    return PoleForm(
        poles=closed(upper),
        shapes=closed(vectors),
        slope=closed(slope),
        rigid=rigid,
        mass=mass,
        damping=damping,
        stiffness=stiffness,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _BesidePole:
    """The sum over the poles as that of the nearest one and the rest, where ``H = own / gap + rest``.

    ``gap`` is the difference of two numbers that may be nearly one: of a zero next to a pole, one end sits nearly on a
    node of the mode, ``-own / rest`` is the same and keeps its digits.
    """

    nearest: IntArray
    own: Numbers
    gap: Numbers
    rest: Numbers
    slope: Numbers
    distance: Numbers
    second: FloatArray


def _beside_pole(residues: Numbers, double: FloatArray, poles: Numbers, z: Numbers) -> _BesidePole:
    """Split; distance to all poles with 1 for the nearest, slope of the rest, and the second smallest distance."""
    distance = z[:, None] - poles
    moduli = np.abs(distance)
    nearest = np.argmin(moduli, axis=1)
    places = nearest[:, None]
    rows = np.arange(len(z))
    gap, own = distance[rows, nearest], residues[rows, nearest]
    np.put_along_axis(distance, places, 1.0, axis=1)
    np.put_along_axis(moduli, places, np.inf, axis=1)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # where it leads nowhere, nothing is found
        terms = residues / distance
        np.put_along_axis(terms, places, 0.0, axis=1)
        return _BesidePole(
            nearest=nearest,
            own=own,
            gap=gap,
            rest=terms.sum(axis=1) + double / z**2,
            slope=-np.sum(terms / distance, axis=1) - 2 * double / z**3,
            distance=distance,
            second=moduli.min(axis=1, initial=np.inf),
        )


def _newton(
    residues: Numbers, double: FloatArray, poles: Numbers, start: ComplexArray
) -> tuple[ComplexArray, BoolArray]:
    """Newton's method on the sum times the distance to the nearest pole, which may lie next to the zero."""
    is_real = not np.iscomplexobj(residues) and bool(np.all(start.imag == 0))
    values = start.real.copy() if is_real else start.astype(complex)
    found = np.zeros(len(values), bool)
    for _ in range(STEPS):
        open_ones = np.flatnonzero(~found)
        if not len(open_ones):
            break
        z = values[open_ones]
        at = _beside_pole(residues[open_ones], double[open_ones], poles, z)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # where it leads nowhere, nothing is found
            step = (at.own + at.gap * at.rest) / (at.rest + at.gap * at.slope)
        is_finite = np.isfinite(step)
        values[open_ones] = z - np.where(is_finite, step, 0.0)
        found[open_ones] = is_finite & (np.abs(step) <= CONVERGED * np.abs(z))
        if not is_finite.any():
            break
    return np.asarray(values), found


def are_symmetric(*matrices: FloatArray) -> bool:
    """Tell whether matrices are symmetric to rounding, as a form over poles needs them.

    Parameters
    ----------
    *matrices : (r, r) array
        The model.

    Returns
    -------
    bool
        True where all are.
    """
    return all(np.abs(matrix - matrix.T).max() <= SYMMETRIC * np.abs(matrix).max() for matrix in matrices)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DampedModel:
    """A symmetric model by its poles, with and without damping.

    Parameters
    ----------
    undamped, damped : PoleForm
        The two.
    """

    undamped: PoleForm
    damped: PoleForm

    @classmethod
    def of(cls, mass: FloatArray, damping: FloatArray, stiffness: FloatArray) -> DampedModel | None:
        """Express a model by its poles.

        Parameters
        ----------
        mass, damping, stiffness : (r, r) array
            The mass positive definite.

        Returns
        -------
        DampedModel or None
            None where the matrices are not symmetric.
        """
        if not are_symmetric(mass, damping, stiffness):
            return None
        undamped = undamped_form(mass, stiffness)
        return cls(undamped=undamped, damped=damped_form(mass, damping, stiffness, undamped=undamped))

    @classmethod
    def of_roots(
        cls,
        matrices: tuple[FloatArray, FloatArray, FloatArray],
        modes: tuple[FloatArray, FloatArray],
        roots: tuple[ComplexArray, ComplexArray],
    ) -> DampedModel | None:
        """Express a model by poles that are known.

        Parameters
        ----------
        matrices : tuple of (r, r) array
            Mass, positive definite, damping, and stiffness.
        modes : pair of (r,) and (r, r) array
            Squared natural frequencies without damping, (rad/s)^2, and mass-normalised shapes.
        roots : pair of (k,) and (r, k) array
            Poles without conjugates, rad/s, and their vectors.

        Returns
        -------
        DampedModel or None
            None where the matrices are not symmetric. One with rigid-body modes is expressed by the matrices alone.
        """
        mass, damping, stiffness = matrices
        (squares, shapes), (poles, vectors) = modes, roots
        if not are_symmetric(*matrices) or squares.min(initial=np.inf) <= RIGID * squares.max(initial=0.0):
            return cls.of(*matrices)
        slope = np.sum(vectors * (2 * poles * _times(mass, vectors) + _times(damping, vectors)), axis=0)
        return cls(
            undamped=_undamped_form(mass, stiffness, squares, shapes),
            damped=_closed_form(matrices, poles, vectors, slope, np.zeros((len(mass), 0))),
        )

    def every_zero(self, outputs: FloatArray, inputs: FloatArray) -> list[Roots]:
        """All zeros of several FRFs, those with an imaginary part of at least 0.

        Zeros without damping are eigenvalues of a diagonal matrix with one of rank 1; damping moves each a little, or,
        of zeros far from the imaginary axis, so far that several meet, which then repel one another on their way. Where
        not all are found, the quadratic eigenvalue problem of that FRF is solved.

        Parameters
        ----------
        outputs, inputs : (n_frfs, r) array
            Rows of sensors and excitations.

        Returns
        -------
        list of Roots
            Of each FRF, rad/s.
        """
        return [
            _damped_from_undamped(self.undamped, self.damped, output, force)
            or _by_pencil(self.undamped.mass, self._damping, self.undamped.stiffness, output, force)
            for output, force in zip(outputs, inputs, strict=True)
        ]

    def zeros_up_to(self, outputs: FloatArray, inputs: FloatArray, limit_rad_s: float) -> list[ComplexArray]:
        """Zeros of many FRFs up to a frequency, without their vectors.

        They begin at those without damping of a smaller model, in which a few poles stand for all that are far above
        the limit, and end at those of the model itself. An FRF with a zero that does not is left to `every_zero`.

        Parameters
        ----------
        outputs, inputs : (n_frfs, r) array
            Rows of sensors and excitations.
        limit_rad_s : float
            Modulus up to which zeros are asked for, rad/s.

        Returns
        -------
        list of complex arrays
            Of each FRF those with an imaginary part of at least 0, rad/s.
        """
        residues = (outputs @ self.undamped.shapes.real) * (inputs @ self.undamped.shapes.real)
        rates = np.sum(self.undamped.shapes.real * (self._damping @ self.undamped.shapes.real), axis=0)
        squares, frf, is_sure = _squares_up_to(self.undamped.poles.real, residues, (limit_rad_s * (1 + 2 * CLOSE)) ** 2)
        with np.errstate(divide="ignore", invalid="ignore"):  # of a zero on a pole, or a double one
            weights = residues[frf] / (self.undamped.poles.real - squares[:, None]) ** 2
            shift = (weights @ rates) / weights.sum(axis=1) / 2
        start, place = _upper_starts(squares, shift)
        frf = frf[place]
        values, is_found = self.damped.zeros(outputs[frf], inputs[frf], start)
        with np.errstate(invalid="ignore"):
            is_same = is_found & (np.abs(values - start) <= CLOSE * np.abs(start))
        is_same &= values.imag >= -REAL * np.abs(values)
        failed = set(frf[~is_same].tolist()) | set(np.flatnonzero(~is_sure).tolist())
        result = []
        for number in range(len(outputs)):
            of_frf = values[frf == number]
            if number in failed or _merge(of_frf):
                of_frf = self.every_zero(outputs[number, None], inputs[number, None])[0].values
            result.append(of_frf[np.abs(of_frf) <= limit_rad_s])
        return result

    def slopes(self, output: FloatArray, force: FloatArray, zeros: ComplexArray) -> ComplexArray:
        """Slope of a receptance over s at its zeros.

        Parameters
        ----------
        output, force : (r,) array
            Rows of sensor and excitation.
        zeros : (n,) complex array
            rad/s.

        Returns
        -------
        (n,) complex array
            0 where a pole lies on the zero.
        """
        residues, double = self.damped._residues(output[None], force[None])
        at = _beside_pole(
            np.asarray(np.repeat(residues, len(zeros), axis=0), complex), double, self.damped.poles, zeros
        )
        # at a zero the distance from the nearest pole is -own / rest, which keeps its digits next to that pole
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = at.slope - at.rest**2 / at.own
        return np.asarray(np.where(at.own == 0.0, 0.0, slope), complex)

    @property
    def _damping(self) -> FloatArray:
        damping = self.damped.damping
        return np.zeros_like(self.damped.mass) if damping is None else damping


def every_damped_zero(
    mass: FloatArray, damping: FloatArray, stiffness: FloatArray, outputs: FloatArray, inputs: FloatArray
) -> list[Roots]:
    """All zeros of several FRFs of a lightly damped model.

    Parameters
    ----------
    mass, damping, stiffness : (r, r) array
        They need not be symmetric, but that costs an eigenvalue problem an FRF.
    outputs, inputs : (n_frfs, r) array
        Rows of sensors and excitations.

    Returns
    -------
    list of Roots
        Of each FRF those with an imaginary part of at least 0, rad/s.
    """
    if not len(outputs):
        return []
    model = DampedModel.of(mass, damping, stiffness)
    if model is not None:
        return model.every_zero(outputs, inputs)
    return [_by_pencil(mass, damping, stiffness, *rows) for rows in zip(outputs, inputs, strict=True)]


def _by_pencil(
    mass: FloatArray, damping: FloatArray, stiffness: FloatArray, output: FloatArray, force: FloatArray
) -> Roots:
    every = damped_zeros(mass, damping, stiffness, output, force)
    return every.take(np.flatnonzero(every.values.imag >= -REAL * np.abs(every.values)))


def every_undamped_zero(form: PoleForm, output: FloatArray, force: FloatArray) -> Roots:
    """All squared zeros of an FRF of an undamped model.

    Parameters
    ----------
    form : PoleForm
        The model by its poles.
    output, force : (r,) array
        Rows of sensor and excitation.

    Returns
    -------
    Roots
        As `undamped_zeros` gives them.
    """
    roots = _from_poles(form, output, force)
    return undamped_zeros(form.mass, form.stiffness, output, force) if roots is None else roots


def _from_poles(undamped: PoleForm, output: FloatArray, force: FloatArray) -> Roots | None:
    """Squared zeros from the poles; None where they do not give each to rounding."""
    squares = _undamped_zeros(undamped, output, force)
    if squares is None:
        return None
    outputs, inputs = np.tile(output, (len(squares), 1)), np.tile(force, (len(squares), 1))
    squares, is_found = undamped.zeros(outputs, inputs, squares)
    if not is_found.all() or _merge(squares):
        return None
    roots, exact = undamped.roots(outputs, inputs, squares)
    return roots if exact.all() and roots.slope.all() else None  # a double zero has no slope


def _damped_from_undamped(undamped: PoleForm, damped: PoleForm, output: FloatArray, force: FloatArray) -> Roots | None:
    roots = _from_poles(undamped, output, force)
    if roots is None or damped.damping is None:
        return None
    squares = roots.values
    shift = np.sum(roots.left_vectors * (damped.damping @ roots.right_vectors), axis=0) / (2 * roots.slope)
    start, _ = _upper_starts(squares.astype(complex), shift)
    outputs, inputs = np.tile(output, (len(start), 1)), np.tile(force, (len(start), 1))
    values, is_found = damped.zeros(outputs, inputs, start)
    is_same = is_found & (np.abs(values - start) <= CLOSE * np.abs(start)) & (_gaps(values) >= MERGED)
    is_same &= values.imag >= -REAL * np.abs(values)
    if not is_same.all():
        complete = _repelled(damped, (output, force), start, np.where(is_same, values, np.nan))
        if complete is None:
            return None
        values = complete
        outputs, inputs = np.tile(output, (len(values), 1)), np.tile(force, (len(values), 1))
    roots, exact = damped.roots(outputs, inputs, values)
    return roots if exact.all() else None


def _upper_starts(squares: ComplexArray, shift: ComplexArray) -> tuple[ComplexArray, IntArray]:
    """Where zeros in s begin, those with an imaginary part of at least 0, and the squared zero that each is of."""
    s = 1j * np.sqrt(squares)
    s = np.where(s.imag < 0, -s, s)
    is_real = np.abs(s.imag) <= REAL * np.abs(s)
    place = np.concatenate([np.arange(len(s)), np.flatnonzero(is_real)])
    return np.concatenate([s, -s[is_real]]) - shift[place], place


def _repelled(
    damped: PoleForm, rows: tuple[FloatArray, FloatArray], start: ComplexArray, known: ComplexArray
) -> ComplexArray | None:
    """All zeros with an imaginary part of at least 0, from some that are known; None where not each is found once."""
    on_axis = np.abs(start.imag) <= REAL * np.abs(start)  # such a start stands for itself alone, the others for a pair
    is_open = np.isnan(known) | (on_axis != (np.abs(known.imag) <= REAL * np.abs(known)))
    fixed, begin = (
        np.concatenate([numbers[chosen], numbers[chosen & ~on_axis].conj()])
        for numbers, chosen in ((known, ~is_open), (start, is_open))
    )
    numerator = _Numerator.of(damped, *rows)
    repelled = numerator.zeros_beside(fixed, begin)
    if repelled is None:
        return None
    outputs, inputs = (np.tile(row, (len(repelled), 1)) for row in rows)
    repelled, is_found = damped.zeros(outputs, inputs, repelled)
    every = np.concatenate([fixed, repelled])
    upper = np.concatenate(
        [every[every.imag > REAL * np.abs(every)], every[np.abs(every.imag) <= REAL * np.abs(every)]]
    )
    is_closed = 2 * len(upper) - np.count_nonzero(np.abs(upper.imag) <= REAL * np.abs(upper)) == len(every)
    return upper if is_found.all() and is_closed and not _merge(every) and numerator.has_all(every) else None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Numerator:
    """Numerator of an FRF, as the FRF times the factors of its poles."""

    residues: ComplexArray
    double: float
    poles: ComplexArray

    @classmethod
    def of(cls, damped: PoleForm, output: FloatArray, force: FloatArray) -> _Numerator:
        residues = (output @ damped.shapes) * (force @ damped.shapes) / damped.slope
        double = float((output @ damped.rigid) @ (force @ damped.rigid))
        return cls(residues=np.asarray(residues, complex), double=double, poles=np.asarray(damped.poles, complex))

    def logarithmic_slope(self, z: ComplexArray) -> ComplexArray:
        fractions = 1 / (z[:, None] - self.poles)
        value, slope = fractions @ self.residues, -(fractions**2 @ self.residues)
        result = fractions.sum(axis=1)
        if self.double:
            value, slope, result = value + self.double / z**2, slope - 2 * self.double / z**3, result + 2 / z
        return np.asarray(result + slope / value)

    def zeros_beside(self, fixed: ComplexArray, start: ComplexArray) -> ComplexArray | None:
        """Newton's method on the numerator without the factors of all other zeros [Aberth1973]."""
        # starts that are symmetric would stay so, and a pair never become two real zeros
        values: ComplexArray = start * (1 + CLOSE * np.exp(2j * np.pi * GOLDEN * np.arange(len(start))))
        for _ in range(REPULSIONS):
            others = values[:, None] - values + np.where(np.eye(len(values), dtype=bool), np.inf, 0.0)
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # a step from a pole is not finite
                repulsion = (1 / (values[:, None] - fixed)).sum(axis=1) + (1 / others).sum(axis=1)
                step = 1 / (self.logarithmic_slope(values) - repulsion)
            if not np.isfinite(step).all():
                return None
            values = np.asarray(values - step)
            if (np.abs(step) <= MERGED * np.abs(values)).all():
                return values
        return None

    def has_all(self, zeros: ComplexArray) -> bool:
        """Tell whether these zeros, and no more, add up to the logarithmic slope at another place."""
        probe = np.array([np.median(np.abs(self.poles)) * np.exp(0.25j * np.pi)])
        parts = 1 / (probe - zeros)
        missing = self.logarithmic_slope(probe)[0] - parts.sum()
        return bool(np.abs(missing) <= SMALL_RESIDUE * np.abs(parts).sum())


def _undamped_zeros(form: PoleForm, output: FloatArray, force: FloatArray) -> ComplexArray | None:
    """Eigenvalues that are one over the distance of each zero from a shift below all poles."""
    residues = (output @ form.shapes) * (force @ form.shapes)
    top = float(np.abs(form.poles).max(initial=0.0))
    if not top or not np.any(residues):
        return None
    shift = -top / np.sqrt(len(residues))
    inverse = 1 / (form.poles - shift)
    size = np.sqrt(np.abs(residues))
    response = float(residues @ inverse)
    if abs(response) < SMALL_RESIDUE * float(np.abs(residues) @ inverse):
        return None
    matrix = np.diag(inverse) - np.outer(inverse * size, np.sign(residues) * size * inverse) / response
    values = np.linalg.eigvals(matrix)
    finite = np.abs(values) > SMALLEST_INVERSE * np.abs(values).max()
    return np.asarray(shift + 1 / values[finite], complex)


def _squares_up_to(poles: FloatArray, residues: FloatArray, limit: float) -> tuple[ComplexArray, IntArray, BoolArray]:
    """Squared zeros below a limit of many undamped FRFs, the FRF of each, and whose are sure to be all."""
    far = np.flatnonzero(poles > FAR * limit)
    if len(far) > STAND_INS:
        # what the far poles add is that of a few of them, with residues that agree about the disc of the limit
        stand_ins = poles[far[np.linspace(0, len(far) - 1, STAND_INS).astype(int)]]
        circle = limit * np.exp(1j * np.pi * (np.arange(2 * STAND_INS) + 0.5) / (2 * STAND_INS))
        wanted, given = (1 / (circle[:, None] - of) for of in (poles[far], stand_ins))
        real_given, real_wanted = (np.concatenate([numbers.real, numbers.imag]) for numbers in (given, wanted))
        carry = np.linalg.lstsq(real_given, real_wanted, rcond=None)[0]
        near = np.flatnonzero(poles <= FAR * limit)
        residues = np.concatenate([residues[:, near], residues[:, far] @ carry.T], axis=1)
        poles = np.concatenate([poles[near], stand_ins])
    top = float(np.abs(poles).max(initial=0.0))
    shift = -top / np.sqrt(max(len(poles), 1)) if not np.isfinite(limit) else -limit
    inverse = 1 / (poles - shift)
    size = np.sqrt(np.abs(residues))
    response = residues @ inverse
    is_sure = np.abs(response) > SMALL_RESIDUE * (np.abs(residues) @ np.abs(inverse))  # else a zero is near the shift
    sides = inverse * size
    rows = np.sign(residues) * sides / np.where(is_sure, response, 1.0)[:, None]
    matrices = np.diag(inverse) - sides[:, :, None] * rows[:, None, :]
    values = np.linalg.eigvals(matrices).astype(complex)
    finite = np.abs(values) > SMALLEST_INVERSE * np.abs(values).max(axis=1, keepdims=True, initial=0.0)
    frf, places = np.nonzero(finite)
    squares = np.asarray(shift + 1 / values[frf, places], complex)
    inside = np.abs(squares) <= limit
    return squares[inside], frf[inside], is_sure


def _merge(values: ComplexArray) -> bool:
    return bool(np.any(_gaps(values) < MERGED))


def _gaps(values: ComplexArray) -> FloatArray:
    """Distance of each from the nearest other one, over its modulus."""
    distance = np.abs(values[:, None] - values) + np.where(np.eye(len(values), dtype=bool), np.inf, 0.0)
    with np.errstate(divide="ignore"):  # two at 0 are one
        return np.asarray(distance.min(axis=1, initial=np.inf) / np.abs(values))
