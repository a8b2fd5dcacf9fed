"""A measured mode that is hardly found again counts as little in pairs and targets as it is sure."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from frf_ipz.pairing.model_roots import model_poles
from frf_ipz.pairing.pair import pair_roots
from frf_ipz.pairing.poles import pair_poles
from frf_ipz.updating.problem import make_problem
from frf_testbench.updating.study import make_update_case


@pytest.fixture(scope="module")
def case():
    return make_update_case(7)


def with_probability(fit, mode, probability):
    found_again = np.where(np.arange(fit.n_modes) == mode, probability, 1.0)
    return replace(fit, modes=pd.DataFrame({"found_again": found_again}))


def test_the_odds_of_a_pair_are_those_of_the_mode_times_those_of_the_assignment(case):
    model = model_poles(case.reduced_model, case.fit.labels)
    sure, doubtful = (pair_poles(with_probability(case.fit, 0, p), model) for p in (1.0, 0.25))
    partner = sure.matching.partner[0]
    costs = [found.costs[0, partner] for found in (sure, doubtful)]
    assert_allclose(costs[1] - costs[0], -2 * np.log(0.25), rtol=1e-9, atol=0)
    assert doubtful.matching.partner[0] == partner
    odds = [found.probabilities[0, partner] / found.probabilities[0, -1] for found in (sure, doubtful)]
    assert odds[1] < 0.3 * odds[0]


def test_a_mode_that_is_none_is_no_target(case):
    targets = pair_roots(with_probability(case.fit, 0, 1e-6), case.reduced_model).targets
    assert 0 not in [row.measured for row in targets if row.kind == "pole"]


def test_a_target_tells_as_much_as_its_mode_is_found_again(case):
    fits = [with_probability(case.fit, 0, p) for p in (1.0, 0.5)]
    sure, doubtful = (make_problem(case.reduced_model, fit, case.pairs, None) for fit in fits)
    place = next(k for k, row in enumerate(case.pairs.targets) if row.kind == "pole" and row.measured == 0)
    rows = slice(2 * place, 2 * place + 2)
    before, after = (np.array(problem.covariance) for problem in (sure, doubtful))
    assert_allclose(after[rows, rows], 2 * before[rows, rows], rtol=1e-9, atol=0)
    others = np.delete(np.arange(len(before)), [2 * place, 2 * place + 1])
    assert_allclose(after[np.ix_(others, others)], before[np.ix_(others, others)], rtol=1e-12, atol=0)
