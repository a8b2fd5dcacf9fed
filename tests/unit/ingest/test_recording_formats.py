"""Recordings are read however laboratories write their CSVs."""

import numpy as np
import pytest

from frf_ipz.ingest.campaign_file import read_test
from frf_ipz.ingest.estimation.traces import thin
from frf_ipz.ingest.formats.registry import open_recording
from frf_ipz.ingest.formats.text_layout import name_and_unit
from frf_ipz.ingest.recording_files import RecordingFiles
from synthetic_campaign import HIT, Structure, impact, write_csv, write_test

STEP_S = 1 / 2048
SIGNALS = impact(Structure(), n_samples=512)
DIGITS = 1e-14  # relative: the numbers are written with all of their digits


def read(path, **of_test):
    test = read_test(write_test(path.parent.parent, HIT, **of_test))
    blocks = list(RecordingFiles(test=test).blocks(test.setups[0], path))
    return np.concatenate(blocks)


def rewrite(path, change):
    path.write_bytes(change(path.read_bytes()))
    return path


@pytest.fixture
def plain(tmp_path):
    return write_csv(tmp_path / "hits" / "1.csv", SIGNALS, STEP_S)


def expect(table, signals=SIGNALS):
    np.testing.assert_allclose(table[:, 0], np.arange(512) * STEP_S, rtol=DIGITS)
    np.testing.assert_allclose(table[:, 1:].T, signals, rtol=DIGITS)


def test_plain_csv(plain):
    expect(read(plain))


@pytest.mark.parametrize(("delimiter", "decimal"), [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ",")])
def test_delimiters_and_decimal_signs(tmp_path, delimiter, decimal):
    path = write_csv(tmp_path / "hits" / "1.csv", SIGNALS, STEP_S, delimiter=delimiter, decimal=decimal)
    expect(read(path))


@pytest.mark.parametrize(
    "change",
    [
        lambda data: b"\xef\xbb\xbf" + data,
        lambda data: data.replace(b"\n", b"\r\n"),
        lambda data: b"\xef\xbb\xbf" + data.replace(b"\n", b"\r\n"),
        lambda data: data.rstrip(b"\n"),
        lambda data: data + b"\n\n",
        lambda data: data + b",,\n,,\n".replace(b",,", b",,,"),
        lambda data: data.replace(b",", b" , "),
        lambda data: data.replace(b"time,", b'"time",').replace(b"acc_1", b'"acc_1"'),
        lambda data: data.replace(b"time,", b"Time (s),"),
        lambda data: data.replace(b"\n", b",\n"),
        lambda data: data.replace(b"\n", b",\n").replace(b"acc_2,", b"acc_2"),
        lambda data: b"made by an analyser\nserial number 7\n" + data,
        lambda data: data.replace(b",", b"   "),
    ],
    ids=[
        "BOM",
        "CRLF",
        "BOM and CRLF",
        "no newline at the end",
        "empty lines at the end",
        "rows of nothing at the end",
        "blanks around fields",
        "quoted names",
        "time with its unit",
        "a delimiter at every end",
        "a delimiter at the end of the numbers",
        "lines before the header",
        "blanks between columns",
    ],
)
def test_ways_to_write_a_csv(plain, change):
    expect(read(rewrite(plain, change)))


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-8-sig"])
def test_encodings(tmp_path, encoding):
    path = write_csv(tmp_path / "hits" / "1.csv", SIGNALS, STEP_S, columns=["force", "Stoß", "acc_2"])
    path.write_bytes(path.read_text(encoding="utf-8").encode(encoding))
    test_path = write_test(tmp_path, HIT)
    test_path.write_text(test_path.read_text(encoding="utf-8").replace("acc_1", "Stoß"), encoding="utf-8")
    test = read_test(test_path)
    expect(np.concatenate(list(RecordingFiles(test=test).blocks(test.setups[0], path))))


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
def test_a_row_of_units_is_used(tmp_path, encoding):
    path = write_csv(tmp_path / "hits" / "1.csv", SIGNALS, STEP_S, units=["(s)", "(kN)", "(g)", "(mm/s²)"])
    path.write_bytes(path.read_text(encoding="utf-8").encode(encoding))
    expect(read_without_units(path), SIGNALS * np.array([[1e3], [9.80665], [1e-3]]))


def test_units_in_brackets_behind_the_names_are_used(plain):
    rewrite(plain, lambda data: data.replace(b"force", b"force [kN]").replace(b"acc_1", b"acc_1 (g_0)"))
    rewrite(plain, lambda data: data.replace(b"acc_2", b"acc_2 [m/s^2]"))
    expect(read_without_units(plain), SIGNALS * np.array([[1e3], [9.80665], [1.0]]))


def test_a_time_in_milliseconds_is_brought_to_seconds(tmp_path):
    path = write_csv(tmp_path / "hits" / "1.csv", SIGNALS, 1e3 * STEP_S, units=["ms", "N", "m/s^2", "m/s^2"])
    expect(read(path))


def read_without_units(path):
    test_path = write_test(path.parent.parent, HIT)
    text = test_path.read_text(encoding="utf-8")
    test_path.write_text(text.replace('unit = "m/s^2"\n', "").replace('unit = "N"\n', ""), encoding="utf-8")
    test = read_test(test_path)
    return np.concatenate(list(RecordingFiles(test=test).blocks(test.setups[0], path)))


def test_numbers_without_a_header_have_columns_1_2_3(tmp_path):
    path = tmp_path / "numbers.txt"
    np.savetxt(path, np.vstack([np.arange(512) * STEP_S, SIGNALS]).T, fmt="%.16e")
    recording = open_recording(path, ["2", "4"])
    table = np.concatenate(list(recording.blocks))
    np.testing.assert_allclose(table[:, 1:].T, SIGNALS[[0, 2]], rtol=DIGITS)


def test_columns_come_in_the_order_asked_for(plain):
    table = np.concatenate(list(open_recording(plain, ["acc_2", "force"]).blocks))
    np.testing.assert_allclose(table[:, 1:].T, SIGNALS[[2, 0]], rtol=DIGITS)


def test_a_time_that_starts_anywhere_is_fine(tmp_path):
    path = write_csv(tmp_path / "hits" / "1.csv", SIGNALS, STEP_S, start_s=-0.25)
    assert read(path)[0, 0] == pytest.approx(-0.25)


def test_large_files_come_in_blocks_that_join_up(tmp_path):
    signals = np.random.default_rng(1).standard_normal((3, 150_000))
    path = write_csv(tmp_path / "hits" / "1.csv", signals, STEP_S)
    recording = open_recording(path, ["force", "acc_1", "acc_2"])
    blocks = list(recording.blocks)
    assert len(blocks) > 1
    np.testing.assert_allclose(np.concatenate(blocks)[:, 1:].T, signals, rtol=DIGITS)


def test_segments_across_blocks_are_whole(tmp_path):
    signals = np.random.default_rng(1).standard_normal((3, 150_000))
    path = write_csv(tmp_path / "hits" / "1.csv", signals, STEP_S)
    test = read_test(write_test(tmp_path, HIT))
    bounds = [(5, 20), (40_000, 140_000), (140_000, 140_001), (149_990, 150_000)]
    segments = list(RecordingFiles(test=test).segments(test.setups[0], path, bounds))
    for (start, stop), segment in zip(bounds, segments, strict=True):
        np.testing.assert_allclose(segment[1:], signals[:, start:stop], rtol=DIGITS)


def test_files_are_read_anew_beyond_the_budget(tmp_path, monkeypatch):
    monkeypatch.setattr("frf_ipz.ingest.recording_files.BUDGET", 40_000)
    test = read_test(write_test_of_three(tmp_path))
    files = RecordingFiles(test=test)
    for _ in range(2):
        for path in test.files:
            expect(np.concatenate(list(files.blocks(test.setups[0], path))))
    assert len(files._cache) == 2


def write_test_of_three(folder):
    for number in range(3):
        write_csv(folder / "hits" / f"{number}.csv", SIGNALS, STEP_S)
    return write_test(folder, HIT)


@pytest.mark.parametrize(
    ("text", "expected"),
    [("force [N]", ("force", "N")), ("a (m/s^2)", ("a", "m/s^2")), ("force", ("force", "")), ("[N]", ("[N]", ""))],
)
def test_names_are_separated_from_units(text, expected):
    assert name_and_unit(text) == expected


@pytest.mark.parametrize("n_samples", [399, 400, 401, 799, 10_000, 10_007])
def test_thinned_signals_keep_their_extremes(n_samples):
    signal = np.random.default_rng(3).standard_normal(n_samples)
    positions, values = thin(signal, 400)
    assert len(positions) <= 400
    assert (np.diff(positions) > 0).all()
    np.testing.assert_array_equal(values, signal[positions])
    assert (values.max(), values.min()) == (signal.max(), signal.min())
