"""Recordings in files of arrays: MATLAB 4 to 7.3, HDF5 and NumPy, under any names."""

import zipfile

import h5py
import numpy as np
import pytest
import scipy.io

from array_files import write_matlab_7_3
from frf_ipz.errors import InputError
from frf_ipz.ingest.campaign_file import read_test
from frf_ipz.ingest.formats.registry import look_at_recording, open_recording
from frf_ipz.ingest.recording_files import RecordingFiles
from synthetic_campaign import Structure, impact

RATE_HZ = 2048.0
SIGNALS = impact(Structure(), n_samples=512)
TIME = np.arange(512) / RATE_HZ


def write_npz(path, arrays):
    np.savez(path, **arrays)


def write_hdf5(path, arrays):
    with h5py.File(path, "w") as file:
        for name, values in arrays.items():
            file[name] = values


WRITERS = {
    "v4.mat": lambda path, arrays: scipy.io.savemat(path, arrays, format="4"),
    "v5.mat": scipy.io.savemat,
    "v7.mat": lambda path, arrays: scipy.io.savemat(path, arrays, do_compression=True),
    "v7_3.mat": write_matlab_7_3,
    "some.npz": write_npz,
    "some.h5": write_hdf5,
}


def read(path, variables="", head=""):
    text = f'[test]\nkind = "hammer"\n{head}\n'
    text += '[[channel]]\ncolumn = "force"\nrole = "input"\nquantity = "force"\nunit = "N"\n'
    for number, column in enumerate(("first", "second"), start=1):
        text += f'[[channel]]\ncolumn = "{column}"\nrole = "output"\nquantity = "acceleration"\nunit = "m/s^2"\n'
        text += f'dof = "{number}:+z"\n'
    text += f'[[hit]]\ndof = "1:+z"\nfiles = ["{path.name}"]\n{variables}\n'
    (path.parent / "test.toml").write_text(text)
    test = read_test(path.parent / "test.toml")
    files = RecordingFiles(test=test)
    return np.concatenate(list(files.blocks(test.setups[0], path))), files.notes


def expect(table):
    np.testing.assert_allclose(table[:, 0], TIME, rtol=1e-12)
    np.testing.assert_array_equal(table[:, 1:].T, SIGNALS)


@pytest.mark.parametrize("name", WRITERS)
def test_arrays_under_any_names_by_variables(tmp_path, name):
    arrays = {"F_12": SIGNALS[0], "Y": SIGNALS[1:].T, "Fs": RATE_HZ}
    WRITERS[name](tmp_path / name, arrays)
    columns = ("Y(:,1)", "Y(:,2)") if name.endswith("mat") else ("Y[:,0]", "Y[:,1]")
    variables = f'variables = {{ force = "F_12", first = "{columns[0]}", second = "{columns[1]}" }}'
    table, notes = read(tmp_path / name, variables)
    expect(table)
    assert "2048 samples a second by 'Fs'" in notes[0]


@pytest.mark.parametrize("name", WRITERS)
def test_arrays_with_the_names_of_the_channels_need_nothing(tmp_path, name):
    arrays = {"t": TIME, "force": SIGNALS[0], "first": SIGNALS[1], "second": SIGNALS[2], "other": np.eye(20)}
    WRITERS[name](tmp_path / name, arrays)
    table, notes = read(tmp_path / name)
    expect(table)
    assert "the time is 't'; left out: 'other' (20 x 20)" in notes[0]


def test_a_structure_and_a_list_of_names(tmp_path):
    table = np.column_stack([TIME, *SIGNALS])
    names = np.array(["Time", "force", "first", "second"], object)
    for name, write in (("v7.mat", scipy.io.savemat), ("v7_3.mat", write_matlab_7_3)):
        labels = list(names) if write is write_matlab_7_3 else names
        write(tmp_path / name, {"run": {"data": table, "channel_names": labels}})
        expect(read(tmp_path / name)[0])


def test_units_of_attributes_and_of_fields(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, values, unit in (("m/force", SIGNALS[0], "N"), ("m/acc", SIGNALS[1], "m/s^2")):
            file[name] = values
            file[name].attrs["unit"] = unit
        file.attrs["sample_rate"] = RATE_HZ
    scipy.io.savemat(
        tmp_path / "a.mat",
        {"F": {"values": SIGNALS[0], "unit": "N"}, "A": {"values": SIGNALS[1], "unit": "m/s^2"}, "dt": 1 / RATE_HZ},
    )
    for name in ("a.h5", "a.mat"):
        contents = look_at_recording(tmp_path / name)
        assert sorted(column.unit for column in contents.columns) == ["N", "m/s^2"]
        assert contents.has_time


def test_signals_as_testlab_exports_them(tmp_path):
    signal = {
        "x_values": {"start_value": 0.0, "increment": 1 / RATE_HZ, "number_of_values": 512.0},
        "y_values": {"values": SIGNALS.T, "quantity": {"label": np.array(["N", "m/s^2", "m/s^2"], object)}},
        "function_record": {"name": np.array(["hammer:1:+Z", "beam:1:+Z", "beam:2:-X"], object)},
    }
    scipy.io.savemat(tmp_path / "a.mat", {"Signal_0": signal})
    contents = look_at_recording(tmp_path / "a.mat")
    assert [(column.unit, str(column.dof)) for column in contents.columns] == [
        ("N", "1:+z"),
        ("m/s^2", "1:+z"),
        ("m/s^2", "2:-x"),
    ]
    recording = open_recording(tmp_path / "a.mat", ["hammer:1:+Z", "2:-x"])
    np.testing.assert_array_equal(next(recording.blocks)[:, 1:], SIGNALS[[0, 2]].T)


@pytest.mark.parametrize(
    ("variables", "message"),
    [
        ('variables = { force = "F", first = "Y(:,1)", second = "Y(:,9)" }', r"'Y\(:,9\)' is no part of 'Y'"),
        ('variables = { force = "G", first = "Y(:,1)", second = "Y(:,2)" }', "has no array 'G'"),
        ('variables = { force = "F", first = "Y", second = "Y(:,2)" }', "'Y' is 512 x 2; a channel is one column"),
        ('variables = { forc = "F" }', "'variables' names 'forc'.*did you mean 'force'"),
        ('variables = { force = "F", first = "Y(:,1)", second = "Y(:,2)", sample_rate_hz = "Y" }', "one positive"),
    ],
)
def test_what_does_not_fit_is_said(tmp_path, variables, message):
    scipy.io.savemat(tmp_path / "a.mat", {"F": SIGNALS[0], "Y": SIGNALS[1:].T, "dt": 1 / RATE_HZ})
    with pytest.raises(InputError, match=message):
        read(tmp_path / "a.mat", variables)


def test_without_a_time_the_way_out_is_said_and_a_rate_of_the_test_serves(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"force": SIGNALS[0], "first": SIGNALS[1], "second": SIGNALS[2]})
    with pytest.raises(InputError, match="write sample_rate_hz"):
        read(tmp_path / "a.mat")
    expect(read(tmp_path / "a.mat", head="sample_rate_hz = 2048.0")[0])


def test_frfs_are_no_recording(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"H": np.ones(100) + 1j, "note": "hello"})
    with pytest.raises(InputError, match=r"'H' is complex: FRFs belong under \[\[frf\]\]"):
        look_at_recording(tmp_path / "a.mat")


def test_nothing_pickled_is_read(tmp_path):
    np.savez(tmp_path / "a.npz", force=SIGNALS[0], first=SIGNALS[1], bad=np.array([{}], object), allow_pickle=True)
    assert [column.name for column in look_at_recording(tmp_path / "a.npz").columns] == ["force", "first"]


def test_what_would_be_larger_than_the_memory_is_refused_before_it_is_read(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        header = b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (300000000,), }"
        archive.writestr("force.npy", header.ljust(127) + b"\n" + bytes(1000))
    with pytest.raises(InputError, match="promises more numbers than there are"):
        look_at_recording(tmp_path / "a.npz")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("force", shape=(400_000_000,), dtype="f8", chunks=(1 << 20,), compression="gzip")
    with pytest.raises(InputError, match="3200 MB of numbers in a file of"):
        look_at_recording(tmp_path / "a.h5")


def test_links_out_of_an_hdf5_file_and_circles_are_not_followed(tmp_path):
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["secret"] = SIGNALS[0]
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["force"] = SIGNALS[0]
        file["outside"] = h5py.ExternalLink("other.h5", "/secret")
        file.create_dataset("raw", shape=(64,), dtype="f8", external=[(str(tmp_path / "raw.bin"), 0, 512)])
    with pytest.raises(InputError, match="'/raw' lies in another file"):
        look_at_recording(tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "a") as file:
        del file["raw"]
    assert [column.name for column in look_at_recording(tmp_path / "a.h5").columns] == ["force"]
    with h5py.File(tmp_path / "a.h5", "a") as file:
        file["group/back"] = file["/"]
    with pytest.raises(InputError, match="in a circle"):
        look_at_recording(tmp_path / "a.h5")


@pytest.mark.parametrize("name", WRITERS)
def test_damaged_files_are_one_line(tmp_path, name):
    rng = np.random.default_rng(0)
    WRITERS[name](tmp_path / name, {"force": SIGNALS[0], "first": SIGNALS[1], "t": TIME})
    whole = (tmp_path / name).read_bytes()
    for cut in rng.integers(200, len(whole) - 1, 4):
        (tmp_path / name).write_bytes(whole[:cut])
        with pytest.raises(InputError):
            next(open_recording(tmp_path / name, ["force", "first"]).blocks)
    for _ in range(30):
        data = bytearray(whole)
        data[int(rng.integers(0, min(len(data), 4000)))] = int(rng.integers(256))
        (tmp_path / name).write_bytes(bytes(data))
        try:
            next(open_recording(tmp_path / name, ["force", "first"]).blocks)
        except InputError:
            continue


def test_a_lone_frequency_beside_signals_is_their_rate(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"indata": SIGNALS.T, "freq": RATE_HZ, "buflen": 512.0, "tsmax": 1.0})
    table, notes = read(
        tmp_path / "a.mat", 'variables = { force = "indata(:,1)", first = "indata(:,2)", second = "indata(:,3)" }'
    )
    expect(table)
    assert "2048 samples a second by 'freq'" in notes[0]


DAY_S = 86400.0


@pytest.mark.parametrize("name", ["v7.mat", "some.npz"])
@pytest.mark.parametrize(
    ("times", "rounded_s"),
    [
        (738000.5 + TIME / DAY_S, np.spacing(738000.5) * DAY_S),
        (1.7e9 + TIME / 25.0, np.spacing(1.7e9)),
        (np.rint(1.7e15 + 1e6 * TIME), 1e-6),
    ],
    ids=["datenum", "s since 1970, 51.2 kHz", "whole us since 1970"],
)
def test_times_since_a_date_give_their_rate(tmp_path, name, times, rounded_s):
    arrays = {"t": times, "force": SIGNALS[0], "first": SIGNALS[1], "second": SIGNALS[2]}
    WRITERS[name](tmp_path / name, arrays)
    table, _ = read(tmp_path / name)
    expected = TIME / 25.0 if times[0] == 1.7e9 else TIME
    np.testing.assert_allclose(table[:, 0] - table[0, 0], expected, atol=2 * rounded_s, rtol=0)
