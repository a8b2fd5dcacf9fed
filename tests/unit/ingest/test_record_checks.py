"""Faults of records are reported; double hits, clipping, overload and a wrong step are left out, others stay in."""

import numpy as np
import pytest
from scipy.optimize import brentq

from frf_ipz.errors import InputError
from frf_ipz.ingest.campaign_file import read_test
from frf_ipz.ingest.estimate import estimate_frfs
from frf_ipz.ingest.options import IngestOptions
from frf_ipz.ingest.recording_files import RecordingFiles
from frf_ipz.ingest.records import read_records
from frf_ipz.ingest.signals.pulses import force_band
from synthetic_campaign import HIT, Structure, hammer_campaign, impact, pulse, write_csv, write_test

STEP_S = 1 / 2048
N_SAMPLES = 4096
NOISE = 0.02


def estimate(path, **options):
    return estimate_frfs(read_test(path), options=IngestOptions(**options))


def noisy(rng, **of_record):
    return impact(Structure(), noise=NOISE, rng=rng, **of_record)


def hit_twice(rng):
    force = pulse(N_SAMPLES, STEP_S) + pulse(N_SAMPLES, STEP_S, height=30.0, at_s=0.05)
    return noisy(rng, force=force)


def clipped(rng):
    signals = noisy(rng, height=140.0)
    signals[0] = np.minimum(signals[0], 90.0)
    return signals


def overloaded(rng):
    signals = noisy(rng)
    limit = 0.5 * np.abs(signals[1]).max()
    signals[1] = np.clip(signals[1], -limit, limit)
    return signals


def cut_off(rng):
    ringing = Structure(damping_ratio=(0.004, 0.02, 0.012))
    return impact(ringing, noise=NOISE, rng=rng)


def weak(rng):
    return noisy(rng, height=0.17)


def noisy_response(rng):
    signals = impact(Structure(), height=30.0)
    signals[1:] += np.abs(signals[1:]).max() * rng.standard_normal(signals[1:].shape)
    return signals


def moving(rng, share=0.1):
    signals = noisy(rng)
    time = np.arange(N_SAMPLES) * STEP_S
    before = np.exp(-time / 0.2) * np.sin(2 * np.pi * 88.0 * time)
    signals[1] += share * np.abs(signals[1]).max() * before
    return signals


def fine(rng):
    return noisy(rng, height=90.0)


def campaign(folder, make_last, *, step_s=STEP_S, n_good=2):
    """Write impacts of which the last is made by a function of its own."""
    rng = np.random.default_rng(5)
    for number in range(n_good):
        write_csv(folder / "hits" / f"p7_{number + 1}.csv", noisy(rng, height=100.0 + 20 * number), STEP_S)
    write_csv(folder / "hits" / "p7_bad.csv", make_last(rng), step_s)
    return write_test(folder, HIT)


@pytest.mark.parametrize(
    ("make_last", "mark"),
    [
        (hit_twice, "double hit: 30 % of the pulse 20 ms after it"),
        (clipped, "clipping of force"),
    ],
)
def test_bad_impacts_are_left_out_and_reported(tmp_path, make_last, mark):
    result = estimate(campaign(tmp_path, make_last))
    assert list(result.records.used) == [True, True, False]
    assert mark in result.records.marks[2]
    assert list(result.records.marks[:2]) == ["", ""]
    assert list(result.frfs.averages) == [2, 2]
    assert list(result.records.weight[2:]) == [0.0]
    assert any("hits/p7_bad.csv is left out" in text and mark in text for text in result.warnings)


@pytest.mark.parametrize(
    ("make_last", "mark"),
    [
        (cut_off, "cut-off decay"),
        (weak, "weak impact: its peak is"),
        (noisy_response, "weak impact: its response is"),
        (moving, "not at rest before the impact"),
    ],
)
def test_impacts_with_minor_faults_are_marked_and_stay(tmp_path, make_last, mark):
    result = estimate(campaign(tmp_path, make_last, n_good=1))
    assert mark in result.records.marks[1]
    assert result.records.marks[0] == ""
    assert result.records.used.all()
    assert list(result.frfs.averages) == [2, 2]


def test_a_weak_impact_has_little_weight(tmp_path):
    weights = estimate(campaign(tmp_path, weak)).records.weight
    assert weights.sum() == pytest.approx(1.0)
    assert weights[2] < 0.01 * weights[0]


def test_a_good_impact_has_no_mark(tmp_path):
    result = estimate(campaign(tmp_path, fine))
    assert list(result.records.marks) == ["", "", ""]
    assert result.warnings == ()


def test_weak_means_below_the_noise_and_not_weaker_than_others(tmp_path):
    result = estimate(campaign(tmp_path, lambda rng: noisy(rng, height=4.0)))
    assert result.records.marks[2] == ""


def test_a_little_motion_before_an_impact_is_no_fault(tmp_path):
    result = estimate(campaign(tmp_path, lambda rng: moving(rng, share=0.015)))
    assert result.records.marks[2] == ""


def test_a_wrong_time_step_is_left_out_and_reported(tmp_path):
    result = estimate(campaign(tmp_path, fine, step_s=1.3 * STEP_S))
    assert list(result.records.used) == [True, True, False]
    assert "wrong sampling step: 0.000634766 s where the others have 0.000488281 s" in result.records.marks[2]


def test_steps_that_differ_in_their_last_digits_are_one_step(tmp_path):
    result = estimate(campaign(tmp_path, fine, step_s=STEP_S * (1 + 1e-5)))
    assert result.records.used.all()


@pytest.mark.parametrize("make_last", [hit_twice, clipped])
def test_the_last_impact_at_a_dof_is_used_with_a_warning(tmp_path, make_last):
    result = estimate(campaign(tmp_path, make_last, n_good=0))
    assert list(result.records.used) == [True]
    assert any("is used although it is bad" in text and "7:+z" in text for text in result.warnings)
    assert not any("is left out" in text for text in result.warnings)


def test_of_bad_impacts_only_the_least_bad_is_used(tmp_path):
    rng = np.random.default_rng(6)
    harder = pulse(N_SAMPLES, STEP_S) + pulse(N_SAMPLES, STEP_S, height=60.0, at_s=0.05)
    write_csv(tmp_path / "hits" / "1.csv", noisy(rng, force=harder), STEP_S)
    write_csv(tmp_path / "hits" / "2.csv", hit_twice(rng), STEP_S)
    hit_twice_and_clipped = hit_twice(rng)
    hit_twice_and_clipped[0] = np.minimum(hit_twice_and_clipped[0], 70.0)
    write_csv(tmp_path / "hits" / "3.csv", hit_twice_and_clipped, STEP_S)
    result = estimate(write_test(tmp_path, HIT))
    assert list(result.records.used) == [False, True, False]


def test_a_dof_whose_impacts_are_bad_is_not_lost_beside_a_good_one(tmp_path):
    rng = np.random.default_rng(7)
    for name, make in (("a/1", fine), ("a/2", hit_twice), ("b/1", clipped), ("b/2", hit_twice)):
        write_csv(tmp_path / f"{name}.csv", make(rng), STEP_S)
    body = '[[hit]]\ndof = "7:+z"\nfiles = ["a/*.csv"]\n[[hit]]\ndof = "8:+z"\nfiles = ["b/*.csv"]\n'
    result = estimate(write_test(tmp_path, body))
    assert list(result.records.groupby("input_dof").used.sum()) == [1, 1]
    assert list(result.frfs.averages) == [1, 1, 1, 1]


@pytest.mark.parametrize("force_window_s", [None, 0.008])
def test_a_double_hit_that_is_kept_gives_the_right_frf(tmp_path, force_window_s):
    """Both pulses are in the force, so that nothing is wrong with the FRF when the window keeps them."""
    result = estimate(campaign(tmp_path, hit_twice, n_good=0), force_window_s=force_window_s)
    band = result.frfs.in_band((20.0, 250.0))
    truth = Structure().accelerance(result.frfs.s[band])
    assert np.abs(result.frfs.values[band] - truth).max() < 0.02 * np.abs(truth).max()


def test_the_user_overrules_the_checks(tmp_path):
    path = campaign(tmp_path, hit_twice)
    with_bad = estimate(path, keep=("p7_bad.csv",))
    assert with_bad.records.used.all()
    assert with_bad.records.marks[2].endswith("kept by the user")
    assert with_bad.warnings == ()
    without_first = estimate(path, drop=("hits/p7_1.csv",))
    assert list(without_first.records.used) == [False, True, False]
    assert without_first.records.marks[0] == "dropped by the user"


def test_one_impact_of_a_file_may_be_dropped(tmp_path):
    force = np.zeros(3 * N_SAMPLES)
    for start, height in ((300, 100.0), (4400, 80.0), (8500, 110.0)):
        force += pulse(len(force), STEP_S, height=height, at_s=start * STEP_S)
    write_csv(tmp_path / "hits" / "all.csv", impact(Structure(), force=force), STEP_S)
    result = estimate(write_test(tmp_path, HIT), drop=("hits/all.csv#2",))
    assert list(result.records.used) == [True, False, True]


def test_a_file_that_cannot_be_read_may_be_dropped(tmp_path):
    path = hammer_campaign(tmp_path)
    (tmp_path / "hits" / "p7_02.csv").write_text("rubbish\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"p7_02\.csv"):
        estimate(path)
    assert list(estimate(path, drop=("p7_02.csv",)).frfs.averages) == [2, 2]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"keep": ("p7_11.csv",)}, "keep: there is no record or file 'p7_11.csv'"),
        ({"drop": ("p7_01.csv#2",)}, "drop: there is no record or file 'p7_01.csv#2'"),
        ({"keep": ("p7_01.csv",), "drop": ("p7_01.csv",)}, "named by both keep and drop"),
        ({"drop": ("p7_01.csv", "p7_02.csv", "p7_03.csv")}, "drop leaves no record at 7:\\+z"),
        ({"exponential_window_s": -1.0}, "exponential_window_s: must be .* 0; given is -1"),
        ({"force_window_s": -1.0}, "force_window_s: must be .* 0; given is -1"),
    ],
)
def test_choices_that_make_no_sense_are_refused(tmp_path, options, says):
    with pytest.raises(InputError, match=says):
        estimate(hammer_campaign(tmp_path), **options)


def test_copies_of_one_impact_are_not_taken_for_clipped_ones(tmp_path):
    assert list(estimate(hammer_campaign(tmp_path, heights=(100.0, 100.0))).records.marks) == ["", ""]


def test_pulses_that_all_end_at_one_force_are_clipped(tmp_path):
    """A rail that cuts a single sample shows no plateau, but two impacts that meet it are equal to the last digit."""
    rng = np.random.default_rng(9)
    for number, delay in enumerate((0.0, 0.05, -0.08)):
        signals = noisy(rng, height=110.0 + number, at_s=(61 + delay) * STEP_S)
        signals[0] = np.minimum(signals[0], 100.0)
        assert np.sum(signals[0] == 100.0) == 1
        write_csv(tmp_path / "hits" / f"{number}.csv", signals, STEP_S)
    write_csv(tmp_path / "hits" / "9.csv", noisy(rng, height=80.0), STEP_S)
    result = estimate(write_test(tmp_path, HIT))
    assert list(result.records.used) == [False, False, False, True]
    assert "equals another record's to the last digit" in result.records.marks[0]


@pytest.mark.parametrize("step_N", [0.5, 8.0])
def test_forces_in_coarse_digital_steps_are_not_clipped(tmp_path, step_N):
    rng = np.random.default_rng(10)
    for number, height in enumerate((100.0, 101.0, 99.0)):
        signals = noisy(rng, height=height, at_s=0.03 + 1e-4 * number, length_s=1.5e-3)
        signals[0] = step_N * np.round(signals[0] / step_N)
        write_csv(tmp_path / "hits" / f"{number}.csv", signals, STEP_S)
    result = estimate(write_test(tmp_path, HIT))
    assert result.records.used.all()


def test_all_records_can_be_read_the_bad_ones_flagged(tmp_path):
    test = read_test(campaign(tmp_path, clipped))
    files = RecordingFiles(test=test)
    records = list(read_records(files, IngestOptions(), used_only=False))
    used = list(read_records(files, IngestOptions()))
    assert [record.used for record in records] == [True, True, False]
    assert [record.name for record in used] == [record.name for record in records[:2]]
    assert "clipping" in records[2].marks[0]
    assert records[2].force.max() == pytest.approx(90.0, abs=0.1)
    assert [str(label.output_dof) for label in records[0].labels] == ["1:+z", "2:+z"]
    assert records[0].labels[0].input_channel == "force"
    assert records[0].responses.shape == (2, records[0].n_samples)
    assert not records[0].force.flags.writeable


def test_frfs_of_others_have_no_records(tmp_path):
    (tmp_path / "frf.csv").write_text(
        "frequency_hz,output_dof,input_dof,real,imag\n1,1:z,2:z,1,0\n2,1:z,2:z,1,0\n", encoding="utf-8"
    )
    path = write_test(tmp_path, '[[frf]]\nfile = "frf.csv"\nquantity = "accelerance"\n', kind="frf")
    with pytest.raises(InputError, match="has no recordings"):
        list(read_records(RecordingFiles(test=read_test(path)), IngestOptions()))


def test_rest_before_an_impact_in_coarse_digital_steps_is_no_dropout(tmp_path):
    rng = np.random.default_rng(12)
    for number in range(3):
        signals = noisy(rng, height=100.0, at_s=0.8)
        step = np.abs(signals[1]).max() / 500
        signals[1] = step * np.round(signals[1] / step)
        signals[1, [700, 800]] = 50 * step  # somebody touched the cable: the rest between is a run of one value
        write_csv(tmp_path / "hits" / f"{number}.csv", signals, STEP_S)
    result = estimate(write_test(tmp_path, HIT))
    assert not any("dropout" in marks for marks in result.records.marks)


@pytest.mark.parametrize("n_samples", [40, 400])
def test_the_force_of_a_half_sine_reaches_where_its_spectrum_has_fallen_by_20_db(n_samples):
    """Its transform is cos(pi f T) / (1 - 4 f^2 T^2) of its value at 0."""
    end = brentq(lambda ratio: abs(np.cos(np.pi * ratio) / (1 - 4 * ratio**2)) - 0.1, 0.6, 1.5)
    half_sine = np.sin(np.pi * np.arange(n_samples + 1) / n_samples)
    line = 1 / (8 * n_samples)  # of the padded spectrum: the end is read off its lines
    assert force_band(half_sine) == pytest.approx(end / n_samples, abs=line)


def test_a_pulse_of_one_sample_reaches_all_frequencies():
    assert force_band(np.array([1.0])) == 0.5


def test_the_band_of_each_impact_is_in_the_table(tmp_path):
    """The transform of a normal pulse of standard deviation t falls by 20 dB at sqrt(ln 10 / 2) / (pi t)."""
    lengths_s = (0.001, 0.002)
    for name, length_s in zip("ab", lengths_s, strict=True):
        signals = impact(Structure(), force=pulse(N_SAMPLES, STEP_S, length_s=length_s))
        write_csv(tmp_path / "hits" / f"{name}.csv", signals, STEP_S)
    bands_hz = estimate(write_test(tmp_path, HIT)).records["force_band_hz"]
    expected_hz = [np.sqrt(np.log(10) / 2) / np.pi / length_s for length_s in lengths_s]
    assert bands_hz.tolist() == pytest.approx(expected_hz, rel=0.03)  # the lines of the spectrum that it is read off
