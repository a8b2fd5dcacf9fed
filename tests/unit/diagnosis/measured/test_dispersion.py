"""Converters whose filter has minimum phase, made with SciPy's own design of it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from frf_ipz.diagnosis.measured.preprocessing.dispersion import CUT_OFF, excess_delay_s, remove_dispersion
from frf_ipz.diagnosis.nonlinear.search import search_laws
from frf_ipz.diagnosis.options import DiagnoseOptions

pytestmark = pytest.mark.slow

CUBIC_N_M3 = 2e10
EVERY = 2  # samples of the fine recordings, one of the converter
FALL_DB = 100.0  # from 0.42 to 0.5 of the converter's rate
TYPICAL = FALL_DB / 20 * np.log(10) / np.pi  # rad


def taps(*, is_fast):
    count, beta = signal.kaiserord(FALL_DB, 2 * 0.08 / EVERY)
    linear_phase = signal.firwin(2 * (count // 2) + 1, 0.92 / EVERY, window=("kaiser", beta))
    return signal.minimum_phase(linear_phase, half=False) if is_fast else linear_phase


def recorded(observations, *, is_fast):
    """Recordings of half the rate, behind a filter of minimum phase or of one delay, which is compensated."""
    chosen = taps(is_fast=is_fast)
    late = 0 if is_fast else len(chosen) // 2

    def filtered(values):
        whole = np.apply_along_axis(np.convolve, -1, values, chosen)
        return whole[..., late : late + values.shape[-1] : EVERY]

    records = tuple(
        replace(
            record, step_s=EVERY * record.step_s, force=filtered(record.force), responses=filtered(record.responses)
        )
        for record in observations.records
    )
    return replace(observations, records=records)


@pytest.fixture(scope="module")
def cubic(strike):
    return strike(lambda w, _: CUBIC_N_M3 * w**3, (0, 0, 1, 0))


def test_a_law_behind_fast_converters_is_found_with_its_parameters(chain, cubic):
    result = search_laws(chain.model, recorded(cubic, is_fast=True), DiagnoseOptions())
    assert result.verdict == "explained"
    assert abs(result.dispersion_rad - TYPICAL) < 0.5
    assert "converters" in result.statement
    first = result.findings[0]
    assert (first.effect, dict(first.location)) == ("cubic_stiffness", {"nodes": [3]})
    assert abs(first.parameters["cubic_N_m3"].value / CUBIC_N_M3 - 1) < 0.02
    assert result.after.held_out < 0.1 * result.before.held_out


def test_converters_of_one_delay_need_no_correction(chain, cubic):
    result = search_laws(chain.model, recorded(cubic, is_fast=False), DiagnoseOptions())
    assert result.verdict == "explained"
    assert result.dispersion_rad == 0.0


@pytest.mark.slow
def test_a_law_outside_the_catalogue_is_not_explained_by_dispersion(chain, strike):
    square = strike(lambda w, _: 3e7 * w * abs(w), (0, 0, 1, 0))
    result = search_laws(chain.model, recorded(square, is_fast=True), DiagnoseOptions())
    assert result.verdict == "unexplained"


def test_the_removed_dispersion_is_that_of_such_a_filter(cubic):
    record = cubic.records[0]
    impulse = np.zeros(record.n_samples)
    impulse[600] = 1.0
    response = np.convolve(impulse, taps(is_fast=True))[: record.n_samples : EVERY]
    test = replace(cubic, records=(replace(record, force=response, responses=np.tile(response, (2, 1)), step_s=1.0),))
    corrected = remove_dispersion(test, TYPICAL).records[0].force
    lines = np.fft.rfft(corrected)
    frequency = np.fft.rfftfreq(len(corrected))
    inside = (frequency > 0.01) & (frequency < 0.36)
    phase = np.unwrap(np.angle(lines))[inside]
    bend = phase - np.polyval(np.polyfit(frequency[inside], phase, 1), frequency[inside])
    assert np.abs(bend).max() < np.radians(8)
    raw = np.unwrap(np.angle(np.fft.rfft(response)))[inside]
    raw_bend = raw - np.polyval(np.polyfit(frequency[inside], raw, 1), frequency[inside])
    assert np.abs(raw_bend).max() > np.radians(30)


def test_all_channels_are_turned_alike(cubic):
    turned = remove_dispersion(cubic, TYPICAL)
    for new, old in zip(turned.records, cubic.records, strict=True):
        lines = [
            np.fft.rfft(np.vstack([record.force, record.responses]), 4 * record.n_samples) for record in (new, old)
        ]
        inside = slice(200, 1200)
        ratios = [spectrum[1:, inside] / spectrum[0, inside] for spectrum in lines]
        assert np.median(np.abs(ratios[0] / ratios[1] - 1)) < 0.005  # where a record ends they are not quite the same
    assert remove_dispersion(cubic, 0.0) is cubic


def test_the_excess_delay_is_the_slope_of_the_phase():
    part = np.array([0.3, 0.3 + 1e-6]) / CUT_OFF
    phase = 2 * TYPICAL * (np.arctanh(part) - part)
    slope = np.diff(phase)[0] / (2 * np.pi * 1e-6 / 1e-3)
    assert excess_delay_s(TYPICAL, 300.0, 1e-3) == pytest.approx(slope, rel=1e-3)
