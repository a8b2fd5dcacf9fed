"""Delays of impacts: what a record lacks of its force is none, and a deviation knows what the lines share."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.errors import NoModesError
from frf_ipz.identification.fit import fit_modes
from frf_ipz.identification.likelihood.delay import find_delays
from frf_ipz.identification.likelihood.smooth_terms import smooth_terms_of_band
from frf_ipz.identification.measured_lines import measured_lines
from frf_ipz.identification.options import FitOptions
from frf_ipz.identification.results.gains import estimate_gains
from frf_ipz.identification.results.shapes import mode_shapes
from frf_ipz.identification.search.find_modes import find_modes
from frf_ipz.ingest.estimate import estimate_frfs
from synthetic_campaign import Structure, in_memory, pulse, respond
from synthetic_frfs import accelerances, random_modes

RATE_HZ, N_SAMPLES = 2048.0, 4096
MODES = Structure(
    frequency_hz=(40.0, 97.0, 181.0, 330.0),
    damping_ratio=(0.015, 0.01, 0.008, 0.008),
    shapes=((1.0, 0.7, -0.5, 0.8), (0.6, -0.8, 0.9, 0.4)),
)
REAL = 0.01  # imaginary part of a shape over its largest component, at the noise of these tests
CALIBRATED = (0.5, 1.5)  # the bar of the project, 0.8 to 1.3, and what a dozen or two of numbers scatter


def impacts(seed, *, delay_s=0.0, begins_at=0.0, force_noise=5e-3, response_noise=5e-3, count=5):
    """Give FRFs of impacts whose responses come late, and whose records begin at a part of the peak."""
    rng = np.random.default_rng(seed)
    records = []
    for height in 100.0 * np.exp(0.3 * rng.standard_normal(count)):
        at_s = 0.03 + rng.uniform() / RATE_HZ
        force = pulse(N_SAMPLES, 1 / RATE_HZ, height=height, at_s=at_s)
        late = pulse(N_SAMPLES, 1 / RATE_HZ, height=height, at_s=at_s + delay_s)
        responses = respond(MODES, late, 1 / RATE_HZ)
        signals = np.vstack([force, responses])
        signals += np.array([[force_noise], [response_noise], [response_noise]]) * rng.standard_normal(signals.shape)
        first = int(np.argmax(force > begins_at * height))
        records.append(signals[:, first : first + N_SAMPLES - 100])
    return estimate_frfs(in_memory(records, step_s=1 / RATE_HZ, input_dof="3:+z", output_dofs=("5:+z", "2:+z"))).frfs


def test_a_record_that_begins_in_the_pulse_is_not_late():
    fit = fit_modes(impacts(1, begins_at=0.7))
    assert not fit.model.delay_s.any()
    assert not any(" ms (+- " in text for text in fit.warnings)


def test_a_delay_is_as_uncertain_as_the_missing_part_of_the_pulse_makes_it():
    delay = find_modes(impacts(1, begins_at=0.7, delay_s=1e-3), FitOptions()).common_delay
    assert 0.5 * delay.std_s < abs(delay.delay_s - 1e-3) < 2 * delay.std_s


@pytest.mark.slow
@pytest.mark.parametrize("noise", [{"force_noise": 0.2}, {"response_noise": 0.05}], ids=["force", "response"])
def test_the_deviation_knows_the_noise_that_lines_share(noise):
    found = [find_modes(impacts(seed, delay_s=1e-3, **noise), FitOptions()).common_delay for seed in range(60, 84)]
    errors = [(delay.delay_s - 1e-3) / delay.std_s for delay in found]
    assert CALIBRATED[0] < np.sqrt(np.mean(np.square(errors))) < CALIBRATED[1]


def test_what_a_record_lacks_of_its_force_is_how_much_too_large_frfs_are():
    frfs = impacts(3, begins_at=0.3, force_noise=0.0, response_noise=0.0)
    used = frfs.in_band((20.0, 200.0))
    excess = frfs.values[used] / MODES.accelerance(frfs.s[used]) - 1
    strong = np.abs(frfs.values[used]) > np.median(np.abs(frfs.values[used]))  # responses before the record count less
    missing = frfs.missing_force[used][strong]
    assert np.median(np.abs(excess[strong] - missing)) < 0.4 * np.median(np.abs(missing))
    assert frfs.select_lines(used).missing_force.shape == frfs.values[used].shape
    assert frfs.select_frfs([0]).missing_force.shape == (frfs.n_lines, 1)
    assert impacts(3).missing_force is None


def test_one_late_sensor_of_three_is_named():
    truth = random_modes([71.5, 134.0, 246.0, 389.0], 0.006, n_outputs=3, n_inputs=1, seed=2)
    frfs = accelerances(truth, np.arange(60, 1001) * 0.5, noise=3e-4, seed=2)
    late_s = np.array([0.0, 2.5e-3, 0.0])
    fit = fit_modes(replace(frfs, values=frfs.values * np.exp(-frfs.s[:, None] * late_s)))
    np.testing.assert_allclose(fit.model.delay_s, late_s, rtol=0, atol=1e-6)
    assert any("each by its own delay" in text for text in fit.warnings)
    np.testing.assert_allclose(fit.modes["frequency_hz"], truth.frequency_hz, rtol=1e-5, atol=0)


def late_frfs(late_s, *, complexity=0.0):
    """Give FRFs of four sensors, some of them late, with modes that are complex by chance."""
    truth = random_modes([44.0, 108.0, 187.5, 296.0], 0.007, n_outputs=4, n_inputs=1, seed=4)
    frfs = accelerances(truth, np.arange(40, 861) * 0.5, noise=3e-4, seed=4)
    s, size = frfs.s[:, None], complexity * np.sqrt(np.mean(np.abs(truth.residues()) ** 2, axis=1))
    turned = np.random.default_rng(4).standard_normal((4, 4)) * size[:, None]
    turns = 1 / (s - truth.poles) + 1 / (s - truth.poles.conj())
    return replace(frfs, values=(frfs.values + s**2 * (turns @ turned)) * np.exp(-s * np.array(late_s)))


@pytest.mark.parametrize("late_s", [(0.0, 0.0, 1.8e-3, 0.0), (-6e-4, -6e-4, 0.0, 0.0), (0.0, 0.0, 0.0, 5e-5)])
def test_short_delays_of_some_sensors_are_told_by_their_phases(late_s):
    fit = fit_modes(late_frfs(late_s))
    np.testing.assert_allclose(fit.model.delay_s, late_s, rtol=0, atol=5e-7)
    assert ((fit.model.delay_s != 0) == (np.array(late_s) != 0)).all()
    assert any("each by its own delay" in text for text in fit.warnings)
    shapes = mode_shapes(fit).shapes
    assert np.abs(shapes.imag).max() < REAL * np.abs(shapes).max()  # and shapes are those without it


def test_gains_of_late_sensors_are_those_of_their_shapes():
    """Over the shapes of a fit without the delays; 1.8 ms turn the highest mode half a turn."""
    late, on_time = fit_modes(late_frfs((0.0, 0.0, 1.8e-3, 0.0))), fit_modes(late_frfs((0.0,) * 4))
    gains = estimate_gains(late, mode_shapes(on_time))["gain"]
    np.testing.assert_allclose(np.abs(gains), 1.0, rtol=0.01)


@pytest.mark.parametrize("complexity", [0.0, 0.02, 0.1])
def test_complex_modes_are_no_delays(complexity):
    assert not fit_modes(late_frfs((0.0,) * 4, complexity=complexity)).model.delay_s.any()


@pytest.mark.parametrize("frequency_hz", [(258.4, 302.6, 332.8, 368.6), (121.1, 265.0, 319.2, 363.0)])
def test_the_best_delay_is_found_between_those_of_a_coarse_grid(frequency_hz):
    for seed in range(8):
        truth = random_modes(frequency_hz, 0.007, n_outputs=4, n_inputs=1, seed=seed)
        frfs = accelerances(truth, np.arange(40, 861) * 0.5, noise=3e-4, seed=seed)
        late_s = np.array([1.8e-3, -2.1e-3, 0.0, 6.2e-3])
        lines = measured_lines(replace(frfs, values=frfs.values * np.exp(-frfs.s[:, None] * late_s)), FitOptions())
        data = lines.weighted(shared=True).with_real_modes()
        terms = smooth_terms_of_band(lines.band_hz, lines.line_hz).first(3)
        found_s, _ = find_delays(data, truth.poles, terms, np.arange(4))
        np.testing.assert_allclose(found_s, late_s, rtol=0, atol=1e-6)


@pytest.mark.parametrize("seed", [1, 8])
def test_no_delay_makes_modes_where_there_are_none(seed):
    """No poles at all were found on the smooth lines, so that any delay with poles of its own described them better."""
    lines_hz = np.arange(20.0, 400.25, 0.5)
    modes = random_modes([58.0, 201.0, 330.0], 0.01, n_outputs=2, n_inputs=1, seed=seed)
    frfs = accelerances(modes, lines_hz, noise=1e-4, seed=seed + 5)
    with pytest.raises(NoModesError):
        fit_modes(frfs, options=FitOptions(band_hz=(20.0, 400.0), exclude_hz=((20.0, 110.0), (130.0, 400.0))))


def test_no_more_poles_are_tried_than_few_lines_can_tell():
    """What a delay of 39 smooth lines leaves proposed so many that there were more unknowns than numbers."""
    modes = random_modes([58.0, 201.0, 330.0], 0.01, n_outputs=2, n_inputs=1, seed=10)
    frfs = accelerances(modes, np.arange(20.0, 400.25, 0.5), noise=1e-4, seed=15)
    early = replace(frfs, values=frfs.values * np.exp(-frfs.s[:, None] * 12 / 13))
    fit = fit_modes(early, options=FitOptions(band_hz=(110.5, 129.5), delay=False))
    assert fit.n_modes < 19
