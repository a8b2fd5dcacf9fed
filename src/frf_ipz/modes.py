"""Mode shapes and the numbers that compare them.

[Allemang2003] R. J. Allemang, The modal assurance criterion: twenty years of use and abuse, Sound and Vibration 37 (8),
2003, 14-23.
[Pappa1993] R. S. Pappa, K. B. Elliott, A. Schenk, Consistent-mode indicator for the eigensystem realization algorithm,
J. Guidance, Control and Dynamics 16 (5), 1993, 852-858, doi:10.2514/3.21092.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from frf_ipz.arguments import take_array
from frf_ipz.arrays import ComplexArray, FloatArray, read_only, require_shape
from frf_ipz.display import Concise
from frf_ipz.dofs import AnyDof, as_dofs
from frf_ipz.errors import InputError
from frf_ipz.frf import FrfLabel
from frf_ipz.quantities import FrfQuantity, as_quantity

BEYOND = 0.05  # of the highest frequency: scatter of the frequencies of a nearly right model, as in pairing
LINES = 800  # of the band, at equal ratios: a pixel each
HALF_WIDTHS, LINES_OF_PEAK = 4.0, 33  # to each side of a mode, four lines a half width
DEVIATIONS = ("frequency_std_hz", "damping_ratio_std")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class ModeSet(Concise):
    """Modes at some DOFs.

    Parameters
    ----------
    natural_frequency_hz, damping_ratio : (n_modes,) array
        Hz and 1.
    shapes : (n_dofs, n_modes) complex array
        Mass-normalised where the scale is known.
    dofs : tuple of Dof
        Rows of the shapes.

    Examples
    --------
    >>> import frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> modes = frf_ipz.solve_modes(beam, n_modes=2)
    >>> modes.shapes.shape, modes.damping_ratio.tolist()
    ((20, 2), [0.01, 0.01])
    """

    natural_frequency_hz: FloatArray
    damping_ratio: FloatArray
    shapes: ComplexArray
    dofs: tuple[AnyDof, ...]

    def __post_init__(self) -> None:
        require_shape("the mode shapes", self.shapes, (len(self.dofs), len(self.natural_frequency_hz)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class ModalParameters(Concise):
    """Modes that were identified elsewhere: frequencies, damping ratios and shapes with their deviations, without FRFs.

    Parameters
    ----------
    natural_frequency_hz, damping_ratio : (n_modes,) array
        Hz, above 0; and from above 0 to below 1. They are sorted by frequency.
    shapes : (n_dofs, n_modes) complex array
        Motion of the sensors. Each mode may have a factor of its own: the scale of a shape is not used.
    dofs : sequence of Dof or str
        Where the sensors sat, with the signs of the test.
    frequency_std_hz, damping_ratio_std : (n_modes,) array, optional
        Standard deviations, above 0; NaN, or nothing at all, where they are not known.
    input_dofs : sequence of Dof or str
        Where forces act in the FRFs that a model predicts.
    quantity : FrfQuantity or str
        What these FRFs are.

    Raises
    ------
    ShapeError
        If shapes disagree or a value is not finite.
    InputError
        If there is no mode or no DOF, a DOF stands there twice, or a number is outside of its range.

    Examples
    --------
    >>> import frf_ipz
    >>> modes = frf_ipz.ModalParameters(
    ...     natural_frequency_hz=[80.0, 12.5], damping_ratio=[0.01, 0.02], shapes=[[1.0, 0.4], [-0.8, 1.0]],
    ...     dofs=["6:+z", "11:+z"], frequency_std_hz=[0.1, 0.02], input_dofs=["11:+z"],
    ... )
    >>> modes.natural_frequency_hz, [str(label) for label in modes.labels]
    (array([12.5, 80. ]), ['6:+z / 11:+z', '11:+z / 11:+z'])
    """

    natural_frequency_hz: FloatArray
    damping_ratio: FloatArray
    shapes: ComplexArray
    dofs: tuple[AnyDof, ...]
    frequency_std_hz: FloatArray | None = None
    damping_ratio_std: FloatArray | None = None
    input_dofs: tuple[AnyDof, ...] = ()
    quantity: FrfQuantity = FrfQuantity.ACCELERANCE

    def __post_init__(self) -> None:
        frequency = take_array("the natural frequencies", self.natural_frequency_hz, np.float64)
        dofs = as_dofs(self.dofs, name="dofs")
        count = len(frequency)
        if not count or not dofs:
            raise InputError(f"there are {count} modes at {len(dofs)} DOFs; needed is one at least of each")
        if len({dof.name for dof in dofs}) < len(dofs):
            raise InputError("a DOF stands there twice; each has one row of the shapes")
        ratio = take_array("the damping ratios", self.damping_ratio, np.float64, (count,))
        shapes = take_array("the shapes", self.shapes, np.complex128, (len(dofs), count))
        known = {"natural frequency": frequency > 0, "damping ratio": (ratio > 0) & (ratio < 1)}
        for what, is_right in known.items():
            if not is_right.all():
                hertz = frequency[int(np.argmin(is_right))]
                expected = "above 0 Hz" if what == "natural frequency" else "above 0 and below 1"
                raise InputError(f"the {what} of the mode at {hertz:g} Hz is none; expected is one {expected}")
        if not np.abs(shapes).max(axis=0).all():
            raise InputError(f"the shape of the mode at {frequency[~shapes.any(axis=0)][0]:g} Hz is 0 at every DOF")
        order = np.argsort(frequency, kind="stable")
        taken = {
            "natural_frequency_hz": frequency[order],
            "damping_ratio": ratio[order],
            "shapes": shapes[:, order],
            "frequency_std_hz": _deviations("frequency_std_hz", self.frequency_std_hz, count)[order],
            "damping_ratio_std": _deviations("damping_ratio_std", self.damping_ratio_std, count)[order],
        }
        for name, array in taken.items():
            object.__setattr__(self, name, read_only(array))
        object.__setattr__(self, "dofs", dofs)
        object.__setattr__(self, "input_dofs", as_dofs(self.input_dofs, name="input_dofs"))
        object.__setattr__(self, "quantity", as_quantity(self.quantity))

    @property
    def labels(self) -> tuple[FrfLabel, ...]:
        """What FRFs from the forces to the sensors would connect; none of them was measured."""
        return tuple(FrfLabel(output, force, self.quantity) for output in self.dofs for force in self.input_dofs)

    @property
    def band_hz(self) -> tuple[float, float]:
        """From half the lowest frequency to beyond the highest, by what separates two modes in a nearly right model."""
        return float(self.natural_frequency_hz[0] / 2), float(self.natural_frequency_hz[-1] * (1 + BEYOND))

    @property
    def lines_hz(self) -> FloatArray:
        """Lines of the band, close where the modes are, since no FRF says on which a model is to be evaluated."""
        low, high = self.band_hz
        across = 1 + self.damping_ratio[:, None] * np.linspace(-1, 1, LINES_OF_PEAK) * HALF_WIDTHS
        near = (self.natural_frequency_hz[:, None] * across).ravel()
        lines = np.unique(np.concatenate([np.geomspace(low, high, LINES), near]))
        return np.asarray(lines[(lines >= low) & (lines <= high)])

    def as_model_has_them(self) -> ModeSet:
        """Give the modes at the sensors' DOFs in their positive directions.

        Returns
        -------
        ModeSet
            Unsigned, the largest entry of each shape 1.
        """
        shapes = self.shapes * np.array([dof.sign for dof in self.dofs])[:, None]
        largest = np.take_along_axis(shapes, np.argmax(np.abs(shapes), axis=0)[None], axis=0)
        return ModeSet(
            natural_frequency_hz=self.natural_frequency_hz,
            damping_ratio=self.damping_ratio,
            shapes=np.asarray(shapes / largest),
            dofs=tuple(dof.unsigned for dof in self.dofs),
        )

    def select(self, modes: Sequence[int]) -> ModalParameters:
        """Select modes by their numbers.

        Parameters
        ----------
        modes : sequence of int
            Numbers by ascending frequency, from 0.

        Returns
        -------
        ModalParameters
            Those modes.
        """
        numbers = np.asarray(modes, int)
        stds = {name: _deviations(name, getattr(self, name), len(self.damping_ratio)) for name in DEVIATIONS}
        return ModalParameters(
            natural_frequency_hz=self.natural_frequency_hz[numbers],
            damping_ratio=self.damping_ratio[numbers],
            shapes=self.shapes[:, numbers],
            dofs=self.dofs,
            input_dofs=self.input_dofs,
            quantity=self.quantity,
            **{name: values[numbers] for name, values in stds.items()},
        )


def _deviations(name: str, values: FloatArray | None, count: int) -> FloatArray:
    """Take standard deviations, NaN where they are not known."""
    if values is None:
        return np.full(count, np.nan)
    array = take_array(name, values, np.float64, (count,), is_finite=False)
    if (np.isinf(array) | (array <= 0)).any():
        raise InputError(f"{name} holds {array[np.isinf(array) | (array <= 0)][0]:g}; a deviation is above 0, or NaN")
    return array


def modal_assurance(first: ComplexArray, second: ComplexArray) -> FloatArray:
    """Modal assurance criterion between two sets of shapes [Allemang2003].

    Parameters
    ----------
    first : (n_dofs, n_first) complex array
        Shapes.
    second : (n_dofs, n_second) complex array
        Shapes at the same DOFs.

    Returns
    -------
    (n_first, n_second) array
        1 where two shapes are the same but for a factor, 0 where they are orthogonal.

    Examples
    --------
    >>> shape = np.array([[1.0], [2.0]]) + 0j
    >>> float(modal_assurance(shape, -3 * shape)[0, 0])
    1.0
    """
    inner = np.abs(first.conj().T @ second) ** 2
    lengths = np.outer(np.sum(np.abs(first) ** 2, 0), np.sum(np.abs(second) ** 2, 0))
    return np.asarray(inner / np.where(lengths > 0, lengths, 1.0))


def modal_phase_collinearity(shapes: ComplexArray) -> FloatArray:
    """How nearly each shape is real but for a factor [Pappa1993].

    Parameters
    ----------
    shapes : (n_dofs, n_modes) complex array
        Shapes.

    Returns
    -------
    (n_modes,) array
        1 for a normal mode, 0 for one without any common phase.

    Examples
    --------
    >>> float(modal_phase_collinearity(np.array([[1j], [2j]]))[0])
    1.0
    """
    real, imag = shapes.real, shapes.imag
    xx, yy, xy = np.sum(real * real, 0), np.sum(imag * imag, 0), np.sum(real * imag, 0)
    total = xx + yy
    return np.asarray(((xx - yy) ** 2 + 4 * xy**2) / np.where(total > 0, total, 1.0) ** 2)
