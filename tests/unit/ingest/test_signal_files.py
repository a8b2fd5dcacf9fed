"""Recordings in files of acquisition programs: LabVIEW, TDMS, WAV, MDF, spreadsheets."""

import gc
import io
import struct
import sys
import wave
import zipfile

import lvm_read
import numpy as np
import openpyxl
import pytest
from scipy.io import wavfile

import frf_ipz
from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.ingest.formats.recording import TableKeys
from frf_ipz.ingest.formats.registry import look_at_recording, open_recording
from synthetic_campaign import Structure, impact

RATE_HZ = 2048.0
SIGNALS = impact(Structure(), n_samples=512)
NAMES, UNITS = ("force", "acc_1", "acc_2"), ("N", "m/s^2", "m/s^2")
TIME = np.arange(512) / RATE_HZ
SHORT_BLOCK = 218  # bytes of a channel of MDF without long names and a further offset
DIGITS = 1e-15  # relative: openpyxl writes 16 digits


def write_lvm(path, signals=SIGNALS, decimal=".", columns="No", segments=1):
    def number(value):
        return f"{value:.17g}".replace(".", decimal)

    lines = ["LabVIEW Measurement\t", "Writer_Version\t2", "Reader_Version\t2", "Separator\tTab"]
    lines += [f"Decimal_Separator\t{decimal}", "Multi_Headings\tYes", f"X_Columns\t{columns}", "Time_Pref\tRelative"]
    lines += ["Operator\tA. Meier", "Date\t2026/11/27", "Time\t10:00:00", "***End_of_Header***\t", "\t"]
    for _ in range(segments):
        lines += ["Channels\t3\t\t\t", "Samples\t" + "\t".join(["512"] * 3), "Date\t" + "\t".join(["2026/11/27"] * 3)]
        lines += ["Y_Unit_Label\t" + "\t".join(UNITS), "X_Dimension\t" + "\t".join(["Time"] * 3)]
        lines += ["X0\t" + "\t".join([number(0.0)] * 3), "Delta_X\t" + "\t".join([number(1 / RATE_HZ)] * 3)]
        lines += ["***End_of_Header***\t\t\t", "X_Value\t" + "\t".join(NAMES) + "\tComment"]
        for time, row in zip(TIME, signals.T, strict=True):
            first = number(time) if columns == "One" else ""
            lines.append("\t".join([first, *map(number, row)]))
        lines += [""]
    path.write_text("\r\n".join(lines) + "\r\n")


def write_tdms(path):
    nptdms = pytest.importorskip("nptdms")
    channels = [
        nptdms.ChannelObject("hammer test", name, values, {"wf_increment": 1 / RATE_HZ, "unit_string": unit})
        for name, unit, values in zip(NAMES, UNITS, SIGNALS, strict=True)
    ]
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(channels)


def write_mdf(path):
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as content:
        content.append(
            [
                asammdf.Signal(values, TIME, name=name, unit=unit)
                for name, unit, values in zip(NAMES, UNITS, SIGNALS, strict=True)
            ]
        )
        content.save(path, overwrite=True, compression=2)


def write_xlsx(path):
    book = openpyxl.Workbook()
    book.active.append(["A note that is no table"])
    sheet = book.create_sheet("data")
    sheet.append(["Date", "2026-11-27"])
    sheet.append([])
    sheet.append(["Time [s]", *(f"{name} [{unit}]" for name, unit in zip(NAMES, UNITS, strict=True))])
    for row in np.column_stack([TIME, SIGNALS.T]).tolist():
        sheet.append(row)
    book.save(path)


WRITERS = {"a.lvm": write_lvm, "a.tdms": write_tdms, "a.mf4": write_mdf, "a.xlsx": write_xlsx}


@pytest.mark.parametrize("name", WRITERS)
def test_names_units_time_and_numbers(tmp_path, name):
    WRITERS[name](tmp_path / name)
    (tmp_path / name).rename(tmp_path / "some file")  # told by its content
    contents = look_at_recording(tmp_path / "some file")
    assert [(column.label, column.unit) for column in contents.columns] == list(zip(NAMES, UNITS, strict=True))
    assert contents.has_time
    recording = open_recording(tmp_path / "some file", [column.name for column in contents.columns])
    table = np.concatenate(list(recording.blocks))
    np.testing.assert_allclose(table[:, 0], TIME, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(table[:, 1:].T, SIGNALS, rtol=DIGITS)
    assert recording.units[1:] == UNITS


@pytest.mark.parametrize(("decimal", "columns"), [(",", "No"), (".", "One"), (",", "One")])
def test_variants_of_labview(tmp_path, decimal, columns):
    write_lvm(tmp_path / "a.lvm", decimal=decimal, columns=columns)
    table = next(open_recording(tmp_path / "a.lvm", NAMES).blocks)
    np.testing.assert_allclose(table, np.column_stack([TIME, SIGNALS.T]), rtol=1e-14)


def test_segments_of_labview_are_records_of_their_own(tmp_path):
    write_lvm(tmp_path / "a.lvm", segments=2)
    contents = look_at_recording(tmp_path / "a.lvm")
    assert [column.name for column in contents.columns] == [*NAMES, *(f"{name} #2" for name in NAMES)]
    assert "2 segments" in contents.notes[0]
    table = next(open_recording(tmp_path / "a.lvm", ["force #2", "acc_1 #2"]).blocks)
    np.testing.assert_array_equal(table[:, 1:].T, SIGNALS[:2])


@pytest.mark.parametrize("remark", ["", "loud"])
def test_rows_of_labview_are_read_by_its_reader_only_where_they_hold_text(tmp_path, remark, monkeypatch):
    path = tmp_path / "a.lvm"
    write_lvm(path, decimal=",", segments=2)
    *rows, end, _ = path.read_text().split("\n")
    path.write_text("\n".join([*rows, f"{end}\t{remark}" if remark else end, ""]))
    given = []
    read = lvm_read.read_str
    monkeypatch.setattr(lvm_read, "read_str", lambda text: given.append(text.count("\n")) or read(text))
    table = next(open_recording(path, ["force #2", "acc_1 #2"]).blocks)
    np.testing.assert_array_equal(table[:, 1:].T, SIGNALS[:2])
    assert (given[-1] > 1000) == bool(remark)  # two segments of 512 rows


@pytest.mark.parametrize("width", [1, 2, 4])
def test_wav_is_fractions_of_full_scale(tmp_path, width):
    whole = 2.0 ** (8 * width - 1)
    scaled = np.round(SIGNALS[:2] / abs(SIGNALS).max() * (whole - 1))
    integers = (scaled + whole).astype("u1") if width == 1 else scaled.astype(f"<i{width}")
    with wave.open(str(tmp_path / "a.wav"), "wb") as file:
        file.setnchannels(2)
        file.setsampwidth(width)
        file.setframerate(int(RATE_HZ))
        file.writeframes(integers.T.tobytes())
    table = next(open_recording(tmp_path / "a.wav", ["1", "channel 2"]).blocks)
    np.testing.assert_allclose(table[:, 0], TIME, rtol=1e-12)
    np.testing.assert_array_equal(table[:, 1:].T, scaled / whole)


def test_numbers_of_a_channel_and_rates_that_contradict(tmp_path):
    write_lvm(tmp_path / "a.lvm")
    table = next(open_recording(tmp_path / "a.lvm", ["2", "1"]).blocks)
    np.testing.assert_array_equal(table[:, 1:].T, SIGNALS[[1, 0]])
    with pytest.raises(InputError, match=r"sample_rate_hz = 1000, but the file's own time.*2048 Hz"):
        open_recording(tmp_path / "a.lvm", NAMES, TableKeys(sample_rate_hz=1000.0))
    with pytest.raises(InputError, match="no signal 'acc_3'; did you mean 'acc_"):
        open_recording(tmp_path / "a.lvm", ["acc_3"])


@pytest.mark.parametrize(
    ("name", "head", "reader", "extra"),
    [("a.tdms", b"TDSm", "nptdms", "tdms"), ("a.mf4", b"MDF     ", "asammdf", "mdf")],
)
def test_a_missing_reader_names_its_extra(tmp_path, monkeypatch, name, head, reader, extra):
    (tmp_path / name).write_bytes(head + bytes(64))
    monkeypatch.setitem(sys.modules, reader, None)
    with pytest.raises(InputError, match=rf"pip install 'frf_ipz\[{extra}\]'"):
        look_at_recording(tmp_path / name)


def test_a_formula_of_an_mdf_file_is_not_run(tmp_path):
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as content:
        values = np.arange(64)
        conversion = {"formula": "__import__('os').getpid() + X1"}
        content.append([asammdf.Signal(values, values / 100.0, name="force", conversion=conversion)])
        content.save(tmp_path / "a.mf4", overwrite=True)
    with pytest.raises(InputError, match="'force' by a formula or a table"):
        look_at_recording(tmp_path / "a.mf4")


@pytest.mark.parametrize(("version", "key"), [("4.10", "byte_offset"), ("3.30", "additional_byte_offset")])
def test_a_channel_of_an_mdf_file_beyond_its_records_is_refused(tmp_path, version, key):
    """What unpacks records would read on behind the file, and end the interpreter."""
    asammdf = pytest.importorskip("asammdf")
    values = np.arange(100.0)
    with asammdf.MDF(version=version) as content:
        content.append([asammdf.Signal(values, values / 100.0, name=name, unit="N") for name in ("force", "acc")])
        setattr(content.groups[0].channels[2], key, 60_000)
        written = content.save(tmp_path / "a.mdf", overwrite=True)
    with pytest.raises(FileFormatError, match=r"says that 'acc' ends at byte 600\d\d of records of 24 bytes"):
        open_recording(written, ["force"], TableKeys())


@pytest.mark.parametrize(("version", "block", "link"), [("4.10", b"##CG", (24, 8)), ("3.30", b"DG", (4, 4))])
def test_an_mdf_file_whose_blocks_lead_round_in_a_circle_is_refused(tmp_path, version, block, link):
    """A group names itself as the next one: the library would count for ever."""
    asammdf = pytest.importorskip("asammdf")
    values = np.arange(100.0)
    with asammdf.MDF(version=version) as content:
        content.append([asammdf.Signal(values, values / 100.0, name=name, unit="N") for name in ("force", "acc")])
        written = content.save(tmp_path / "a.mdf", overwrite=True)
    data = bytearray(written.read_bytes())
    place, (offset, size) = data.index(block, 64), link
    data[place + offset : place + offset + size] = place.to_bytes(size, "little")
    written.write_bytes(data)
    with pytest.raises(FileFormatError, match="lead round in a circle"):
        open_recording(written, ["force"], TableKeys())


def test_an_mdf_file_of_short_blocks_is_read(tmp_path):
    """As before version 3: channels without a further offset."""
    asammdf = pytest.importorskip("asammdf")
    values = np.arange(100.0)
    with asammdf.MDF(version="3.30") as content:
        content.append([asammdf.Signal(values, values / 100.0, name=name, unit="N") for name in ("force", "acc")])
        for channel in content.groups[0].channels:
            channel.block_len = SHORT_BLOCK
        written = content.save(tmp_path / "a.mdf", overwrite=True)
    with asammdf.MDF(written) as content:
        assert not hasattr(content.groups[0].channels[1], "additional_byte_offset")
    assert len(next(open_recording(written, ["force"], TableKeys()).blocks)) == len(values)


def test_a_formula_of_an_mdf_file_costs_its_channel_only(tmp_path):
    asammdf = pytest.importorskip("asammdf")
    values = np.arange(64)
    with asammdf.MDF(version="4.10") as content:
        formula = asammdf.Signal(values, values / 100.0, name="force", conversion={"formula": "X1 + 4"})
        content.append([formula, asammdf.Signal(1.5 * values, values / 100.0, name="acc")])
        content.save(tmp_path / "a.mf4", overwrite=True)
    looked = look_at_recording(tmp_path / "a.mf4")
    assert [column.name for column in looked.columns] == ["acc"]
    assert looked.notes == (
        "MDF: not read, for the file converts them by a formula or a table, and only factor and offset are read: force",
    )
    (block,) = open_recording(tmp_path / "a.mf4", ["acc"]).blocks
    np.testing.assert_array_equal(block[:, 1], 1.5 * values)
    with pytest.raises(InputError, match="'force' by a formula or a table"):
        open_recording(tmp_path / "a.mf4", ["force"])


def test_a_library_that_fails_to_close_a_damaged_file_prints_nothing(tmp_path, monkeypatch):
    unraisable = []
    write_mdf(tmp_path / "a.mf4")
    (tmp_path / "a.mf4").write_bytes((tmp_path / "a.mf4").read_bytes()[:100])
    monkeypatch.setattr("sys.unraisablehook", unraisable.append)
    with pytest.raises(FileFormatError, match="cut off or damaged"):
        look_at_recording(tmp_path / "a.mf4")
    gc.collect()
    assert not unraisable


def test_what_a_library_logs_of_a_whole_file_is_handed_on(tmp_path):
    write_tdms(tmp_path / "a.tdms")
    whole = (tmp_path / "a.tdms").read_bytes()
    (tmp_path / "b.tdms").write_bytes(whole.replace((4712).to_bytes(4, "little"), (4799).to_bytes(4, "little")))
    recording = open_recording(tmp_path / "b.tdms", NAMES)
    assert recording.notes == ("TDMS: Unrecognised version number: 4799",)
    for block, expected in zip(recording.blocks, open_recording(tmp_path / "a.tdms", NAMES).blocks, strict=True):
        np.testing.assert_array_equal(block, expected)


def test_a_sound_file_that_is_cut_off_is_refused(tmp_path):
    wavfile.write(tmp_path / "a.wav", 2048, np.zeros((4096, 2), np.float32))
    whole = (tmp_path / "a.wav").read_bytes()
    (tmp_path / "a.wav").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FileFormatError, match=r"a\.wav.*cut off or damaged"):
        look_at_recording(tmp_path / "a.wav")


def test_a_spreadsheet_that_defines_entities_or_is_a_bomb_is_refused(tmp_path):
    write_xlsx(tmp_path / "a.xlsx")
    with zipfile.ZipFile(tmp_path / "a.xlsx") as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    sheet = "xl/worksheets/sheet1.xml"
    attack = b'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaa">]>' + parts[sheet]
    with zipfile.ZipFile(tmp_path / "b.xlsx", "w") as archive:
        for name, part in (parts | {sheet: attack}).items():
            archive.writestr(name, part)
    with pytest.raises(InputError, match="defines entities"):
        look_at_recording(tmp_path / "b.xlsx")
    data = bytearray((tmp_path / "a.xlsx").read_bytes())
    place = data.rindex(b"PK\x01\x02")  # the last entry of the directory: state that it is huge
    data[place + 24 : place + 28] = struct.pack("<I", 0xFFFFFFFE)
    (tmp_path / "c.xlsx").write_bytes(bytes(data))
    with pytest.raises(InputError, match="MB of numbers in a file of"):
        look_at_recording(tmp_path / "c.xlsx")


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # of the destructor of asammdf
@pytest.mark.parametrize("name", WRITERS)
def test_damaged_files_are_one_line(tmp_path, name):
    WRITERS[name](tmp_path / name)
    whole = (tmp_path / name).read_bytes()
    rng = np.random.default_rng(1)
    changed = [whole[: int(cut)] for cut in rng.integers(60, len(whole) - 1, 3)]
    for _ in range(12):
        data = bytearray(whole)
        data[int(rng.integers(0, len(data)))] = int(rng.integers(256))
        changed.append(bytes(data))
    for data in changed:
        (tmp_path / name).write_bytes(data)
        try:
            contents = look_at_recording(tmp_path / name)
            next(open_recording(tmp_path / name, [contents.columns[0].name]).blocks)
        except InputError:
            continue


def test_frfs_in_a_spreadsheet(tmp_path):
    book = openpyxl.Workbook()
    book.active.append(["frequency_hz", "output_dof", "input_dof", "real", "imag"])
    for line in range(1, 30):
        book.active.append([line, "1:+z", "2:+z", 1.0 / line, -0.1])
    stream = io.BytesIO()
    book.save(stream)
    (tmp_path / "frf.xlsx").write_bytes(stream.getvalue())
    frfs = frf_ipz.read_frfs(tmp_path / "frf.xlsx", quantity="receptance")
    np.testing.assert_allclose(frfs.values[:, 0], 1.0 / np.arange(1, 30) - 0.1j, rtol=DIGITS)


def test_a_file_of_labview_that_was_thinned_out_keeps_its_own_times(tmp_path):
    write_lvm(tmp_path / "a.lvm", columns="One")
    lines = (tmp_path / "a.lvm").read_text().splitlines()
    first = next(number for number, line in enumerate(lines) if line.startswith("X_Value")) + 1
    (tmp_path / "a.lvm").write_text("\n".join([*lines[:first], *lines[first::16]]) + "\n")
    table = next(open_recording(tmp_path / "a.lvm", ["force"]).blocks)
    np.testing.assert_allclose(table[:, 0], TIME[::16], rtol=1e-12)


def test_a_file_that_is_cut_off_is_refused_and_no_library_prints(tmp_path, capfd):
    path = tmp_path / "a.tdms"
    write_tdms(path)
    path.write_bytes(path.read_bytes()[:-5])
    with pytest.raises(FileFormatError, match=r"a\.tdms.*cut off or damaged.*less data than expected"):
        next(open_recording(path, NAMES).blocks)
    assert capfd.readouterr() == ("", "")
