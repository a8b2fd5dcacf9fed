"""The nuisance prior learnt from states before: corrections of the model, and scatter although nothing changed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import BoolArray, FloatArray
from frf_ipz.diagnosis.compare.corrected_model import correct_model
from frf_ipz.diagnosis.compare.states import MachineState
from frf_ipz.diagnosis.compare.unexplained_change import UnexplainedPart, discount_unexplained, find_unexplained_part
from frf_ipz.diagnosis.evidence.inference_problem import make_data, pose_problem
from frf_ipz.diagnosis.evidence.map_fit import fit_map
from frf_ipz.diagnosis.measured.data_split import DataSplit, split_data
from frf_ipz.diagnosis.model.nuisance import UNIFORM_STD
from frf_ipz.diagnosis.search.component_search import fit_null_model
from frf_ipz.diagnosis.verdict.goodness import assess_goodness
from frf_ipz.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from frf_ipz.diagnosis.compare.states import CompareOptions
    from frf_ipz.diagnosis.evidence.fit import Fit
    from frf_ipz.diagnosis.evidence.hypothesis import Hypothesis
    from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem
    from frf_ipz.diagnosis.model.modes import Modes
    from frf_ipz.diagnosis.model.nuisance import NuisancePrior
    from frf_ipz.diagnosis.options import DiagnoseOptions
    from frf_ipz.structure import StructuralModel

ENOUGH_REPEATS = 3  # states: fewer show no scatter
ENOUGH_STATES = 0.9  # of the states before that must be explained by what was learnt
ENOUGH_FOR_MEDIANS = 10  # states
NORMAL_OF_MEDIAN = 1.4826  # standard deviation over the median distance from the median
COARSER = 4.0  # errors of fits to the states before, from try to try
GROWTH = 1.6  # of the tolerance from try to try
MAX_TOLERANCE = 0.3
MAX_ERROR = 0.05  # tolerance of fits to the states before: beyond, it is no matter of tolerances
NEAR_A_PEAK = 3.0  # standard deviations of a frequency: a mode may start so far from a peak of the measurement
MAX_START = 1.5  # standard deviations of a damping ratio


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LearntNuisance:
    """What was learnt from the states before.

    Parameters
    ----------
    correction : (n_nuisance,) array
        Of the model, in standard deviations of `options.model`; signs of modes are those at the first sensor.
    gains : mapping of str to float
        Of the channels, as factors.
    scatter : DiagnoseOptions
        Tolerances within which nothing has changed.
    unexplained_part : UnexplainedPart, optional
        What the model cannot follow whatever is corrected; None where it follows all within `options.scatter`.
    """

    correction: FloatArray
    gains: Mapping[str, float]
    scatter: DiagnoseOptions
    unexplained_part: UnexplainedPart | None


def learn(before: Sequence[MachineState], options: CompareOptions) -> LearntNuisance:
    """Fit the states before, and measure their scatter.

    Parameters
    ----------
    before : sequence of MachineState
        Healthy ones; of three and more the scatter is learnt.
    options : CompareOptions
        What the model may be wrong by, and what differs from test to test at least.

    Returns
    -------
    LearntNuisance
        For `predict_unchanged_model`.

    Raises
    ------
    InputError
        If there is no state, or states do not show the same channels.
    """
    if not before:
        raise InputError("there is no state before to compare with; give at least one")
    sources = [split_data(state.observed) for state in before]
    fits, errors = _fit_states(list(zip(before, sources, strict=True)), options)
    if len({fit.hypothesis.context.layout.channels for fit in fits}) > 1:
        raise InputError("the states to compare were measured with different channels; give FRFs of the same labels")
    if len({len(fit.nuisance) for fit in fits}) > 1:
        raise InputError("the models of the states have different numbers of modes in the band; narrow the band")
    corrections = np.array([fit.nuisance * find_mode_signs(fit) for fit in fits])
    gains = np.array([fit.hypothesis.nuisance_prior.unpack(fit.nuisance).gains for fit in fits])
    by_channel = dict(zip(fits[0].hypothesis.context.layout.channels, np.exp(np.median(gains, 0)), strict=True))
    learnt = LearntNuisance(
        correction=np.median(corrections, 0),
        gains=by_channel,
        scatter=_estimate_scatter(fits, options.scatter),
        unexplained_part=None
        if errors == options.scatter
        else find_unexplained_part([state.observed.frfs for state in before], fits),
    )
    return _widen_tolerance(before, sources, learnt, options)


def _fit_states(
    before: Sequence[tuple[MachineState, DataSplit]], options: CompareOptions
) -> tuple[list[Fit], DiagnoseOptions]:
    """Fit the models, as closely as nearly all of them can follow what was measured."""
    errors = options.scatter
    while True:
        problems = [pose_state_problem(state, source, options.model, errors) for state, source in before]
        fits = [fit_from_peaks(problem, source) for problem, (_, source) in zip(problems, before, strict=True)]
        are_good = [assess_goodness(problem, fit).is_good for problem, fit in zip(problems, fits, strict=True)]
        if np.mean(are_good) >= ENOUGH_STATES or errors.stiffness_tolerance > MAX_ERROR:
            return fits, errors
        errors = replace(errors, stiffness_tolerance=COARSER * errors.stiffness_tolerance)


def fit_from_peaks(problem: InferenceProblem, source: DataSplit) -> Fit:
    """Fit the model from the frequencies and damping that peaks of the measurement show: a model may be far off.

    Parameters
    ----------
    problem : InferenceProblem
        To fit the model.
    source : DataSplit
        What was measured.

    Returns
    -------
    Fit
        The better one of the fits from there and from the nominal model.
    """
    null, nuisance_prior, peaks = problem.make_hypothesis(()), problem.nuisance_prior, source.survey.resonances
    modes = null.modes(np.zeros(0), np.zeros(nuisance_prior.size))
    start = np.zeros(nuisance_prior.size)
    for mode in range(nuisance_prior.n_rigid, nuisance_prior.n_modes):
        distance = np.abs(np.log(peaks.omega_rad_s / modes.omega[mode]))
        reach = NEAR_A_PEAK * nuisance_prior.kappa_std[mode, mode] / 2
        if distance.size and distance.min() < reach:
            nearest = int(np.argmin(distance))
            off = (peaks.omega_rad_s[nearest] / modes.omega[mode]) ** 2 - 1
            start[nuisance_prior.frequency_indices[mode]] = off / nuisance_prior.kappa_std[mode, mode]
            ratio = peaks.decay_1_s[nearest] / peaks.omega_rad_s[nearest] / max(modes.stated_ratio[mode], 1e-9) - 1
            damping = nuisance_prior.damping_std[mode]
            start[nuisance_prior.damping_indices[mode]] = np.clip(ratio / damping, -MAX_START, MAX_START)
    fits = [fit_map(null, problem.data, np.zeros(0), nuisance=start, iterations=30), fit_null_model(problem)]
    return min(fits, key=lambda fit: fit.cost)


def pose_state_problem(
    state: MachineState, source: DataSplit, options: DiagnoseOptions, errors: DiagnoseOptions | None = None
) -> InferenceProblem:
    """Pose the inference problem of a state, with no effects to search for.

    Parameters
    ----------
    state : MachineState
        The state.
    source : DataSplit
        What was measured in it.
    options : DiagnoseOptions
        Tolerances.
    errors : DiagnoseOptions, optional
        Those that say how close to the measurement a fit has to come, where they are narrower.

    Returns
    -------
    InferenceProblem
        To fit the model.
    """
    frfs = state.observed.frfs
    scale = "none" if frfs is None else frfs.unknown_scale
    problem = pose_problem(state.fe_model, source, state.observed.band_hz, options, {}, free_gains=scale)
    if errors is None:
        return problem
    return replace(problem, data=make_data(source.training, errors, free_gains=scale))


def predict_unchanged_model(
    state: MachineState, learnt: LearntNuisance, options: CompareOptions, source: DataSplit
) -> StructuralModel:
    """Predict the model of a state if nothing had changed.

    Parameters
    ----------
    state : MachineState
        With a model of the same modes as the states before.
    learnt : LearntNuisance
        From them.
    options : CompareOptions
        As for `learn`.
    source : DataSplit
        What was measured in the state.

    Returns
    -------
    StructuralModel
        Its model, corrected.
    """
    problem = pose_state_problem(state, source, options.model)
    null = problem.make_hypothesis(())
    no_nuisance = np.zeros(problem.nuisance_prior.size)
    if len(no_nuisance) != len(learnt.correction):
        raise InputError("the state after has other channels or another number of modes in the band than those before")
    signs = _signs(null.modes(np.zeros(0), no_nuisance), null.nuisance_prior)
    return correct_model(null, learnt.correction * signs)


def estimate_change_error(
    corrected: MachineState, source: DataSplit, learnt: LearntNuisance, options: CompareOptions
) -> float:
    """Estimate how wrong the model's answer to a change may be: its corrections are those of the states before.

    Parameters
    ----------
    corrected : MachineState
        The state after, with its corrected model.
    source : DataSplit
        What was measured in it.
    learnt : LearntNuisance
        From the states before.
    options : CompareOptions
        As for `learn`.

    Returns
    -------
    float
        Largest relative change of a frequency in the band, times what the model may be wrong by.
    """
    fit = fit_from_peaks(pose_state_problem(corrected, source, options.model, learnt.scatter), source)
    change = _frequency_change(fit.hypothesis, fit.nuisance)
    return options.model.stiffness_tolerance * float(np.abs(change).max(initial=0.0))


def _frequency_change(hypothesis: Hypothesis, nuisance: FloatArray) -> FloatArray:
    """Relative change of the elastic frequencies in the band by what was fitted."""
    nuisance_prior = hypothesis.nuisance_prior
    modes = hypothesis.modes(np.zeros(0), nuisance)
    squares, omega = (
        values[nuisance_prior.n_rigid : nuisance_prior.n_modes] for values in (modes.squares, modes.omega)
    )
    inside = _mask_modes_in_band(hypothesis)
    return np.asarray(np.sqrt(np.abs(squares[inside])) / omega[inside] - 1)


def _mask_modes_in_band(hypothesis: Hypothesis) -> BoolArray:
    """Mask the elastic modes in the band: nothing is known of the rest."""
    nuisance_prior = hypothesis.nuisance_prior
    modes = hypothesis.modes(np.zeros(0), np.zeros(nuisance_prior.size))
    frequency = modes.omega[nuisance_prior.n_rigid : nuisance_prior.n_modes] / (2 * np.pi)
    low, high = hypothesis.context.band_hz
    return np.asarray((frequency > low) & (frequency < high))


def find_mode_signs(fit: Fit) -> FloatArray:
    """Signs of the parameters between two modes: those of the shapes at the first sensor, for modes have none.

    Parameters
    ----------
    fit : Fit
        Without a component.

    Returns
    -------
    (n_nuisance,) array
        1 or -1.
    """
    nuisance_prior = fit.hypothesis.nuisance_prior
    modes = fit.hypothesis.modes(fit.values, np.zeros(nuisance_prior.size))
    return _signs(modes, nuisance_prior)


def _signs(modes: Modes, nuisance_prior: NuisancePrior) -> FloatArray:
    shape_signs = np.where(modes.outputs[0, : nuisance_prior.n_modes] < 0, -1.0, 1.0)
    rows, columns = nuisance_prior.pairs
    signs, blocks = np.ones(nuisance_prior.size), nuisance_prior.blocks
    signs[blocks.stiffness] = signs[blocks.mass] = shape_signs[rows] * shape_signs[columns]
    signs[blocks.coupling] = (shape_signs[rows] * shape_signs[columns])[nuisance_prior.is_coupled]
    return signs


def _estimate_scatter(fits: Sequence[Fit], stated: DiagnoseOptions) -> DiagnoseOptions:
    """Tolerances of frequencies, damping and gains that repeated states show, or those stated where they are larger."""
    n = len(fits)
    if n < ENOUGH_REPEATS:
        return stated
    frequency = np.array([_frequency_change(fit.hypothesis, fit.nuisance) for fit in fits])
    nuisance_values = [fit.hypothesis.nuisance_prior.unpack(fit.nuisance) for fit in fits]
    elastic = slice(fits[0].hypothesis.nuisance_prior.n_rigid, None)
    inside = _mask_modes_in_band(fits[0].hypothesis)
    damping = np.array([np.log1p(nuisance.damping)[elastic][inside] for nuisance in nuisance_values])
    gains = np.array([nuisance.gains for nuisance in nuisance_values])
    wider = np.sqrt(1 + 1 / n) / UNIFORM_STD  # the mean that they are compared with is not exact either
    return replace(
        stated,
        frequency_tolerance=max(stated.frequency_tolerance, wider * _std_over_states(frequency)),
        damping_tolerance=max(stated.damping_tolerance, wider * _std_over_states(damping)),
        gain_tolerance=max(stated.gain_tolerance, wider * _std_over_states(gains)),
    )


def _std_over_states(values: FloatArray) -> float:
    """Give the standard deviation over states, of all columns together; by the median, for a state may be a bad one."""
    n, columns = values.shape
    if not columns:
        return 0.0
    if n < ENOUGH_FOR_MEDIANS:
        return float(np.sqrt(np.mean(values.var(0, ddof=1))))
    distance = np.abs(values - np.median(values, 0))
    return float(np.sqrt(np.mean((NORMAL_OF_MEDIAN * np.median(distance, 0)) ** 2)))


def _widen_tolerance(
    before: Sequence[MachineState], sources: Sequence[DataSplit], learnt: LearntNuisance, options: CompareOptions
) -> LearntNuisance:
    """Widen the tolerance of the model until nothing has changed in the states before, by the rules for those after."""
    nominals = [
        MachineState(
            fe_model=predict_unchanged_model(state, learnt, options, source),
            observed=discount_unexplained(state.observed, learnt.gains, learnt.unexplained_part),
        )
        for state, source in zip(before, sources, strict=True)
    ]
    sources = [split_data(state.observed) for state in nominals]
    scatter = learnt.scatter
    while scatter.stiffness_tolerance < MAX_TOLERANCE:
        are_explained = [_is_explained(state, source, scatter) for state, source in zip(nominals, sources, strict=True)]
        if np.mean(are_explained) >= ENOUGH_STATES:
            break
        scatter = replace(scatter, stiffness_tolerance=GROWTH * scatter.stiffness_tolerance)
    return replace(learnt, scatter=scatter)


def _is_explained(state: MachineState, source: DataSplit, scatter: DiagnoseOptions) -> bool:
    problem = pose_state_problem(state, source, scatter)
    return assess_goodness(problem, fit_from_peaks(problem, source)).is_good
