"""Scores of many shapes at one location: those of the changes one by one."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosed import beam, labels, lumped, measured, problem_of
from frf_ipz.diagnosis.evidence.hypothesis import Component
from frf_ipz.diagnosis.evidence.inference_problem import make_data
from frf_ipz.diagnosis.model.change import with_change
from frf_ipz.diagnosis.model.nuisance import EDGE
from frf_ipz.diagnosis.search.component_search import fit_null_model
from frf_ipz.diagnosis.search.score_tests import prepare_score_test, run_score_test

EXACT = 1e-8  # relative: sums of products of some thousand values
N_SHAPES, N_SHARED = 7, 3
LIGHT = 1e-3  # damping ratio: half the width of a peak
JOINT, STIFFER = np.array([5e4, 0.01]), np.array([1.3])  # N/m and s, and a ratio
ROUGHLY = 0.3  # relative: a linear step beside a first effect that moves far
PREDICTED = 0.1  # relative: a linear step of what shifts a peak by some widths


@pytest.fixture(scope="module")
def base(tmp_path_factory):
    model = beam(tmp_path_factory.mktemp("beam"))
    problem = problem_of(model, measured(model, labels(inputs=("6:+z", "12:+z"))), ("added_mass",))
    return problem, fit_null_model(problem)


def with_shared_errors(data, rng):
    """Let FRFs of each excited point share errors, as noise of its force does."""
    blocks = []
    for index in np.unique(data.measured.input_index):
        frfs = np.flatnonzero(data.measured.input_index == index)
        columns = rng.standard_normal((len(frfs) * 2 * len(data.measured.s), N_SHARED))
        blocks.append((frfs, np.linalg.qr(columns)[0], rng.uniform(0.1, 0.9, N_SHARED)))
    return replace(data, whitening=replace(data.whitening, blocks=tuple(blocks)))


@pytest.mark.parametrize("free_gains", ["none", "common", "per_channel"])
@pytest.mark.parametrize("is_shared", [False, True])
def test_shapes_are_scored_together_as_they_are_one_by_one(base, free_gains, is_shared):
    problem, fit = base
    rng = np.random.default_rng(5)
    data = make_data(problem.sparse_data.measured, problem.context.options, free_gains=free_gains)
    test = prepare_score_test(problem, fit, with_shared_errors(data, rng) if is_shared else data)
    n_points, n_frfs = test.response.values.shape
    drawn = rng.standard_normal((2, n_points, n_frfs))
    across = test.response.values * (drawn[0] + 1j * drawn[1])
    shapes = rng.standard_normal((N_SHAPES, n_points)) + 1j * rng.standard_normal((N_SHAPES, n_points))
    ((_, together),) = test.sum_over_points().score_all(across[:, :, None], [0], [shapes])
    one_by_one = test.score_changes(np.stack([across * shape[:, None] for shape in shapes], 2))
    for values, expected in zip(together, one_by_one, strict=True):
        np.testing.assert_allclose(values, expected, rtol=EXACT, atol=0)


@pytest.mark.parametrize("force_N", [-12, 12])
def test_what_a_step_promises_is_gained_though_the_nuisance_hides_it_beyond_its_tolerances(tmp_path, force_N):
    """Peaks are so sharp that a force shifts them by several widths, and frequencies make up for it."""
    model = beam(tmp_path, right="clamped", damping=LIGHT)
    places = labels(("5:+z", "9:-z"))
    nominal = problem_of(model, measured(model, places), ("axial_load",))
    effect = nominal.effects["axial_load"]
    change = effect.build(nominal.context, effect.locations(nominal.context)[0])(np.array([force_N]))
    problem = problem_of(model, measured(with_change(model, change), places), ("axial_load",))
    null = fit_null_model(problem)
    assert null.is_nearly_right
    assert np.abs(null.nuisance[problem.nuisance_prior.frequency_indices]).max() > EDGE
    (start,) = run_score_test(problem, null)
    fit = problem.fit((start.component,), start.values)
    assert start.values == pytest.approx(fit.values, rel=PREDICTED)
    assert start.cost == pytest.approx(fit.cost - null.cost, rel=PREDICTED)


def test_a_second_effect_is_promised_that_the_first_one_stands_for_too(tmp_path):
    """A stiffer joint is nearly a stiffer spring: what it changes is seen once the first one's values may move."""
    model = lumped(tmp_path)
    names = labels(("1:+x", "3:+x"), ("2:+x",))
    nominal = problem_of(model, measured(model, names), ("viscoelastic_joint", "local_stiffness"))
    across = {
        name: next(place for place in effect.locations(nominal.context) if place.springs == ("k2",))
        for name, effect in nominal.effects.items()
    }
    joint, spring = (
        Component(effect=nominal.effects[name], location=across[name], n_locations=3)
        for name in ("viscoelastic_joint", "local_stiffness")
    )
    changes = [
        component.effect.build(nominal.context, component.location)(values)
        for component, values in ((joint, JOINT), (spring, STIFFER))
    ]
    true = with_change(model, changes[0] + changes[1])
    problem = problem_of(model, measured(true, names), tuple(nominal.effects))
    base = problem.fit((joint,), JOINT)
    both = problem.fit((joint, spring), np.concatenate([JOINT, STIFFER]))
    promised = next(start for start in run_score_test(problem, base) if start.component.key == spring.key)
    assert promised.cost == pytest.approx(both.cost - base.cost, rel=ROUGHLY)
