"""Small valid inputs of every format, and seeded mutations of them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyuff
from scipy import io, sparse

import small_campaign
from fe_models import beam, export

LINES_HZ = np.arange(10.0, 400.0, 4.0)
MATRICES_TEST = '[test]\nkind = "frf"\n[[frf]]\nfile = "tip.csv"\nquantity = "accelerance"\nunit = "m/s^2/N"\n'
UFF_TEST = MATRICES_TEST.replace("tip.csv", "tip.unv")
MATRICES_PIPELINE = """
[pipeline]
test = "test.toml"
model = "model.toml"
[fit]
band_hz = [10.0, 390.0]
max_order = 20
[reduce]
modes = 4
[update]
max_iterations = 5
ensemble = 10
[predict]
points = ["3:+z"]
[export]
pade_order = 0
sample_time_s = 0.0
"""
TOKENS = (
    *("nan", "inf", "-1", "0", "1e300", "1e-300", "1.0D-03", "1.0-3", "2,5", "1_000", "0x10", "1.2.3", "1e", "--1"),
    *("", " ", "\0", "\ufeff", "\r", '"', "'", "[", "]", "{}", "=", "%", "#", ",", ";", "\t", "text"),
    *("\u0663", "99999999999999999999"),
)


@dataclass(frozen=True)
class Mutation:
    """A file of an input that was changed: which input, which file, how, and its bytes."""

    source: str
    file: str
    what: str
    data: bytes


def write_inputs(folder, *, diagnosed=True):
    """Write each input into a folder of its own: one of matrices and FRFs as CSV, one of UFF, and one of records."""
    for name in ("matrices", "uff"):
        (folder / name).mkdir(parents=True)
        export(folder / name, beam(left="clamped", elements=4))
        text = MATRICES_PIPELINE + "[diagnose]\n" + ("seconds = 2.0\n" if diagnosed else 'run = "never"\n')
        (folder / name / "pipeline.toml").write_text(text, encoding="utf-8")
    values = np.exp(2j * np.pi * LINES_HZ / 400) / (1 - (LINES_HZ / 80) ** 2 + 0.02j * LINES_HZ / 80)
    rows = "".join(
        f"{hz:g},5:+z,3:+z,{value.real:.8g},{value.imag:.8g}\n" for hz, value in zip(LINES_HZ, values, strict=True)
    )
    text = "frequency_hz,output_dof,input_dof,real,imag\n" + rows
    (folder / "matrices" / "tip.csv").write_text(text, encoding="utf-8")
    (folder / "matrices" / "test.toml").write_text(MATRICES_TEST, encoding="utf-8")
    data_set = pyuff.prepare_58(
        binary=0,
        func_type=4,
        rsp_node=5,
        rsp_dir=3,
        ref_node=3,
        ref_dir=3,
        data=values,
        x=LINES_HZ,
        id1="tip",
        rsp_ent_name="NONE",
        ref_ent_name="NONE",
        abscissa_spacing=1,
        abscissa_min=float(LINES_HZ[0]),
        abscissa_inc=4.0,
        ordinate_spec_data_type=12,
        orddenom_spec_data_type=13,
    )
    pyuff.UFF(str(folder / "uff" / "tip.unv")).write_sets(data_set, "add")
    (folder / "uff" / "test.toml").write_text(UFF_TEST, encoding="utf-8")
    damping = sparse.coo_array(([5.0], ([6], [6])), shape=(8, 8))
    io.mmwrite(folder / "matrices" / "B.mtx", damping, symmetry="symmetric")
    model = folder / "matrices" / "model.toml"
    model.write_text(model.read_text("utf-8").replace('dofs = "', 'damping = "B.mtx"\ndofs = "'), "utf-8")
    (folder / "records").mkdir()
    small_campaign.write_campaign(folder / "records", records=1)
    return folder


def inputs_of(folder):
    """All files of all inputs, relative to their folder."""
    return sorted(path.relative_to(folder) for path in folder.rglob("*") if path.is_file())


def mutations(folder, seed, count):
    """Give mutations of files, each file as often as the others."""
    rng = np.random.default_rng(seed)
    files = inputs_of(folder)
    for number in range(count):
        path = files[number % len(files)]
        data = (folder / path).read_bytes()
        what, mutate = WAYS[int(rng.integers(len(WAYS)))]
        yield Mutation(source=path.parts[0], file=str(Path(*path.parts[1:])), what=what, data=mutate(data, rng))


def _place(data, rng):
    return int(rng.integers(max(len(data), 1)))


def _change_byte(data, rng):
    place = _place(data, rng)
    return data[:place] + bytes([int(rng.integers(256))]) + data[place + 1 :]


def _insert_token(data, rng):
    place = _place(data, rng)
    return data[:place] + str(rng.choice(TOKENS)).encode() + data[place:]


def _replace_word(data, rng):
    lines = data.split(b"\n")
    line = int(rng.integers(len(lines)))
    words = lines[line].replace(b",", b" , ").split(b" ")
    words[int(rng.integers(len(words)))] = str(rng.choice(TOKENS)).encode()
    lines[line] = b" ".join(words).replace(b" , ", b",")
    return b"\n".join(lines)


def _delete_line(data, rng):
    lines = data.split(b"\n")
    del lines[int(rng.integers(len(lines)))]
    return b"\n".join(lines)


def _repeat_line(data, rng):
    lines = data.split(b"\n")
    line = int(rng.integers(len(lines)))
    return b"\n".join([*lines[: line + 1], *lines[line:]])


def _swap_lines(data, rng):
    lines = data.split(b"\n")
    first, second = (int(rng.integers(len(lines))) for _ in range(2))
    lines[first], lines[second] = lines[second], lines[first]
    return b"\n".join(lines)


def _cut_off(data, rng):
    return data[: _place(data, rng)]


def _delete_span(data, rng):
    place = _place(data, rng)
    return data[:place] + data[place + int(rng.integers(1, 40)) :]


def _other_encoding(data, rng):
    return data.decode("utf-8", "replace").encode(str(rng.choice(["utf-16", "utf-16-le", "utf-8-sig", "utf-32"])))


def _other_line_ends(data, rng):
    return data.replace(b"\n", [b"\r\n", b"\r", b"\n\n"][int(rng.integers(3))])


def _decimal_commas(data, rng):
    del rng
    return data.replace(b".", b",")


def _nothing(data, rng):
    del data, rng
    return b""


WAYS = (
    ("byte changed", _change_byte),
    ("token inserted", _insert_token),
    ("word replaced", _replace_word),
    ("word replaced", _replace_word),
    ("line deleted", _delete_line),
    ("line repeated", _repeat_line),
    ("lines swapped", _swap_lines),
    ("cut off", _cut_off),
    ("span deleted", _delete_span),
    ("encoding", _other_encoding),
    ("line ends", _other_line_ends),
    ("decimal commas", _decimal_commas),
    ("empty", _nothing),
)
