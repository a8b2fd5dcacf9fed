"""From a folder of recordings or FRFs in any format, by init, check and run, to a page, without an editor."""

import re
import sys

import h5py
import numpy as np
import openpyxl
import pytest
import pyuff
import scipy.io
from scipy.io import wavfile

import data_sets
import frf_ipz
from array_files import write_matlab_7_3
from data_sets import NONE
from frf_ipz.cli import main as command
from frf_ipz.errors import InputError
from frf_ipz.ingest.campaign_file import read_test
from frf_ipz.pipeline.check.setup import describe_setup
from frf_ipz.pipeline.init.folder_contents import look_into
from frf_ipz.pipeline.init.starting_files import write_starting_files
from frf_ipz.pipeline.inputs import read_inputs
from small_campaign import RATE, accelerance, blow

UNITS = ["N", "m/s^2"]
BLOWS = [blow(np.random.default_rng(seed), level=30.0 + 10 * seed) for seed in range(3)]
LINES_HZ = np.arange(5.0, 700.0, 0.5)
FRF = accelerance(2j * np.pi * LINES_HZ, 1.0, 14 / 20)


def structure_of_testlab(force, acc):
    return {
        "x_values": {"start_value": 0.0, "increment": 1 / RATE, "number_of_values": float(len(force))},
        "y_values": {"values": np.column_stack([force, acc]), "quantity": {"label": np.array(UNITS, object)}},
        "function_record": {"name": np.array(["hammer:15:+Z", "beam:21:+Z"], object)},
    }


def write_mat(path, time, force, acc):
    del time
    scipy.io.savemat(path, {"Signal": structure_of_testlab(force, acc)})


def write_v7_3(path, time, force, acc):
    write_matlab_7_3(path, {"time": time, "force": force, "acc": acc})


def write_npz(path, time, force, acc):
    del time
    np.savez(path, data=np.column_stack([force, acc]), names=["force", "acc"], units=UNITS, fs=RATE)


def write_hdf5(path, time, force, acc):
    with h5py.File(path, "w") as file:
        for name, values, unit in (("t", time, "s"), ("force", force, "N"), ("acc", acc, "m/s^2")):
            file[name] = values
            file[name].attrs["unit"] = unit


def write_xlsx(path, time, force, acc):
    book = openpyxl.Workbook()
    book.active.append(["Time [s]", "force [N]", "acc [m/s^2]"])
    for row in np.column_stack([time, force, acc]).tolist():
        book.active.append(row)
    book.save(path)


def write_lvm(path, time, force, acc):
    del time
    head = ["LabVIEW Measurement", "Separator\tTab", "Decimal_Separator\t.", "X_Columns\tNo", "***End_of_Header***", ""]
    head += ["Channels\t2", f"Samples\t{len(force)}\t{len(force)}", "Y_Unit_Label\tN\tm/s^2"]
    head += [f"X0\t0\t0\nDelta_X\t{1 / RATE!r}\t{1 / RATE!r}", "***End_of_Header***", "X_Value\tforce\tacc\tComment"]
    rows = [f"\t{first!r}\t{second!r}" for first, second in zip(force.tolist(), acc.tolist(), strict=True)]
    path.write_text("\n".join([*head, *rows]) + "\n")


def write_tdms(path, time, force, acc):
    del time
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(path) as writer:
        for name, values, unit in (("force", force, "N"), ("acc", acc, "m/s^2")):
            properties = {"wf_increment": 1 / RATE, "unit_string": unit}
            writer.write_segment([nptdms.ChannelObject("test", name, values, properties)])


def write_mdf(path, time, force, acc):
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as content:
        content.append(
            [
                asammdf.Signal(values, time, name=name, unit=unit)
                for name, values, unit in (("force", force, "N"), ("acc", acc, "m/s^2"))
            ]
        )
        content.save(path, overwrite=True)


def write_uff(path, time, force, acc):
    del time
    path.write_text(
        "".join(
            data_sets.data_set(
                values,
                axes=((17, "Time", "s"), (kind, label, unit), NONE),
                kind=1,
                ordinate_type=4,
                step=1 / RATE,
                ends=f"      NONE{node:10d}   3       NONE         0   0",
                number=lambda value: f"{value:20.11e}",
            )
            for values, kind, label, unit, node in ((force, 13, "Force", "N", 15), (acc, 12, "Acc", "m/s^2", 21))
        )
    )


def write_wav(path, time, force, acc):
    del time
    wavfile.write(path, int(RATE), np.column_stack([force, acc]))


WRITERS = {
    "mat": write_mat,
    "v73.mat": write_v7_3,
    "npz": write_npz,
    "h5": write_hdf5,
    "xlsx": write_xlsx,
    "lvm": write_lvm,
    "tdms": write_tdms,
    "mf4": write_mdf,
    "uff": write_uff,
    "wav": write_wav,
}
STATE_DOFS, STATE_UNITS = {"mat", "uff"}, set(WRITERS) - {"v73.mat", "wav"}


def campaign(folder, kind):
    for number, values in enumerate(BLOWS, start=1):
        WRITERS[kind](folder / f"hit_{number:02d}.{kind}", *values)
    return folder


@pytest.mark.parametrize("kind", WRITERS)
def test_check_accepts_what_init_writes(tmp_path, kind):
    campaign(tmp_path, kind)
    write_starting_files(tmp_path)
    text = (tmp_path / "test.toml").read_text(encoding="utf-8")
    marked = [line.split("=")[0].strip() for line in text.splitlines() if line.endswith("CHECK")]
    assert ("dof" in marked) == (kind not in STATE_DOFS)
    assert ("unit" in marked) == (kind not in STATE_UNITS)
    assert "  read      3 x 4096 samples at 409" in describe_setup(read_inputs(tmp_path / "pipeline.toml"))
    test = read_test(tmp_path / "test.toml")
    assert test.kind == "hammer"
    frfs = frf_ipz.estimate_frfs(test).frfs
    lines = frfs.in_band((20.0, 600.0))
    truth = accelerance(2j * np.pi * frfs.frequency_hz[lines] + frfs.window_decay_1_s, 1.0, 14 / 20)
    assert np.linalg.norm(frfs.values[lines, 0] - truth) <= 0.02 * np.linalg.norm(truth)  # of the noise of three blows
    if kind in STATE_DOFS:
        assert str(test.labels[0]) == "21:+z / 15:+z"


def test_a_shakers_record_is_told_from_impacts(tmp_path):
    rng = np.random.default_rng(3)
    for number in range(2):
        np.savez(tmp_path / f"run_{number}.npz", force=rng.normal(size=9000), acc=rng.normal(size=9000), fs=RATE)
    write_starting_files(tmp_path)
    test = read_test(tmp_path / "test.toml")
    assert (test.kind, len(test.files)) == ("random", 2)


def write_frf_mat(path):
    scipy.io.savemat(path, {"frf": np.stack([FRF, 2 * FRF], 1), "f": LINES_HZ, "unit": "m/s^2/N"})


def write_frf_analyser(path):
    head = ["Units: Ratio", "Channel\t1", "", "Frequency\tReal\tImaginary", "Hz\t(m/s²)(N)\t"]
    rows = [f"{hertz!r}\t{value.real!r}\t{value.imag!r}" for hertz, value in zip(LINES_HZ, FRF, strict=True)]
    path.write_text("\n".join([*head, *(row.replace("np.float64(", "").replace(")", "") for row in rows)]) + "\n")


def write_frf_uff(path):
    axes = ((18, "Frequency", "Hz"), (12, "Acc", "m/s^2"), (13, "Force", "N"))
    ends = "      NONE        21   3       NONE        15   3"
    path.write_text(data_sets.data_set(FRF, axes=axes, start=LINES_HZ[0], step=0.5, ends=ends))


@pytest.mark.parametrize(
    ("name", "write", "n_frfs"),
    [("a.mat", write_frf_mat, 2), ("Hxy 21-15.txt", write_frf_analyser, 1), ("a.unv", write_frf_uff, 1)],
)
def test_frfs_in_any_format(tmp_path, name, write, n_frfs):
    write(tmp_path / name)
    write_starting_files(tmp_path)
    assert f"read      {n_frfs} FRF" in describe_setup(read_inputs(tmp_path / "pipeline.toml"))
    test = read_test(tmp_path / "test.toml")
    frfs = frf_ipz.estimate_frfs(test).frfs
    np.testing.assert_allclose(frfs.values[:, 0], FRF, rtol=1e-10)
    if n_frfs == 1:
        assert str(test.labels[0]) == "21:+z / 15:+z"


def test_the_geometry_of_a_universal_file_is_drawn_without_a_model(tmp_path):
    """FRFs, nodes and trace lines in one file, as analysers export them."""
    nodes = {"type": 15, "node_nums": [15, 21], "def_cs": [0, 0], "disp_cs": [0, 0], "color": [1, 1]}
    trace = {"type": 82, "trace_num": 1, "n_nodes": 2, "color": 1, "id": "frame", "nodes": np.array([15, 21])}
    pyuff.UFF(str(tmp_path / "a.unv")).write_sets(
        [nodes | {"x": [0.0, 0.3], "y": [0.0, 0.4], "z": [0.0, 0.1]}, trace], "overwrite"
    )
    write_frf_uff(tmp_path / "b.unv")
    (tmp_path / "a.unv").write_text((tmp_path / "a.unv").read_text() + (tmp_path / "b.unv").read_text())
    (tmp_path / "b.unv").unlink()
    starting = write_starting_files(tmp_path)
    assert "a.unv: where the nodes are, for drawings" in starting.taken_for
    test = read_test(tmp_path / "test.toml")
    assert str(test.labels[0]) == "21:+z / 15:+z"
    results = frf_ipz.run_pipeline(tmp_path / "pipeline.toml", tmp_path / "out", until="fit")
    np.testing.assert_allclose(results.geometry.coordinates_m, [[0, 0, 0], [0.3, 0.4, 0.1]])
    assert results.geometry.mesh.lines.tolist() == [[15, 21]]


def test_frfs_without_a_header_are_guessed_and_their_single_numbers_are_those_of_a_roving_hammer(tmp_path):
    for point, values in enumerate((FRF, 2 * FRF), start=1):
        table = np.column_stack([np.arange(400.0), values.real[:400], values.imag[:400]])
        table[0, 2] = 0.0
        np.savetxt(tmp_path / f"Point_{point}.txt", table, fmt="%.6e", delimiter="\t")
    np.savetxt(tmp_path / "counted.txt", np.arange(60.0).reshape(20, 3) % 7)
    starting = write_starting_files(tmp_path)
    text = (tmp_path / "test.toml").read_text(encoding="utf-8")
    assert re.search(r'columns = \["frequency_hz", "real", "imag"\] .*CHECK', text)
    assert any(note.startswith("counted.txt: left out") for note in starting.taken_for)
    frfs = frf_ipz.estimate_frfs(read_test(tmp_path / "test.toml")).frfs
    assert [str(label) for label in frfs.labels] == ["1:+z / 1:+z", "1:+z / 2:+z"]
    np.testing.assert_allclose(frfs.values[1:, 1], 2 * FRF[1:400], rtol=1e-5)


def test_what_is_no_measurement_is_left_aside(tmp_path):
    campaign(tmp_path, "npz")
    (tmp_path / "notes.txt").write_text("Measured on Friday.\n3 blows a point.\n")
    (tmp_path / "picture.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    np.savez(tmp_path / "K.npz", K=np.eye(64))
    (tmp_path / "broken.mat").write_bytes(b"MATLAB 5.0 MAT-file".ljust(126) + b"IM" + bytes(9))
    starting = write_starting_files(tmp_path)
    assert len(read_test(tmp_path / "test.toml").files) == 3
    assert any(text.startswith("broken.mat: left out") for text in starting.taken_for)


@pytest.mark.slow
@pytest.mark.parametrize("kind", sorted(STATE_UNITS))
def test_a_folder_becomes_a_page(tmp_path, kind, monkeypatch):
    campaign(tmp_path, kind)
    for arguments in (["init", str(tmp_path)], ["run", str(tmp_path), "--out", str(tmp_path / "out")]):
        monkeypatch.setattr(sys, "argv", ["frf-ipz", *arguments])
        with pytest.raises(SystemExit) as stop:
            command.main()
        assert not stop.value.code
    assert (tmp_path / "out" / "report.html").stat().st_size > 100_000


def test_a_file_beside_the_frfs_that_cannot_be_read_is_left_out_and_said(tmp_path):
    rows = "".join(f"{hz} 1.0 {hz}\n" for hz in range(1, 40))
    (tmp_path / "H1.txt").write_text("Frequency Real Imag\n" + rows)
    (tmp_path / "setup.csv").write_text("xHammer,0,0\nzHammer,0.1,0.2\n")
    pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12\n"
    (tmp_path / "H2.wav").write_text(pointer)
    contents = look_into(tmp_path)
    assert [path.name for path in contents.frfs] == ["H1.txt"]
    said = {path.name: reason for path, reason in contents.unread.items()}
    assert said["setup.csv"].startswith("holds no line that begins with a number")
    assert said["H2.wav"] == "is a pointer of Git LFS and not the file itself; run: git lfs pull"
    (tmp_path / "H1.txt").unlink()
    with pytest.raises(InputError, match=r"setup\.csv: holds no line"):
        look_into(tmp_path)


def test_a_text_table_without_time_is_named(tmp_path):
    (tmp_path / "accel.txt").write_text("".join(f"{row % 7} {row}\n" for row in range(40)))
    with pytest.raises(InputError, match=r"accel\.txt: is a table without a column of time"):
        look_into(tmp_path)
