"""Hum of the mains: found where records have decayed, and taken off the whole of them."""

from dataclasses import replace

import numpy as np

from frf_ipz.diagnosis.measured.preprocessing.hum import remove_hum

HUM_HZ = 50.03, 49.98, 50.01, 50.02  # it wanders from record to record
HUM_PART = 1e-2  # of the largest response
LEFT = 0.02  # of a tone: what the noise and the last motion in the tail hide of its phase


def with_tones(observations, sizes, decay_1_s=0.0):
    """Add a tone and its third harmonic to the force and the first channel of each record."""
    records = []
    for record, hz in zip(observations.records, HUM_HZ, strict=True):
        time = record.step_s * np.arange(record.n_samples)
        tone = np.sin(2 * np.pi * hz * time + hz) + 0.5 * np.sin(6 * np.pi * hz * time)
        tone *= np.exp(-decay_1_s * time)
        responses = record.responses + np.outer([sizes[1], 0.0], tone)
        records.append(replace(record, force=record.force + sizes[0] * tone, responses=responses))
    return replace(observations, records=tuple(records), band_hz=(observations.band_hz[0], 180.0))


def sizes_of(observations):
    force = max(record.level for record in observations.records)
    return HUM_PART * force, HUM_PART * max(np.abs(record.responses[0]).max() for record in observations.records)


def test_hum_is_subtracted_in_the_force_and_in_the_channels_that_show_it(strike):
    observations = strike()
    sizes = sizes_of(observations)
    quiet = with_tones(observations, (0.0, 0.0))
    for cleaned, record in zip(remove_hum(with_tones(observations, sizes)).records, quiet.records, strict=True):
        assert np.abs(cleaned.force - record.force).max() < LEFT * sizes[0]
        assert np.abs(cleaned.responses[0] - record.responses[0]).max() < LEFT * sizes[1]
        assert np.array_equal(cleaned.responses[1], record.responses[1])  # a mode at 48.8 Hz stays


def test_what_decays_is_a_mode(strike):
    observations = strike()
    ringing = with_tones(observations, sizes_of(observations), decay_1_s=1.0)
    assert remove_hum(ringing) is ringing


def test_records_without_hum_stay_as_they_are(strike):
    observations = strike()
    assert remove_hum(observations) is observations


def test_hum_just_above_the_band_is_subtracted(strike):
    observations = strike()
    sizes = sizes_of(observations)
    band_hz = observations.band_hz[0], 140.0  # the third harmonic stands above
    quiet, humming = (replace(with_tones(observations, some), band_hz=band_hz) for some in ((0.0, 0.0), sizes))
    for cleaned, record in zip(remove_hum(humming).records, quiet.records, strict=True):
        assert np.abs(cleaned.responses[0] - record.responses[0]).max() < LEFT * sizes[1]
