"""Measured frequency response functions: values, what they connect, and how well they are known.

The one container that leaves ingest, and the only measured data that fitting, pairing, updating and diagnosis see.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt

from frf_ipz.arguments import describe, require_choice, require_type, take_array
from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray, IntArray, read_only, require_finite, require_shape
from frf_ipz.display import Drawn, Tabulated
from frf_ipz.dofs import AnyDof, as_dof, as_dofs
from frf_ipz.errors import InputError, ShapeError
from frf_ipz.quantities import FrfQuantity, as_quantity
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

SCALES = ("none", "common", "per_channel")
IN_THOUSANDS = "the frequencies are in kHz, or the time of the recordings is in ms"
ARRAYS = ("frequency_hz", "values", "variance", "coherence", "averages")


@dataclass(frozen=True, slots=True)
class FrfLabel:
    """What one FRF connects.

    Parameters
    ----------
    output_dof, input_dof : Dof or str
        Sensor and excited DOF, with the signs of the test.
    quantity : FrfQuantity or str
        What was measured.
    output_channel, input_channel : str
        Columns of the recordings that it comes from.

    Examples
    --------
    >>> import frf_ipz
    >>> label = frf_ipz.FrfLabel("20:-z", "18:+z", "accelerance")
    >>> str(label), label.unit, label.sign
    ('20:-z / 18:+z', 'm/s^2/N', -1)
    """

    output_dof: AnyDof
    input_dof: AnyDof
    quantity: FrfQuantity
    output_channel: str = ""
    input_channel: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "output_dof", as_dof(self.output_dof))
        object.__setattr__(self, "input_dof", as_dof(self.input_dof))
        object.__setattr__(self, "quantity", as_quantity(self.quantity))

    def __str__(self) -> str:
        return f"{self.output_dof} / {self.input_dof}"

    @property
    def unit(self) -> str:
        """SI unit of the values."""
        return self.quantity.unit(self.output_dof.direction, self.input_dof.direction)

    @property
    def sign(self) -> int:
        """Product of the signs of sensor and excitation: the model's FRF times this is the measured one."""
        return self.output_dof.sign * self.input_dof.sign


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ForceNoise:
    """What the noise of the force makes of FRFs: an error that neighbouring lines share.

    The force of an impact is kept for a short time, and its noise with it. So FRFs are off by the factor
    ``1 + sum_k n_k exp(-i omega t_k) / F``, over the samples of that time.

    Parameters
    ----------
    relative : (n_lines, n_frfs) complex array
        Root of the mean square of that error, relative to the FRF, with the phase of ``1 / F``.
    force : (n_frfs,) int array
        Which FRFs were measured with the same impacts, by a number.
    interval_s : pair of float
        First and last time for which the force is kept, from the impact on, s.
    """

    relative: ComplexArray
    force: IntArray
    interval_s: tuple[float, float]

    def __post_init__(self) -> None:
        require_finite("the noise of the force", self.relative)
        require_shape("the numbers of the forces", self.force, self.relative.shape[1:])
        for name in ("relative", "force"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def of(self, lines: BoolArray | slice, frfs: Sequence[int] | slice) -> ForceNoise:
        """Select lines and FRFs.

        Parameters
        ----------
        lines : (n_lines,) bool array or slice
            Lines to select.
        frfs : sequence of int or slice
            FRFs to select.

        Returns
        -------
        ForceNoise
            Theirs.
        """
        return replace(self, relative=self.relative[lines][:, frfs], force=self.force[frfs])


class Measured(Protocol):
    """What says which FRFs were measured, and where: a `FrfSet`, or the `ModalFit` of one."""

    @property
    def labels(self) -> tuple[FrfLabel, ...]:
        """What each FRF connects."""

    @property
    def connections(self) -> tuple[FrfLabel, ...]:
        """What a model's FRFs connect: sensors and forces, whether or not FRFs were measured between them."""

    @property
    def frequency_hz(self) -> FloatArray:
        """Frequency lines, (n_lines,) array, Hz."""

    @property
    def band_hz(self) -> tuple[float, float]:
        """Lowest and highest frequency, Hz."""


def require_measured(measured: object) -> None:
    """Refuse what does not say which FRFs were measured.

    Parameters
    ----------
    measured : object
        What was given.

    Raises
    ------
    InputError
        If it is neither a `FrfSet` nor a `ModalFit`.
    """
    if not isinstance(getattr(measured, "labels", None), tuple):
        raise InputError(f"what was measured is {describe(measured)}; needed is a FrfSet or a ModalFit")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrfSet(Tabulated, Drawn):
    """Measured FRFs on common frequency lines.

    Not every pair of sensor and excited DOF need be measured (roving sensors), so FRFs stand in a row, not in a
    matrix; `matrix` arranges those that are.

    Parameters
    ----------
    frequency_hz : (n_lines,) array
        Frequencies, ascending, Hz.
    values : (n_lines, n_frfs) complex array
        In SI units of each label's quantity. The time convention is exp(+i omega t).
    labels : tuple of FrfLabel
        One an FRF.
    variance : (n_lines, n_frfs) array
        E of the squared modulus of the error, half in each part; NaN where unknown.
    coherence : (n_lines, n_frfs) array
        NaN where unknown.
    averages : (n_frfs,) int array
        Records or segments averaged in each FRF; 0 where unknown.
    window_decay_1_s : float
        Rate sigma of an exponential window that force and response share. The values are then exactly the transfer
        function at s = sigma + i omega, and whoever fits evaluates the model there: that takes the added damping
        back without an approximation. 0 without a window.
    unknown_scale : str
        ``none``, ``common`` or ``per_channel``: gains that are not known and may be fitted.
    correlated_lines : int
        Neighbouring lines whose errors are hardly independent, as under an exponential window: who counts lines as
        evidence takes one in so many.
    force_noise : ForceNoise, optional
        The part of `variance` that neighbouring lines share.
    missing_force : (n_lines, n_frfs) complex array, optional
        About what records lack of the force as they begin within its pulse, over what they hold of it: FRFs are too
        large by this part. All of it is in `variance`.
    gain_variance : (n_lines, n_frfs) array, optional
        The part of `variance` that stems from relative errors which change slowly with frequency, as by what records
        lack at their beginning, or of modes at their end: the residue of a mode follows it, and the pole hardly does.

    Raises
    ------
    ShapeError
        If shapes disagree or a value is not finite.

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
    >>> frfs
    FrfSet: 2 FRFs (accelerance) on 790 lines from 5 to 399.5 Hz, 6:+z, 11:+z / 11:+z
    >>> frfs.select_frfs([1]).select_lines(frfs.in_band((10.0, 100.0))).values.shape
    (181, 1)
    """

    frequency_hz: FloatArray
    values: ComplexArray
    labels: tuple[FrfLabel, ...]
    variance: FloatArray
    coherence: FloatArray
    averages: IntArray
    window_decay_1_s: float = 0.0
    unknown_scale: str = "none"
    correlated_lines: int = 1
    force_noise: ForceNoise | None = None
    missing_force: ComplexArray | None = None
    gain_variance: FloatArray | None = None

    def __post_init__(self) -> None:
        shape = (len(self.frequency_hz), len(self.labels))
        for name in ("values", "variance", "coherence"):
            require_shape(f"the FRFs' {name}", getattr(self, name), shape)
        require_shape("the FRFs' averages", self.averages, shape[1:])
        require_finite("the FRFs' values", self.values)
        if self.force_noise is not None:
            require_shape("the FRFs' force_noise", self.force_noise.relative, shape)
        for name in ("missing_force", "gain_variance"):
            array = getattr(self, name)
            if array is not None:
                require_shape(f"the FRFs' {name}", array, shape)
                object.__setattr__(self, name, read_only(array))
        for name in ARRAYS:
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def __repr__(self) -> str:
        low, high = self.band_hz
        ends = f"{', '.join(map(str, self.output_dofs))} / {', '.join(map(str, self.input_dofs))}"
        kinds = ", ".join(dict.fromkeys(label.quantity.value for label in self.labels))
        n_frfs, n_lines = counted(self.n_frfs, "FRF"), counted(self.n_lines, "line")
        return f"FrfSet: {n_frfs} ({kinds}) on {n_lines} from {low:g} to {high:g} Hz, {ends}"

    @classmethod
    def from_arrays(
        cls,
        frequency_hz: ArrayLike,
        values: ArrayLike,
        *,
        outputs: Sequence[AnyDof | str],
        inputs: Sequence[AnyDof | str],
        quantity: FrfQuantity | str = FrfQuantity.ACCELERANCE,
        variance: ArrayLike | None = None,
        coherence: ArrayLike | None = None,
        averages: int = 0,
        unknown_scale: str = "none",
    ) -> FrfSet:
        """Make a set of FRFs from arrays, and check it.

        Parameters
        ----------
        frequency_hz : (n_lines,) array
            Frequencies, ascending, Hz.
        values : (n_lines, n_outputs, n_inputs) complex array
            FRFs in SI units of the quantity, for the time convention exp(+i omega t). A pair of output and input that
            was not measured is NaN on all lines and left out.
        outputs, inputs : sequence of Dof or str
            DOFs of the sensors and of the forces, such as ``"18:+z"``.
        quantity : FrfQuantity or str
            ``accelerance``, ``mobility`` or ``receptance``.
        variance : array, optional
            E of the squared modulus of the error, half in each part, of the shape of `values`.
        coherence : array, optional
            From 0 to 1, of the shape of `values`.
        averages : int
            Records behind each FRF; 0 where unknown.
        unknown_scale : str
            ``none``, ``common`` or ``per_channel``: gains that are not known and may be fitted.

        Returns
        -------
        FrfSet
            Its FRFs output by output.

        Raises
        ------
        ShapeError
            If shapes disagree, frequencies do not ascend, or a measured FRF holds a value that is not finite.
        QuantityError
            If there is no such quantity.
        InputError
            If a label is none, a pair is named twice, or nothing was measured.

        Examples
        --------
        >>> f = np.array([1.0, 2.0, 3.0])
        >>> FrfSet.from_arrays(f, np.ones((3, 2, 1)), outputs=["1:+x", "2:+x"], inputs=["2:+x"]).n_frfs
        2
        """
        lines = take_array("the frequencies", np.atleast_1d(frequency_hz), np.float64)
        outputs_given, inputs_given = as_dofs(outputs, name="outputs"), as_dofs(inputs, name="inputs")
        require_choice("unknown_scale", unknown_scale, SCALES)
        require_type("averages", averages, int, np.integer)
        if averages < 0:
            raise InputError(f"averages is {averages}; it is the number of records behind each FRF, or 0")
        shape = (len(lines), len(outputs_given), len(inputs_given))
        blocks = {
            "values": _block("values", values, shape, np.complex128),
            "variance": _block("variance", variance, shape, np.float64),
            "coherence": _block("coherence", coherence, shape, np.float64),
        }
        _require_lines(lines)
        measured = np.argwhere(~np.isnan(blocks["values"]).all(axis=0))
        if not len(measured):
            raise InputError("the FRFs' values are NaN throughout; give at least one FRF that was measured")
        kind = as_quantity(quantity)
        labels = tuple(
            FrfLabel(outputs_given[row], inputs_given[column], kind, f"output {outputs_given[row]}",
                     f"input {inputs_given[column]}")
            for row, column in measured
        )  # fmt: skip
        if len(set(labels)) < len(labels):
            raise InputError("a pair of output and input is named twice; each FRF has DOFs of its own")
        rows, columns = measured.T
        return cls(
            frequency_hz=lines,
            values=blocks["values"][:, rows, columns],
            labels=labels,
            variance=blocks["variance"][:, rows, columns],
            coherence=blocks["coherence"][:, rows, columns],
            averages=np.full(len(labels), averages, np.int64),
            unknown_scale=unknown_scale,
        )

    @property
    def connections(self) -> tuple[FrfLabel, ...]:
        """The same as `labels`: what a model's FRFs connect."""
        return self.labels

    @property
    def n_lines(self) -> int:
        """Number of frequency lines."""
        return len(self.frequency_hz)

    @property
    def band_hz(self) -> tuple[float, float]:
        """Lowest and highest frequency line, Hz."""
        return float(self.frequency_hz[0]), float(self.frequency_hz[-1])

    @property
    def n_frfs(self) -> int:
        """Number of FRFs."""
        return len(self.labels)

    @property
    def s(self) -> ComplexArray:
        """Where the transfer function was measured: sigma + i omega, (n_lines,) array, rad/s."""
        return np.asarray(self.window_decay_1_s + 2j * np.pi * self.frequency_hz, np.complex128)

    @property
    def output_dofs(self) -> tuple[AnyDof, ...]:
        """The sensors' DOFs, each once, in the order of the labels."""
        return tuple(dict.fromkeys(label.output_dof for label in self.labels))

    @property
    def input_dofs(self) -> tuple[AnyDof, ...]:
        """The excited DOFs, each once, in the order of the labels."""
        return tuple(dict.fromkeys(label.input_dof for label in self.labels))

    def in_band(self, band_hz: tuple[float, float], exclude_hz: Sequence[tuple[float, float]] = ()) -> BoolArray:
        """Mark the lines that lie in a band.

        Parameters
        ----------
        band_hz : pair of float
            Lowest and highest frequency, both included, Hz.
        exclude_hz : sequence of pairs of float
            Bands to leave out, Hz.

        Returns
        -------
        (n_lines,) bool array
            True for the lines to use.

        Raises
        ------
        InputError
            If no line remains; names `band_hz` or `exclude_hz`, whichever leaves none.
        """
        frequency = self.frequency_hz
        used = in_band = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
        for low, high in exclude_hz:
            used = used & ((frequency < low) | (frequency > high))
        if in_band.any() and not used.any():
            listed = ", ".join(f"{low:g} to {high:g} Hz" for low, high in exclude_hz)
            raise InputError(
                f"[fit] exclude_hz leaves no frequency line of the band {band_hz[0]:g} to {band_hz[1]:g} Hz: it takes "
                f"{listed}; exclude less of it"
            )
        if not used.any():
            held = (1e3 * frequency >= band_hz[0]) & (1e3 * frequency <= band_hz[1])
            raise InputError(
                f"no frequency line remains in the band {band_hz[0]:g} to {band_hz[1]:g} Hz; the measured lines go "
                f"from {frequency[0]:g} to {frequency[-1]:g} Hz, so set another [fit] band_hz"
                + (f"; or {IN_THOUSANDS}: name that unit in the column's header" if held.sum() > 1 else "")
            )
        return used

    def select_lines(self, used: BoolArray) -> FrfSet:
        """Select frequency lines.

        Parameters
        ----------
        used : (n_lines,) bool array
            True for the lines to select.

        Returns
        -------
        FrfSet
            The same FRFs on fewer lines.
        """
        rows = ("values", "variance", "coherence")
        return replace(
            self,
            frequency_hz=self.frequency_hz[used],
            force_noise=None if self.force_noise is None else self.force_noise.of(used, slice(None)),
            missing_force=None if self.missing_force is None else self.missing_force[used],
            gain_variance=None if self.gain_variance is None else self.gain_variance[used],
            **{name: getattr(self, name)[used] for name in rows},
        )

    def select_frfs(self, indices: Sequence[int]) -> FrfSet:
        """Select FRFs by their numbers.

        Parameters
        ----------
        indices : sequence of int
            Numbers of the FRFs, in the order of the result.

        Returns
        -------
        FrfSet
            Those FRFs on the same lines.
        """
        selected = list(indices)
        columns = ("values", "variance", "coherence")
        return replace(
            self,
            labels=tuple(self.labels[index] for index in selected),
            averages=self.averages[selected],
            force_noise=None if self.force_noise is None else self.force_noise.of(slice(None), selected),
            missing_force=None if self.missing_force is None else self.missing_force[:, selected],
            gain_variance=None if self.gain_variance is None else self.gain_variance[:, selected],
            **{name: getattr(self, name)[:, selected] for name in columns},
        )

    def matrix(self) -> tuple[ComplexArray, BoolArray]:
        """Arrange the FRFs as a matrix of output by input.

        Returns
        -------
        values : (n_lines, n_outputs, n_inputs) complex array
            Rows and columns as `output_dofs` and `input_dofs`; 0 where nothing was measured.
        measured : (n_outputs, n_inputs) bool array
            True where it was.
        """
        rows = {dof: index for index, dof in enumerate(self.output_dofs)}
        columns = {dof: index for index, dof in enumerate(self.input_dofs)}
        values = np.zeros((self.n_lines, len(rows), len(columns)), complex)
        measured = np.zeros((len(rows), len(columns)), bool)
        for index, label in enumerate(self.labels):
            entry = rows[label.output_dof], columns[label.input_dof]
            values[:, *entry] = self.values[:, index]
            measured[entry] = True
        return values, measured


def _block(
    name: str, values: ArrayLike | None, shape: tuple[int, int, int], dtype: type[np.complex128 | np.float64]
) -> npt.NDArray[Any]:
    """Take an array of the shape of the FRFs; NaN where there is none."""
    if values is None:
        return np.full(shape, np.nan, dtype)
    return take_array(f"the FRFs' {name} [frequency, output, input]", values, dtype, shape, is_finite=False)


def _require_lines(frequency_hz: FloatArray) -> None:
    require_finite("the frequencies", frequency_hz)
    if len(frequency_hz) < 2 or frequency_hz[0] < 0 or (np.diff(frequency_hz) <= 0).any():
        raise ShapeError("the frequencies must ascend from 0 Hz or above, each once; sort the lines")
