"""``minimal-change``: the smallest change of the model, in a stated metric, that explains poles and zeros of all FRFs.

The metric is that of a prior over what may be wrong in a model (`updating.parameters`): the change is the most likely
one. First the stiffness and masses at nodes (and, when asked, all of the mass) bring the moduli of poles and zeros to
their targets, then the damping their real parts. Targets are weighted by the inverse of their covariance, so that noisy
ones are met only to within their noise; targets that all others contradict are excluded, and reported. Matrices stay
symmetric and positive semi-definite, rigid-body modes stay. The ensemble is drawn from the posterior.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtri

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from frf_ipz.late_imports import import_late
from frf_ipz.numerics.low_rank import factorise
from frf_ipz.updating.along_structure import part_table
from frf_ipz.updating.gaussian import gain_of_further_terms
from frf_ipz.updating.local_masses import find_local_masses, local_mass_notes
from frf_ipz.updating.minimal_change.damping import DampingPhase, damping_phase
from frf_ipz.updating.minimal_change.ensemble import Posterior, draw_ensemble, draw_whitened, parameters_of
from frf_ipz.updating.minimal_change.gauss_newton import PhaseResult, iterate, log_evidence_of
from frf_ipz.updating.minimal_change.modal_frame import ModalFrame, frame_of, modal_frame
from frf_ipz.updating.minimal_change.outliers import EXCLUDED_STD, contradicted_targets, unmet_targets
from frf_ipz.updating.minimal_change.stiffness import StiffnessPhase, log_moduli
from frf_ipz.updating.pairing_again import ROUNDS
from frf_ipz.updating.parameters import ParameterBasis, generic_basis
from frf_ipz.updating.target_noise import project
from frf_ipz.updating.tracking import TargetRoots, TrackedRoots, track, with_damping
from frf_ipz.updating.updated_model import UpdatedModel, UpdateStatus, free_matrices, nothing_to_do

if TYPE_CHECKING:
    import pandas as pd

    from frf_ipz.progress import Progress
    from frf_ipz.structure import ReducedModel
    from frf_ipz.updating.options import UpdateOptions
    from frf_ipz.updating.problem import UpdateProblem
else:
    pd = import_late("pandas")

SMALLEST_NOISE = 1e-6  # relative standard deviation of a frequency: none is measured better
OF_DAMPING = 1.0  # change of the logarithm of a modulus by damping, from which damping makes a root
UNKNOWN_STD = 1e15  # relative, of what is no target: however far its root runs, and with it what moves it
STEPS_BACK = 16  # to the nominal model: so many that roots keep the greater part of their vectors over each
LEAST_DRAWS = 200  # to judge masses of sensors and at nodes by
SEED = 0  # of those at nodes: the same choice from the same inputs
CHANCE = 0.05  # that of sensors without a mass any one is held to weigh less than nothing, and left out
SHIFTED = 0.1  # standard deviations of a modulus from which the stiffness is updated again for the change by damping


def update(problem: UpdateProblem, options: UpdateOptions, progress: Progress) -> UpdatedModel:
    """Update a model by the smallest change.

    Parameters
    ----------
    problem : UpdateProblem
        Model, targets, parameters.
    options : UpdateOptions
        Options of the user.
    progress : Progress
        Reports how far the work is.

    Returns
    -------
    UpdatedModel
        With an ensemble of the posterior.
    """
    if not len(problem.values):
        return nothing_to_do(problem.model, "minimal-change")
    frame = frame_of(problem.model, problem.at_ports)
    update_of = _likelier(problem, frame, options, progress)
    pairs, again = None, problem.pair_again
    for _ in range(ROUNDS):
        if again is None:
            break
        paired = again.with_model(problem, update_of.model, pairs or again.pairs, update_of.values)
        if paired is None:
            break
        targets = replace(paired[1], basis=update_of.problem.basis)
        further = _solve(targets, frame, options, progress, start=update_of)
        if not again.deviation_db(further.model) < again.deviation_db(update_of.model):
            break
        pairs, update_of = paired[0], further
    progress(0.8, "ensemble")
    updated = _updated(update_of, options)
    if pairs is None or again is None:
        return updated
    before = _values_before(update_of)
    return replace(updated, before=before, pairs=again.named_before(pairs, problem.model, before))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Update:
    """An update of both phases: its targets, what is left open, what was done, and which targets were excluded.

    What was drawn of its stiffness and mass to judge masses by is kept with the source of randomness after that.
    """

    problem: UpdateProblem
    posterior: Posterior
    history: tuple[dict[str, str | float], ...]
    excluded: IntArray
    drawn: tuple[FloatArray, np.random.Generator] | None = None

    @cached_property
    def model(self) -> ReducedModel:
        nominal = self.problem.model
        mass, damping, stiffness = free_matrices(nominal, *self.posterior.model())
        return replace(nominal, mass=mass, damping=damping, stiffness=stiffness)

    @property
    def has_converged(self) -> bool:
        """Whether both phases have."""
        return self.posterior.stiffness_result.converged and self.posterior.damping_result.converged

    @cached_property
    def local_masses(self) -> pd.DataFrame:
        basis = self.posterior.stiffness.basis
        if not basis.at_nodes:
            return find_local_masses(basis, np.zeros((0, len(basis.names))))
        drawn = draw_whitened(self.posterior, np.random.default_rng(SEED), LEAST_DRAWS)
        return find_local_masses(basis, parameters_of(self.posterior, drawn))

    @cached_property
    def log_evidence(self) -> float:
        return log_evidence_of(self.posterior.stiffness, self.posterior.stiffness_result)

    @cached_property
    def values(self) -> ComplexArray:
        return self.problem.nearest_roots(self.model, self.posterior.values(len(self.problem.values)))


def _likelier(problem: UpdateProblem, frame: ModalFrame, options: UpdateOptions, progress: Progress) -> _Update:
    """Let masses at nodes change where targets are likelier so, and tell of a node for sure.

    With and without them, each is as likely before. Some at all nodes, none of them sure, stand for other changes than
    the prior of the stiffness has, as of a single element: they are not taken for masses.
    """
    basis = problem.basis
    if basis is None or not basis.at_nodes:
        return _solve_with_masses(problem, frame, options, progress)
    without = replace(problem, basis=basis.without(list(basis.at_nodes)))
    unloaded = _solve_with_masses(without, frame, options, progress)
    if not _promises_masses(problem, basis, frame, unloaded):
        return unloaded
    loaded = _solve_with_masses(problem, frame, options, progress)
    if unloaded.has_converged and not loaded.has_converged:  # its evidence is not that of the likeliest change
        return unloaded
    return loaded if len(loaded.local_masses) and loaded.log_evidence > unloaded.log_evidence else unloaded


def _promises_masses(problem: UpdateProblem, basis: ParameterBasis, frame: ModalFrame, unloaded: _Update) -> bool:
    """Tell whether masses at nodes would make the targets likelier, to first order about an update without them.

    All else stays as likely as it is. What data ask of masses shows in the cost of the change that took their place.
    """
    result = unloaded.posterior.stiffness_result
    others = [place for place in range(len(basis.names)) if place not in basis.at_nodes]
    of_nodes = _stiffness_phase(replace(problem, basis=replace(basis, regions=()).without(others)), frame)
    slopes = of_nodes.slopes(np.zeros(len(of_nodes.basis.names)), result.tracked)
    (term,) = of_nodes.terms
    further = term.by_whitened(slopes) * term.std
    return gain_of_further_terms(result.linear, further, result.scales[:-1], float(result.scales[-1])) > 0.0


def _solve_with_masses(
    problem: UpdateProblem, frame: ModalFrame, options: UpdateOptions, progress: Progress
) -> _Update:
    """Leave out masses of sensors that would have to be less than nothing.

    A prior that is symmetric about 0 allows them, and where a change of the stiffness is less likely than many of them
    together, they take its place: poles and zeros are met, and the FRFs at other points are not.
    """
    while True:
        update_of = _solve(problem, frame, options, progress)
        basis = problem.basis
        if basis is None or not basis.attached:
            return update_of
        attached, rng = np.array(basis.attached), np.random.default_rng(options.seed)
        drawn = draw_whitened(update_of.posterior, rng, max(options.ensemble, LEAST_DRAWS))
        below = attached[surely_below(parameters_of(update_of.posterior, drawn)[:, attached])]
        if not len(below):
            return replace(update_of, drawn=(drawn, rng))
        problem = replace(problem, basis=basis.without(below.tolist()))
        del update_of  # before another one takes as much memory


def surely_below(drawn: FloatArray) -> BoolArray:
    """Find masses that are less than nothing: so far that of as many masses of nothing hardly one is by chance.

    Parameters
    ----------
    drawn : (count, n) array
        Of each mass, kg.

    Returns
    -------
    (n,) bool array
        True where it is.
    """
    return np.asarray(np.mean(drawn, axis=0) < ndtri(CHANCE / drawn.shape[1]) * np.std(drawn, axis=0))


def _solve(
    problem: UpdateProblem,
    frame: ModalFrame,
    options: UpdateOptions,
    progress: Progress,
    *,
    start: _Update | None = None,
) -> _Update:
    """Bring stiffness and damping to the targets, from the nominal model or from an update that went before."""
    phase = _stiffness_phase(problem, frame)
    before = None if start is None else start.posterior.stiffness_result
    theta = np.zeros(len(phase.basis.names)) if before is None else before.theta
    roots = phase.named_roots(theta, problem.computed)
    stated = _change_by_damping(problem.computed, roots)
    # a zero that is there by damping only tells nothing of stiffness
    of_damping = np.where(np.abs(stated) > OF_DAMPING, UNKNOWN_STD**2, 0.0)
    phase = replace(phase, targets=phase.targets - stated, noise=phase.noise.plus(of_damping))
    excluded, likely = contradicted_targets(phase, roots, theta)
    is_excluded = np.isin(np.arange(len(phase.target_roots.frf)), excluded)
    phase = replace(phase, noise=phase.noise.plus(np.where(is_excluded, EXCLUDED_STD**2, 0.0)))
    result = iterate(
        phase,
        roots,
        start=None if before is None else before.whitened,
        likely=likely if before is None else before.scales[:-1],
        max_iterations=options.max_iterations,
    )
    progress(0.5, "damping")
    inner = modal_frame(*phase.matrices(result.theta))
    damping = _damping_phase(problem, frame, inner, phase, result, of_damping)
    damped = iterate(damping, damping.initial_roots(), start=damping.start())
    history = [*_rows("stiffness", result), *_rows("damping", damped)]
    shift = _change_by_damping(damped.tracked.values(len(stated)), result.tracked) - stated
    if np.any(np.abs(shift) > SHIFTED * np.sqrt(result.noise.variance)):
        phase = replace(phase, targets=phase.targets - shift, noise=phase.noise.plus((shift / 2) ** 2))
        result = iterate(
            phase,
            result.tracked,
            start=result.whitened,
            scales=result.scales,
            max_iterations=options.max_iterations,
        )
        history += _rows("stiffness with damping", result)
    posterior = Posterior(
        frame=frame,
        stiffness=phase,
        stiffness_result=result,
        inner=inner,
        damping=damping,
        damping_result=damped,
    )
    earlier = () if start is None else start.history
    return _Update(problem=problem, posterior=posterior, history=(*earlier, *history), excluded=excluded)


def _rows(phase: str, result: PhaseResult) -> list[dict[str, str | float]]:
    """Rows of the history: results of phases that were done again take too much memory."""
    return [{"phase": phase, **row} for row in result.rows]


def _values_before(update_of: _Update) -> ComplexArray:
    """Give the targets in the nominal model, followed from the updated one on a straight line."""
    phase, result = update_of.posterior.stiffness, update_of.posterior.stiffness_result
    problem, tracked = update_of.problem, result.tracked
    for share in np.linspace(1.0, 0.0, STEPS_BACK + 1)[1:]:
        tracked = track(phase.target_roots, tracked, *phase.matrices(share * result.theta))
    damping = update_of.posterior.frame.to_modal(problem.model.damping)
    mass, stiffness = phase.matrices(0.0 * result.theta)
    return with_damping(phase.target_roots, tracked, mass, damping, stiffness).values(len(problem.values))


def _change_by_damping(damped: ComplexArray, undamped: TrackedRoots) -> FloatArray:
    """Change of the logarithms of the moduli by damping."""
    return np.asarray(np.log(np.abs(damped)) - log_moduli(undamped, len(damped)))


def _stiffness_phase(problem: UpdateProblem, frame: ModalFrame) -> StiffnessPhase:
    basis = generic_basis(problem.model) if problem.basis is None else problem.basis
    size = np.abs(problem.values)
    # d ln|s| = (Re s d Re s + Im s d Im s) / |s|^2
    gradient = np.stack([problem.values.real, problem.values.imag], axis=1) / size[:, None] ** 2
    return StiffnessPhase(
        eigenvalues=frame.eigenvalues,
        basis=basis,
        by_stiffness=factorise(basis.stiffness, frame.shapes),
        by_mass=factorise(basis.mass, frame.shapes),
        target_roots=TargetRoots(frf=problem.frf, rows=_modal_rows(problem, frame)),
        targets=np.log(size),
        noise=project(problem.covariance, gradient).plus(np.full(len(size), SMALLEST_NOISE**2)),
        changes_mass=bool(np.any(basis.mass)),
    )


def _damping_phase(
    problem: UpdateProblem,
    frame: ModalFrame,
    inner: ModalFrame,
    phase: StiffnessPhase,
    result: PhaseResult,
    of_damping: FloatArray,
) -> DampingPhase:
    rows = phase.target_roots.rows.items()
    real_part = np.tile([-1.0, 0.0], (len(problem.values), 1))
    # what shapes leave of a modulus they leave of the real part: an error of a complex number has no direction
    of_shapes = result.error**2
    return damping_phase(
        phase.basis,
        frame.shapes @ inner.shapes,
        inner,
        TargetRoots(
            frf=problem.frf, rows={number: (out @ inner.shapes, force @ inner.shapes) for number, (out, force) in rows}
        ),
        inner.to_modal(frame.to_modal(problem.model.damping + _damping_by_stiffness(phase, result.theta))),
        _dashpots(problem, frame, inner),
        problem.values,
        project(problem.covariance, real_part).plus((of_damping + of_shapes) * np.abs(problem.values) ** 2),
        1j * np.sqrt(result.tracked.values(len(problem.values))),
    )


def _dashpots(problem: UpdateProblem, frame: ModalFrame, inner: ModalFrame) -> FloatArray:
    """Dampers of the model, which are no damping of its modes, in the inner coordinates."""
    dashpots = problem.model.dashpots
    return inner.to_modal(frame.to_modal(dashpots)) if dashpots.size else np.zeros((len(inner.eigenvalues),) * 2)


def _damping_by_stiffness(phase: StiffnessPhase, theta: FloatArray) -> FloatArray:
    """Damping of parameters that the stiffness phase has fixed: a joint that is both a spring and a damper."""
    fixed = np.any(phase.basis.stiffness != 0, axis=(1, 2)) | np.any(phase.basis.mass != 0, axis=(1, 2))
    return np.asarray(np.tensordot(phase.basis.amounts(theta) * fixed, phase.basis.damping, 1))


def _modal_rows(problem: UpdateProblem, frame: ModalFrame) -> dict[int, tuple[FloatArray, FloatArray]]:
    pairs = {number: problem.rows(number) for number in problem.frfs}
    return {number: (output @ frame.shapes, force @ frame.shapes) for number, (output, force) in pairs.items()}


def _updated(update_of: _Update, options: UpdateOptions) -> UpdatedModel:
    problem, posterior = update_of.problem, update_of.posterior
    drawn, rng = update_of.drawn or (None, np.random.default_rng(options.seed))
    if drawn is not None and len(drawn) != options.ensemble:
        drawn, rng = None, np.random.default_rng(options.seed)
    ensemble, draws = draw_ensemble(posterior, rng, options.ensemble, drawn=drawn)
    return UpdatedModel(
        model=update_of.model,
        nominal=problem.model,
        method="minimal-change",
        status=UpdateStatus.CONVERGED if update_of.has_converged else UpdateStatus.MAX_ITERATIONS,
        history=pd.DataFrame(list(update_of.history)),
        before=problem.computed,
        after=update_of.values,
        ensemble=ensemble,
        unmet=unmet_targets(posterior.stiffness_result, problem.names, update_of.excluded),
        warnings=local_mass_notes(update_of.local_masses, n_without_counterpart=problem.n_without_counterpart),
        masses=update_of.local_masses,
        parts=_parts(posterior.stiffness.basis, posterior.stiffness_result.theta, draws),
    )


def _parts(basis: ParameterBasis, theta: FloatArray, draws: FloatArray) -> pd.DataFrame:
    """Change of each part; empty for parameters without a location."""
    count = len(basis.regions)
    if not count:
        return pd.DataFrame()
    return part_table(basis.regions, 1 + basis.amounts(theta)[:count], 1 + basis.amounts(draws)[:, :count])
