"""A fitted transfer function as a value: poles, residues and what lies out of band; and its zeros.

``H_f(s) = exp(-s delay_f) (sum_r R_rf / (s - p_r) + conj(R_rf) / (s - conj(p_r)) + sum_k c_kf (s / scale)**k)``

Poles and zeros are kept once per conjugate pair, with the imaginary part that is not negative.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray, IntArray, require_shape
from frf_ipz.display import Concise


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class PoleResidueModel(Concise):
    """A set of FRFs with common poles.

    Parameters
    ----------
    poles : (n_poles,) complex array
        rad/s, imaginary part >= 0; a real pole stands for itself alone.
    residues : (n_poles, n_frfs) complex array
        Unit of the FRF times rad/s; real for a real pole.
    powers : tuple of int
        Powers of s of the residual terms: negative ones stand for what lies below the band, others for what lies above.
    coefficients : (n_powers, n_frfs) array
        Their real coefficients, in the unit of the FRF.
    scale_rad_s : float
        s is divided by this before it is raised to a power.
    delay_s : (n_frfs,) array
        Pure delay of each FRF.

    Raises
    ------
    ShapeError
        If shapes disagree.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> model = frf_ipz.PoleResidueModel(
    ...     poles=np.array([-1.0 + 100.0j]), residues=np.array([[-0.005j]]), powers=(0,), coefficients=np.zeros((1, 1)),
    ...     scale_rad_s=1.0, delay_s=np.zeros(1),
    ... )
    >>> model.natural_frequency_hz.round(2), model.damping_ratio.round(3)
    (array([15.92]), array([0.01]))
    >>> float(model(np.array([0.0j]))[0, 0].real.round(8))
    9.999e-05
    """

    poles: ComplexArray
    residues: ComplexArray
    powers: tuple[int, ...]
    coefficients: FloatArray
    scale_rad_s: float
    delay_s: FloatArray

    def __post_init__(self) -> None:
        n_frfs = self.residues.shape[1]
        require_shape("the residues", self.residues, (len(self.poles), n_frfs))
        require_shape("the residual terms", self.coefficients, (len(self.powers), n_frfs))
        require_shape("the delays", self.delay_s, (n_frfs,))

    def __call__(self, s: ComplexArray) -> ComplexArray:
        """Evaluate the FRFs.

        Parameters
        ----------
        s : (n_lines,) complex array
            rad/s.

        Returns
        -------
        (n_lines, n_frfs) complex array
            In the unit of the FRFs.
        """
        values = partial_fractions(s, self.poles) @ self.residues
        values += partial_fractions(s, self.conjugates) @ self.residues[self.poles.imag > 0].conj()
        for power, coefficients in zip(self.powers, self.coefficients, strict=True):
            values += ((s / self.scale_rad_s) ** power)[:, None] * coefficients
        return values * np.exp(-s[:, None] * self.delay_s)

    @property
    def conjugates(self) -> ComplexArray:
        """The other half of each conjugate pair."""
        return self.poles[self.poles.imag > 0].conj()

    @property
    def all_poles(self) -> ComplexArray:
        """The closed set of poles: (model_order,) complex array, rad/s."""
        return np.concatenate([self.poles, self.conjugates])

    @property
    def natural_frequency_hz(self) -> FloatArray:
        """``|p| / 2 pi``."""
        return natural_frequency_hz(self.poles)

    @property
    def damping_ratio(self) -> FloatArray:
        """``-Re p / |p|``."""
        return damping_ratio(self.poles)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class ZeroSet(Concise):
    """Zeros of single FRFs.

    Parameters
    ----------
    values : (n_zeros,) complex array
        rad/s, imaginary part >= 0. A zero of kind ``quadruple`` stands for itself, its conjugate and the two mirrored
        at the imaginary axis; one of kind ``real`` for a real zero.
    frf : (n_zeros,) int array
        Which FRF.
    kind : tuple of str
        ``complex``, ``real`` or ``quadruple``.
    identifiable : (n_zeros,) bool array
        False where the data do not support the number.
    reason : tuple of str
        Why it is not identifiable; empty where it is.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> lines = np.arange(5, 400.0, 0.5)
    >>> tip, middle = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
    >>> labels = [frf_ipz.FrfLabel(output, tip, frf_ipz.FrfQuantity.ACCELERANCE) for output in (middle, tip)]
    >>> values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=[middle, tip], inputs=[tip], variance=np.full(values.shape, 1e-4)
    ... )
    >>> fit = frf_ipz.fit_modes(frfs)
    >>> zeros = fit.zeros
    >>> hertz = np.abs(zeros.values) / (2 * np.pi)
    >>> hertz[zeros.identifiable].round(2)
    array([100.94, 102.52, 292.4 ,  72.11, 233.56])
    """

    values: ComplexArray
    frf: IntArray
    kind: tuple[str, ...]
    identifiable: BoolArray
    reason: tuple[str, ...]

    def __post_init__(self) -> None:
        n_zeros = len(self.values)
        require_shape("the zeros' FRF numbers", self.frf, (n_zeros,))
        require_shape("the zeros' marks", self.identifiable, (n_zeros,))


def partial_fractions(s: ComplexArray, poles: ComplexArray) -> ComplexArray:
    """1 / (s - p) for every line and pole.

    Parameters
    ----------
    s : (n_lines,) complex array
        rad/s.
    poles : (n_poles,) complex array
        rad/s.

    Returns
    -------
    (n_lines, n_poles) complex array
        s/rad.
    """
    return np.asarray(1.0 / (s[:, None] - poles))


def natural_frequency_hz(poles: ComplexArray) -> FloatArray:
    """Undamped natural frequency of poles, ``|p| / 2 pi``.

    Parameters
    ----------
    poles : complex array
        rad/s.

    Returns
    -------
    array
        Hz.
    """
    return np.abs(poles) / (2 * np.pi)


def damping_ratio(poles: ComplexArray) -> FloatArray:
    """Damping ratio of poles, ``-Re p / |p|``.

    Parameters
    ----------
    poles : complex array
        rad/s; a pole at zero has the ratio 0.

    Returns
    -------
    array
        1 is critical.
    """
    modulus = np.abs(poles)
    return -poles.real / np.where((modulus > 0) & np.isfinite(modulus), modulus, 1.0)


def underdamped_poles(natural_frequency: FloatArray, damping: FloatArray) -> ComplexArray:
    """Poles of underdamped modes.

    Parameters
    ----------
    natural_frequency : (n_modes,) array
        Hz.
    damping : (n_modes,) array
        Damping ratios, below 1.

    Returns
    -------
    (n_modes,) complex array
        rad/s, imaginary part >= 0.

    Examples
    --------
    >>> p = underdamped_poles(np.array([10.0]), np.array([0.01]))
    >>> round(float(natural_frequency_hz(p)[0]), 9), round(float(damping_ratio(p)[0]), 9)
    (10.0, 0.01)
    """
    omega = 2 * np.pi * natural_frequency
    return omega * (-damping + 1j * np.sqrt(1 - damping**2))
