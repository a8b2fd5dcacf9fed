"""Mean and covariance over machines: total covariance, shrunk for few machines."""

import numpy as np
import pytest

from frf_ipz.fleet.machine_record import MachineRecord
from frf_ipz.fleet.population import make_population, shrunk_covariance


def records(values, std):
    return [
        MachineRecord(
            machine=f"m{place}",
            status="done",
            parameters={f"stiffness of element {k}": (float(value), std) for k, value in enumerate(row)},
        )
        for place, row in enumerate(values)
    ]


def test_the_spread_is_that_of_machines_and_of_what_their_tests_leave_open():
    rng = np.random.default_rng(0)
    values = 1.05 + rng.normal(size=(400, 3)) * [0.02, 0.01, 0.03]
    population = make_population(records(values, 0.02))
    np.testing.assert_allclose(population.mean, 1.05, atol=0.006)
    np.testing.assert_allclose(population.std, np.hypot([0.02, 0.01, 0.03], 0.02), rtol=0.1)
    assert population.to_json()["parameters"] == [f"stiffness of element {k}" for k in range(3)]


def test_few_machines_are_shrunk_and_many_keep_their_correlation():
    rng = np.random.default_rng(1)
    factor = rng.normal(size=(200, 1))
    values = factor + 0.3 * rng.normal(size=(200, 6))
    few, shrinkage_of_few = shrunk_covariance(values[:5])
    many, shrinkage_of_many = shrunk_covariance(values)
    assert np.linalg.eigvalsh(few).min() > 0
    assert shrinkage_of_many < 0.05 < shrinkage_of_few
    correlation = many / np.sqrt(np.outer(np.diag(many), np.diag(many)))
    np.testing.assert_allclose(correlation[0, 1:], 1 / 1.09, atol=0.08)


def test_machines_without_scatter_have_none():
    covariance, _ = shrunk_covariance(np.ones((4, 3)))
    np.testing.assert_array_equal(covariance, 0.0)


@pytest.mark.parametrize("count", [0, 2])
def test_too_few_machines_are_no_population(count):
    population = make_population(records(np.ones((count, 2)), 0.1))
    assert population.names == ()
    assert population.to_json()["covariance"] == []
