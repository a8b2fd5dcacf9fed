"""Recordings that others made are read, and give the FRFs that are known of them."""

import numpy as np
import pytest

from frf_ipz.errors import FileFormatError
from frf_ipz.ingest.campaign_file import read_test
from frf_ipz.ingest.estimate import estimate_frfs
from frf_ipz.ingest.options import IngestOptions

HAND_SCATTER = 2.0  # times: no two impacts by hand are quite alike, so that five of them do not scatter like noise


def estimate(path, **options):
    return estimate_frfs(read_test(path), options=IngestOptions(**options))


def write(folder, text):
    path = folder / "test.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_five_impacts_are_coherent(recordings):
    result = estimate(recordings / "raw_hammer" / "test.toml")
    band = result.frfs.in_band((200.0, 1000.0))
    assert np.median(result.frfs.coherence[band]) >= 0.999
    assert result.records.used.all()
    assert result.records.peak_force_N.abs().between(68, 90).all()
    assert result.records.pulse_s.between(0.15e-3, 0.35e-3).all()
    assert result.records.second_pulse_ratio.max() == 0.0
    assert list(result.frfs.averages) == [5]


def test_the_variance_of_four_impacts_predicts_the_fifth(recordings):
    """Each impact alone differs from the mean of the other four by as much as the variance and its weight say."""
    path = recordings / "raw_hammer" / "test.toml"
    records = estimate(path).records
    ratios = []
    for name, weight in zip(records.record, records.weight, strict=True):
        rest = tuple(record for record in records.record if record != name)
        windows = {"exponential_window_s": 0.1}
        alone = estimate(path, drop=rest, **windows).frfs
        mean = estimate(path, drop=(name,), **windows).frfs
        band = alone.in_band((200.0, 6000.0))
        error = np.abs(alone.values - mean.values)[band] ** 2
        ratios.append(error / (mean.variance[band] / weight))
    assert 1 / HAND_SCATTER < np.mean(ratios) < HAND_SCATTER


def test_a_milling_tool_has_the_receptance_that_its_laboratory_found(recordings, tmp_path):
    folder = recordings / "milling_tool"
    path = write(
        tmp_path,
        f"""
        [test]
        kind = "hammer"
        [[channel]]
        column = 2
        role = "input"
        quantity = "force"
        unit = "N"
        [[channel]]
        column = 3
        role = "output"
        quantity = "acceleration"
        unit = "m/s^2"
        dof = "1:+x"
        [[hit]]
        dof = "1:+x"
        files = ["{folder.resolve()}/Impact_Point1.txt"]
        """,
    )
    frfs = estimate(path).frfs
    frequency, real, imag = np.loadtxt(folder / "EMA_Point_1.txt").T
    receptance = frfs.values[1:, 0] / frfs.s[1:] ** 2
    estimated = np.interp(frequency, frfs.frequency_hz[1:], receptance)
    band = (frequency >= 300.0) & (frequency <= 3500.0)
    assert frac(estimated[band], (real + 1j * imag)[band]) >= 0.998


def test_all_points_of_a_milling_tool_are_read_as_receptances(recordings, tmp_path):
    folder = (recordings / "milling_tool").resolve()
    entries = [
        f'[[frf]]\nfile = "{folder}/EMA_Point_{point}.txt"\nquantity = "receptance"\noutput_dof = "{point}:+x"\n'
        'input_dof = "1:+x"\ncolumns = ["frequency_hz", "real", "imag"]\n'
        for point in range(1, 6)
    ]
    frfs = estimate(write(tmp_path, '[test]\nkind = "frf"\n' + "".join(entries))).frfs
    frequency, real, imag = np.loadtxt(folder / "EMA_Point_3.txt").T
    assert frfs.n_frfs == 5
    assert frfs.labels[2].unit == "m/N"
    np.testing.assert_allclose(frfs.values[:, 2], np.interp(frfs.frequency_hz, frequency, real + 1j * imag), rtol=1e-12)


def test_a_roving_hammer_on_a_free_beam(recordings):
    folder = recordings / "freefree_beam"
    frfs = estimate(folder / "test.toml").frfs
    frequency, real, imag = np.loadtxt(folder / "Hxysv00009.txt", skiprows=9, encoding="latin-1").T[:3]
    np.testing.assert_array_equal(frfs.frequency_hz, frequency)
    np.testing.assert_array_equal(frfs.values[:, 8], real + 1j * imag)
    assert [str(label) for label in frfs.labels][:2] == ["99:-z / 19:+z", "99:-z / 49:+z"]
    assert frfs.labels[0].sign == -1
    assert np.isnan(frfs.variance).all()


def test_a_steel_beam_with_five_sensors_and_three_actuators(recordings):
    result = estimate(recordings / "steel_beam_5x3" / "test.toml")
    values, measured = result.frfs.matrix()
    assert measured.all()
    assert values.shape[1:] == (5, 3)
    assert result.frfs.unknown_scale == "per_channel"
    assert result.frfs.frequency_hz[1] - result.frfs.frequency_hz[0] == pytest.approx(0.25)


def test_magnitudes_in_db_and_phases_in_degrees(recordings, tmp_path):
    file = (recordings / "cantilever_masses" / "Beam_healthy" / "P-7.txt").resolve()
    text = f"""
        [test]
        kind = "frf"
        unknown_scale = "common"
        [[frf]]
        file = "{file}"
        quantity = "accelerance"
        output_dof = "39:+z"
        input_dof = "5:+z"
        columns = ["frequency_hz", "magnitude_db", "phase_deg"]
        skip_rows = 1
        """
    frfs = estimate(write(tmp_path, text)).frfs
    frequency, level_db, phase_deg = np.loadtxt(file, skiprows=1).T
    np.testing.assert_allclose(frfs.frequency_hz, frequency, rtol=1e-12)
    np.testing.assert_allclose(20 * np.log10(np.abs(frfs.values[:, 0])), level_db, rtol=1e-12)
    np.testing.assert_allclose(np.exp(1j * np.radians(phase_deg)), np.exp(1j * np.angle(frfs.values[:, 0])), rtol=1e-9)


@pytest.mark.parametrize(
    ("file", "says"),
    [("double_beam_ringdown/ringdown_01.csv", "has no column 'force'"), ("silverbox/SNLS80mV.csv", "no column 'time'")],
)
def test_recordings_without_force_or_time_are_refused(recordings, tmp_path, file, says):
    path = write(
        tmp_path,
        f"""
        [test]
        kind = "hammer"
        [[channel]]
        column = "force"
        role = "input"
        quantity = "force"
        unit = "N"
        [[channel]]
        column = "velocity_m_s"
        role = "output"
        quantity = "velocity"
        unit = "m/s"
        dof = "1:+x"
        [[hit]]
        dof = "1:+x"
        files = ["{(recordings / file).resolve()}"]
        """,
    )
    with pytest.raises(FileFormatError, match=says):
        estimate(path)


def frac(a, b):
    """Frequency response assurance criterion of two FRFs."""
    return float(np.abs(np.vdot(a, b)) ** 2 / (np.vdot(a, a).real * np.vdot(b, b).real))
