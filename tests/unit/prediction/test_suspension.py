"""A free model on the suspension of a test: what is measured at a few hertz is a rigid body on springs."""

import numpy as np
import pytest

import frf_ipz

OUTPUTS, INPUTS, POINT = ("4:+z", "9:+z"), ("6:+z", "16:+z"), "18:+z"
BAND_HZ = (1.0, 150.0)
FIRST_HZ = 20.0  # below the first elastic mode, at 105 Hz, and above all of the suspension
CLOSE_DB = 0.1  # the noise of a peak, many times
NOISE = 1e-3  # of the root mean square of an FRF


def make_model():
    return frf_ipz.make_beam(
        length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=20,
        left="free", right="free", modal_ratio=0.005,
    )  # fmt: skip


def hang(model, springs):
    """Hang a model on springs, N/m by node."""
    stiffness = model.stiffness.tolil()
    for node, rate in springs.items():
        stiffness[(model.index(frf_ipz.Dof(node, "z")),) * 2] += rate
    return frf_ipz.StructuralModel.from_matrices(model.mass, stiffness.tocsr(), dofs=model.dofs, modal_damping=0.005)


def predict(springs):
    machine, model, lines = hang(make_model(), springs), make_model(), np.arange(*BAND_HZ, 0.5)
    labels = [frf_ipz.FrfLabel(output, force, "accelerance") for output in OUTPUTS for force in INPUTS]
    values = frf_ipz.compute_frfs(machine, labels, 2j * np.pi * lines)
    std = NOISE * np.sqrt(np.mean(np.abs(values) ** 2, axis=0))
    noisy = values + std * np.random.default_rng(1).normal(size=(*values.shape, 2)).view(complex)[..., 0] / 2**0.5
    frfs = frf_ipz.FrfSet.from_arrays(
        lines,
        noisy.reshape(-1, len(OUTPUTS), len(INPUTS)),
        outputs=OUTPUTS,
        inputs=INPUTS,
        variance=np.broadcast_to(std**2, values.shape).reshape(-1, len(OUTPUTS), len(INPUTS)),
    )
    fit = frf_ipz.fit_modes(frfs)
    updated = frf_ipz.update_model(fit, frf_ipz.reduce_model(fit, model, points=[POINT]), fe_model=model)
    prediction = frf_ipz.predict_frfs(fit, updated, points=[POINT], frequency_hz=lines)
    truth = frf_ipz.compute_frfs(machine, prediction.labels, 2j * np.pi * lines)
    return fit, updated, prediction, np.abs(truth)


@pytest.fixture(scope="module")
def hung():
    return predict({3: 60.0, 17: 25.0})


def test_a_prediction_hangs_as_the_test_does(hung):
    _, updated, prediction, truth = hung
    low = prediction.frequency_hz < FIRST_HZ
    error_db = np.abs(20 * np.log10(np.abs(prediction.values[low]) / truth[low]))
    assert np.median(error_db) < CLOSE_DB
    inside = (truth[low] >= prediction.magnitude_low[low]) & (truth[low] <= prediction.magnitude_high[low])
    assert inside.mean() > 0.8
    assert any("rigid body on its suspension" in text for text in prediction.warnings)
    assert updated.model.rigid.shape[1] == 2  # what is exported stays free


def test_bands_of_any_frf_hang_too(hung):
    fit, updated, prediction, truth = hung
    low = prediction.frequency_hz < FIRST_HZ
    bands = frf_ipz.band_of_magnitudes(
        fit, updated, labels=prediction.labels, s=2j * np.pi * prediction.frequency_hz[low]
    )
    assert np.mean((truth[low] >= bands[0]) & (truth[low] <= bands[1])) > 0.8
    assert np.median(10 * np.log10(bands[1] / bands[0])) < 1.0


def test_a_structure_that_is_free_stays_free():
    _, _, prediction, _ = predict({})
    assert not any("suspension" in text for text in prediction.warnings)
