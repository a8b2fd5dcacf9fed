"""Masses of sensors that an update finds: none is less than nothing."""

import numpy as np
import pytest

import frf_ipz
from frf_ipz.updating.methods.minimal_change import surely_below
from frf_ipz.updating.parameters import make_structural_basis

SENSORS = [frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")]


def make_beam(mass_kg):
    """A cantilever of 0.14 kg with a mass at its tip."""
    return frf_ipz.make_beam(
        length_m=0.5,
        width_m=0.02,
        thickness_m=0.005,
        youngs_modulus_Pa=70e9,
        density_kg_m3=2700,
        elements=10,
        left="clamped",
        modal_ratio=0.01,
        point_mass=[frf_ipz.BeamPointMass(node=11, mass_kg=mass_kg)] if mass_kg else (),
    )


def mass_at_the_tip(*, modelled_kg, real_kg):
    """What an update adds there, kg."""
    lines = np.arange(5, 900.0, 0.5)
    labels = [frf_ipz.FrfLabel(output, SENSORS[0], frf_ipz.FrfQuantity.ACCELERANCE) for output in SENSORS]
    values = frf_ipz.compute_frfs(make_beam(real_kg), labels, 2j * np.pi * lines)[:, :, None]
    frfs = frf_ipz.FrfSet.from_arrays(
        lines, values, outputs=SENSORS, inputs=SENSORS[:1], variance=np.full(values.shape, 1e-4)
    )
    fit, model = frf_ipz.fit_modes(frfs), make_beam(modelled_kg)
    reduced = frf_ipz.reduce_model(fit, model)
    basis = make_structural_basis(model, reduced, sensors=SENSORS)
    basis = basis.without(list(basis.at_nodes))  # what the model has too much may be beside the sensor
    updated = frf_ipz.update_model(
        fit, reduced, fe_model=model, basis=basis, options=frf_ipz.UpdateOptions(expand=False, ensemble=0)
    )
    place = reduced.dofs.index(SENSORS[0])
    return (updated.model.mass - reduced.mass)[place, place]


def test_a_sensor_weighs_what_is_found():
    assert mass_at_the_tip(modelled_kg=0.0, real_kg=0.006) == pytest.approx(0.006, rel=0.3)


def test_no_sensor_weighs_less_than_nothing():
    assert mass_at_the_tip(modelled_kg=0.006, real_kg=0.0) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("n_sensors", [2, 100])
def test_hardly_one_of_many_masses_of_nothing_is_left_out_by_chance(n_sensors):
    rng = np.random.default_rng(3)
    means = rng.standard_normal((300, 1, n_sensors))
    left_out = [surely_below(mean + rng.standard_normal((200, n_sensors))).any() for mean in means]
    assert 0.02 < np.mean(left_out) < 0.12
    assert surely_below(rng.standard_normal((200, n_sensors)) - 5.0).all()


def test_a_mass_that_is_left_out_takes_its_prior_along():
    lines = np.arange(5, 900.0, 5.0)
    labels = [frf_ipz.FrfLabel(SENSORS[0], SENSORS[0], frf_ipz.FrfQuantity.ACCELERANCE)]
    values = frf_ipz.compute_frfs(make_beam(0.0), labels, 2j * np.pi * lines)[:, :, None]
    frfs = frf_ipz.FrfSet.from_arrays(lines, values, outputs=SENSORS[:1], inputs=SENSORS[:1])
    model = make_beam(0.0)
    basis = make_structural_basis(model, frf_ipz.reduce_model(frfs, model), sensors=SENSORS)
    first, second = basis.attached
    one = basis.without([first])
    assert one.names == (*basis.names[:first], basis.names[second])
    assert one.attached == (first,)
    assert one.terms[-1].name == "mass of sensors"
    assert one.terms[-1].root.shape == (len(one.names), 1)
    none = basis.without([first, second])
    assert [term.name for term in none.terms] == [term.name for term in basis.terms[:-1]]
    assert not none.attached
