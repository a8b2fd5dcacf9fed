"""What holds for every recording: however it is written, scaled, windowed or delayed."""

import tempfile
from pathlib import Path

import numpy as np
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from frf_ipz.ingest.campaign_file import read_test
from frf_ipz.ingest.estimate import estimate_frfs
from frf_ipz.ingest.estimation.spectra import empty_sums, estimate_coherence, estimate_frf
from frf_ipz.ingest.estimation.variance import frf_variance
from frf_ipz.ingest.formats.registry import open_recording
from frf_ipz.ingest.options import IngestOptions
from frf_ipz.ingest.signals.clipping import digital_step, is_clipped
from frf_ipz.ingest.signals.pulses import find_pulse, pulse_extent
from frf_ipz.ingest.signals.windows import exponential_window, force_window
from frf_ipz.ingest.survey.checks import SECOND_PULSE
from synthetic_campaign import HIT, Structure, impact, pulse, write_csv, write_test

FILES = settings(max_examples=30, deadline=None)  # an example writes and reads files
STEP_S = 1 / 1024
EXACT = 1e-5  # relative: 1e-6 of the pulse is left at half of this sampling rate
ROUNDING = 1e-9  # relative
UNITS = {"force": {"N": 1.0, "kN": 1e3, "lbf": 4.4482216152605}, "acc": {"m/s^2": 1.0, "g_0": 9.80665, "mm/s^2": 1e-3}}

finite = st.floats(-1e30, 1e30, allow_nan=False, allow_subnormal=False)


@FILES
@given(
    rows=st.lists(st.tuples(finite, finite), min_size=1, max_size=30),
    layout=st.sampled_from([(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ",")]),
    bom=st.booleans(),
    newline=st.sampled_from(["\n", "\r\n"]),
    units=st.booleans(),
)
def test_what_is_written_is_read(rows, layout, bom, newline, units):
    delimiter, decimal = layout
    signals = np.array(rows).T
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.csv"
        write_csv(
            path,
            signals,
            STEP_S,
            columns=["force", "acc"],
            delimiter=delimiter,
            decimal=decimal,
            units=["s", "N", "m/s^2"] if units else None,
        )
        text = path.read_text(encoding="utf-8").replace("\n", newline)
        path.write_bytes((b"\xef\xbb\xbf" if bom else b"") + text.encode())
        table = np.concatenate(list(open_recording(path, ["force", "acc"]).blocks))
    np.testing.assert_allclose(table[:, 1:].T, signals, rtol=1e-15, atol=0.0)


structures = st.builds(
    lambda lowest, ratio, damping: Structure(
        frequency_hz=(lowest, ratio * lowest, ratio**2 * lowest), damping_ratio=damping
    ),
    st.floats(15.0, 40.0),
    st.floats(1.2, 2.2),
    st.tuples(*[st.floats(0.001, 0.05)] * 3),
)


@FILES
@given(structure=structures, decay_1_s=st.floats(6.0, 12.0), at_s=st.floats(0.02, 0.06))
def test_an_exponential_window_is_taken_back_exactly_for_any_structure(structure, decay_1_s, at_s):
    """However light the damping: the remainder at the end, exp(-sigma T), is all that is lost."""
    n_samples = 2048
    remainder = np.exp(-decay_1_s * (n_samples * STEP_S - at_s))
    with tempfile.TemporaryDirectory() as folder:
        signals = impact(structure, n_samples=n_samples, step_s=STEP_S, at_s=at_s, length_s=1.6e-3)
        write_csv(Path(folder) / "hits" / "1.csv", signals, STEP_S)
        options = IngestOptions(exponential_window_s=1 / decay_1_s)
        frfs = estimate_frfs(read_test(write_test(Path(folder), HIT)), options=options).frfs
    band = frfs.in_band((5.0, 150.0))
    truth = structure.accelerance(frfs.s[band])
    # a mode's FRF is as high as its decay rate is small, and what is cut off stands against its first swing
    assert np.abs(frfs.values[band] - truth).max() < (EXACT + 4.0 * remainder) * np.abs(truth).max()


@FILES
@given(force=st.sampled_from(list(UNITS["force"])), acc=st.sampled_from(list(UNITS["acc"])))
def test_units_do_not_change_frfs(force, acc):
    signals = impact(Structure(), n_samples=512, step_s=STEP_S, length_s=1.6e-3)
    values = []
    with tempfile.TemporaryDirectory() as folder:
        for number, (force_unit, unit) in enumerate((("N", "m/s^2"), (force, acc))):
            campaign = Path(folder) / str(number)
            scaled = signals / np.array([UNITS["force"][force_unit]] + [UNITS["acc"][unit]] * 2)[:, None]
            write_csv(campaign / "hits" / "1.csv", scaled, STEP_S)
            test = read_test(write_test(campaign, HIT, force_unit=force_unit, unit=unit))
            values.append(estimate_frfs(test, options=IngestOptions(exponential_window_s=0.1)).frfs.values)
    assert np.abs(values[1] - values[0]).max() <= ROUNDING * np.abs(values[0]).max()


@FILES
@given(
    gaps=st.lists(st.floats(1.0, 1.6), min_size=1, max_size=5),
    heights=st.lists(st.floats(20.0, 150.0), min_size=6, max_size=6),
    sign=st.sampled_from([-1, 1]),
)
def test_every_impact_of_a_file_is_found(gaps, heights, sign):
    at_s = 0.1 + np.concatenate([[0.0], np.cumsum(gaps)])
    n_samples = int((at_s[-1] + 1.0) / STEP_S)
    force = sum(
        pulse(n_samples, STEP_S, height=sign * height, at_s=at, length_s=1.6e-3)
        for at, height in zip(at_s, heights, strict=False)
    )
    with tempfile.TemporaryDirectory() as folder:
        write_csv(Path(folder) / "hits" / "1.csv", impact(Structure(), force=force, step_s=STEP_S), STEP_S)
        result = estimate_frfs(read_test(write_test(Path(folder), HIT)), options=IngestOptions())
    expected = sign * np.array(heights[: len(at_s)])
    np.testing.assert_allclose(result.records.peak_force_N, expected, rtol=0.05)  # samples beside the top


pulses = st.builds(
    lambda height, at, length: height * np.exp(-0.5 * ((np.arange(4000) - at) / length) ** 2),
    st.floats(1.0, 1e4),
    st.floats(300.0, 3000.0),
    st.floats(0.6, 12.0),
)


@given(force=pulses, scale=st.floats(1e-6, 1e6), seed=st.integers(0, 2**16))
@settings(max_examples=60, deadline=None)
def test_a_pulse_is_found_whatever_its_scale_and_sign(force, scale, seed):
    force = force + 1e-3 * np.abs(force).max() * np.random.default_rng(seed).standard_normal(4000)
    pulse_ = find_pulse(force, threshold=SECOND_PULSE)
    scaled = find_pulse(-scale * force, threshold=SECOND_PULSE)
    assert pulse_.bumps.size == scaled.bumps.size == 0
    assert pulse_.peak == scaled.peak == np.argmax(np.abs(force))
    np.testing.assert_allclose([scaled.width, -scaled.height / scale], [pulse_.width, pulse_.height], rtol=1e-6)
    start, stop = pulse_extent(force, pulse_)
    assert start <= pulse_.onset <= pulse_.peak < stop


@given(force=pulses, share=st.floats(0.3, 0.9))
@example(force=np.exp(-0.5 * ((np.arange(4000) - 300.0) / 9.5) ** 2), share=0.453125)  # a sample just past the corner
@settings(max_examples=60, deadline=None)
def test_a_top_that_is_cut_is_clipped_and_a_whole_one_is_not(force, share):
    cut = np.minimum(force, share * force.max())
    assert not is_clipped(force)
    assert is_clipped(cut) or np.sum(cut == cut.max()) < 3  # one or two equal samples may be chance


@given(step=st.floats(1e-6, 1e6), counts=st.lists(st.integers(-500, 500), min_size=5, max_size=200))
def test_the_digital_step_is_found(step, counts):
    levels = np.unique(counts)
    smallest = np.diff(levels).min() if levels.size > 1 else 0
    off = np.abs((levels - levels[0]) / smallest - np.round((levels - levels[0]) / smallest)).max() if smallest else 0
    assume(off < 1e-9 or off > 0.06)  # nearer than 5 % of the step counts as a multiple
    multiple = levels.size > 1 and off < 1e-9
    measured = digital_step(np.array(counts) * step)
    np.testing.assert_allclose(measured, smallest * step if multiple else 0.0, rtol=ROUNDING)


@given(start=st.integers(-50, 1100), length=st.integers(1, 900))
def test_a_force_window_keeps_its_interval_and_nothing_far_from_it(start, length):
    window = force_window(1000, start, start + length)
    sample = np.arange(1000)
    inside = (sample >= start) & (sample < start + length)
    far = (sample < start - 0.25 * length - 5) | (sample > start + 1.25 * length + 5)
    assert (window[inside] == 1.0).all()
    assert (window[far] < 1e-12).all()
    assert ((window >= 0.0) & (window <= 1.0)).all()


@given(decay=st.floats(0.0, 100.0), origin=st.integers(0, 99))
def test_exponential_windows_are_1_at_the_impact(decay, origin):
    window = exponential_window(100, 0.01, decay, origin)
    assert window[origin] == 1.0
    np.testing.assert_allclose(window[1:] / window[:-1], np.exp(-0.01 * decay), rtol=ROUNDING)


@given(n_records=st.integers(2, 6), outputs=st.integers(1, 3), seed=st.integers(0, 2**16), gain=st.floats(1e-6, 1e6))
@settings(max_examples=50, deadline=None)
def test_estimates_scale_with_the_signals(n_records, outputs, seed, gain):
    rng = np.random.default_rng(seed)
    sums, scaled = empty_sums(65, outputs), empty_sums(65, outputs)
    for _ in range(n_records):
        force, responses = rng.standard_normal(128), rng.standard_normal((outputs, 128))
        sums.add(force, responses)
        scaled.add(force, gain * responses)
    for name in ("H1", "H2", "Hv"):
        np.testing.assert_allclose(estimate_frf(scaled, name), gain * estimate_frf(sums, name), rtol=1e-8)
    coherence = estimate_coherence(sums)
    assert ((coherence >= 0.0) & (coherence <= 1.0)).all()
    np.testing.assert_allclose(estimate_coherence(scaled), coherence, rtol=1e-8)
    np.testing.assert_allclose(frf_variance(scaled), gain**2 * frf_variance(sums), rtol=1e-5)
