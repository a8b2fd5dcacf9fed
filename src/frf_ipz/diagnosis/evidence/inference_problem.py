"""Everything that hypotheses are fitted with: model, nuisance, effects and measurement, brought together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.catalogue.effect import Effect
from frf_ipz.diagnosis.catalogue.model_context import ModelContext
from frf_ipz.diagnosis.evidence.fit import Data, Fit
from frf_ipz.diagnosis.evidence.hypothesis import Cause, Hypothesis, suppose
from frf_ipz.diagnosis.evidence.map_fit import polish, same_modes
from frf_ipz.diagnosis.measured.transfer_functions import Whitening, make_whitening, select_points
from frf_ipz.diagnosis.model.basis import make_basis
from frf_ipz.diagnosis.model.change import NOTHING
from frf_ipz.diagnosis.model.layout import lay_out
from frf_ipz.diagnosis.model.modes import modify, rows_of, scatter
from frf_ipz.diagnosis.model.nuisance import make_nuisance
from frf_ipz.diagnosis.model.response import respond

if TYPE_CHECKING:
    from frf_ipz.diagnosis.measured.data_split import DataSplit
    from frf_ipz.diagnosis.measured.transfer_functions import TransferFunctions
    from frf_ipz.diagnosis.model.basis import Basis
    from frf_ipz.diagnosis.model.layout import Layout
    from frf_ipz.diagnosis.model.nuisance import Nuisance
    from frf_ipz.diagnosis.options import DiagnoseOptions
    from frf_ipz.structure import StructuralModel

LAST_STEPS = 90  # along a bent valley many are small
MANY_POINTS = 120  # of a contour: every other one is enough for first steps
FEW_POINTS = 110  # of a contour: what a first look at small effects needs
EARLY_FLOOR = 8.0  # times the model's errors: first steps see past narrow peaks


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InferenceProblem:
    """Everything a search works with.

    Parameters
    ----------
    specimen : ModelContext
        What is tested.
    nuisance : Nuisance
        What cannot be known.
    effects : mapping of str to Effect
        What is looked for.
    coarse, middle : TransferFunctions
        Transfer functions far from the axis, and on the way to it.
    data : Data
        Those near the axis, with their errors.
    early : Data
        The same, with larger errors: for first steps.
    thin : Data
        Fewer points near the axis: for a first look at small effects.
    kind : str
        What was looked at: blows of a ``hammer``, ``random`` records from rest, ``running`` ones, or ``frf``.
    """

    specimen: ModelContext
    nuisance: Nuisance
    effects: Mapping[str, Effect]
    coarse: TransferFunctions
    middle: TransferFunctions
    data: Data
    early: Data
    thin: Data
    kind: str

    def suppose(self, causes: tuple[Cause, ...], *, exact: bool = True) -> Hypothesis:
        """Make a hypothesis."""
        return suppose(self.specimen, self.nuisance, causes, exact=exact)

    def fit(self, causes: tuple[Cause, ...], values: FloatArray, *, bar: float = np.inf) -> Fit:
        """Fit causes, from values of their parameters; given up where the cost does not come below a bar."""
        return self.fit_from(self.fit_early(causes, values), bar=bar)

    def fit_early(self, causes: tuple[Cause, ...], values: FloatArray, unknown: FloatArray | None = None) -> Fit:
        """Fit causes with large errors, from values of their parameters, and from some scatter if it is known."""
        return polish(self.suppose(causes), self.early, values, unknown=unknown, iterations=6, tolerance=1.0)

    def fit_from(self, fit: Fit, *, bar: float = np.inf) -> Fit:
        """Fit exactly, from a fit with large errors; given up where the cost does not come below a bar."""
        freely = replace(self.data, is_bounded=False)  # costs no more than with bounds
        near = polish(fit.hypothesis, freely, fit.values, unknown=fit.unknown, iterations=16, bar=bar)
        iterations = 12 if near.cost < bar else 0
        return polish(fit.hypothesis, self.data, near.values, unknown=near.unknown, iterations=iterations, bar=bar)

    def fit_beside(self, hypothesis: Hypothesis, values: FloatArray, base: Fit, *, bar: float = np.inf) -> Fit:
        """Fit a small effect exactly, with the scatter of a fit without it or with that fit's frequencies.

        It is given up where the cost does not come below a bar.
        """
        inside, unknown = self.nearest(hypothesis, (values,), base)
        return polish(hypothesis, self.data, inside, unknown=unknown, iterations=8, tolerance=0.2, bar=bar)

    def nearest(self, hypothesis: Hypothesis, starts: Sequence[FloatArray], fit: Fit) -> tuple[FloatArray, FloatArray]:
        """Choose the start that is nearest to the data, with the scatter of a fit or with its frequencies."""
        inside = [hypothesis.physical(hypothesis.start_at(values)) for values in starts]
        both = [(at, unknown) for at in inside for unknown in (fit.unknown, same_modes(hypothesis, at, fit))]
        return min(both, key=lambda start: self._cost(hypothesis, *start))

    def _cost(self, hypothesis: Hypothesis, values: FloatArray, unknown: FloatArray) -> float:
        white = self.data.misfit(hypothesis.respond(values, unknown, self.data.measured.s))
        pulls, _ = self.nuisance.pulls(unknown)
        return float(white @ white + pulls @ pulls)

    def go_on(self, fit: Fit) -> Fit:
        """Go on with a fit that has not converged."""
        return polish(fit.hypothesis, self.data, fit.values, unknown=fit.unknown, iterations=LAST_STEPS)


def weights_of(measured: TransferFunctions, error: float) -> FloatArray:
    """Weigh squared misfits, line by line.

    Parameters
    ----------
    measured : TransferFunctions
        Transfer functions.
    error : float
        Relative error of the model.

    Returns
    -------
    (n_points, n_frfs) array
        One over the expected square.
    """
    noise = np.array([np.diag(covariance).real for covariance in measured.covariance]).T
    return np.asarray(1 / ((error * measured.size) ** 2 + noise))


def set_up(
    model: StructuralModel,
    source: DataSplit,
    band_hz: tuple[float, float],
    options: DiagnoseOptions,
    effects: Mapping[str, Effect],
    *,
    free_gains: str = "none",
) -> InferenceProblem:
    """Bring model and measurement together.

    Parameters
    ----------
    model : StructuralModel
        The nominal model.
    source : DataSplit
        What was measured.
    band_hz : pair of float
        Hz.
    options : DiagnoseOptions
        Tolerances.
    effects : mapping of str to Effect
        What is looked for.
    free_gains : str
        ``none``, ``common`` or ``per_channel``: gains that nobody knows.

    Returns
    -------
    InferenceProblem
        Ready for a search.

    Raises
    ------
    InputError
        If the model lacks a DOF that was measured.
    """
    layout = lay_out(source.training.labels)
    places = [model.full_index(dof) for dof in (*(dof for _, dof in layout.outputs), *layout.inputs)]
    basis = make_basis(model, 2 * np.pi * band_hz[1], places)
    nuisance = make_nuisance(basis, layout, options)
    coarse, middle = source.coarse, source.middle
    if free_gains != "none":
        coarse, middle = (_scaled(one, basis, layout, nuisance, free_gains) for one in (coarse, middle))
    n_points = len(source.training.s)
    half = select_points(source.training, np.arange(0, n_points, 2 if n_points > MANY_POINTS else 1))
    few = select_points(source.training, np.arange(0, n_points, -(-n_points // FEW_POINTS)))
    specimen = ModelContext(basis=basis, layout=layout, band_hz=band_hz, contour=source.coarse.s, options=options)
    early = with_errors(half, options, free_gains=free_gains, floor=EARLY_FLOOR)
    return InferenceProblem(
        specimen=specimen,
        nuisance=nuisance,
        effects=effects,
        coarse=coarse,
        middle=middle,
        data=with_errors(source.training, options, free_gains=free_gains),
        early=replace(early, is_bounded=False),
        thin=with_errors(few, options, free_gains=free_gains),
        kind=source.kind,
    )


def with_errors(
    measured: TransferFunctions, options: DiagnoseOptions, *, free_gains: str = "none", floor: float = 1.0
) -> Data:
    """Put tolerances beside measurements.

    Parameters
    ----------
    measured : TransferFunctions
        Transfer functions.
    options : DiagnoseOptions
        Tolerances.
    free_gains : str
        As for `set_up`.
    floor : float
        Factor of the model's errors.

    Returns
    -------
    Data
        To fit to.
    """
    whitening = make_whitening(
        measured,
        tolerance=options.stiffness_tolerance,
        floor=floor,
    )
    return Data(measured=measured, whitening=whitening, free_gains=free_gains)


def _scaled(
    measured: TransferFunctions, basis: Basis, layout: Layout, nuisance: Nuisance, free_gains: str
) -> TransferFunctions:
    """Bring measured FRFs of unknown scale to the scale of the nominal model."""
    unknowns = nuisance.unpack(np.zeros(nuisance.size))
    modes = scatter(basis, modify(basis, NOTHING), rows_of(basis, layout, NOTHING, nuisance), unknowns)
    nominal = respond(modes, NOTHING, layout, unknowns, measured.s, basis)
    whitening = Whitening(factors=np.zeros((0, 0, 0), complex), blocks=())
    gains = Data(measured=measured, whitening=whitening, free_gains=free_gains).gains(nominal)
    size = np.abs(gains)
    return replace(
        measured,
        values=measured.values / gains,
        size=measured.size / size,
        covariance=measured.covariance / size[:, None, None] ** 2,
    )
