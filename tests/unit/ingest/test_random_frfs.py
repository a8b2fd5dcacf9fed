"""Shaker tests: records without their transients; segments and exponential windows as options."""

import numpy as np
import pytest

from frf_ipz.errors import InputError
from frf_ipz.ingest.campaign_file import read_test
from frf_ipz.ingest.estimate import estimate_frfs
from frf_ipz.ingest.options import IngestOptions
from frf_ipz.ingest.recording_files import RecordingFiles
from frf_ipz.ingest.records import read_records
from frf_ipz.ingest.signals.clipping import is_clipped
from frf_ipz.ingest.signals.periods import find_period
from frf_ipz.ingest.signals.windows import count_independent_segments, cut_segments
from synthetic_campaign import Structure, respond, write_csv, write_test

STEP_S = 1 / 1024
RECORD = '[[record]]\ndof = "7:+z"\nfiles = ["records/*.csv"]\n'
STRUCTURE = Structure()
BAND_HZ = (10.0, 250.0)


def estimate(path, **options):
    return estimate_frfs(read_test(path), options=IngestOptions(**options))


def smooth_noise(rng, n_samples):
    """Random force without anything near half of the sampling rate, where sampled responses are no longer exact."""
    spectrum = np.fft.rfft(rng.standard_normal(n_samples))
    frequency = np.fft.rfftfreq(n_samples, STEP_S)
    return np.fft.irfft(spectrum * np.exp(-((frequency / 280.0) ** 8)), n_samples)


def from_rest(rng, n_samples, *, structure=STRUCTURE, noise=0.0):
    """Force that is switched on after a short while, and the responses."""
    force = smooth_noise(rng, n_samples)
    start = n_samples // 50
    force *= np.clip((np.arange(n_samples) - start) / start, 0.0, 1.0) ** 2
    signals = np.vstack([force, respond(structure, force, STEP_S)])
    signals[1:] += noise * rng.standard_normal(signals[1:].shape)
    return signals


def stationary(rng, n_samples, **options):
    """A record of a test that has been running for a while."""
    return from_rest(rng, n_samples + 8192, **options)[:, 8192:]


def write(folder, records, step_s=STEP_S):
    for number, signals in enumerate(records):
        write_csv(folder / "records" / f"{number}.csv", signals, step_s)
    return write_test(folder, RECORD, kind="random")


def errors(frfs, structure=STRUCTURE):
    band = frfs.in_band(BAND_HZ)
    truth = structure.accelerance(frfs.s[band])
    return np.abs(frfs.values[band] - truth) / np.abs(truth).max(axis=0)


def test_a_long_stationary_record_is_cut_into_subrecords(tmp_path):
    rng = np.random.default_rng(1)
    result = estimate(write(tmp_path, [stationary(rng, 120_000, noise=0.01)]))
    assert result.choices[0].startswith("sub-records of 29.3 s, transients at both ends removed")
    assert result.frfs.window_decay_1_s == 0.0
    assert list(result.frfs.averages) == [4, 4]
    assert errors(result.frfs).max() < 0.01
    assert result.warnings == ()
    assert np.median(result.frfs.coherence[result.frfs.in_band(BAND_HZ)]) > 0.99


def test_running_records_give_exact_frfs_of_modes_that_are_narrower_than_their_lines(tmp_path):
    """Three records of 3 s at 0.05 % damping: half-power widths of 0.02 to 0.2 Hz, lines 0.34 Hz apart."""
    rng = np.random.default_rng(6)
    light = Structure(damping_ratio=(0.0005, 0.0005, 0.0005))
    path = write(tmp_path, [stationary(rng, 3000, structure=light) for _ in range(3)])
    whole, segments = estimate(path), estimate(path, segment_s=1.5)
    assert whole.choices[0].startswith("records used whole, transients at both ends removed")
    assert errors(whole.frfs, light).max() < 0.01
    assert errors(segments.frfs, light).max() > 0.2


def test_a_single_short_record_is_cut_into_subrecords_whose_scatter_is_the_noise(tmp_path):
    frfs = estimate(write(tmp_path, [stationary(np.random.default_rng(14), 6000, noise=0.1)])).frfs
    assert list(frfs.averages) == [3, 3]
    assert np.isfinite(frfs.variance[1:-1]).all()


def test_the_variance_of_subrecords_is_their_error(tmp_path):
    rng = np.random.default_rng(15)
    frfs = estimate(write(tmp_path, [stationary(rng, 8192, noise=0.3) for _ in range(6)])).frfs
    band = frfs.in_band(BAND_HZ)
    error = np.abs(frfs.values - STRUCTURE.accelerance(frfs.s))[band] ** 2
    assert np.mean(error / frfs.variance[band]) == pytest.approx(1.0, abs=0.2)


def test_records_from_rest_give_exact_frfs(tmp_path):
    rng = np.random.default_rng(2)
    light = Structure(damping_ratio=(0.003, 0.002, 0.002))
    result = estimate(write(tmp_path, [from_rest(rng, 8192, structure=light) for _ in range(4)]))
    assert result.choices[0].startswith("records used whole, transients at both ends removed")
    assert result.frfs.window_decay_1_s == 0.0
    assert list(result.frfs.averages) == [4, 4]
    assert errors(result.frfs, light).max() < 1e-4
    assert result.records.used.all()


def test_an_exponential_window_may_be_asked_for(tmp_path):
    rng = np.random.default_rng(2)
    light = Structure(damping_ratio=(0.003, 0.002, 0.002))
    records = [from_rest(rng, 8192, structure=light) for _ in range(4)]
    result = estimate(write(tmp_path, records), exponential_window_s=8192 * STEP_S / 7.0)
    assert "records used whole, with an exponential window" in result.choices[0]
    assert result.frfs.window_decay_1_s == pytest.approx(7.0 / (8192 * STEP_S))
    assert errors(result.frfs, light).max() < 5e-3  # exp(-7) of the motion at the end is cut off


def test_segments_would_lose_the_peaks_of_records_from_rest(tmp_path):
    """At 0.4 % damping, segments of a quarter of the record lose a tenth of the peaks, and nothing shows it."""
    rng = np.random.default_rng(11)
    light = Structure(damping_ratio=(0.004, 0.004, 0.004))
    path = write(tmp_path, [from_rest(rng, 16_384, structure=light, noise=0.3) for _ in range(3)])
    whole, segments = estimate(path).frfs, estimate(path, segment_s=4.0).frfs
    assert errors(whole, light).max() < 0.05
    assert errors(segments, light).max() > 0.1


def test_a_single_long_record_from_rest_is_cut_into_subrecords(tmp_path):
    result = estimate(write(tmp_path, [from_rest(np.random.default_rng(12), 120_000)]))
    assert "sub-records of" in result.choices[0]
    assert np.isfinite(result.frfs.variance[1:-1]).all()


def test_the_variance_under_an_exponential_window_is_the_error(tmp_path):
    rng = np.random.default_rng(3)
    light = Structure(damping_ratio=(0.003, 0.002, 0.002))
    path = write(tmp_path, [from_rest(rng, 8192, structure=light, noise=0.3) for _ in range(6)])
    frfs = estimate(path, exponential_window_s=8192 * STEP_S / 7.0).frfs
    band = frfs.in_band(BAND_HZ)
    error = np.abs(frfs.values - light.accelerance(frfs.s))[band] ** 2
    assert np.mean(error / frfs.variance[band]) == pytest.approx(1.0, abs=0.2)


def test_the_variance_of_segments_is_their_error(tmp_path):
    rng = np.random.default_rng(4)
    frfs = estimate(write(tmp_path, [stationary(rng, 60_000, noise=0.3)]), segment_s=4.0).frfs
    band = frfs.in_band(BAND_HZ)
    error = np.abs(frfs.values - STRUCTURE.accelerance(frfs.s))[band] ** 2
    assert np.mean(error / frfs.variance[band]) == pytest.approx(1.0, abs=0.25)


def multisine(rng, n_period, lines):
    """Give one period of a force with equal amplitudes and random phases."""
    spectrum = np.zeros(n_period // 2 + 1, complex)
    spectrum[lines] = np.exp(2j * np.pi * rng.random(len(lines)))
    period = np.fft.irfft(spectrum, n_period)
    return period / period.std()


@pytest.mark.parametrize("step", [1, 2], ids=["every line", "odd lines, so that the force comes again with minus"])
def test_periodic_excitation_is_transformed_in_whole_periods(tmp_path, step):
    rng = np.random.default_rng(11)
    force = np.tile(multisine(rng, 2048, np.arange(11, 505, step)), 9)
    signals = np.vstack([force, respond(STRUCTURE, force, STEP_S)])[:, 4096 - 700 :]  # long after the start
    signals += 0.003 * rng.standard_normal(signals.shape) * signals.std(axis=1, keepdims=True)
    result = estimate(write(tmp_path, [signals]))
    assert result.choices == ("the force comes again every 2 s: parts of 2 s, whole periods",)
    assert result.warnings == ()
    assert len(result.frfs.frequency_hz) == 1025
    band = result.frfs.in_band(BAND_HZ) & (np.arange(1025) % 2 == 1)
    truth = STRUCTURE.accelerance(result.frfs.s[band])
    error = np.abs(result.frfs.values[band] - truth)
    assert (error / np.abs(truth).max(axis=0)).max() < 0.01
    assert np.sqrt(np.mean(error**2 / result.frfs.variance[band])) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("seed", range(3))
def test_lines_that_a_periodic_force_leaves_out_have_no_variance(tmp_path, seed):
    """What stands there is the quotient of two noises."""
    rng = np.random.default_rng(seed)
    excited = np.arange(11, 505, 3)
    force = np.tile(multisine(rng, 2048, excited), 9)
    signals = np.vstack([force, respond(STRUCTURE, force, STEP_S)])[:, 4096:]
    signals += 0.003 * rng.standard_normal(signals.shape) * signals.std(axis=1, keepdims=True)
    variance = estimate(write(tmp_path, [signals])).frfs.variance
    assert np.array_equal(np.flatnonzero(np.isfinite(variance[:, 0])), excited)


def chirp(n_period):
    """Give one period of a force that sweeps up, 2 to 250 Hz: smooth from line to line."""
    t_s = np.arange(n_period) * STEP_S
    return np.sin(2 * np.pi * (2.0 + 124.0 * t_s / (n_period * STEP_S)) * t_s)


@pytest.mark.parametrize("begin", [4096, 0], ids=["long after the start", "from rest"])
def test_periodic_sweeps_are_free_of_bias_too(tmp_path, begin):
    rng = np.random.default_rng(12)
    force = np.tile(chirp(2048), 12)
    signals = np.vstack([force, respond(STRUCTURE, force, STEP_S)])[:, begin:]
    signals[1:] += 0.003 * rng.standard_normal(signals[1:].shape) * signals[1:].std(axis=1, keepdims=True)
    result = estimate(write(tmp_path, [signals]))
    about_start = [text for text in result.choices if "dies out, left out" in text]
    assert len(about_start) == (begin == 0)
    band = result.frfs.in_band((5.0, 240.0))
    truth = STRUCTURE.accelerance(result.frfs.s[band])
    error = np.abs(result.frfs.values[band] - truth)
    assert np.sqrt(np.mean(error**2 / result.frfs.variance[band])) == pytest.approx(1.0, abs=0.15)


def test_what_does_not_come_again_has_no_period():
    rng = np.random.default_rng(5)
    noise = rng.standard_normal(8192)
    assert find_period(noise) == 0
    assert find_period(smooth_noise(rng, 8192)) == 0
    spectrum, hertz = np.fft.rfft(noise), np.fft.rfftfreq(8192, STEP_S)
    narrow = np.fft.irfft(spectrum * np.exp(-(((hertz - 40.0) / 1.0) ** 2)), 8192)  # alike after one cycle
    assert find_period(narrow) == 0
    assert find_period(np.sin(1e-2 * np.arange(8192) ** 1.5)) == 0
    assert find_period(np.zeros(8192)) == 0
    assert find_period(np.tile(noise[:1000], 8) + 0.02 * rng.standard_normal(8000)) == 1000
    assert find_period(np.tile(noise[:1000], 2)[:1900]) == 0  # not once again as a whole


def test_segments_may_be_asked_for(tmp_path):
    path = write(tmp_path, [stationary(np.random.default_rng(5), 20_000)])
    result = estimate(path, segment_s=2.0)
    assert result.frfs.frequency_hz[1] == pytest.approx(0.5)
    assert list(result.frfs.averages) == [20_000 // 1024 - 1] * 2
    assert "as asked for" in result.choices[0]


def test_an_overload_costs_one_channel_of_one_record(tmp_path):
    rng = np.random.default_rng(7)
    records = [stationary(rng, 20_000, noise=0.01) for _ in range(3)]
    limit = 0.4 * np.abs(records[1][1]).max()
    records[1][1] = np.clip(records[1][1], -limit, limit)
    result = estimate(write(tmp_path, records))
    assert list(result.records.used) == [True, True, True]
    assert result.records.marks[1] == "overload of acc_1"
    subrecords = result.frfs.averages[1] // 3
    assert list(result.frfs.averages) == [2 * subrecords, 3 * subrecords]


@pytest.mark.parametrize("segment_s", [1e-3, 1e3])
def test_segments_that_cannot_be_are_refused(tmp_path, segment_s):
    path = write(tmp_path, [stationary(np.random.default_rng(8), 4000)])
    with pytest.raises(InputError, match=r"segment_s = .* samples; possible are 32 to 4000"):
        estimate(path, segment_s=segment_s)


def test_records_can_be_read_whole(tmp_path):
    signals = from_rest(np.random.default_rng(9), 8192)
    (record,) = read_records(RecordingFiles(test=read_test(write(tmp_path, [signals]))), IngestOptions())
    assert record.starts_at_rest
    np.testing.assert_allclose(record.force, signals[0], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(record.responses, signals[1:], rtol=1e-12, atol=1e-12)


def test_half_overlapping_segments_cover_the_record():
    segments = list(cut_segments(np.ones((2, 1000)), 200))
    assert len(segments) == 9
    total = np.zeros(1000)
    for number, segment in enumerate(segments):
        total[100 * number : 100 * number + 200] += segment[0]
    np.testing.assert_allclose(total[100:900], 1.0, rtol=1e-12)


def test_overlapping_segments_are_worth_a_little_less_than_their_number():
    assert count_independent_segments(0) == 0.0
    assert count_independent_segments(1) == 1.0
    assert count_independent_segments(1000) == pytest.approx(1000 / (1 + 1 / 18), rel=1e-3)


def sweep(rng, n_samples, *, band_hz=BAND_HZ, noise=1e-3):
    """A sine of constant force through a band, from rest; it ends with the record."""
    time = STEP_S * np.arange(n_samples)
    low, high = band_hz
    phase = 2 * np.pi * (low * time + (high - low) * time**2 / (2 * time[-1]))
    force = np.sin(phase) * np.minimum(time / 0.1, 1.0)
    signals = np.vstack([force, respond(STRUCTURE, force, STEP_S)])
    return signals + noise * np.abs(signals).max(axis=1, keepdims=True) * rng.standard_normal(signals.shape)


def test_lines_near_the_ends_of_a_sweep_have_little_weight(tmp_path):
    """There a transient looks like the response; a sweep over a wider band shows what the response is."""
    rng = np.random.default_rng(21)
    records = [sweep(rng, 8192), sweep(rng, 8192, band_hz=(10.0, 330.0)), sweep(rng, 8192)]
    result = estimate(write(tmp_path, records))
    assert result.records.used.all()
    band = result.frfs.in_band(BAND_HZ)
    inside = result.frfs.frequency_hz[band] > 60.0
    error = errors(result.frfs)
    assert error[inside].max() < 5e-3
    largest = np.abs(STRUCTURE.accelerance(result.frfs.s[band])).max(axis=0)
    stated = np.sqrt(result.frfs.variance[band]) / largest
    assert np.sqrt(np.mean((error / stated)[inside] ** 2)) < 2.0


def test_a_sweep_is_clipped_only_where_it_was_cut():
    rng = np.random.default_rng(22)
    for _ in range(10):
        force = sweep(rng, 20_000, noise=0.0)[0] * (1 + 1e-7 * rng.standard_normal(20_000))
        swelling = force * (1 + 0.3 * np.sin(np.arange(20_000) / 3000 + rng.uniform(0, 6)))
        assert not is_clipped(force)
        assert not is_clipped(np.round(1e5 * force))
        assert is_clipped(np.clip(swelling, -1.1, 1.1))
        assert is_clipped(np.round(2048 * np.clip(swelling, -1.1, 1.1)))
