"""What was found of each pole follows it."""

import numpy as np

from frf_ipz.identification.search.goodness_of_fit import GoodnessOfFit


def test_what_was_found_of_a_pole_stays_with_it_where_others_are_discarded():
    before = 2 * np.pi * np.array([10.0, 20.0, 20.1, 40.0]) * complex(-0.01, 1.0)
    rows = np.arange(4.0)
    goodness = GoodnessOfFit(
        frequency_hz=np.arange(5.0),
        misfit=np.zeros((5, 1), complex),
        level=np.ones((5, 1)),
        candidates=(),
        significance=rows,
        damping_std=rows + 10,
        factor=rows[:, None],
        drops=rows[:, None] + 20,
        is_needed=rows > 2,
    )
    kept = goodness.of_poles(before, before[[0, 2, 3]] * 1.001)
    assert kept.significance.tolist() == [0, 2, 3]
    assert kept.damping_std.tolist() == [10, 12, 13]
    assert kept.factor.ravel().tolist() == [0, 2, 3]
    assert kept.drops.ravel().tolist() == [20, 22, 23]
    assert kept.is_needed.tolist() == [False, False, True]
