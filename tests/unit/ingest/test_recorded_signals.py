"""Recordings of any format in memory, and those of SEP-005."""

import numpy as np
import pytest

import frf_ipz
from frf_ipz.errors import InputError, QuantityError
from synthetic_campaign import Structure, impact, write_csv

RATE_HZ = 2048.0
SIGNALS = impact(Structure(), n_samples=512)


def channels(**changes):
    units = ("kN", "g", "g")
    names = ("hammer", "tip", "middle")
    return [
        {"name": name, "data": values, "unit_str": unit, "fs": RATE_HZ, **changes}
        for name, unit, values in zip(names, units, SIGNALS, strict=True)
    ]


def test_files_of_two_formats_give_the_same(tmp_path):
    write_csv(tmp_path / "a.csv", SIGNALS, 1 / RATE_HZ)
    np.savez(tmp_path / "b.npz", force=SIGNALS[0], rest=SIGNALS[1:], fs=RATE_HZ)
    (text,) = frf_ipz.read_recordings(tmp_path / "a.csv")
    (binary,) = frf_ipz.read_recordings(f"{tmp_path}/*.npz")
    np.testing.assert_allclose(text.values, binary.values, rtol=1e-14)
    assert text.sample_rate_hz == pytest.approx(binary.sample_rate_hz, rel=1e-12)
    assert binary.names == ("force", "rest[0,:]", "rest[1,:]")
    assert [one.name for one in frf_ipz.read_recordings(f"{tmp_path}/*")] == ["a.csv", "b.npz"]
    frame = text.to_frame()
    assert list(frame.columns) == list(text.names)
    np.testing.assert_allclose(frame.index, np.arange(512) / RATE_HZ, rtol=1e-12)


def test_a_rate_is_given_where_the_file_has_none(tmp_path):
    np.save(tmp_path / "a.npy", SIGNALS.T)
    with pytest.raises(InputError, match="does not say when its samples were taken"):
        frf_ipz.read_recordings(tmp_path / "a.npy")
    assert frf_ipz.read_recordings(tmp_path / "a.npy", sample_rate_hz=100.0)[0].sample_rate_hz == pytest.approx(100.0)
    with pytest.raises(InputError, match="no file fits"):
        frf_ipz.read_recordings(tmp_path / "*.mat")


def test_sep005_there_and_back():
    signals = frf_ipz.RecordedSignals.from_sep005(channels())
    again = frf_ipz.RecordedSignals.from_sep005(signals.to_sep005())
    assert (again.names, again.units, again.sample_rate_hz) == (signals.names, signals.units, RATE_HZ)
    np.testing.assert_array_equal(again.values, SIGNALS)
    times = np.arange(512) / RATE_HZ
    by_time = [{key: value for key, value in one.items() if key != "fs"} | {"time": times} for one in channels()]
    assert frf_ipz.RecordedSignals.from_sep005(by_time).sample_rate_hz == pytest.approx(RATE_HZ, rel=1e-12)


def test_sep005_is_checked_where_its_package_is():
    model = pytest.importorskip("sdypy_sep005").Sep005Data
    for channel in frf_ipz.RecordedSignals.from_sep005(channels()).to_sep005():
        model.model_validate(channel | {"time": list(channel["time"])})


def test_a_recording_is_in_si():
    signals = frf_ipz.RecordedSignals.from_sep005(channels())
    recording = signals.to_recording(force="hammer", input_dof="18:+z", output_dofs={"middle": "9:+z", "tip": "20:-z"})
    np.testing.assert_allclose(recording.force, 1e3 * SIGNALS[0], rtol=1e-14)
    np.testing.assert_allclose(recording.responses, 9.80665 * SIGNALS[[2, 1]], rtol=1e-14)
    test = frf_ipz.VibrationTest.from_recordings([recording])
    assert [str(label) for label in test.labels] == ["9:+z / 18:+z", "20:-z / 18:+z"]


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"fs": 0.0}, InputError, "the rate of channel 'hammer' is 0 Hz"),
        ({"data": np.full(512, np.nan)}, InputError, "channel 'hammer'"),
        ({"unit_str": ""}, QuantityError, "'hammer' has no unit; give it"),
        ({"unit_str": "V"}, QuantityError, "'V' is no unit of a motion"),
    ],
)
def test_what_does_not_fit_is_said(changes, error, message):
    with pytest.raises(error, match=message):
        frf_ipz.RecordedSignals.from_sep005(channels(**changes)).to_recording(
            force="hammer", input_dof="18:+z", output_dofs={"tip": "20:+z"}
        )


def test_missing_keys_and_names_are_said():
    with pytest.raises(InputError, match="no 'unit_str'; SEP-005 asks for"):
        frf_ipz.RecordedSignals.from_sep005([{"data": [1.0], "name": "a", "fs": 1.0}])
    with pytest.raises(InputError, match="no signal 'tipp'; did you mean 'tip'"):
        frf_ipz.RecordedSignals.from_sep005(channels()).to_recording(
            force="hammer", input_dof="18:+z", output_dofs={"tipp": "20:+z"}
        )
