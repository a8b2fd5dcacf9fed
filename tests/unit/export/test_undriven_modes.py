"""Modes with a node at the only input: what noise makes of their residues is left out, what was measured is not."""

import numpy as np

import frf_ipz
from frf_ipz.export.state_space import make_state_space

ELEMENTS = 12
LINES_HZ = np.arange(20.0, 1500.0, 1.0)
ODD = [1, 3, 5]  # modes of a beam clamped at both ends that its middle drives, counted from 1


def exported_modes(**machine):
    """Measure a clamped beam that is struck in its middle, update its model, and list the modes of its state space."""
    size = {"length_m": 0.5, "width_m": 0.03, "thickness_m": 0.006, "elements": ELEMENTS, "modal_ratio": 0.004}
    size |= {"youngs_modulus_Pa": 70e9, "density_kg_m3": 2700.0, "left": "clamped", "right": "clamped"}
    model = frf_ipz.make_beam(**size)
    middle, beside = ELEMENTS // 2 + 1, ELEMENTS // 3
    labels = tuple(frf_ipz.FrfLabel(f"{node}:z", f"{middle}:z", "accelerance") for node in (middle, beside))
    values = frf_ipz.compute_frfs(frf_ipz.make_beam(**size | machine), labels, 2j * np.pi * LINES_HZ)
    noise = 1e-4 * np.abs(values)
    real, imag = np.random.default_rng(8).standard_normal((2, *values.shape)) * noise / np.sqrt(2)
    frfs = frf_ipz.FrfSet(
        frequency_hz=LINES_HZ,
        values=values + real + 1j * imag,
        labels=labels,
        variance=noise**2,
        coherence=np.full(values.shape, np.nan),
        averages=np.ones(2, int),
    )
    fit = frf_ipz.fit_modes(frfs)
    reduced = frf_ipz.reduce_model(fit, model, points=["3:z"])
    updated = frf_ipz.update_model(fit, reduced, pairs=frf_ipz.pair_roots(fit, reduced), fe_model=model)
    space = make_state_space(fit, updated, points=["3:z"])
    return [int(name.split()[1]) for name in space.state_names[::2]], space.notes


def test_modes_that_only_noise_drives_are_left_out_and_said():
    modes, notes = exported_modes()
    assert modes[:3] == ODD
    assert any("no input drives it" in note for note in notes)


def test_modes_that_a_mass_beside_the_middle_makes_visible_stay():
    modes, _ = exported_modes(point_mass=[frf_ipz.BeamPointMass(node=4, mass_kg=0.02)])
    assert modes[:4] == [1, 2, 3, 4]
