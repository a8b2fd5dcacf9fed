"""FRFs of hammer tests are the transfer function, at the complex frequency that they claim."""

import numpy as np
import pytest

from frf_ipz.diagnosis.observations import observe
from frf_ipz.dofs import parse_dof
from frf_ipz.errors import InputError
from frf_ipz.ingest.campaign_file import read_test
from frf_ipz.ingest.estimate import estimate_frfs
from frf_ipz.ingest.options import IngestOptions
from frf_ipz.ingest.recording_files import RecordingFiles
from frf_ipz.ingest.records import read_records
from frf_ipz.ingest.survey.file_index import CELL
from synthetic_campaign import HIT, Structure, hammer_campaign, impact, pulse, write_csv, write_test

EXACT = 2e-6  # relative: 17 digits in the files, and a pulse that is cut 15 standard deviations from its middle
RINGING = Structure(damping_ratio=(0.0006, 0.002, 0.004))  # 79 % of the first mode remains after 2 s
RECORD = '[[record]]\ndof = "7:+z"\nfiles = ["hits/*.csv"]\n'
BAND_HZ = (5.0, 400.0)


def estimate(path, **options):
    return estimate_frfs(read_test(path), options=IngestOptions(**options))


def errors(result, structure, columns=slice(None)):
    """Give the errors in the band over the largest value of each FRF."""
    frfs = result.frfs
    band = frfs.in_band(BAND_HZ)
    truth = structure.accelerance(frfs.s[band])[:, columns]
    return np.abs(frfs.values[band] - truth) / np.abs(truth).max(axis=0)


@pytest.mark.parametrize("estimator", ["H1", "H2", "Hv"])
def test_frfs_without_noise_are_the_transfer_function(tmp_path, estimator):
    structure = Structure()
    result = estimate(hammer_campaign(tmp_path, structure=structure), estimator=estimator)
    assert result.frfs.window_decay_1_s == 0.0
    assert errors(result, structure).max() < EXACT
    assert list(result.frfs.averages) == [3, 3]
    assert [str(label) for label in result.frfs.labels] == ["1:+z / 7:+z", "2:+z / 7:+z"]
    assert result.warnings == ()


def test_an_exponential_window_is_taken_back_exactly(tmp_path):
    structure = Structure()
    result = estimate(hammer_campaign(tmp_path, structure=structure), exponential_window_s=0.25)
    assert result.frfs.window_decay_1_s == pytest.approx(4.0)
    assert errors(result, structure).max() < EXACT


def windowed_campaign(folder, structure, time_constant_s, *, first=1, force_noise=0.0):
    """Write recordings as an analyser does that has put an exponential window on the responses alone, or on all."""
    step_s = 1 / 2048
    for number, height in enumerate((100.0, 60.0, 150.0), start=1):
        signals = impact(structure, height=height)
        signals[0] += force_noise * np.random.default_rng(number).standard_normal(signals.shape[1])
        signals[first:] *= np.exp(-np.arange(signals.shape[1]) * step_s / time_constant_s)
        write_csv(folder / "hits" / f"p7_{number:02d}.csv", signals, step_s, start_s=5.0)
    return lambda head: write_test(folder, HIT, n_outputs=structure.n_outputs, head=head)


def test_a_window_that_the_analyser_has_applied_is_taken_back(tmp_path):
    structure = Structure()
    write = windowed_campaign(tmp_path, structure, 0.4)
    stated = estimate(write("applied_exponential_window_s = 0.4"))
    assert stated.frfs.window_decay_1_s == 0.0
    assert errors(stated, structure).max() < EXACT
    assert errors(estimate(write("")), structure).max() > 0.2  # peaks that the window has widened


@pytest.mark.parametrize("first", [0, 1], ids=["on the force too", "on responses alone"])
def test_whether_a_window_was_on_the_force_shows_in_its_noise(tmp_path, first):
    structure = Structure()
    write = windowed_campaign(tmp_path, structure, 0.4, first=first, force_noise=1e-3)
    stated = estimate(write("applied_exponential_window_s = 0.4"))
    assert np.median(errors(stated, structure)) < 1e-3
    assert any("from the force too" in note for note in stated.choices) == (first == 0)


def test_a_window_after_which_nothing_is_left_is_refused(tmp_path):
    write = windowed_campaign(tmp_path, Structure(), 0.4)
    with pytest.raises(InputError, match=r"applied_exponential_window_s.*has left nothing"):
        estimate(write("applied_exponential_window_s = 0.04"))
    with pytest.raises(InputError, match="belongs to impacts"):
        read_test(
            write_test(tmp_path, HIT.replace("hit", "record"), kind="random", head="applied_exponential_window_s = 0.4")
        )


def test_decays_that_are_cut_off_get_the_window_they_need(tmp_path):
    path = hammer_campaign(tmp_path, structure=RINGING)
    result = estimate(path)
    truncated = estimate(path, exponential_window_s=0.0)
    remainder = np.exp(-0.0006 * 2 * np.pi * 31.0 * (4096 / 2048 - 0.03))
    assert result.records.remaining_amplitude.max() == pytest.approx(remainder, rel=0.05)
    assert result.records.marks.str.contains("cut-off decay").all()
    assert result.records.used.all()
    assert errors(truncated, RINGING).max() > 0.5
    assert errors(result, RINGING).max() < 1e-3  # 0.03 % of the slowest mode remain, spread over a wider peak
    assert "exponential window" in result.choices[0]
    assert any("is cut off" in warning for warning in truncated.warnings)


def test_a_decay_is_cut_off_where_what_is_missing_exceeds_the_noise(tmp_path):
    structure = Structure(damping_ratio=(0.0186, 0.02, 0.012))  # 0.8 in 1000 of the first mode remains
    windows = []
    for noise in (0.002, 2.0):
        frfs = estimate(hammer_campaign(tmp_path / str(noise), structure=structure, noise=noise, seed=1)).frfs
        band = frfs.in_band(BAND_HZ)
        over_std = np.abs(frfs.values[band] - structure.accelerance(frfs.s[band])) / np.sqrt(frfs.variance[band])
        assert np.sqrt(np.mean(over_std**2)) == pytest.approx(1.0, abs=0.2)  # 7 in the quiet test without a window
        windows.append(frfs.window_decay_1_s)
    assert windows[0] > 0.0
    assert windows[1] == 0.0


def test_what_the_end_of_a_record_cuts_off_is_in_the_variance(tmp_path):
    frfs = estimate(hammer_campaign(tmp_path, structure=RINGING, noise=2e-3, seed=1)).frfs
    band = frfs.in_band(BAND_HZ)
    over_std = np.abs(frfs.values[band] - RINGING.accelerance(frfs.s[band])) / np.sqrt(frfs.variance[band])
    assert frfs.window_decay_1_s > 0.0
    assert over_std.max() < 3.5
    assert 0.7 < np.sqrt(np.mean(over_std**2)) < 1.3


def test_an_exponential_window_does_not_magnify_what_precedes_the_pulse(tmp_path):
    rng = np.random.default_rng(2)
    for number in range(3):
        signals = impact(RINGING, height=100.0 + 20 * number, at_s=0.2)
        signals[0] += 1e-6 * rng.standard_normal(signals.shape[1])
        before = int(np.argmax(np.abs(signals[0]) > 1.0)) - 100
        signals[1:, :before] += rng.standard_normal((len(signals) - 1, before))
        write_csv(tmp_path / "hits" / f"p_{number}.csv", signals, 1 / 2048)
    result = estimate(write_test(tmp_path, HIT))
    assert result.frfs.window_decay_1_s > 0.0
    assert errors(result, RINGING).max() < 1e-3  # what the window leaves of the slowest mode


def test_lines_that_a_window_correlates_are_counted(tmp_path):
    result = estimate(hammer_campaign(tmp_path, structure=RINGING))
    decay = result.frfs.window_decay_1_s * 2.0
    assert result.frfs.correlated_lines == round(0.5 * decay / np.tanh(0.5 * decay))
    assert np.diff(result.frfs.frequency_hz) == pytest.approx(0.5)


def test_a_recording_that_starts_long_before_the_impact_is_cut_to_it(tmp_path):
    structure = Structure()
    path = hammer_campaign(tmp_path, structure=structure, at_s=0.7, n_samples=8192)
    result = estimate(path)
    assert errors(result, structure).max() < EXACT
    assert result.records.trigger_s.max() < 0.3
    assert result.records.samples.max() < 8192


def test_the_force_window_takes_out_the_noise_of_the_force(tmp_path):
    structure, rng = Structure(), np.random.default_rng(3)
    for number in range(6):
        signals = impact(structure)
        signals[0] += 0.05 * rng.standard_normal(4096)
        write_csv(tmp_path / "hits" / f"p_{number}.csv", signals, 1 / 2048)
    path = write_test(tmp_path, HIT)
    with_window, without = estimate(path), estimate(path, force_window_s=0.0)
    assert "force window" in with_window.choices[0]
    assert without.choices == ()
    rms = [np.sqrt(np.mean(errors(result, structure) ** 2)) for result in (with_window, without)]
    assert rms[0] < 0.3 * rms[1]


def test_nothing_is_windowed_where_the_force_is_silent(tmp_path):
    assert estimate(hammer_campaign(tmp_path)).choices == ()


def test_a_force_window_may_be_asked_for(tmp_path):
    result = estimate(hammer_campaign(tmp_path), force_window_s=0.02)
    assert "20 ms after it: as asked for" in result.choices[0]
    assert errors(result, Structure()).max() < EXACT


def test_several_impacts_in_a_file_are_found_by_their_pulses(tmp_path):
    structure, step_s = Structure(), 1 / 2048
    heights = np.zeros(5 * 4096)
    for start, height in zip((300, 4500, 8600, 12800, 17000), (100, 8.0, 70, 120, 90), strict=True):
        heights += pulse(len(heights), step_s, height=height, at_s=start * step_s)
    write_csv(tmp_path / "hits" / "all.csv", impact(structure, force=heights), step_s)
    result = estimate(write_test(tmp_path, HIT))
    assert list(result.records.record) == [f"hits/all.csv#{number}" for number in range(1, 6)]
    assert result.records.peak_force_N.to_numpy() == pytest.approx([100, 8, 70, 120, 90], rel=1e-3)
    assert list(result.frfs.averages) == [5, 5]
    assert errors(result, structure).max() < 2e-3  # motion that remains of the impact before


def test_an_impact_at_the_beginning_of_a_file_does_not_shorten_the_lead_of_those_after_it(tmp_path):
    step_s = 1 / 2048
    heights = np.zeros(3 * 4096)
    for start in (40, 4240, 8440):
        heights += pulse(len(heights), step_s, at_s=start * step_s)
    write_csv(tmp_path / "hits" / "all.csv", impact(Structure(), force=heights), step_s)
    test = read_test(write_test(tmp_path, HIT))
    result = estimate_frfs(test, options=IngestOptions())
    first, *later = result.records.trigger_s
    assert first < 40 * step_s
    assert min(later) > 0.9 * CELL * step_s
    records = observe(test, ingest=IngestOptions(), frfs=result.frfs).records
    assert [record.number for record in records] == [1, 2, 3]
    assert [record.has_predecessor for record in records] == [False, True, True]
    pulses = [record.start_s + record.step_s * np.argmax(record.force) for record in records]
    np.testing.assert_allclose(np.diff(pulses), 4200 * step_s)
    assert len({record.recording for record in records}) == 1


def test_a_short_record_is_padded_with_zeros(tmp_path):
    path = hammer_campaign(tmp_path, structure=RINGING)
    short = impact(RINGING, n_samples=2500)
    write_csv(tmp_path / "hits" / "p7_02.csv", short, 1 / 2048)
    result = estimate(path, keep=("p7_02.csv",))
    assert list(result.records.samples) == [4096, 2500, 4096]
    assert errors(result, RINGING).max() < 1e-3


def test_recordings_whose_lengths_differ_by_a_little_are_used(tmp_path):
    path = hammer_campaign(tmp_path)
    write_csv(tmp_path / "hits" / "p7_02.csv", impact(Structure(), n_samples=4090), 1 / 2048)
    assert errors(estimate(path), Structure()).max() < 1e-5


def test_offsets_are_removed(tmp_path):
    structure = Structure()
    for number in range(3):
        signals = impact(structure, height=100.0 + 20 * number)
        signals += np.array([[2.0], [5.0], [-3.0]])
        write_csv(tmp_path / "hits" / f"p_{number}.csv", signals, 1 / 2048)
    result = estimate(write_test(tmp_path, HIT), exponential_window_s=0.3)
    assert errors(result, structure).max() < EXACT
    assert "DC offset of acc_1: 5 m/s^2, removed" in result.records.marks[0]
    assert "DC offset of force: 2 N" in result.records.marks[0]


@pytest.mark.parametrize(("step", "noise"), [(0.0, 0.02), (0.05, 0.02)], ids=["fine", "coarse"])
def test_offset_is_seen_beside_the_ringing_of_a_filter_before_a_strong_impact(tmp_path, step, noise):
    """The ringing is some 100 times the noise, so that among it every offset could be chance."""
    rng, offset = np.random.default_rng(5), np.array([0.0, 0.04, -0.04])[:, None]
    signals = impact(Structure(), noise=noise, rng=rng) + offset
    n_before = int(np.argmax(np.abs(signals[0]) > 1.0))
    signals[1:, :n_before] += 3.0 * (-0.6) ** np.arange(n_before, 0, -1)
    if step:
        signals = step * np.round(signals / step)
    write_csv(tmp_path / "hits" / "p_0.csv", signals, 1 / 2048)
    (record,) = read_records(RecordingFiles(test=read_test(write_test(tmp_path, HIT))), IngestOptions())
    removed = signals[1:, :1] - record.responses[:, :1]
    scatter = np.hypot(noise, step / np.sqrt(12)) / np.sqrt(n_before)
    np.testing.assert_allclose(removed, offset[1:], rtol=0, atol=4 * scatter)  # a false alarm in some 10 000


def test_motion_from_the_impact_before_is_no_offset(tmp_path):
    """A slow mode that still moves looks like a constant for as long as the recording shows before the next impact."""
    step_s, offsets = 1 / 32768, np.array([[0.0], [0.02], [-0.03]])
    heights = np.zeros(3 * 8192)
    for start in (400, 8592, 16784):
        heights += pulse(len(heights), step_s, at_s=start * step_s)
    signals = impact(RINGING, force=heights, step_s=step_s)
    write_csv(tmp_path / "hits" / "all.csv", signals + offsets, step_s)
    records = list(read_records(RecordingFiles(test=read_test(write_test(tmp_path, HIT))), IngestOptions()))
    assert len(records) == 3
    start = len(heights) - sum(record.n_samples for record in records)
    for record in records:
        error = record.responses - signals[1:, start : start + record.n_samples]
        assert np.abs(error).max() < 1e-6 * np.abs(signals).max()  # the pulse has no sharp beginning
        start += record.n_samples


def test_signs_of_dofs_and_forces_are_unchanged(tmp_path):
    structure = Structure()
    for number in range(2):
        write_csv(tmp_path / "hits" / f"p_{number}.csv", -impact(structure), 1 / 2048)
    path = write_test(tmp_path, HIT.replace("7:+z", "7:-z"))
    frfs = estimate(path).frfs
    assert frfs.labels[0].input_dof == parse_dof("7:-z")
    assert frfs.labels[0].sign == -1
    assert errors(estimate(path), structure).max() < EXACT


def test_a_roving_hammer_gives_a_column_for_every_struck_dof(tmp_path):
    structure, structure_from_9 = Structure(), Structure(shapes=((0.2, 0.4, 0.8), (0.9, -0.3, 0.1)))
    write_csv(tmp_path / "a" / "1.csv", impact(structure), 1 / 2048)
    write_csv(tmp_path / "b" / "1.csv", impact(structure_from_9), 1 / 2048)
    body = '[[hit]]\ndof = "7:+z"\nfiles = ["a/*.csv"]\n[[hit]]\ndof = "9:-x"\nfiles = ["b/*.csv"]\n'
    result = estimate(write_test(tmp_path, body))
    values, measured = result.frfs.matrix()
    assert measured.all()
    band = result.frfs.in_band(BAND_HZ)
    for place, truth in enumerate((structure, structure_from_9)):
        expected = truth.accelerance(result.frfs.s[band])
        assert np.abs(values[band, :, place] - expected).max() < EXACT * np.abs(expected).max()


def test_a_roving_sensor_gives_its_frfs_and_the_reference_one(tmp_path):
    first, second = Structure(), Structure(shapes=((1.0, 0.7, -0.5), (0.2, 0.9, 0.4)))
    for folder, structure in (("a", first), ("b", second)):
        for number in range(2):
            write_csv(tmp_path / folder / f"{number}.csv", impact(structure, height=80.0 + 9 * number), 1 / 2048)
    body = (
        '[[hit]]\ndof = "7:+z"\nfiles = ["a/*.csv"]\n'
        '[[hit]]\ndof = "7:+z"\nfiles = ["b/*.csv"]\noutput_dofs = { acc_2 = "5:+z" }\n'
    )
    frfs = estimate(write_test(tmp_path, body)).frfs
    assert [str(label) for label in frfs.labels] == ["1:+z / 7:+z", "2:+z / 7:+z", "5:+z / 7:+z"]
    assert list(frfs.averages) == [4, 2, 2]
    band = frfs.in_band(BAND_HZ)
    s = frfs.s[band]
    truth = np.column_stack([first.accelerance(s), second.accelerance(s)[:, 1]])
    assert np.abs(frfs.values[band] - truth).max() < EXACT * np.abs(truth).max()


def test_units_and_sensitivities_are_brought_to_si(tmp_path):
    structure = Structure()
    for number in range(2):
        signals = impact(structure)
        signals[0] /= 4.4482216152605  # in pounds-force
        signals[1:] *= 10.2 / 9.80665  # in mV of a sensor of 10.2 mV/g
        write_csv(tmp_path / "hits" / f"p_{number}.csv", signals, 1 / 2048)
    path = write_test(tmp_path, HIT, force_unit="lbf")
    path.write_text(path.read_text().replace('unit = "m/s^2"', 'sensitivity = "10.2 mV/g_0"'))
    assert errors(estimate(path), structure).max() < EXACT


def test_a_response_may_be_a_velocity(tmp_path):
    structure, step_s = Structure(), 1 / 2048
    force = pulse(4096, step_s)
    omega = 2 * np.pi * np.fft.rfftfreq(8 * 4096, step_s)
    mobility = structure.accelerance(1j * omega)[:, 0] / np.where(omega > 0, 1j * omega, np.inf)
    velocity = np.fft.irfft(np.fft.rfft(force, 8 * 4096) * mobility)[:4096] * 1e3
    write_csv(tmp_path / "hits" / "1.csv", np.vstack([force, velocity]), step_s)
    path = write_test(tmp_path, HIT, n_outputs=1)
    path.write_text(path.read_text().replace("acceleration", "velocity").replace("m/s^2", "mm/s"))
    frfs = estimate(path).frfs
    assert frfs.labels[0].quantity.value == "mobility"
    band = frfs.in_band(BAND_HZ)
    truth = structure.accelerance(frfs.s[band])[:, :1] / frfs.s[band, None]
    assert np.abs(frfs.values[band] - truth).max() < EXACT * np.abs(truth).max()


def test_the_variance_of_a_single_impact_is_the_noise_in_its_own_record(tmp_path):
    """Over many lines the squared error is what the variance says, though nothing was averaged."""
    structure = Structure()
    path = hammer_campaign(tmp_path, structure=structure, heights=(100.0,), noise=0.05, seed=4)
    result = estimate(path, exponential_window_s=0.3)
    band = result.frfs.in_band(BAND_HZ)
    truth = structure.accelerance(result.frfs.s[band])
    ratio = np.abs(result.frfs.values[band] - truth) ** 2 / result.frfs.variance[band]
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.3)  # under the window a sixth of the 790 lines is independent
    assert np.isnan(result.frfs.coherence).all()
    assert any("a single record at 7:+z: no coherence" in warning for warning in result.warnings)


def test_the_variance_of_several_impacts_is_their_error(tmp_path):
    structure = Structure()
    path = hammer_campaign(tmp_path, structure=structure, heights=(100, 60, 150, 80, 120), noise=0.05, seed=5)
    frfs = estimate(path).frfs
    band = frfs.in_band(BAND_HZ)
    ratio = np.abs(frfs.values[band] - structure.accelerance(frfs.s[band])) ** 2 / frfs.variance[band]
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.2)
    assert np.median(frfs.coherence[band]) > 0.99


def test_the_scatter_between_impacts_is_what_the_variance_says(tmp_path):
    """FRFs of single impacts scatter about their mean as the variance of the mean predicts."""
    path = hammer_campaign(tmp_path, heights=(100.0,) * 6, noise=0.05, seed=6, at_s=0.0303)
    names = [f"p7_{number:02d}.csv" for number in range(1, 7)]
    windows = {"exponential_window_s": 0.3}
    mean = estimate(path, **windows).frfs
    alone = [
        estimate(path, drop=tuple(rest for rest in names if rest != name), **windows).frfs.values for name in names
    ]
    band = mean.in_band(BAND_HZ)
    scatter = np.var(alone, axis=0, ddof=1)[band] / 6
    assert np.mean(scatter / mean.variance[band]) == pytest.approx(1.0, abs=0.2)


def test_a_response_may_be_a_rotation(tmp_path):
    structure = Structure()
    for number in range(2):
        signals = impact(structure, height=90.0 + number)
        signals[2] *= 1e3  # in mrad/s^2
        write_csv(tmp_path / "hits" / f"{number}.csv", signals, 1 / 2048)
    path = write_test(tmp_path, HIT)
    head, tail = path.read_text(encoding="utf-8").split('column = "acc_2"')
    tail = tail.replace('unit = "m/s^2"', 'unit = "mrad/s^2"').replace('dof = "2:+z"', 'dof = "1:-ry"')
    path.write_text(f'{head}column = "acc_2"{tail}', encoding="utf-8")
    result = estimate(path)
    assert errors(result, structure).max() < EXACT
    assert result.frfs.labels[1].unit == "rad/s^2/N"
    assert result.frfs.labels[1].sign == -1
