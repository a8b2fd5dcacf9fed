"""Constant gains of channels are found where FRFs determine them, and refused where they do not."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.errors import InputError
from frf_ipz.frf import FrfSet
from frf_ipz.identification.fit import fit_modes
from frf_ipz.identification.options import FitOptions
from frf_ipz.identification.results.gains import estimate_gains
from frf_ipz.identification.results.shapes import mode_shapes
from frf_ipz.modes import ModeSet
from synthetic_frfs import accelerances, random_modes

LINES_HZ = np.arange(1, 1025) * 0.5
TRUTH = random_modes([60.0, 135.0, 210.0, 340.0, 430.0], 0.005, seed=5)
GAIN = 0.85
STANDARD_DEVIATIONS = 4.0  # a correct gain is farther off once in 16000
FEW = (0.6, 1.5)  # 3 standard deviations of the rms of 12 numbers


def measured(seed=1, **gains):
    """Give FRFs in which sensors ("output1") and force channels ("input2") have gains."""
    frfs = accelerances(TRUTH, LINES_HZ, seed=seed)
    factor = np.ones(frfs.n_frfs)
    for name, gain in gains.items():
        for number, label in enumerate(frfs.labels):
            dof = label.output_dof if name.startswith("output") else label.input_dof
            if dof.node == int(name[-1]):
                factor[number] *= gain if name.startswith("output") else 1 / gain
    return replace(frfs, values=frfs.values * factor, variance=frfs.variance * factor**2)


def test_a_sensor_against_the_trusted_channels():
    fit = fit_modes(measured(output1=GAIN), options=FitOptions(gain=("output 1:+z",)))
    (row,) = fit.channel_gains.itertuples(index=False)
    assert row.channel == "output 1:+z"
    assert 0 < row.gain_std < 0.005
    assert row.gain == pytest.approx(GAIN, abs=STANDARD_DEVIATIONS * row.gain_std)
    of_first = [label.output_dof.node == 1 for label in fit.labels]
    np.testing.assert_array_equal(fit.gain, np.where(of_first, row.gain, 1.0))
    assert set(fit.misfit.loc[fit.misfit["frf"] == 0, "gain"]) == {row.gain}
    assert any("the channel 'output 1:+z' records 0.8" in text for text in fit.warnings)
    expected = mode_shapes(fit_modes(measured(), options=FitOptions()))
    largest = np.abs(expected.shapes).max()
    np.testing.assert_allclose(mode_shapes(fit).shapes, expected.shapes, rtol=0, atol=0.01 * largest)  # 1 % of noise


def test_a_force_channel():
    fit = fit_modes(measured(input2=1.2), options=FitOptions(gain=("input 2:+z",)))
    row = fit.channel_gains.iloc[0]
    assert row["gain"] == pytest.approx(1.2, abs=STANDARD_DEVIATIONS * row["gain_std"])


def test_standard_deviations_of_gains_are_calibrated():
    errors = []
    for seed in range(12):
        fit = fit_modes(measured(seed=seed, output1=GAIN), options=FitOptions(gain=("output 1:+z",)))
        row = fit.channel_gains.iloc[0]
        errors.append((row["gain"] - GAIN) / row["gain_std"])
    assert FEW[0] < np.sqrt(np.mean(np.square(errors))) < FEW[1]


def test_two_channels_that_record_the_same():
    frfs = measured()
    second = frfs.select_frfs([8, 9])
    labels = tuple(replace(label, output_channel="second") for label in second.labels)
    rng = np.random.default_rng(3)
    noise = (rng.standard_normal(second.values.shape) + 1j * rng.standard_normal(second.values.shape)) / np.sqrt(2)
    values = (second.values + np.sqrt(second.variance) * noise) * 2.5
    frfs_of_both = FrfSet(
        frequency_hz=frfs.frequency_hz,
        values=np.hstack([frfs.values, values]),
        labels=(*frfs.labels, *labels),
        variance=np.hstack([frfs.variance, 2 * 2.5**2 * second.variance]),
        coherence=np.hstack([frfs.coherence, second.coherence]),
        averages=np.zeros(14, int),
    )
    row = fit_modes(frfs_of_both, options=FitOptions(gain=("second",))).channel_gains.iloc[0]
    assert row["gain"] == pytest.approx(2.5, abs=STANDARD_DEVIATIONS * row["gain_std"])


@pytest.mark.parametrize(
    ("channels", "message"),
    [
        (("output 3:+z",), r"do not determine the gain of the channel 'output 3:\+z'"),
        (("output 1:+z", "input 1:+z"), r"do not determine the gain of the channel 'output 1:\+z'"),
        (("output 1:-z",), r"which no FRF has; did you mean 'output 1:\+z'"),
    ],
)
def test_gains_that_the_frfs_do_not_determine(channels, message):
    with pytest.raises(InputError, match=message):
        fit_modes(measured(), options=FitOptions(gain=channels))


def test_a_channel_named_twice():
    with pytest.raises(InputError, match="names the channel 'a' twice"):
        FitOptions(gain=("a", "a"))


def test_a_flipped_channel_is_refused():
    with pytest.raises(InputError, match="opposite signs"):
        fit_modes(measured(output1=-1.0), options=FitOptions(gain=("output 1:+z",)))


def test_frfs_that_differ_by_more_than_a_gain():
    frfs = measured()
    changed = accelerances(replace(TRUTH, outputs=TRUTH.outputs * np.linspace(0.9, 1.1, 5)), LINES_HZ, seed=2)
    values = np.where(np.arange(frfs.n_frfs) == 1, changed.values, frfs.values)
    fit = fit_modes(replace(frfs, values=values), options=FitOptions(gain=("output 1:+z",)))
    assert any("differ by more than a gain" in text for text in fit.warnings)


def test_gains_from_known_shapes():
    fit = fit_modes(measured(output4=GAIN), options=FitOptions())
    shapes = ModeSet(
        natural_frequency_hz=TRUTH.frequency_hz,
        damping_ratio=TRUTH.damping_ratio,
        shapes=TRUTH.outputs * np.array([2.0, 1.0, 3.0, 1.0, 5.0]) + 0j,  # the scale of a mode does not matter
        dofs=tuple(dict.fromkeys(label.output_dof for label in fit.labels)),
    )
    table = estimate_gains(fit, shapes)
    expected = np.where([label.output_dof.node == 4 for label in fit.labels], GAIN, 1.0)
    error = np.abs(table["gain"] - expected) / table["gain_std"]
    assert error.max() < STANDARD_DEVIATIONS
    assert table["gain_std"].max() < 0.1
