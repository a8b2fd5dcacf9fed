"""Score test of small effects on a fit that is nearly right: what each promises beyond what the nuisance explains.

A small effect changes the FRFs in proportion to its size, so that one projection gives the best size and the evidence
of each, at every location. The signatures of effects that are one dynamic stiffness on one motion are scored together.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from frf_ipz.diagnosis.model.nuisance import UNIFORM_STD
from frf_ipz.diagnosis.model.response import nuisance_jacobian
from frf_ipz.diagnosis.search.global_scan import (
    MOTIONS_AT_ONCE,
    evaluate_receptances,
    group_readings,
    list_components,
    read_elsewhere,
    show_components,
)
from frf_ipz.diagnosis.search.places import search_places
from frf_ipz.diagnosis.search.robust_refinement import Start
from frf_ipz.numerics.least_squares import cholesky_with_prior

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.diagnosis.catalogue.effect import Parameter, Reading, Signature
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.evidence.fit import Data, Fit
    from frf_ipz.diagnosis.evidence.hypothesis import Component, Hypothesis
    from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem
    from frf_ipz.diagnosis.model.response import Response

BATCH_SIZE = 600  # signatures that are scored together
LOCATIONS_AT_ONCE = 16  # whose many shapes are scored together: keeps arrays within some ten MB
NEGLIGIBLE_FUNCTION = 1e-10  # of the largest: what shapes along the contour have of it is rounding
SMALL_STEP = 1e-6  # of a neutral value, or of a range, to both sides: so near, even the sharpest peak is linear
PARAMETER_STEP = 1e-6  # as searched, to both sides
MAX_SCALING = 3.0  # times the size that a signature stands for, where its sizes are fixed
VANISHING_RATIO = 1.5  # times: the FRFs change by more at the doubled parameter, if an effect vanishes with it


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ScoreTest:
    """Scores changes of the FRFs on top of a fit, projected on what the nuisance cannot explain.

    Parameters
    ----------
    problem : InferenceProblem
        Model and effects.
    base : Fit
        The fit to build on.
    data : Data
        What is scored against.
    misfit : (n_data,) array
        Whitened misfit of the base, as it would be without its nuisance.
    columns : (n_data, n_nuisance) array
        Whitened derivatives of the FRFs by the whitened nuisance parameters.
    factor : (n_nuisance, n_nuisance) array
        Lower Cholesky factor of their curvature with its prior.
    by_nuisance : (n_data,) array
        What the nuisance of the base changes of the whitened FRFs.
    response : Response
        Of the base.
    """

    problem: InferenceProblem
    base: Fit
    data: Data
    misfit: FloatArray
    columns: FloatArray
    factor: FloatArray
    by_nuisance: FloatArray
    response: Response
    _shape_scores: list[ShapeScores] = field(init=False, default_factory=list, repr=False)

    def change(self, hypothesis: Hypothesis, values: FloatArray) -> ComplexArray:
        """Change of the FRFs by some values, with the nuisance of the base."""
        searched = hypothesis.clip_to_searched(np.concatenate([self.base.values, values]))
        response = hypothesis.respond(hypothesis.to_physical(searched), self.base.nuisance, self.data.measured.s)
        return np.asarray(response.values - self.response.values)

    def gain_at(self, hypothesis: Hypothesis, values: FloatArray) -> float:
        """Gain in log-likelihood at some values: half the fall of the sum of squares."""
        searched = hypothesis.clip_to_searched(np.concatenate([self.base.values, values]))
        response = hypothesis.respond(hypothesis.to_physical(searched), self.base.nuisance, self.data.measured.s)
        return float(self.gains_of(response.values[:, :, None])[0])

    def gains_of(self, values: ComplexArray) -> FloatArray:
        """Gains in log-likelihood of FRFs instead of those of the base: half the fall of the sum of squares.

        Parameters
        ----------
        values : (n_points, n_frfs, n) complex array
            FRFs with the nuisance of the base.

        Returns
        -------
        (n,) array
            The nuisance is fitted by one step.
        """
        own = self.misfit[:, None]
        return np.asarray(0.5 * (self._squares(own) - self._squares(self.without_nuisance(values))))

    def costs_of(self, values: ComplexArray) -> FloatArray:
        """Half the sums of squares that FRFs, (n_points, n_frfs, n), leave beside one step of the nuisance, (n,)."""
        return np.asarray(0.5 * self._squares(self.without_nuisance(values)))

    def without_nuisance(self, values: ComplexArray) -> FloatArray:
        """Whitened misfits of FRFs with the nuisance of the base, as they would be without it, (n_data, n) array."""
        return np.asarray(self.data.misfits(values) + self.by_nuisance[:, None])

    def explained_by_nuisance(self, misfits: FloatArray) -> FloatArray:
        """Give what the nuisance explains of misfits, (n_data, n): (n_nuisance, n) array; its squares are taken off."""
        explained = linalg.solve_triangular(self.factor, self.columns.T @ misfits, lower=True, check_finite=False)
        return np.asarray(explained)

    def score_changes(self, changes: ComplexArray) -> tuple[FloatArray, FloatArray]:
        """Find the best sizes of changes, and the gain of each.

        Parameters
        ----------
        changes : (n_points, n_frfs, n) complex array
            Of the FRFs, for size 1.

        Returns
        -------
        sizes, gains : (n,) array
            Sizes may be negative; gains in log-likelihood.
        """
        white = self.data.slopes(self.response, changes)
        explained = self.explained_by_nuisance(white)
        misfit_explained = self.explained_by_nuisance(self.misfit[:, None])[:, 0]
        return _best_sizes(
            self.misfit @ white - misfit_explained @ explained, np.sum(white**2, 0), np.sum(explained**2, 0)
        )

    def sum_over_points(self) -> ShapeScores:
        """Prepare scores of changes that are one function of FRFs and point times many of the point alone.

        All that a score needs of a whitened change are products with columns of which there are as many as nuisance
        parameters, and its own square: both are sums over points, whose terms are known before the changes are.
        """
        if not self._shape_scores:
            self._shape_scores.append(self._sum_over_points())
        return self._shape_scores[0]

    def _sum_over_points(self) -> ShapeScores:
        whitening, n_points = self.data.whitening, len(self.data.measured.s)
        explaining = linalg.solve_triangular(self.factor, self.columns.T, lower=True, check_finite=False).T
        columns, by_gains = np.column_stack([explaining, self.misfit]), self.data.gain_directions(self.response)
        rows = whitening.transposed(np.hstack([columns - by_gains @ (by_gains.T @ columns), by_gains]))
        rows = np.concatenate([rows, whitening.shared_rows()], axis=2)
        n_frfs = len(self.data.measured.labels)
        parts = rows.reshape(n_frfs, 2, n_points, -1)
        gains = np.sqrt(2.0) * self.data.gains(self.response)[:, None, None]
        factors = gains * whitening.factors
        return ShapeScores(
            products=np.ascontiguousarray(
                ((parts[:, 0] - 1j * parts[:, 1]).swapaxes(1, 2) @ factors).transpose(2, 1, 0)
            ),
            squares=np.asarray(factors.conj().swapaxes(1, 2) @ factors),
            misfit_explained=self.explained_by_nuisance(self.misfit[:, None])[:, 0],
        )

    def _squares(self, misfits: FloatArray) -> FloatArray:
        """Sum the squares of misfits, (n_data, n), that the nuisance cannot explain."""
        return np.asarray(np.sum(misfits**2, 0) - np.sum(self.explained_by_nuisance(misfits) ** 2, 0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShapeScores:
    """Scores of many shapes along the contour at one location.

    Parameters
    ----------
    products : (n_points, n_rows, n_frfs) complex array
        Of the FRFs: with orthonormal columns of the nuisance, the misfit, and what unknown gains and shared errors take
        off.
    squares : (n_frfs, n_points, n_points) complex array
        Of the FRFs, whitened each by itself.
    misfit_explained : (n_nuisance,) array
        What the nuisance explains of the misfit.
    """

    products: ComplexArray
    squares: ComplexArray
    misfit_explained: FloatArray
    _known: list[tuple[ComplexArray, ComplexArray, FloatArray]] = field(init=False, default_factory=list, repr=False)

    def score_all(
        self, across: ComplexArray, columns: Sequence[int], shapes: Sequence[ComplexArray]
    ) -> Iterator[tuple[int, tuple[FloatArray, FloatArray]]]:
        """Find the best sizes of changes, and the gain of each, as `ScoreTest.score_changes` does one by one.

        Parameters
        ----------
        across : (n_points, n_frfs, n_locations) complex array
            What each shape is multiplied by.
        columns : sequence of int
            Locations to be scored.
        shapes : sequence of (n_shapes, n_points) complex array
            Along the contour, at each location.

        Yields
        ------
        column : int
            A location.
        sizes, gains : (n_shapes,) array
            Sizes may be negative; gains in log-likelihood.
        """
        for begin in range(0, len(columns), LOCATIONS_AT_ONCE):
            some = list(columns[begin : begin + LOCATIONS_AT_ONCE])
            rows = (self.products @ across[:, :, some]).transpose(2, 1, 0)
            for column, of_location in zip(some, rows, strict=True):
                yield column, self._score_location(across[:, :, column], of_location, *self._take_apart(shapes[column]))

    def _score_location(
        self, across: ComplexArray, rows: ComplexArray, basis: ComplexArray, parts: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Score all combinations of a few functions: squares of theirs are quadratic forms of the functions'."""
        n_nuisance = len(self.misfit_explained)
        by_functions = rows @ basis.T
        real_rows = np.hstack([by_functions.real, -by_functions.imag])
        explaining, with_misfit, taken_off = np.split(real_rows, [n_nuisance, n_nuisance + 1])
        by_points = np.einsum("fij,if,jf->ij", self.squares, across.conj(), across, optimize=True)
        between = basis.conj() @ by_points @ basis.T
        whole = np.block([[between.real, -between.imag], [between.imag, between.real]])
        squares = _quadratic(parts, whole - taken_off.T @ taken_off)
        explained = _quadratic(parts, explaining.T @ explaining)
        return _best_sizes(parts @ (with_misfit[0] - self.misfit_explained @ explaining), squares, explained)

    def _take_apart(self, shapes: ComplexArray) -> tuple[ComplexArray, FloatArray]:
        """Write shapes as combinations of few functions, (r, n_points): real and imaginary parts, (n_shapes, 2 r)."""
        for known, basis, parts in self._known:  # the same at all locations
            if known is shapes:
                return basis, parts
        left, sizes, right = linalg.svd(shapes, full_matrices=False, check_finite=False)
        used = sizes > NEGLIGIBLE_FUNCTION * sizes[0]
        combined = left[:, used] * sizes[used]
        self._known.append((shapes, right[used], np.hstack([combined.real, combined.imag])))
        return self._known[-1][1:]


def _quadratic(vectors: FloatArray, matrix: FloatArray) -> FloatArray:
    """Give the quadratic form of each row, (n,) array."""
    return np.asarray(np.sum((vectors @ matrix) * vectors, axis=1))


def _best_sizes(products: FloatArray, squares: FloatArray, explained: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Sizes of changes and their gains: products with the misfit, squares, and what of these the nuisance explains."""
    left = np.maximum(squares - explained, 1e-9 * squares + 1e-300)
    return products / left, 0.5 * products**2 / left


def prepare_score_test(problem: InferenceProblem, base: Fit, data: Data) -> ScoreTest:
    """Prepare scores on top of a fit.

    Parameters
    ----------
    problem : InferenceProblem
        Model and effects.
    base : Fit
        The fit to build on.
    data : Data
        What is scored against.

    Returns
    -------
    ScoreTest
        For any further component.
    """
    response = base.hypothesis.respond(base.values, base.nuisance, data.measured.s)
    jacobian = nuisance_jacobian(response, problem.nuisance_prior, problem.context.layout)
    whitened_nuisance, _ = problem.nuisance_prior.whiten(base.nuisance)
    columns = data.slopes(response, jacobian) / _secants(base.nuisance, whitened_nuisance)
    by_nuisance = columns @ whitened_nuisance
    return ScoreTest(
        problem=problem,
        base=base,
        data=data,
        misfit=data.misfit(response) + by_nuisance,
        columns=columns,
        factor=cholesky_with_prior(columns.T),
        by_nuisance=by_nuisance,
        response=response,
    )


def free_parameters(test: ScoreTest) -> ScoreTest:
    """Let the base's own parameters move along with one more component, as the nuisance does.

    Where one component stands for two, what the second one changes is nearly what a change of the first one's values
    does. The base is best without it: to the misfit itself that is orthogonal, and nothing would be promised.

    Parameters
    ----------
    test : ScoreTest
        With the nuisance alone.

    Returns
    -------
    ScoreTest
        With uniform priors of the parameters within their bounds.
    """
    hypothesis, base = test.base.hypothesis, test.base
    if not hypothesis.parameters:
        return test
    searched, changes = hypothesis.clip_to_searched(base.values), []
    for index in range(len(searched)):
        ends = np.clip(
            searched[index] + np.array([-PARAMETER_STEP, PARAMETER_STEP]), hypothesis.low[index], hypothesis.high[index]
        )
        below, above = (
            hypothesis.respond(
                hypothesis.to_physical(np.concatenate([searched[:index], [end], searched[index + 1 :]])),
                base.nuisance,
                test.data.measured.s,
            ).values
            for end in ends
        )
        changes.append((above - below) / (ends[1] - ends[0]))
    deviations = (hypothesis.high - hypothesis.low) * UNIFORM_STD / 2
    columns = np.hstack([test.columns, test.data.slopes(test.response, np.dstack(changes)) * deviations])
    return replace(
        test,
        columns=columns,
        factor=cholesky_with_prior(columns.T),
    )


def _secants(nuisance: FloatArray, whitened_nuisance: FloatArray) -> FloatArray:
    """Give the slopes of a parabola for the prior of each parameter: through zero and what the base has.

    What one more component explains goes back to zero, from wherever beyond its tolerance it was: the slope there,
    where the prior rises steeply, would say that a small part of the way is enough.
    """
    return np.divide(whitened_nuisance, nuisance, out=np.ones_like(nuisance), where=nuisance != 0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SmallEffects:
    """Scores effects as small ones on top of a fit.

    Parameters
    ----------
    test : ScoreTest
        On fewer points, the base's own parameters free.
    context : ModelContext
        With the contour of these points.
    """

    test: ScoreTest
    context: ModelContext

    def score(self, components: Sequence[Component]) -> list[Start]:
        """Find the best values of components; the cost is minus the gain in log-likelihood.

        Those whose best size is negative are left out.
        """
        shown = show_components(self.context, components)
        return [
            *_score_signatures(self.test, list(zip(*shown.signed, strict=True))),
            *_score_readings(self.test, *shown.read),
            *(_score_directly(self.test, component) for component in shown.unshown),
        ]

    def score_everywhere(self) -> list[Start]:
        """Score all effects at all locations, the most promising first."""
        problem, context = self.test.problem, self.context
        components = [
            component for effect in problem.effects.values() for component in list_components(effect, context)
        ]
        starts = search_places(context, problem.nuisance_prior.n_modes, components, self.score)
        return sorted(starts, key=lambda start: start.cost)


def prepare_small_effects(problem: InferenceProblem, base: Fit) -> SmallEffects:
    """Prepare scores of small effects.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    base : Fit
        The fit to build on, nearly right.

    Returns
    -------
    SmallEffects
        Of any component.
    """
    test = free_parameters(prepare_score_test(problem, base, problem.sparse_data))
    return SmallEffects(test=test, context=replace(problem.context, contour=problem.sparse_data.measured.s))


def run_score_test(problem: InferenceProblem, base: Fit) -> list[Start]:
    """Score all effects at all locations as small ones.

    Parameters
    ----------
    problem : InferenceProblem
        Data and effects.
    base : Fit
        The fit to build on, nearly right.

    Returns
    -------
    list of Start
        The best values of each component, the most promising first; the cost is minus the gain in log-likelihood.
    """
    return prepare_small_effects(problem, base).score_everywhere()


def _score_readings(test: ScoreTest, components: Sequence[Component], readings: Sequence[Reading]) -> list[Start]:
    """Score all channels that read other motions."""
    hypothesis, base = test.base.hypothesis, test.response
    local = hypothesis.nuisance_prior.unpack(test.base.nuisance).local
    starts = []
    for channel, members in group_readings(readings):
        test.problem.deadline.check()
        motions = [readings[member].motion for member in members]
        frfs, values = read_elsewhere(base, hypothesis.basis, hypothesis.context.layout, local, channel, motions)
        all_values = np.repeat(base.values[:, :, None], len(members), 2)
        all_values[:, frfs] = values
        starts += [
            Start(component=components[member], values=np.zeros(0), cost=-gain)
            for member, gain in zip(members, test.gains_of(all_values).tolist(), strict=True)
        ]
    return starts


def _score_signatures(test: ScoreTest, signed: list[tuple[Component, Signature]]) -> list[Start]:
    """Score all shapes of all signatures; keep the best of each."""
    best: dict[int, Start] = {}
    batch: list[tuple[int, int, ComplexArray]] = []
    of_shapes = test.sum_over_points() if any(len(signature.shapes) > 1 for _, signature in signed) else None
    for first in range(0, len(signed), MOTIONS_AT_ONCE):
        test.problem.deadline.check()
        group = signed[first : first + MOTIONS_AT_ONCE]
        motions = [motion for _, signature in group for motion in signature.motions]
        firsts = np.cumsum([0, *(len(signature.motions) for _, signature in group[:-1])])
        hypothesis = test.base.hypothesis
        layout = hypothesis.context.layout
        each = evaluate_receptances(test.response, hypothesis.basis, layout, motions, np.zeros(len(motions))).across
        across = np.add.reduceat(each, firsts, axis=2)
        several = [column for column, (_, signature) in enumerate(group) if len(signature.shapes) > 1]
        if of_shapes is not None:
            for column, scores in of_shapes.score_all(-across, several, [signature.shapes for _, signature in group]):
                indices = [(first + column, shape) for shape in range(len(scores[0]))]
                _keep_best(signed, indices, *scores, best)
        for column in sorted(set(range(len(group))) - set(several)):
            signature = group[column][1]
            batch.append((first + column, 0, -across[:, :, column] * signature.shapes[0][:, None]))
            if len(batch) == BATCH_SIZE:
                _score_batch(test, signed, batch, best)
                batch = []
    if batch:
        _score_batch(test, signed, batch, best)
    return list(best.values())


def _score_batch(
    test: ScoreTest,
    signed: list[tuple[Component, Signature]],
    batch: list[tuple[int, int, ComplexArray]],
    best: dict[int, Start],
) -> None:
    indices = [(index, shape) for index, shape, _ in batch]
    _keep_best(signed, indices, *test.score_changes(np.stack([change for _, _, change in batch], 2)), best)


def _keep_best(
    signed: list[tuple[Component, Signature]],
    indices: list[tuple[int, int]],
    sizes: FloatArray,
    gains: FloatArray,
    best: dict[int, Start],
) -> None:
    """Keep the best shape of each signature, of those whose size is positive."""
    for (index, shape), size, gain in zip(indices, sizes.tolist(), gains.tolist(), strict=True):
        if size > 0 and (index not in best or -gain < best[index].cost):
            component, signature = signed[index]
            values = signature.values[shape].copy()
            if signature.amplitudes is not None and len(signature.amplitudes) == 1:
                values = 1 + (values - 1) * min(size, MAX_SCALING)
            else:
                values[signature.amplitude] *= size
            best[index] = Start(component=component, values=values, cost=-gain)


def _score_directly(test: ScoreTest, component: Component) -> Start:
    """Move the first parameter away from where the effect vanishes, by as much as explains most."""
    hypothesis = test.problem.make_hypothesis((*test.base.hypothesis.components, component), exact=False)
    if not hypothesis.counts[-1]:
        return Start(component=component, values=np.zeros(0), cost=-test.gain_at(hypothesis, np.zeros(0)))
    first, *further = hypothesis.parameters[len(test.base.values) :]
    further_values = [float(np.sqrt(parameter.low * parameter.high)) for parameter in further]
    neutral, values = _smallest_values(first)
    is_between = first.low < first.neutral < first.high
    changed = test.change(hypothesis, np.array([values, *further_values]))
    if is_between:
        changed = 0.5 * (changed - test.change(hypothesis, np.array([2 * neutral - values, *further_values])))
    elif not _vanishes_with_parameter(
        changed, test.change(hypothesis, np.array([_double_effect(first, values), *further_values]))
    ):
        middle = np.array([float(np.sqrt(first.low * first.high)), *further_values])
        return Start(component=component, values=middle, cost=-test.gain_at(hypothesis, middle))
    sizes, gains = test.score_changes(changed[:, :, None])
    size, gain = float(sizes[0]), float(gains[0])
    if is_between:
        step = size * (values - neutral)
        if first.is_log:  # a ratio: a straight line would leave its bounds
            step = neutral * float(np.expm1(min(step / neutral, np.log(first.high / neutral))))
        value = neutral + step
    elif size <= 0:
        value, gain = values, 0.0
    else:
        value = values * size if first.neutral == 0 else values / size
    return Start(
        component=component,
        values=np.array([float(np.clip(value, first.low, first.high)), *further_values]),
        cost=-gain,
    )


def _vanishes_with_parameter(change: ComplexArray, doubled_change: ComplexArray) -> bool:
    """Whether an effect vanishes with its parameter; a sensor of the wrong sign does not."""
    return bool(np.linalg.norm(doubled_change) > VANISHING_RATIO * np.linalg.norm(change))


def _double_effect(parameter: Parameter, value: float) -> float:
    return value / 2 if np.isinf(parameter.neutral) else 2 * value


def _smallest_values(parameter: Parameter) -> tuple[float, float]:
    """Where an effect vanishes, and a value just beside."""
    if np.isinf(parameter.neutral):
        return parameter.neutral, parameter.high
    if parameter.low < parameter.neutral < parameter.high:
        step = SMALL_STEP * (abs(parameter.neutral) or parameter.high - parameter.low)
        return parameter.neutral, parameter.neutral + step
    return parameter.neutral, parameter.low
