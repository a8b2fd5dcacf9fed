"""Everything that hypotheses are fitted with: model, nuisance, effects and measurement, brought together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.catalogue.effect import Effect
from frf_ipz.diagnosis.catalogue.model_context import ModelContext
from frf_ipz.diagnosis.deadline import NO_LIMIT, Deadline
from frf_ipz.diagnosis.evidence.fit import Data, Fit
from frf_ipz.diagnosis.evidence.hypothesis import Component, Hypothesis, make_hypothesis
from frf_ipz.diagnosis.evidence.map_fit import adopt_modes, fit_map
from frf_ipz.diagnosis.measured.disagreement import measure_disagreement
from frf_ipz.diagnosis.measured.transfer_functions import Whitening, make_whitening, select_points
from frf_ipz.diagnosis.model.basis import make_basis
from frf_ipz.diagnosis.model.change import NO_CHANGE
from frf_ipz.diagnosis.model.layout import make_layout
from frf_ipz.diagnosis.model.modes import make_motion_rows, modify_structure, scatter_modes
from frf_ipz.diagnosis.model.nuisance import make_nuisance_prior
from frf_ipz.diagnosis.model.response import respond

if TYPE_CHECKING:
    from frf_ipz.diagnosis.measured.data_split import DataSplit
    from frf_ipz.diagnosis.measured.transfer_functions import TransferFunctions
    from frf_ipz.diagnosis.model.basis import Basis
    from frf_ipz.diagnosis.model.layout import Layout
    from frf_ipz.diagnosis.model.nuisance import NuisancePrior
    from frf_ipz.diagnosis.options import DiagnoseOptions
    from frf_ipz.structure import StructuralModel

LAST_STEPS = 90  # along a curved valley many are small
MANY_POINTS = 120  # of a contour: every other one is enough for first steps
FEW_POINTS = 110  # of a contour: what a score test of small effects needs
REMEMBERED_BYTES = 2**26  # of the shapes of hypotheses: a small part of what a computer has
ROUGH_FLOOR = 8.0  # times the model's errors: first steps overlook narrow peaks


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InferenceProblem:
    """Model, nuisance prior, effects and measurement: everything that hypotheses are fitted with.

    Parameters
    ----------
    context : ModelContext
        Model, layout and tolerances.
    nuisance_prior : NuisancePrior
        Prior of the nuisance parameters.
    effects : mapping of str to Effect
        The effects to search for.
    coarse, middle : TransferFunctions
        Transfer functions far from the axis, and on the way to it.
    data : Data
        Those near the axis, with their errors.
    rough_data : Data
        The same with inflated errors, for first steps.
    sparse_data : Data
        Fewer points near the axis, for score tests of small effects.
    disagreement : (n_frfs, n_subbands) array
        How much records disagree in parts of the band, over what their noise explains; 1 where they do not.
    kind : str
        What was measured: impacts of a ``hammer``, ``random`` records from rest, ``running`` ones, or ``frf``.
    deadline : Deadline
        When no further hypothesis is made, and no further step of a fit.
    """

    context: ModelContext
    nuisance_prior: NuisancePrior
    effects: Mapping[str, Effect]
    coarse: TransferFunctions
    middle: TransferFunctions
    data: Data
    rough_data: Data
    sparse_data: Data
    disagreement: FloatArray
    kind: str
    deadline: Deadline = NO_LIMIT
    _known: dict[tuple[object, ...], Hypothesis] = field(init=False, default_factory=dict, repr=False)

    def make_hypothesis(self, components: tuple[Component, ...], *, exact: bool = True) -> Hypothesis:
        """Make a hypothesis, or give the known one; raises DeadlineError where there is no time for it."""
        self.deadline.check()
        key = (exact, *((component.key, component.n_locations) for component in components))
        if key in self._known:
            hypothesis = self._known.pop(key)
        else:
            hypothesis = make_hypothesis(
                self.context, self.nuisance_prior, components, exact=exact, deadline=self.deadline
            )
        self._known[key] = hypothesis  # the latest is last
        if len(self._known) > 1 and len(self._known) * hypothesis.basis.vectors.nbytes > REMEMBERED_BYTES:
            self._known.pop(next(iter(self._known)))
        return hypothesis

    def fit(self, components: tuple[Component, ...], values: FloatArray, *, cost_limit: float = np.inf) -> Fit:
        """Fit components, from values of their parameters; stopped early if the cost cannot come below a limit."""
        return self.fit_exactly(self.fit_roughly(components, values), cost_limit=cost_limit)

    def fit_roughly(
        self, components: tuple[Component, ...], values: FloatArray, nuisance: FloatArray | None = None
    ) -> Fit:
        """Fit components with inflated errors, from values of their parameters and, if given, of the nuisance."""
        return fit_map(
            self.make_hypothesis(components), self.rough_data, values, nuisance=nuisance, iterations=6, tolerance=1.0
        )

    def fit_exactly(self, fit: Fit, *, cost_limit: float = np.inf) -> Fit:
        """Fit exactly, from a fit with inflated errors; stopped early if the cost cannot come below a limit."""
        freely = replace(self.data, is_bounded=False)  # costs no more than with bounds
        unbounded = fit_map(
            fit.hypothesis, freely, fit.values, nuisance=fit.nuisance, iterations=16, cost_limit=cost_limit
        )
        iterations = 12 if unbounded.cost < cost_limit else 0
        return fit_map(
            fit.hypothesis,
            self.data,
            unbounded.values,
            nuisance=unbounded.nuisance,
            iterations=iterations,
            cost_limit=cost_limit,
        )

    def fit_from_base(
        self, hypothesis: Hypothesis, values: FloatArray, base: Fit, *, cost_limit: float = np.inf
    ) -> Fit:
        """Fit a small effect exactly, with the nuisance of a fit without it or with that fit's frequencies.

        It is stopped early if the cost cannot come below a limit.
        """
        inside, nuisance = self.nearest_start(hypothesis, (values,), base)
        return fit_map(
            hypothesis, self.data, inside, nuisance=nuisance, iterations=8, tolerance=0.2, cost_limit=cost_limit
        )

    def nearest_start(
        self, hypothesis: Hypothesis, starts: Sequence[FloatArray], fit: Fit
    ) -> tuple[FloatArray, FloatArray]:
        """Choose the start that is nearest to the data, with the nuisance of a fit or with its frequencies."""
        inside = [hypothesis.to_physical(hypothesis.clip_to_searched(values)) for values in starts]
        candidates = [
            (start, nuisance) for start in inside for nuisance in (fit.nuisance, adopt_modes(hypothesis, start, fit))
        ]
        return min(candidates, key=lambda start: self._cost(hypothesis, *start))

    def _cost(self, hypothesis: Hypothesis, values: FloatArray, nuisance: FloatArray) -> float:
        white = self.data.misfit(hypothesis.respond(values, nuisance, self.data.measured.s))
        whitened_nuisance, _ = self.nuisance_prior.whiten(nuisance)
        return float(white @ white + whitened_nuisance @ whitened_nuisance)

    def fit_to_convergence(self, fit: Fit) -> Fit:
        """Continue a fit that has not converged."""
        return fit_map(fit.hypothesis, self.data, fit.values, nuisance=fit.nuisance, iterations=LAST_STEPS)


def compute_weights(measured: TransferFunctions, error: float) -> FloatArray:
    """Compute the weights of squared misfits, line by line.

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


def pose_problem(
    model: StructuralModel,
    source: DataSplit,
    band_hz: tuple[float, float],
    options: DiagnoseOptions,
    effects: Mapping[str, Effect],
    *,
    free_gains: str = "none",
) -> InferenceProblem:
    """Pose the inference problem of a model and a measurement.

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
        The effects to search for.
    free_gains : str
        ``none``, ``common`` or ``per_channel``: unknown gains.

    Returns
    -------
    InferenceProblem
        Ready for a search.

    Raises
    ------
    InputError
        If the model lacks a DOF that was measured.
    """
    layout = make_layout(source.training.labels)
    basis = make_basis(model, 2 * np.pi * band_hz[1], layout.dofs)
    nuisance_prior = make_nuisance_prior(basis, layout, options)
    coarse, middle = source.coarse, source.middle
    if free_gains != "none":
        coarse, middle = (
            _scale_to_nominal(measured, basis, layout, nuisance_prior, free_gains) for measured in (coarse, middle)
        )
    n_points = len(source.training.s)
    half = select_points(source.training, np.arange(0, n_points, 2 if n_points > MANY_POINTS else 1))
    sparse = select_points(source.training, np.arange(0, n_points, -(-n_points // FEW_POINTS)))
    context = ModelContext(basis=basis, layout=layout, band_hz=band_hz, contour=source.coarse.s, options=options)
    rough = make_data(half, options, free_gains=free_gains, floor=ROUGH_FLOOR)
    return InferenceProblem(
        context=context,
        nuisance_prior=nuisance_prior,
        effects=effects,
        coarse=coarse,
        middle=middle,
        data=make_data(source.training, options, free_gains=free_gains),
        rough_data=replace(rough, is_bounded=False),
        sparse_data=make_data(sparse, options, free_gains=free_gains),
        disagreement=measure_disagreement(source, options.stiffness_tolerance),
        kind=source.kind,
    )


def make_data(
    measured: TransferFunctions, options: DiagnoseOptions, *, free_gains: str = "none", floor: float = 1.0
) -> Data:
    """Make the data of measurements and tolerances.

    Parameters
    ----------
    measured : TransferFunctions
        Transfer functions.
    options : DiagnoseOptions
        Tolerances.
    free_gains : str
        As for `pose_problem`.
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


def _scale_to_nominal(
    measured: TransferFunctions, basis: Basis, layout: Layout, nuisance_prior: NuisancePrior, free_gains: str
) -> TransferFunctions:
    """Bring measured FRFs of unknown scale to the scale of the nominal model."""
    nuisance_values = nuisance_prior.unpack(np.zeros(nuisance_prior.size))
    modes = scatter_modes(
        basis,
        modify_structure(basis, NO_CHANGE),
        make_motion_rows(basis, layout, NO_CHANGE, nuisance_prior),
        nuisance_values,
    )
    nominal = respond(modes, NO_CHANGE, layout, nuisance_values, measured.s, basis)
    whitening = Whitening(factors=np.zeros((0, 0, 0), complex), blocks=())
    gains = Data(measured=measured, whitening=whitening, free_gains=free_gains).gains(nominal)
    size = np.abs(gains)
    return replace(
        measured,
        values=measured.values / gains,
        size=measured.size / size,
        covariance=measured.covariance / size[:, None, None] ** 2,
    )
