"""A floating stage of 6 by 6 ports from its FRFs to a loop: modes, prediction, decoupled axes, margins of the truth."""

from dataclasses import replace

import control
import numpy as np
import pytest
from numpy.testing import assert_allclose

import frf_ipz
import wafer_stage
from frf_ipz.frf import FrfLabel

pytestmark = pytest.mark.slow  # 500 zeros of 36 FRFs are targets of an update
SEED = 2
MARGIN_DB, MARGIN_DEG = 0.5, 3.0  # what a designer leaves anyway
OPTIONS = frf_ipz.ExportOptions(outputs="displacement")


@pytest.fixture(scope="module")
def stage():
    model, responses, lines_hz = wafer_stage.make_stage(SEED)
    fit = frf_ipz.fit_modes(wafer_stage.measure(responses, lines_hz, SEED))
    reduced = frf_ipz.reduce_model(fit, model, points=wafer_stage.POINTS)
    return fit, reduced, frf_ipz.update_model(fit, reduced, fe_model=model), responses, lines_hz


def test_no_mode_is_false(stage):
    fit, _, _, responses, _ = stage
    assert_allclose(fit.modes["frequency_hz"], responses.omega[: fit.n_modes] / (2 * np.pi), rtol=1e-4)
    assert fit.n_modes >= wafer_stage.FLEXIBLE
    assert not fit.warnings


def test_means_and_tilts_are_predicted(stage):
    _, reduced, updated, responses, lines_hz = stage
    s = 2j * np.pi * lines_hz[::2]
    true = responses(wafer_stage.POINTS, wafer_stage.ACTUATORS, s)
    labels = [FrfLabel(point, force, "accelerance") for point in wafer_stage.POINTS for force in wafer_stage.ACTUATORS]
    before, after = (
        np.median(np.abs(20 * np.log10(np.abs(frf_ipz.compute_frfs(model, labels, s).reshape(true.shape) / true))))
        for model in (reduced, updated.model)
    )
    assert before > 1.0
    assert after < 0.5


def test_six_rigid_body_modes_are_decoupled(stage):
    fit, _, updated, *_ = stage
    plant = frf_ipz.to_state_space(fit, updated, points=wafer_stage.POINTS, options=OPTIONS)
    low = 2j * np.pi * 0.5
    for axes in ((), wafer_stage.SENSORS):
        decoupled = frf_ipz.decouple_rigid_body(plant, axes=axes).apply(plant)
        assert_allclose(decoupled(low) * low**2, np.eye(6), rtol=0, atol=1e-5)  # flexible modes: (0.5 Hz / 570 Hz)^2


@pytest.mark.parametrize(("axis", "crossover_hz"), [("height", 150.0), ("sensor 1", 100.0), ("sensor 1", 150.0)])
def test_margins_of_a_loop_are_those_of_the_truth(stage, axis, crossover_hz):
    """The first flexible mode sets them at the corner of the stage, where the nominal model is dB off."""
    fit, reduced, updated, responses, lines_hz = stage
    hz = np.geomspace(5.0, lines_hz[-1], 6000)
    s = 2j * np.pi * hz
    plant = frf_ipz.to_state_space(fit, updated, points=wafer_stage.POINTS, options=OPTIONS)
    nominal = frf_ipz.to_state_space(fit, replace(updated, model=reduced), points=wafer_stage.POINTS, options=OPTIONS)
    command = frf_ipz.decouple_rigid_body(plant, axes=wafer_stage.SENSORS).inputs[:, 0]
    row = plant.output_labels.index(axis)
    frfs = plant(s)[row].T, responses([axis], wafer_stage.ACTUATORS, s, power=0)[:, 0], nominal(s)[row].T
    margins = [find_margins(frf @ command, hz, crossover_hz) for frf in frfs]
    assert_allclose(margins[0][0], margins[1][0], rtol=0, atol=MARGIN_DB)
    assert_allclose(margins[0][1], margins[1][1], rtol=0, atol=MARGIN_DEG)
    assert abs(margins[2][0] - margins[1][0]) > MARGIN_DB  # the nominal model would not do


def find_margins(frf, hz, crossover_hz):
    """Gain margin in dB and phase margin in degrees with a lead of 10 around the crossover and a roll-off."""
    s, crossover = 2j * np.pi * hz, 2 * np.pi * crossover_hz
    lead = (1 + s * np.sqrt(10) / crossover) / (1 + s / (crossover * np.sqrt(10))) / (1 + s / (6 * crossover))
    mass_line = np.abs(np.mean((frf * s**2)[:50]))
    loop = frf / mass_line * crossover**2 / np.sqrt(10) * lead
    gain, phase, *_ = control.stability_margins(control.frd(loop[None, None], 2 * np.pi * hz))
    return 20 * np.log10(gain), phase
