"""The covariance of targets in blocks, against the whole matrix."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from frf_ipz.updating.target_noise import TargetNoise

PLACES = (np.array([3, 0]), np.array([1]), np.array([4, 2, 5]))


@pytest.fixture
def noise():
    rng = np.random.default_rng(0)
    roots = [rng.standard_normal((len(place),) * 2) for place in PLACES]
    blocks = tuple(root @ root.T + 1e-3 * np.eye(len(root)) for root in roots)
    return TargetNoise(common=rng.standard_normal((6, 2)), blocks=blocks, places=PLACES)


def whole(noise):
    covariance = noise.common @ noise.common.T
    for place, block in noise.parts():
        covariance[np.ix_(place, place)] += block
    return covariance


def test_an_error_is_weighed_by_the_inverse_of_the_covariance(noise):
    error = np.random.default_rng(1).standard_normal(6)
    assert_allclose(noise.squares(error[:, None])[0], error @ np.linalg.solve(whole(noise), error), rtol=1e-9)


def test_it_is_weighed_so_without_common_errors_too(noise):
    alone = TargetNoise(common=np.zeros((6, 0)), blocks=noise.blocks, places=noise.places)
    error = np.random.default_rng(1).standard_normal(6)
    assert_allclose(alone.squares(error[:, None])[0], error @ np.linalg.solve(whole(alone), error), rtol=1e-9)


def test_drawn_errors_have_the_covariance(noise):
    factor = noise.draw(np.eye(6))
    assert_allclose(factor.T @ factor, whole(noise), rtol=0, atol=1e-12)
