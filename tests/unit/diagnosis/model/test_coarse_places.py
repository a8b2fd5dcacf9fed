"""Places that are as far apart as can be."""

import numpy as np

from frf_ipz.diagnosis.model.coarse_places import spread_places


def test_every_place_is_within_reach_of_a_chosen_one():
    positions = np.random.default_rng(2).random((300, 3))
    chosen, reach = spread_places(positions, 40)
    nearest = np.linalg.norm(positions[:, None] - positions[chosen], axis=2).min(1)
    assert len(set(chosen.tolist())) == 40
    assert np.isclose(nearest.max(), reach, rtol=1e-12)
    apart = np.linalg.norm(positions[chosen, None] - positions[chosen], axis=2) + 10 * np.eye(40)
    assert apart.min() >= reach
