"""A target that all others contradict is excluded only where its error is large."""

import numpy as np
import pytest

from frf_ipz.updating.gaussian import contradicted, linearise
from frf_ipz.updating.target_noise import noise_of

SENSITIVITY = np.ones((4, 1))  # four data of one number
NOISE = 1e-8 * np.eye(4)


def contradictions(data, **options):
    linear = linearise([SENSITIVITY], data, noise_of(NOISE))
    return contradicted(linear, np.ones(1), limit=6.0, excluded_std=1.0, most=4, **options).tolist()


@pytest.mark.parametrize(("off", "least", "expected"), [(0.5, 0.02, [2]), (0.005, 0.02, []), (0.005, 0.0, [2])])
def test_a_contradicted_datum_counts_from_its_least_size(off, least, expected):
    data = np.array([0.001, 0.001, 0.001 + off, 0.001])
    assert contradictions(data, judged=np.abs(data) >= least) == expected


def test_data_that_agree_contradict_nothing():
    assert contradictions(np.full(4, 0.3)) == []
