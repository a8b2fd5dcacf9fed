"""The stabilisation diagram: its orders, its tolerances, and the columns that lead to the modes of the fit."""

import numpy as np
import pytest

import frf_ipz
from clamped_beam import BEAM

LINES = np.arange(5.0, 400.0, 0.5)
FLAGS = ["stable_frequency", "stable_damping", "stable_shape"]


@pytest.fixture(scope="module")
def frfs():
    beam = frf_ipz.make_beam(**BEAM)
    pairs = [(output, force) for output in ("21:+z", "11:+z", "16:+z") for force in ("21:+z", "8:+z")]
    labels = [frf_ipz.FrfLabel(*pair, "accelerance") for pair in pairs]
    values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * LINES).reshape(len(LINES), 3, 2)
    noise = 2e-3 * np.abs(values).max()
    values = values + noise * np.random.default_rng(0).standard_normal((*values.shape, 2)).view(complex)[..., 0]
    return frf_ipz.FrfSet.from_arrays(
        LINES, values, outputs=["21:+z", "11:+z", "16:+z"], inputs=["21:+z", "8:+z"],
        variance=np.full(values.shape, 2 * noise**2),
    )  # fmt: skip


def fitted(frfs, **options):
    return frf_ipz.fit_modes(frfs, options=frf_ipz.FitOptions(**options))


@pytest.mark.parametrize(("max_order", "step"), [(30, 1), (60, 2)])
def test_orders_are_one_or_two_apart_to_the_stated_maximum(frfs, max_order, step):
    orders = np.unique(fitted(frfs, max_order=max_order).stabilization["order"])
    assert orders.max() == max_order
    assert set(np.diff(orders)) <= {step, 2 * step}  # the lowest orders may hold no pole of the band
    assert len(orders) > 20


def test_columns_lead_to_the_modes_of_the_fit(frfs):
    fit = fitted(frfs)
    table = fit.stabilization
    for number, hertz in enumerate(fit.modes["frequency_hz"], start=1):
        column = table[table["mode"] == number]
        assert len(column) > 10
        assert (abs(column["frequency_hz"] / hertz - 1) < fit.stability.frequency).all()
        assert column["stable_frequency"].all()
        assert column["stable_shape"].mean() > 0.5
    assert (table["mode"] == 0).any()


def test_tolerances_are_the_users_and_leave_the_fit_alone(frfs):
    usual = fitted(frfs)
    strict = fitted(frfs, stability=frf_ipz.Stability(frequency=1e-4, damping=1e-3, vector=1e-5))
    counts = [fit.stabilization[FLAGS].sum() for fit in (usual, strict)]
    assert (counts[1] < counts[0]).all()
    np.testing.assert_array_equal(strict.model.poles, usual.model.poles)
    assert usual.stability == frf_ipz.Stability(frequency=0.01, damping=0.05, vector=0.02)


def test_each_mark_needs_the_one_before(frfs):
    table = fitted(frfs).stabilization
    assert (table["stable_frequency"] | ~table["stable_damping"]).all()
    assert (table["stable_damping"] | ~table["stable_shape"]).all()


def test_picture_states_the_tolerances(frfs):
    from frf_ipz.plotting.poles import describe_stabilization

    picture = describe_stabilization(fitted(frfs, stability=frf_ipz.Stability(damping=0.03)), frfs)
    assert "1 % in frequency, 3 % in damping, 2 % in the vector" in picture.note
    assert "column of a mode of the fit" in {layer.name for layer in picture.panels[0].layers}
    assert picture.panels[0].backdrop is not None


@pytest.mark.parametrize("value", [0.0, -0.1])
def test_tolerances_that_are_none_are_refused(value):
    with pytest.raises(frf_ipz.InputError, match="frequency"):
        frf_ipz.Stability(frequency=value)
