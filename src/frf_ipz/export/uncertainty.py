"""Multiplicative uncertainty of the plant: a weight for every output.

A robust design takes every plant ``(1 + w Delta) G`` with ``|Delta| <= 1`` into account. The weight is an upper bound
of the relative errors of the members of the posterior, of second order, stable and without zeros in the right half
plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arguments import require_type
from frf_ipz.arrays import ComplexArray, FloatArray, require_shape
from frf_ipz.display import Concise
from frf_ipz.dofs import as_dofs
from frf_ipz.errors import InputError
from frf_ipz.export.options import ExportOptions
from frf_ipz.export.ports import choose_ports
from frf_ipz.frf import FrfLabel, require_measured
from frf_ipz.late_imports import import_late
from frf_ipz.numerics.one_thread import on_one_thread
from frf_ipz.prediction.ensemble import ModelEnsemble
from frf_ipz.quantities import FrfQuantity
from frf_ipz.updating.updated_model import UpdatedModel, UpdateStatus

if TYPE_CHECKING:
    from collections.abc import Sequence

    import control
    from scipy.optimize import minimize

    from frf_ipz.dofs import AnyDof
    from frf_ipz.frf import Measured
else:
    minimize = import_late("scipy.optimize", "minimize")

WEIGHT_LINES = 400  # of the band, at equal ratios, on which the error of an output is bounded
WIDEST = 1e4  # ratio of the ends of the band on which it is, where the band begins at 0
QUANTILE = 0.95  # of the members
SMALLEST = 1e-6  # relative error below which a bound would only follow rounding
BOUND = 1.0 + 1e-9  # so that the bound holds despite rounding
STARTS = ((0.1, 1.0), (1.0, 10.0), (0.1, 10.0), (0.5, 2.0))  # corners of the weight, over the middle of the band


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class UncertaintyWeights(Concise):
    """Relative errors of the members, and weights that bound them.

    Parameters
    ----------
    output_names : tuple of str
        DOF labels of the outputs.
    frequency_hz : (n_lines,) array
        Lines on which the errors are given, Hz.
    relative_error : (n_lines, n_outputs) array
        Norm over all inputs of (member minus model) over that of the model: the 95 % quantile over the members.
    numerators, denominators : (n_outputs, 3) array
        Polynomials in s, highest power first, of the weight of each output.

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
    >>> reduced_model = frf_ipz.reduce_model(fit, beam, points=["9:+z"])
    >>> updated_model = frf_ipz.update_model(fit, reduced_model)
    >>> weights = frf_ipz.estimate_uncertainty_weights(fit, updated_model)
    >>> weights.output_names, weights.numerators.shape
    (('6:+z', '11:+z'), (2, 3))
    """

    output_names: tuple[str, ...]
    frequency_hz: FloatArray
    relative_error: FloatArray
    numerators: FloatArray
    denominators: FloatArray

    def __post_init__(self) -> None:
        count = len(self.output_names)
        require_shape("the relative errors", self.relative_error, (len(self.frequency_hz), count))
        require_shape("the numerators", self.numerators, (count, 3))
        require_shape("the denominators", self.denominators, (count, 3))

    def to_control(self) -> tuple[control.TransferFunction, ...]:
        """Give the weights to python-control, one an output."""
        import control  # here, since it takes a second and loads pyplot

        return tuple(control.tf(above, below) for above, below in zip(self.numerators, self.denominators, strict=True))


@on_one_thread
def estimate_uncertainty_weights(
    measured: Measured,
    updated_model: UpdatedModel,
    *,
    points: Sequence[AnyDof | str] = (),
    options: ExportOptions | None = None,
    frequency_hz: FloatArray | None = None,
) -> UncertaintyWeights:
    """Bound the relative error of the members of the posterior, for every sensor and point of interest.

    Parameters
    ----------
    measured : ModalFit or FrfSet
        What was measured: its excited DOFs are the inputs, its sensors the first outputs.
    updated_model : UpdatedModel
        With an ensemble.
    points : sequence of Dof or str
        Points of interest.
    options : ExportOptions, optional
        Which ports and quantities the state space has; by default all sensors and points as they are measured.
    frequency_hz : (n_lines,) array, optional
        Frequencies at which the bound has to hold, above 0, Hz; `WEIGHT_LINES` of the band at equal ratios where they
        are left out.

    Returns
    -------
    UncertaintyWeights
        In the order of the outputs of `make_state_space`; the quantity of an output does not matter to relative errors.

    Raises
    ------
    InputError
        If the method of updating has drawn no ensemble.

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
    >>> reduced_model = frf_ipz.reduce_model(fit, beam, points=["9:+z"])
    >>> updated_model = frf_ipz.update_model(fit, reduced_model)
    >>> weights = frf_ipz.estimate_uncertainty_weights(fit, updated_model, points=["9:+z"])
    >>> bool((weights.relative_error >= 0).all())
    True
    """
    require_measured(measured)
    require_type("updated_model", updated_model, UpdatedModel)
    labels, updated = measured.connections, updated_model
    if frequency_hz is None:
        low, high = measured.band_hz
        frequency_hz = np.geomspace(max(low, high / WIDEST), high, WEIGHT_LINES)
    if updated.status is UpdateStatus.NOTHING_TO_DO:
        raise InputError("the update had no target in the band, so the uncertainty of its model is unknown")
    if not len(updated.ensemble):
        raise InputError(
            f"the update by '{updated.method}' has no ensemble, so its uncertainty is unknown; use [update] "
            "method = 'minimal-change' with ensemble = 200"
        )
    ports = choose_ports(labels, as_dofs(points), options or ExportOptions(), {}, updated.model.expanded_dofs)
    s = 2j * np.pi * np.asarray(frequency_hz, float)
    lowest = float(np.abs(s).min())
    nominal = np.array([(updated.model.mass, updated.model.damping, updated.model.stiffness)])
    updated_frfs = ModelEnsemble(matrices=nominal, lowest_rad_s=lowest)
    member_frfs = ModelEnsemble(matrices=updated.ensemble, lowest_rad_s=lowest)
    errors = np.stack(
        [
            _relative_error(updated, (updated_frfs, member_frfs), output.dof, ports.inputs, s)
            for output in ports.outputs
        ],
        axis=1,
    )
    weights = [_bound(np.asarray(frequency_hz, float), error) for error in errors.T]
    return UncertaintyWeights(
        output_names=tuple(output.name for output in ports.outputs),
        frequency_hz=np.asarray(frequency_hz, float),
        relative_error=errors,
        numerators=np.array([above for above, _ in weights]),
        denominators=np.array([below for _, below in weights]),
    )


def _relative_error(
    updated: UpdatedModel,
    ensembles: tuple[ModelEnsemble, ModelEnsemble],
    output: AnyDof,
    inputs: Sequence[AnyDof],
    s: ComplexArray,
) -> FloatArray:
    model, (updated_frfs, member_frfs) = updated.model, ensembles
    size, distance = np.zeros(len(s)), np.zeros((len(updated.ensemble), len(s)))
    for force in inputs:
        rows = model.row(output), model.row(force)
        receptance = updated_frfs.receptance(*rows, s)
        members = member_frfs.receptance(*rows, s)
        label = FrfLabel(output, force, FrfQuantity.RECEPTANCE)
        gain, drawn = updated.scale.gain(label), updated.scale.drawn(label, len(members))[:, None]
        size += np.abs(gain * receptance[0]) ** 2
        distance += np.abs(gain * (drawn * members - receptance)) ** 2
    return np.asarray(np.quantile(np.sqrt(distance / size), QUANTILE, axis=0))


def _bound(frequency_hz: FloatArray, error: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Find the biquadratic weight above the curve that is closest to it on average in dB."""
    log_error = np.log(np.maximum(error, SMALLEST))
    middle = 2 * np.pi * float(np.sqrt(frequency_hz[0] * frequency_hz[-1]))
    s = 2j * np.pi * frequency_hz / middle

    def excess(logs: FloatArray) -> FloatArray:
        above, below = _polynomials(logs)
        log_weight = np.log(np.abs(np.polyval(above, s) / np.polyval(below, s)))
        return np.asarray(log_weight - log_error)

    def cost(logs: FloatArray) -> float:
        gap = excess(logs)
        return float(np.mean(gap) - gap.min() + 1e-3 * (logs @ logs))

    starts = [
        np.array([np.log(low), 0.0, np.log(high), 0.0]) for low, high in (*STARTS, *(pair[::-1] for pair in STARTS))
    ]
    optimum = min((minimize(cost, start, method="Nelder-Mead") for start in starts), key=lambda result: result.fun)
    above, below = _polynomials(optimum.x)
    gain = BOUND * float(np.exp(-excess(optimum.x).min()))
    time = np.array([1 / middle**2, 1 / middle, 1.0])
    return gain * above * time, below * time


def _polynomials(logs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Numerator and denominator from logarithms of corners and damping; all roots in the left half plane."""
    corner, damping, pole_corner, pole_damping = np.exp(np.clip(logs, -12, 12))
    return (
        np.array([1.0, 2 * damping * corner, corner**2]),
        np.array([1.0, 2 * pole_damping * pole_corner, pole_corner**2]),
    )
