"""Whatever lies in a file, a parser reads it or refuses it with an error of the project; ``-m slow`` looks longer."""

import re
import tempfile
import warnings
from functools import cache
from io import BytesIO
from pathlib import Path

import h5py
import numpy as np
import openpyxl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import io, sparse
from scipy.io import wavfile

import frf_ipz
from array_files import write_matlab_7_3
from data_sets import data_set
from fe_models import BEAM_TEXT, LUMPED_TEXT
from frf_ipz.errors import FrfIpzError
from frf_ipz.fe.matrices.dof_table import read_dof_table
from frf_ipz.fe.matrices.formats.matrix_market import read_matrix_market
from frf_ipz.fe.matrices.registry import read_matrix
from frf_ipz.fe.matrices.row_tables import read_rows
from frf_ipz.fe.matrices.stored import MatrixRequest
from frf_ipz.fe.model_file import read_model
from frf_ipz.fleet.fleet_file import read_fleet
from frf_ipz.fleet.machine_list import read_machine_list
from frf_ipz.ingest.campaign_file import read_test
from frf_ipz.ingest.formats.modes_file import ModesSource
from frf_ipz.ingest.formats.registry import open_recording, read_modes_file
from frf_ipz.json_files import read_json
from frf_ipz.meshes.registry import read_mesh
from frf_ipz.pipeline.config import read_pipeline
from frf_ipz.runs.manifest import load_manifest
from frf_ipz.runs.stage_file import StageFile, read_stage_file, write_stage_file
from mutated_inputs import TOKENS
from small_campaign import PIPELINE, TEST

ROWS = "".join(f"{row / 1024!r},{10.0 * (row == 3)!r},{1.0 / (1 + row)!r}\n" for row in range(24))
STAMPED = "".join(f"27/03/2025 10:51:13,{row:03d};{row};{row % 5},5\n" for row in range(24))
FRF_ROWS = "".join(f"{hz}.0,5:+z,3:+z,{1.0 / hz!r},{-0.5 / hz!r}\n" for hz in range(1, 20))
TRIPLES = "3 3 5\n1 1 2.0\n2 2 2.0\n3 3 2.0\n2 1 -1.0\n3 2 -1.0\n"
DOFS = "node,direction,x_m,y_m,z_m\n1,z,0.0,0,0\n2,z,0.5,0,0\n3,z,1.0,0,0\n"


def universal(kind):
    values, ordinate_type = (np.tile([0 + 1j, 2 + 3j, 4 + 5j], 6), 5) if kind == 4 else (np.tile(np.arange(6.0), 3), 2)
    return data_set(values, axes=AXES, kind=kind, ordinate_type=ordinate_type, start=5.0)


AXES = ((18, "Frequency", "Hz"), (12, "force", "m/s2"), (13, "Force", "N"))


def stage_file():
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.bin"
        write_stage_file(StageFile(key="0f", tree={"a": [1, "x"]}, arrays=[np.arange(6.0).reshape(2, 3)]), path)
        return path.read_bytes()


def read_recording(path):
    return [block.sum() for block in open_recording(path, ["force", "acc"]).blocks]


def read_channel(path):
    return [block.sum() for block in open_recording(path, ["force"]).blocks]


def read_columns(path):
    columns = ("frequency_hz", "real", "imag")
    return frf_ipz.read_frfs(path, output="1:+z", input="2:+z", columns=columns, skip_rows=1)


def read_any_matrix(path):
    return read_matrix(MatrixRequest(path=path, what="stiffness"))


def read_arrays(path):
    return frf_ipz.read_frfs(path, quantity="receptance", output=["1:+z", "2:+z"], input=["1:+z", "2:+z"])


def read_fleet_beside_a_pipeline(path):
    (path.parent / "pipeline.toml").write_text(PIPELINE)
    return read_fleet(path)


def read_described(path):
    return frf_ipz.read_frfs(path, output="1:+z", input="2:+z")


MODES_ROWS = "mode,frequency_hz,damping_ratio,dof,real,imag\n" + "".join(
    f"{mode},{10.0 * mode},0.01,{node}:+z,{node / mode},0.0\n" for mode in (1, 2) for node in (1, 2, 3)
)


def read_modes(path):
    return read_modes_file(ModesSource(path=path))


ANALYSER = "Analyser 2\nFrequency [Hz]\tReal [(m/s^2)/N]\tImaginary [(m/s^2)/N]\tCoherence\n" + "".join(
    f"{hz}.0\t{1.0 / hz!r}\t{-0.5 / hz!r}\t0.99\n" for hz in range(1, 20)
)
DECK = (
    "GRID,1,,0.,0.,0.\n"
    + f"{'GRID':8}{2:8}{'':8}{1.5:8}{0.5:8}\n"
    + (f"{'GRID*':8}{3:16}{'':16}{2.5:16}{0.0:16}\n{'*':8}{1.0:16}\n")
)
SHAPES = "\n".join(
    line
    for mode in (1, 2)
    for line in (
        *("    -1", "    55", *["NONE"] * 5),
        "".join(f"{number:10d}" for number in (1, 2, 2, 8, 2, 3)),
        "".join(f"{number:10d}" for number in (2, 4, 1, mode)),
        "".join(f"{number:13.5e}" for number in (10.0 * mode, 1.0, 0.01, 0.0)),
        *(line for node in (1, 2, 3) for line in (f"{node:10d}", "".join(f"{v:13.5e}" for v in (0, 0, node / mode)))),
        "    -1\n",
    )
)
PUNCHED = "$ punched\nDMIG    KAAX           0       6       2       0\n" + "".join(
    f"{'DMIG*':8}{'KAAX':16}{column:16}{1:16}\n{'*':8}{column:16}{1:16}{'2.000000000D+03':>16}\n"
    for column in (1, 2, 3)
)
MAPPING = "Eqn  Node  DOF\n" + "".join(f"{row:10d}{row:10d}      UX\n" for row in (1, 2, 3))
FLEET = """[fleet]
name = "stages"
pipeline = "pipeline.toml"
[[machine]]
id = "a1"
test = "a1/test.toml"
serial_number = "17"
[machine.fit]
max_order = 20
"""
HARWELL_BOEING = """K of a chain
             4             1             1             2             0
RSA                        3             3             5             0
(4I4)           (5I4)           (3E20.8)
   1   3   5   6
   1   2   2   3   3
      2.00000000E+00     -1.00000000E+00      2.00000000E+00
     -1.00000000E+00      1.00000000E+00
"""
SIGNALS = {"force": np.sin(np.arange(24.0)), "acc": np.cos(np.arange(24.0))}
RATE_HZ = 1024.0
LABVIEW = """LabVIEW Measurement
Separator\tTab
Decimal_Separator\t.
Multi_Headings\tYes
X_Columns\tNo
***End_of_Header***

Channels\t2
Samples\t24\t24
X0\t0.0\t0.0
Delta_X\t0.001\t0.001
***End_of_Header***
X_Value\tforce\tacc\tComment
""" + "".join(f"\t{row}.5\t{row % 5}.25\n" for row in range(24))


def write_mat(stream):
    io.savemat(stream, SIGNALS | {"fs": RATE_HZ, "info": {"unit": "N", "names": np.array(["a", "b"], object)}})


def write_hdf5(stream):
    with h5py.File(stream, "w") as file:
        for name, values in SIGNALS.items():
            file.create_dataset(f"day1/{name}", data=values).attrs["unit"] = "N"
        file["time"] = np.arange(24) / RATE_HZ


def write_wav(stream):
    wavfile.write(stream, int(RATE_HZ), np.column_stack(list(SIGNALS.values())).astype(np.float32))


def write_tdms(stream):
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(stream) as writer:
        writer.write_segment(
            [nptdms.ChannelObject("a", name, values, {"wf_increment": 1 / RATE_HZ}) for name, values in SIGNALS.items()]
        )


def write_mdf(stream):
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as content, tempfile.TemporaryDirectory() as folder:
        time = np.arange(24) / RATE_HZ
        content.append([asammdf.Signal(values, time, name=name, unit="N") for name, values in SIGNALS.items()])
        stream.write(Path(content.save(Path(folder) / "a.mf4", overwrite=True)).read_bytes())


def write_xlsx(stream):
    book = openpyxl.Workbook()
    book.active.append(["time", *SIGNALS])
    for row, values in enumerate(zip(*SIGNALS.values(), strict=True)):
        book.active.append([row / RATE_HZ, *values])
    book.save(stream)


MATRIX = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 2.0]])
FEW, MANY = 30, 400  # contents of each file
LONGEST = 1000  # letters of a refusal
LINES_HZ = np.arange(1.0, 20.0)
FRFS = (np.ones((2, 2)) * (1 / (100 - LINES_HZ**2 + 1j * LINES_HZ))[:, None, None]).astype(complex)
UNITS = np.array(["um", "um"], object)
FRD = {
    "ResponseData": np.moveaxis(FRFS, 0, 2),
    "Frequency": 2 * np.pi * LINES_HZ[:, None],
    "FrequencyUnit": "rad/TimeUnit",
    "OutputName": np.array(["1:+z", "2:+z"], object),
    "InputName": np.array(["1:+z", "2:+z"], object),
    "OutputUnit": UNITS,
    "InputUnit": np.array(["N", "N"], object),
}
TESTLAB = {
    "x_values": {"start_value": 1.0, "increment": 1.0, "number_of_values": 19.0},
    "y_values": {"values": FRFS.reshape(19, 4), "quantity": {"label": "mm/N"}},
    "function_record": {"name": np.array([f"FRF b:{o}:+Z/b:{i}:+Z" for o in (1, 2) for i in (1, 2)], object)},
}


def write_matlab_matrices(stream):
    io.savemat(stream, {"K": sparse.csc_array(MATRIX), "fem": {"M": MATRIX}, "dofs": [[1, 1], [2, 1], [3, 1]]})


def write_matlab_7_3_matrices(stream):
    with h5py.File(stream, "w", userblock_size=512) as file:
        columns = sparse.csc_array(MATRIX)
        group = file.create_group("K")
        group.attrs["MATLAB_sparse"] = np.uint64(3)
        group["data"], group["ir"], group["jc"] = columns.data, columns.indices, columns.indptr


def write_hdf5_frfs(stream):
    with h5py.File(stream, "w") as file:
        file["frf"], file["f"] = FRFS, LINES_HZ


def by_path(write):
    """Let a writer that takes a path write into a stream."""

    def into(stream):
        with tempfile.TemporaryDirectory() as folder:
            write(Path(folder) / "a")
            stream.write((Path(folder) / "a").read_bytes())

    return into


def write_op4(path, *, binary):
    op4 = pytest.importorskip("pyyeti.nastran.op4")
    op4.write(str(path), {"KAA": MATRIX, "GM": np.zeros((2, 3))}, binary=binary)


def write_op2(path):
    pyyeti = pytest.importorskip("pyyeti")
    source = Path(pyyeti.__file__).parent / "tests" / "nas2cam_extseout" / "nas2cam.op2"
    if not source.is_file():
        pytest.skip("this pyyeti came without its files of Nastran")
    path.write_bytes(source.read_bytes())


BINARY = {
    "K.mat": write_matlab_matrices,
    "K73.mat": write_matlab_7_3_matrices,
    "K.npy": lambda stream: np.save(stream, MATRIX),
    "text.op4": by_path(lambda path: write_op4(path, binary=False)),
    "binary.op4": by_path(lambda path: write_op4(path, binary=True)),
    "rows.op2": by_path(write_op2),
    "frf.mat": lambda stream: io.savemat(stream, {"frf": FRFS, "f": LINES_HZ[:, None], "coh": np.ones((19, 2, 2))}),
    "frd.mat": lambda stream: io.savemat(stream, {"sys": FRD}),
    "testlab.mat": lambda stream: io.savemat(stream, {"FRF": TESTLAB}),
    "frf73.mat": by_path(lambda path: write_matlab_7_3(path, {"frf": FRFS, "f": LINES_HZ[:, None], "s": {"n": ["a"]}})),
    "frf.h5": write_hdf5_frfs,
    "frf.npz": lambda stream: np.savez(stream, H=FRFS, f=LINES_HZ),
    "K.npz": lambda stream: sparse.save_npz(stream, sparse.csr_array([[2.0, -1.0], [-1.0, 1.0]]), compressed=False),
    "stage.bin": lambda stream: stream.write(stage_file()),
    "recording.mat": write_mat,
    "recording.h5": write_hdf5,
    "recording.npz": lambda stream: np.savez(stream, time=np.arange(24) / RATE_HZ, **SIGNALS),
    "recording.wav": write_wav,
    "recording.tdms": write_tdms,
    "recording.mf4": write_mdf,
    "recording.xlsx": write_xlsx,
}
PARSERS = {
    "recording.csv": (f"time,force,acc\ns,N,m/s^2\n{ROWS}", read_recording),
    "stamped.csv": (f"sep=;\nDate;force;acc\n{STAMPED}", read_recording),
    "recording.uff": (universal(1), read_channel),
    "frf.csv": (f"frequency_hz,output_dof,input_dof,real,imag\n{FRF_ROWS}", frf_ipz.read_frfs),
    "frf.txt": ("an analyser\n" + FRF_ROWS.replace(",5:+z,3:+z,", "\t").replace(",", "\t"), read_columns),
    "frf.uff": (universal(4), frf_ipz.read_frfs),
    "general.mtx": (
        f"%%MatrixMarket matrix coordinate real symmetric\n% K\n{TRIPLES}",
        lambda path: read_matrix_market(MatrixRequest(path=path, what="stiffness", order=3, ordered_by="dofs.csv")),
    ),
    "array.mtx": (
        "%%MatrixMarket matrix array real general\n3 3\n" + "2.0\n-1.0\n0.0\n" * 3,
        lambda path: read_matrix_market(MatrixRequest(path=path, what="stiffness", order=3, ordered_by="dofs.csv")),
    ),
    "dofs.csv": (DOFS, read_dof_table),
    "job.sti": ("1 1 2.0e3\n2 1 -1.0D3\n2 2 1.0e3\n" * 2, read_any_matrix),
    "labels.mtx": ("** K\n1,1,1,1, 2.0e3\n2,1,1,1,-1.0e3\n2,1,2,1,1.0e3\n-1,0,2,1,1.0\n", read_any_matrix),
    "K.hb": (HARWELL_BOEING, read_any_matrix),
    "job.dof": ("1.1\n1.2\n2.1\n", read_rows),
    "deck.inp": ("*NODE\n1, 0., 0., 0.\n2, 1.5, 0.\n*ELEMENT\n1,1,2\n", read_mesh),
    "K.npz": (None, read_any_matrix),
    "K.npy": (None, read_any_matrix),
    "K.mat": (None, read_any_matrix),
    "K73.mat": (None, read_any_matrix),
    "text.op4": (None, read_any_matrix),
    "binary.op4": (None, read_any_matrix),
    "job.pch": (PUNCHED, read_any_matrix),
    "rows.op2": (None, read_rows),
    "rows.mapping": (MAPPING, read_rows),
    "deck.bdf": (DECK, read_mesh),
    "nodes.csv": ("node,x,y,z\n1,0,0,0\n2,1.5,0,0\n", read_mesh),
    "frf.mat": (None, read_arrays),
    "frd.mat": (None, read_arrays),
    "testlab.mat": (None, read_arrays),
    "frf73.mat": (None, read_arrays),
    "frf.h5": (None, read_arrays),
    "frf.npz": (None, read_arrays),
    "analyser.txt": (ANALYSER, read_described),
    "modes.uff": (SHAPES, read_modes),
    "fleet.toml": (FLEET, read_fleet_beside_a_pipeline),
    "machines.csv": ("id,test,date\na1,a1/test.toml,2026-01-02\na2,'a2/test.toml',\n", read_machine_list),
    "test.toml": (TEST, read_test),
    "beam.toml": (BEAM_TEXT, read_model),
    "lumped.toml": (LUMPED_TEXT, read_model),
    "pipeline.toml": (PIPELINE, read_pipeline),
    "values.json": ('{"a": [1.5, null, "x"], "b": {"c": true}}', read_json),
    "run.json": ('{"frf_ipz_version": "0.3.0", "name": "x", "stages": {"fit": {"files": ["poles.parquet"]}}}', None),
    "stage.bin": (None, read_stage_file),
    "recording.lvm": (LABVIEW, read_recording),
    "recording.mat": (None, read_recording),
    "recording.h5": (None, read_recording),
    "recording.npz": (None, read_recording),
    "recording.wav": (None, lambda path: [block.sum() for block in open_recording(path, ["1", "2"]).blocks]),
    "recording.tdms": (None, read_recording),
    "recording.mf4": (None, read_recording),
    "recording.xlsx": (None, read_recording),
    "modes.csv": (MODES_ROWS, read_modes),
}


@cache
def valid_bytes(name):
    """Give the bytes of a file as it should be."""
    text = PARSERS[name][0]
    if text is not None:
        return text.encode()
    stream = BytesIO()
    BINARY[name](stream)
    return stream.getvalue()


def parse(name, data):
    """Read a file with these bytes, alone in its folder."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(data)
        reader = PARSERS[name][1]
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # a user would see it on the terminal
            return load_manifest(Path(folder)) if reader is None else reader(path)


def refusal_of(name, data):
    """Give what is said about a file that is refused."""
    try:
        parse(name, data)
    except FrfIpzError as error:
        return str(error)
    return None


edits = st.lists(
    st.tuples(
        st.floats(0.0, 1.0),  # where in the file
        st.integers(0, 30),  # how many bytes go
        st.one_of(
            st.sampled_from([token.encode() for token in TOKENS]),
            st.binary(max_size=8),
            st.text("0123456789.+-eEdD,; \t\n", max_size=12).map(str.encode),
        ),
    ),
    min_size=1,
    max_size=6,
)


numbers = st.tuples(
    st.sampled_from([0, 1, 2, -1, 127, -128, 255, 32767, 65535, 2**31 - 1, -(2**31), 2**32 - 1, 2**40, 2**63 - 1]),
    st.sampled_from(["<i2", "<i4", "<i8", ">i2", ">i4", ">i8", "<f8", ">f8"]),
).map(lambda pair: np.array([pair[0]], "i8").astype(pair[1]).tobytes())  # as binary files hold them
overwritings = st.lists(st.tuples(st.floats(0.0, 1.0), numbers), min_size=1, max_size=3)
moves = st.lists(
    st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.sampled_from(["delete", "swap", "repeat", "word"])),
    min_size=1,
    max_size=4,
)


def overwritten(data, changes):
    for share, new in changes:
        place = int(share * len(data))
        data = data[:place] + new + data[place + len(new) :]
    return data


def moved(data, changes):
    """Delete, exchange or repeat lines, or copy a word of one into another."""
    lines = data.split(b"\n")
    for first, second, what in changes:
        here, there = int(first * (len(lines) - 1)), int(second * (len(lines) - 1))
        if what == "delete" and len(lines) > 1:
            del lines[here]
        elif what == "swap":
            lines[here], lines[there] = lines[there], lines[here]
        elif what == "repeat":
            lines.insert(there, lines[here])
        elif what == "word":
            words, others = lines[here].split(b" "), lines[there].split(b" ")
            words[int(second * (len(words) - 1))] = others[int(first * (len(others) - 1))]
            lines[here] = b" ".join(words)
    return b"\n".join(lines)


def edited(data, changes):
    for share, length, new in changes:
        place = int(share * len(data))
        data = data[:place] + new + data[place + length :]
    return data


@pytest.mark.parametrize("name", PARSERS)
def test_what_is_valid_is_read(name):
    text = PARSERS[name][0]
    if name == "test.toml":
        with pytest.raises(FrfIpzError, match="no file fits"):  # its recordings are not there
            parse(name, text.encode())
    else:
        parse(name, valid_bytes(name))


def search(name, examples):
    """Look for a content that is neither read nor refused by one short line that names the file."""
    valid = valid_bytes(name)

    @settings(max_examples=examples)
    @given(
        st.one_of(
            edits.map(lambda changes: edited(valid, changes)),
            overwritings.map(lambda changes: overwritten(valid, changes)),
            moves.map(lambda changes: moved(valid, changes)),
            st.floats(0.0, 1.0).map(lambda share: valid[: int(share * len(valid))]),
            st.binary(max_size=200),
        )
    )
    def look(content):
        refusal = refusal_of(name, content)
        assert refusal is None or name in refusal
        assert "\n" not in (refusal or "")
        assert len(refusal or "") < LONGEST

    look()


@pytest.mark.parametrize("name", PARSERS)
def test_anything_is_read_or_refused(name):
    search(name, FEW)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(PARSERS))
def test_whatever_a_longer_search_finds_is_read_or_refused(name):
    search(name, MANY)


FOUND = [  # by a longer search
    ("frf.uff", (0.7, 12, b"inf")),
    ("frf.uff", (0.05, 0, 2000 * b" x")),
    ("recording.uff", (0.26953125, 0, b"\n")),
    ("frf.csv", (0.0, 0, b"0;")),
    ("frf.csv", (0.5700660287258991, 14, b"1e300")),
]


@pytest.mark.parametrize(("name", "change"), FOUND)
def test_what_a_longer_search_has_found_is_refused(name, change):
    refusal = refusal_of(name, edited(PARSERS[name][0].encode(), [change]))
    assert refusal is not None
    assert name in refusal
    assert len(refusal) < LONGEST


@pytest.mark.parametrize("name", ["recording.h5", "recording.mat"])
def test_absurdly_large_samples_are_refused_in_binary_formats_too(name):
    """As in text: their squares overflow, and a result would come of it."""
    data, place = valid_bytes(name), int(np.argmax(SIGNALS["force"]))
    changed = data.replace(SIGNALS["force"][place].tobytes(), np.float64(1e200).tobytes())
    expected = f"sample {place + 1} of .*force.* is no number, or absurdly large"
    assert re.search(expected, refusal_of(name, changed) or "")
