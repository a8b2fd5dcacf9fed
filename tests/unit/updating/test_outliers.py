"""A target that all others contradict is excluded only where its error is large."""

import numpy as np
import pytest

from frf_ipz.updating.gaussian import most_contradicted

SENSITIVITY = np.ones((4, 1))  # four data of one number
NOISE = 1e-8 * np.eye(4)


@pytest.mark.parametrize(("off", "least", "expected"), [(0.5, 0.02, 2), (0.005, 0.02, -1), (0.005, 0.0, 2)])
def test_a_contradicted_datum_counts_from_its_least_size(off, least, expected):
    data = np.array([0.001, 0.001, 0.001 + off, 0.001])
    assert most_contradicted(SENSITIVITY, data, NOISE, 6.0, least=least) == expected


def test_data_that_agree_contradict_nothing():
    assert most_contradicted(SENSITIVITY, np.full(4, 0.3), NOISE, 6.0) == -1
