"""Members of an ensemble have a mass that machines have, however little the update knows."""

from types import SimpleNamespace

import numpy as np

from frf_ipz.updating.minimal_change import ensemble


def posterior_of_masses(found, mean):
    """A posterior whose parameters are the entries of a diagonal mass: what was found, and what no step led to."""
    phase = SimpleNamespace(terms=None, matrices=lambda theta: (np.eye(2) * theta[:, None, :], None))
    result = SimpleNamespace(scales=np.ones(1), whitened=found, step=SimpleNamespace(mean=mean))
    return SimpleNamespace(stiffness=phase, stiffness_result=result)


def test_members_without_a_positive_mass_come_nearer_to_what_was_found_and_the_others_stay(monkeypatch):
    monkeypatch.setattr(ensemble, "unwhiten", lambda _terms, _scales, whitened: whitened)
    found, mean = np.array([1.0, 2.0]), np.array([-0.1, 2.0])  # of an update that has not converged
    drawn = np.array([[0.9, 2.1], [-0.5, 2.0], [1.0, -60.0]])
    members, *_ = ensemble._with_positive_mass(posterior_of_masses(found, mean), drawn)
    np.testing.assert_array_equal(members[0], drawn[0])
    np.testing.assert_allclose(members[1], [0.25, 2.0])
    np.testing.assert_allclose(members[2], [1.0, 2.0 - 62.0 / 32.0])
