"""FRFs that were estimated elsewhere, in all formats."""

import re

import numpy as np
import pytest
import pyuff

import frf_ipz
from frf_ipz.errors import InputError
from frf_ipz.ingest.campaign_file import read_test
from frf_ipz.ingest.estimate import estimate_frfs
from frf_ipz.ingest.options import IngestOptions
from frf_ipz.quantities import FrfQuantity
from synthetic_campaign import Structure, write_test

LINES_HZ = np.arange(0.0, 200.5, 0.5)
VALUES = Structure().accelerance(2j * np.pi * LINES_HZ)
DIGITS = 1e-14  # relative: the numbers are written with all of their digits
GRAVITY = 9.80665


def read(folder, *entries):
    body = "".join(f"[[frf]]\n{entry}\n" for entry in entries)
    return estimate_frfs(read_test(write_test(folder, body, kind="frf")), options=IngestOptions())


def message(folder, *entries):
    with pytest.raises(InputError) as caught:
        read(folder, *entries)
    text = str(caught.value)
    assert "\n" not in text
    return text


def entry(file="frf.csv", quantity="accelerance", **keys):
    keys = {"file": file, "quantity": quantity, **keys}
    return "\n".join(f"{key} = {str(value).replace(chr(39), chr(34))}" for key, value in quoted(keys).items())


def quoted(keys):
    return {key: f'"{value}"' if isinstance(value, str) else list_or_number(value) for key, value in keys.items()}


def list_or_number(value):
    return list(value) if isinstance(value, tuple) else value


def long_csv(
    folder, *, name="frf.csv", extra=(), factor=1.0, lines_hz=LINES_HZ, values=VALUES, outputs=("1:+z", "2:-x")
):
    rows = [",".join(["frequency_hz", "output_dof", "input_dof", "real", "imag", *extra])]
    for column, output in enumerate(outputs):
        for frequency, value in zip(lines_hz, values[:, column] * factor, strict=True):
            extra_values = {"coherence": 0.9, "variance": 0.25}
            numbers = [
                repr(float(number)) for number in (value.real, value.imag, *(extra_values[key] for key in extra))
            ]
            rows.append(",".join([repr(float(frequency)), output, "7:+z", *numbers]))
    (folder / name).write_text("\n".join(rows) + "\n", encoding="utf-8")


def text_file(folder, columns, *, name="frf.txt", delimiter="\t"):
    np.savetxt(
        folder / name, np.column_stack(columns), fmt="%.16e", delimiter=delimiter, header="an analyser", comments=""
    )


def expect(frfs, values=VALUES):
    np.testing.assert_allclose(frfs.frequency_hz, LINES_HZ, rtol=DIGITS)
    assert np.abs(frfs.values - values).max() <= 10 * DIGITS * np.abs(values).max()


def test_long_csv(tmp_path):
    long_csv(tmp_path)
    result = read(tmp_path, entry())
    frfs = result.frfs
    expect(frfs)
    assert [str(label) for label in frfs.labels] == ["1:+z / 7:+z", "2:-x / 7:+z"]
    assert [label.output_channel for label in frfs.labels] == ["output 1:+z", "output 2:-x"]
    assert frfs.labels[0].input_channel == "input 7:+z"
    assert np.isnan(frfs.variance).all()
    assert np.isnan(frfs.coherence).all()
    assert list(frfs.averages) == [0, 0]
    assert result.records.empty


def test_frfs_under_the_window_of_an_analyser_give_the_damping_of_the_structure(tmp_path):
    lines_hz = np.arange(0.5, 250.0, 0.25)
    long_csv(tmp_path, lines_hz=lines_hz, values=Structure().accelerance(4.0 + 2j * np.pi * lines_hz))
    for head, extra_1_s, error in (("applied_exponential_window_s = 0.25", 0.0, 1e-6), ("", 4.0, 3e-3)):
        frfs = estimate_frfs(read_test(write_test(tmp_path, f"[[frf]]\n{entry()}", kind="frf", head=head))).frfs
        fit = frf_ipz.fit_modes(frfs)
        poles = fit.model.poles[: fit.n_modes]
        omega = 2 * np.pi * np.array(Structure().frequency_hz)
        ratio = np.array(Structure().damping_ratio)
        expected = omega * (-ratio + 1j * np.sqrt(1 - ratio**2)) - extra_1_s
        np.testing.assert_allclose(poles[np.argsort(poles.imag)], expected, rtol=error)


def test_coherence_and_variance_come_along(tmp_path):
    long_csv(tmp_path, extra=("coherence", "variance"))
    frfs = read(tmp_path, entry()).frfs
    assert np.unique(frfs.coherence) == pytest.approx([0.9])
    assert np.unique(frfs.variance) == pytest.approx([0.25])


def test_units_scale_values_and_their_variance(tmp_path):
    long_csv(tmp_path, extra=("variance",), factor=1 / GRAVITY)
    frfs = read(tmp_path, entry(unit="g_0/N")).frfs
    expect(frfs)
    assert np.unique(frfs.variance) == pytest.approx([0.25 * GRAVITY**2])


def test_rows_of_a_long_csv_may_come_in_any_order(tmp_path):
    long_csv(tmp_path)
    head, *rows = (tmp_path / "frf.csv").read_text(encoding="utf-8").splitlines()
    mixed = [rows[row] for row in np.random.default_rng(1).permutation(len(rows))]
    (tmp_path / "frf.csv").write_text("\n".join([head, *mixed]), encoding="utf-8")
    frfs = read(tmp_path, entry()).frfs
    order = [str(label.output_dof) for label in frfs.labels].index("1:+z")
    np.testing.assert_allclose(frfs.values[:, order], VALUES[:, 0], rtol=DIGITS)


@pytest.mark.parametrize("delimiter", ["\t", " ", ",", ";"])
def test_text_with_real_and_imaginary_parts(tmp_path, delimiter):
    text_file(tmp_path, [LINES_HZ, VALUES[:, 0].real, VALUES[:, 0].imag], delimiter=delimiter)
    frfs = read(tmp_path, text_entry(["frequency_hz", "real", "imag"])).frfs
    expect(frfs, VALUES[:, :1])


def text_entry(columns, file="frf.txt", output="1:+z", **keys):
    return entry(file, output_dof=output, input_dof="7:+z", columns=tuple(columns), skip_rows=1, **keys)


@pytest.mark.parametrize(
    ("columns", "make"),
    [
        (("magnitude", "phase_rad"), lambda h: (np.abs(h), np.angle(h))),
        (("magnitude_db", "phase_deg"), lambda h: (20 * np.log10(np.abs(h)), np.degrees(np.angle(h)))),
        (("phase_deg", "magnitude"), lambda h: (np.degrees(np.angle(h)), np.abs(h))),
    ],
)
def test_text_with_magnitude_and_phase(tmp_path, columns, make):
    lines, values = LINES_HZ[1:], VALUES[1:, 1]
    text_file(tmp_path, [lines, *make(values)])
    frfs = read(tmp_path, text_entry(["frequency_hz", *columns])).frfs
    np.testing.assert_allclose(frfs.values[:, 0], values, rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "factor", "column"),
    [
        ("omega", 2 * np.pi, "frequency_rad_s"),
        ("Frequency [rad/s]", 2 * np.pi, "frequency_rad_s"),
        ("f [kHz]", 1e-3, "frequency"),
        ("freq (Hz)", 1.0, "frequency_hz"),
    ],
)
def test_frequencies_are_read_in_the_unit_of_the_header(tmp_path, name, factor, column):
    def write(name):
        head = f"an analyser\n{name}\treal\timag\n"
        rows = np.column_stack([LINES_HZ * factor, VALUES[:, 0].real, VALUES[:, 0].imag])
        (tmp_path / "frf.txt").write_text(head + "\n".join("\t".join(map(repr, row)) for row in rows.tolist()))

    write(name)
    frfs = read(tmp_path, text_entry([column, "real", "imag"])).frfs
    np.testing.assert_allclose(frfs.frequency_hz, LINES_HZ, rtol=1e-12)
    by_header = read(tmp_path, entry("frf.txt", output_dof="1:+z", input_dof="7:+z")).frfs
    np.testing.assert_allclose(by_header.frequency_hz, LINES_HZ, rtol=1e-12)
    if column != "frequency_hz":
        says = message(tmp_path, text_entry(["frequency_hz", "real", "imag"]))
        assert re.search(rf"frf\.txt: its header gives frequencies in .* says frequency_hz; write {column} there", says)


def test_a_line_that_stands_there_twice_is_named(tmp_path):
    long_csv(tmp_path)
    lines = (tmp_path / "frf.csv").read_text().splitlines()
    (tmp_path / "frf.csv").write_text("\n".join([*lines[:5], lines[4], *lines[5:]]))
    says = message(tmp_path, entry())
    assert re.search(r"frf\.csv, line 6, column 'frequency_hz': .* a second time, after line 5", says)


@pytest.mark.parametrize(
    ("name", "keys", "is_said"),
    [
        ("Magnitude [dB]", {}, True),
        ("Magnitude [dB re 1 m/s²/N]", {}, False),
        ("Magnitude [dB]", {"unit": "m/s^2/N"}, False),
    ],
)
def test_what_decibels_are_taken_to_be_relative_to_is_said_where_nobody_does(tmp_path, name, keys, is_said):
    moving = VALUES[1:, 0]
    columns = [LINES_HZ[1:], 20 * np.log10(np.abs(moving)), np.degrees(np.angle(moving))]
    header = f"Frequency [Hz];{name};Phase [deg]"
    rows = "\n".join(";".join(map(str, row)) for row in np.column_stack(columns).tolist())
    (tmp_path / "frf.txt").write_text(f"{header}\n{rows}\n", encoding="utf-8")
    estimate = read(tmp_path, entry("frf.txt", output_dof="1:+z", input_dof="1:+z", **keys))
    np.testing.assert_allclose(estimate.frfs.values[:, 0], moving, rtol=1e-9)
    said = [text for text in estimate.warnings if "decibels are taken re 1 m/s^2/N" in text]
    assert len(said) == is_said


@pytest.mark.parametrize("name", ["Magnitude [m/N]", "Amplitude dB", "Abs (m/s²/N)"])
def test_text_with_magnitudes_only(tmp_path, name):
    header = f"Frequency [Hz];{name};Coherence"
    columns = np.column_stack([LINES_HZ, np.abs(VALUES[:, 0]), np.ones(len(LINES_HZ))])
    np.savetxt(tmp_path / "frf.txt", columns, fmt="%.9e", delimiter=";", header=header, comments="", encoding="utf-8")
    text = message(tmp_path, entry("frf.txt", output_dof="1:+z", input_dof="1:+z"))
    assert re.search(r"frf\.txt: its header names frequencies and magnitudes, without a phase.*export real", text), text


def test_columns_may_be_skipped(tmp_path):
    text_file(tmp_path, [LINES_HZ, LINES_HZ, VALUES[:, 0].imag, np.full(len(LINES_HZ), 0.5), VALUES[:, 0].real])
    frfs = read(tmp_path, text_entry(["frequency_hz", "skip", "imag", "coherence", "real"])).frfs
    expect(frfs, VALUES[:, :1])
    assert np.unique(frfs.coherence) == [0.5]


def universal(folder, *, func_type=4, values=VALUES[:, 0], **fields):
    data_set = {
        "func_type": func_type,
        "rsp_node": 3,
        "rsp_dir": -3,
        "ref_node": 4,
        "ref_dir": 1,
        "abscissa_spacing": 1,
        "abscissa_min": 0.0,
        "abscissa_inc": 0.5,
        "ordinate_spec_data_type": 12,
        "orddenom_spec_data_type": 13,
        "rsp_ent_name": "part",
        "ref_ent_name": "part",
        "id1": "a measurement",
    } | fields
    file = pyuff.UFF(str(folder / "frf.uff"))
    data = pyuff.prepare_58(binary=0, data=values, x=LINES_HZ, **data_set)
    file.write_sets([data], "add" if (folder / "frf.uff").exists() else "overwrite")


def make_binary(file, values):
    """Write the numbers of a universal file of one set as little-endian doubles, as the format 58b wants them."""
    lines = file.read_bytes().split(b"\n")
    data = np.ascontiguousarray(values, "<c16").tobytes()
    head = b"    58b%6d%6d%12d%12d%6d%6d%12d%12d" % (1, 2, 11, len(data), 0, 0, 0, 0)
    file.write_bytes(b"\n".join([lines[0], head, *lines[2:13], data]) + b"\n    -1\n")


def test_universal_files(tmp_path):
    universal(tmp_path)
    universal(tmp_path, rsp_node=5, rsp_dir=4, values=VALUES[:, 1])
    frfs = read(tmp_path, entry("frf.uff")).frfs
    assert [str(label) for label in frfs.labels] == ["3:-z / 4:+x", "5:+rx / 4:+x"]
    np.testing.assert_allclose(frfs.frequency_hz, LINES_HZ, rtol=1e-6)
    assert np.abs(frfs.values - VALUES).max() < 1e-11 * np.abs(VALUES).max()  # written with 12 digits


def test_binary_universal_files(tmp_path):
    universal(tmp_path)
    make_binary(tmp_path / "frf.uff", VALUES[:, 0])
    frfs = read(tmp_path, entry("frf.uff")).frfs
    assert [str(label) for label in frfs.labels] == ["3:-z / 4:+x"]
    np.testing.assert_array_equal(frfs.values[:, 0], VALUES[:, 0])


def test_coherences_of_universal_files_are_found(tmp_path):
    universal(tmp_path)
    universal(tmp_path, func_type=6, values=np.full(len(LINES_HZ), 0.75 + 0j))
    frfs = read(tmp_path, entry("frf.uff")).frfs
    assert frfs.n_frfs == 1
    assert np.unique(frfs.coherence) == pytest.approx([0.75])


def test_units_in_labels_of_universal_files_are_used(tmp_path):
    universal(tmp_path, ordinate_axis_units_lab="g", orddenom_axis_units_lab="N", values=VALUES[:, 0] / GRAVITY)
    frfs = read(tmp_path, entry("frf.uff")).frfs
    assert np.abs(frfs.values[:, 0] - VALUES[:, 0]).max() < 1e-11 * np.abs(VALUES).max()  # written with 12 digits


def test_several_files_make_one_test(tmp_path):
    text_file(tmp_path, [LINES_HZ, VALUES[:, 0].real, VALUES[:, 0].imag], name="a.txt")
    text_file(tmp_path, [LINES_HZ, VALUES[:, 1].real, VALUES[:, 1].imag], name="b.txt")
    columns = ["frequency_hz", "real", "imag"]
    expect(read(tmp_path, text_entry(columns, "a.txt"), text_entry(columns, "b.txt", "2:+z")).frfs)


def test_only_common_lines_are_used_and_reported(tmp_path):
    long_csv(tmp_path, outputs=("1:+z",))
    long_csv(tmp_path, name="b.csv", outputs=("2:+z",), lines_hz=LINES_HZ[20:], values=VALUES[20:])
    result = read(tmp_path, entry(), entry("b.csv"))
    np.testing.assert_allclose(result.frfs.frequency_hz, LINES_HZ[20:], rtol=DIGITS)
    np.testing.assert_allclose(result.frfs.values[:, 0], VALUES[20:, 0], rtol=DIGITS)
    used = "381 of up to 401 lines are used: those that all FRFs share; frf.csv has more"
    assert result.warnings[0] == f"{used}; none below {LINES_HZ[20]:g} Hz, where b.csv begins"


def test_masses_and_scale_are_handed_on(tmp_path):
    long_csv(tmp_path)
    path = write_test(tmp_path, f"[[frf]]\n{entry()}\n", kind="frf", head='unknown_scale = "common"')
    assert estimate_frfs(read_test(path), options=IngestOptions()).frfs.unknown_scale == "common"


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda text: text.replace("frequency_hz", "f"), "no known format for FRFs.*CSV.*UFF 58"),
        (lambda text: text.replace("output_dof", "output"), "line 1: has no column 'output_dof'"),
        (lambda text: text.replace("1:+z", "1:+w"), r"column 'output_dof' or 'input_dof'.*1:\+w"),
        (lambda text: text.replace("\n0.5,1:+z,7:+z,", "\n0.5,1:+z,7:+z,x", 1), "line 3, column 'real'.*'x"),
        (lambda text: text.replace("\n0.5,1:+z,7:+z,", "\n0.5,1:+z,7:+z,,", 1), "line 3: has 6 values.*5 columns"),
        (lambda text: text.replace("\n0.5,1:+z", "\nnan,1:+z", 1), "line 3, column 'frequency_hz'.*'nan'"),
        (
            lambda text: text.replace("\n0.5,1:+z", "\n0.0,1:+z", 1),
            "line 3, .* has 0 of 1:\\+z / 7:\\+z a second time, after line 2",
        ),
        (lambda text: text[: len(text) // 2].rpartition(",")[0], "cut off"),
        (lambda text: text.splitlines()[0], "no line that begins with a number"),
        (lambda _: "", "is empty"),
    ],
)
def test_faults_in_a_long_csv(tmp_path, change, says):
    long_csv(tmp_path)
    file = tmp_path / "frf.csv"
    file.write_text(change(file.read_text(encoding="utf-8")), encoding="utf-8")
    text = message(tmp_path, entry())
    assert re.search(says, text), text
    assert "frf.csv" in text


def test_values_that_cannot_be(tmp_path):
    long_csv(tmp_path, extra=("variance",))
    file = tmp_path / "frf.csv"
    file.write_text(file.read_text(encoding="utf-8").replace(",0.25\n", ",-0.25\n", 1), encoding="utf-8")
    assert re.search("column 'variance': the FRF .* has the variance .* Hz, below zero", message(tmp_path, entry()))


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: entry("absent.csv"), r"absent\.csv: there is no such file"),
        (lambda: entry(quantity="inertance"), "quantity.*receptance.*mobility.*accelerance"),
        (lambda: entry(unit="m/N"), "'m/N' is no unit of accelerance; expected is a unit like m/s\\^2/N"),
        (lambda: entry(unit="quark"), "frf.csv: the 'unit' of its ..frf..: 'quark' is no unit that can be read"),
        (lambda: text_entry(["frequency_hz", "real", "imagin"]), "'columns' names 'imagin'; did you mean 'imag'"),
        (lambda: text_entry(["frequency_hz", "real"]), "needed are frequency_hz .* and either real and imag"),
        (lambda: text_entry(["frequency_hz", "real", "imag", "coherence"]), "has 3 columns, but 'columns'.*names 4"),
        (lambda: entry("frf.txt", columns=("frequency_hz", "real", "imag")), "needs 'output_dof' and 'input_dof'"),
        (lambda: text_entry(["frequency_hz", "real", "imag"], output="1:q"), r"\[\[frf\]\] 'frf.txt'.*1:q"),
        (lambda: entry(skip_row=3), "skip_row.*did you mean 'skip_rows'"),
    ],
)
def test_mistakes_in_an_entry(tmp_path, make, says):
    long_csv(tmp_path)
    text_file(tmp_path, [LINES_HZ, VALUES[:, 0].real, VALUES[:, 0].imag])
    text = message(tmp_path, make())
    assert re.search(says, text), text


def test_one_frf_twice(tmp_path):
    long_csv(tmp_path)
    long_csv(tmp_path, name="b.csv")
    assert re.search(
        r"b\.csv: holds the FRF .* that frf\.csv holds already", message(tmp_path, entry(), entry("b.csv"))
    )


def test_a_phase_without_a_magnitude_is_refused_as_such(tmp_path):
    rows = [f"{hertz}\t{np.degrees(np.angle(value))}" for hertz, value in zip(LINES_HZ, VALUES[:, 0], strict=True)]
    (tmp_path / "frf.txt").write_text("\n".join(["Frequency [Hz]\tPhase [deg]", *rows]), encoding="utf-8")
    text = message(tmp_path, entry("frf.txt") + '\noutput_dof = "1:+z"\ninput_dof = "3:+z"')
    assert "it has 'Phase [deg]' alone beside 'Frequency [Hz]': an FRF needs real and imaginary part" in text


@pytest.mark.parametrize("header", ["Real [m/s²/N]\tImag [m/s²/N]", "Real\tImag\tCoherence"])
def test_a_table_without_frequencies_is_refused_as_such(tmp_path, header):
    further = "\t1.0" if "Coherence" in header else ""
    rows = [f"{value.real}\t{value.imag}{further}" for value in VALUES[:, 0]]
    (tmp_path / "frf.txt").write_text("\n".join([header, *rows]), encoding="utf-8")
    text = message(tmp_path, entry("frf.txt") + '\noutput_dof = "1:+z"\ninput_dof = "3:+z"')
    assert "it has no column of frequencies beside 'Real" in text


def test_files_without_common_lines(tmp_path):
    long_csv(tmp_path, outputs=("1:+z",))
    long_csv(tmp_path, name="b.csv", outputs=("2:+z",), lines_hz=LINES_HZ * 1.37)
    text = message(tmp_path, entry(), entry("b.csv"))
    assert re.search(r"b\.csv: the lines of 2:.* are not those of 1:.* in frf\.csv .*they share \d+;", text), text


def test_half_of_the_lines_is_enough_by_whatever_line_they_begin(tmp_path):
    """Of lines of 0.6 Hz from 0.6 Hz on, 199 of 399 are lines of 0.4 Hz too: one less than half of them and one."""
    long_csv(tmp_path, outputs=("1:+z",), lines_hz=0.4 * np.arange(1, 402))
    long_csv(tmp_path, name="b.csv", outputs=("2:+z",), lines_hz=0.6 * np.arange(1, 402))
    hertz = read(tmp_path, entry(), entry("b.csv")).frfs.frequency_hz
    np.testing.assert_allclose(hertz, 1.2 * np.arange(1, 134))


def test_frfs_of_the_ground_are_refused(tmp_path):
    long_csv(tmp_path, outputs=("1:+z", "0:+z"))
    text = message(tmp_path, entry())
    assert re.search(r"frf\.csv.*'0:\+z' is at node 0, which is the ground; name the node", text), text


def test_a_channel_in_a_test_of_frfs(tmp_path):
    long_csv(tmp_path)
    channel = '[[channel]]\ncolumn = "a"\nrole = "input"\nquantity = "force"\n'
    path = write_test(tmp_path, channel + f"[[frf]]\n{entry()}\n", kind="frf")
    with pytest.raises(InputError, match=r"key 'channel'.*has no channels"):
        read_test(path)


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"func_type": 1}, "holds no data set 58 with a frequency response function"),
        ({"rsp_dir": 0}, "states no direction of the response .direction 0 at node 3.; give.*direction = .z."),
        (
            {"rsp_node": 0},
            "the response is at node 0, and node 0 is the ground; name output_dof and input_dof in its .*, or where "
            "it holds several FRFs, count nodes from 1",
        ),
        ({"ref_node": 0}, "the reference is at node 0, and node 0 is the ground; name output_dof and input_dof"),
        ({"ordinate_spec_data_type": 8}, "is stated to be receptance, but the test says accelerance"),
        ({"orddenom_spec_data_type": 12}, "is not a ratio to a force"),
    ],
)
def test_faults_in_a_universal_file(tmp_path, fields, says):
    values = VALUES[:, 0].real if fields.get("func_type") == 1 else VALUES[:, 0]
    universal(tmp_path, values=values, **fields)
    text = message(tmp_path, entry("frf.uff"))
    assert re.search(says, text), text
    assert "frf.uff" in text


def test_a_universal_file_that_is_cut_off(tmp_path):
    universal(tmp_path)
    file = tmp_path / "frf.uff"
    file.write_bytes(file.read_bytes()[:3000])
    assert "frf.uff" in message(tmp_path, entry("frf.uff"))


def test_a_direction_of_a_universal_file_may_be_given(tmp_path):
    universal(tmp_path, rsp_dir=0)
    frfs = read(tmp_path, entry("frf.uff", output_dof="9:+y")).frfs
    assert str(frfs.labels[0]) == "9:+y / 4:+x"
    assert frfs.labels[0].quantity is FrfQuantity.ACCELERANCE


def test_a_file_is_read_alone(tmp_path):
    path = tmp_path / "frf.csv"
    lines = "\n".join(f"{hertz},1:+z,2:+z,{hertz / 10},0.5" for hertz in (1.0, 2.0, 4.0))
    path.write_text(f"frequency_hz,output_dof,input_dof,real,imag\n{lines}\n", encoding="utf-8")
    frfs = frf_ipz.read_frfs(str(path))
    assert [str(label) for label in frfs.labels] == ["1:+z / 2:+z"]
    np.testing.assert_array_equal(frfs.values[:, 0], [0.1 + 0.5j, 0.2 + 0.5j, 0.4 + 0.5j])
    in_g = frf_ipz.read_frfs(path, quantity="accelerance", unit="g_0/N")
    np.testing.assert_allclose(in_g.values, 9.80665 * frfs.values)
    with pytest.raises(frf_ipz.QuantityError, match="did you mean 'mobility'"):
        frf_ipz.read_frfs(path, quantity="mobilit")
    with pytest.raises(frf_ipz.FileFormatError, match="no such file"):
        frf_ipz.read_frfs(tmp_path / "gone.csv")


def test_every_line_of_uneven_lines_is_taken_from_where_it_is(tmp_path):
    hertz = np.geomspace(1.0, 1000.0, 61)
    for file, output in (("a.csv", "1:+z"), ("b.csv", "3:+z")):
        lines = "\n".join(f"{value!r},{output},2:+z,{value!r},1.0" for value in hertz.tolist())
        (tmp_path / file).write_text(f"frequency_hz,output_dof,input_dof,real,imag\n{lines}\n", encoding="utf-8")
    entries = '[[frf]]\nfile = "a.csv"\nquantity = "accelerance"\n[[frf]]\nfile = "b.csv"\nquantity = "accelerance"\n'
    (tmp_path / "test.toml").write_text(f'[test]\nkind = "frf"\n{entries}', encoding="utf-8")
    frfs = frf_ipz.estimate_frfs(frf_ipz.read_test(tmp_path / "test.toml")).frfs
    np.testing.assert_array_equal(frfs.frequency_hz, hertz)
    np.testing.assert_array_equal(frfs.values.real, np.column_stack([hertz, hertz]))


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", ""])
def test_a_line_at_0_hz_that_is_not_finite_is_left_out_of_a_csv(tmp_path, value):
    long_csv(tmp_path)
    file = tmp_path / "frf.csv"
    rows = [",".join([*row.split(",")[:3], value, "0"]) if row.startswith("0.0,") else row for row in lines_of(file)]
    file.write_text("\n".join(rows) + "\n", encoding="utf-8")
    result = read(tmp_path, entry())
    np.testing.assert_allclose(result.frfs.frequency_hz, LINES_HZ[1:], rtol=DIGITS)
    assert any("the line at 0 Hz of 1:+z / 7:+z is not finite: left out" in warning for warning in result.warnings)


def lines_of(file):
    return file.read_text(encoding="utf-8").splitlines()


def test_a_line_at_0_hz_that_is_not_finite_is_left_out_of_a_text_file(tmp_path):
    magnitude_db = np.concatenate([[-np.inf], 20 * np.log10(np.abs(VALUES[1:, 0]))])
    text_file(tmp_path, [LINES_HZ, magnitude_db, np.degrees(np.angle(VALUES[:, 0]))])
    result = read(tmp_path, text_entry(["frequency_hz", "magnitude_db", "phase_deg"]))
    np.testing.assert_allclose(result.frfs.frequency_hz, LINES_HZ[1:], rtol=DIGITS)
    assert any("the line at 0 Hz of 1:+z / 7:+z is not finite: left out" in warning for warning in result.warnings)


def test_a_column_of_a_long_table_that_is_not_read_is_told_once(tmp_path):
    long_csv(tmp_path)
    file = tmp_path / "frf.csv"
    header, *rows = lines_of(file)
    file.write_text("\n".join([header + ",coherence_%", *(row + ",93.9" for row in rows)]) + "\n", encoding="utf-8")
    told = [text for text in read(tmp_path, entry("frf.csv")).warnings if "not read: 1 column coherence_%" in text]
    assert len(told) == 1


def test_a_line_above_0_hz_that_is_not_finite_is_refused(tmp_path):
    long_csv(tmp_path)
    file = tmp_path / "frf.csv"
    rows = [",".join([*row.split(",")[:3], "nan", "0"]) if row.startswith("0.5,") else row for row in lines_of(file)]
    file.write_text("\n".join(rows) + "\n", encoding="utf-8")
    assert re.search("line 3, column 'real': holds 'nan'", message(tmp_path, entry()))


STATED = {"output_dof": "1:+z", "input_dof": "1:+z"}


POLAR = np.abs(VALUES[:, 0]), np.angle(VALUES[:, 0])


def analyser_text(folder, names, *columns):
    text = np.column_stack([LINES_HZ, *columns])
    header = "\t".join(["Frequency [Hz]", *names])
    np.savetxt(folder / "frf.txt", text, fmt="%.16e", delimiter="\t", header=header, comments="", encoding="utf-8")


def parts(scale=1.0, values=VALUES[:, 0]):
    return values.real * scale, values.imag * scale


@pytest.mark.parametrize(
    ("names", "columns", "says"),
    [
        (
            ("Magnitude", "Phase"),
            POLAR,
            "degrees or radians; write columns = ",
        ),
        (("Magnitude", "Phase [grad]"), POLAR, "'Phase .grad.' is neither in"),
        (("Magnitude", "Phase [mrad]"), POLAR, "'Phase .mrad.' is neither in"),
        (("Magnitude", "Phase [pi rad]"), POLAR, "'Phase .pi rad.' is neither in"),
        (("Magnitude", "Phase (×π rad)"), POLAR, "'Phase .×π rad.' is neither in"),
        (("Magnitude", "arg [rad/pi]"), POLAR, "'arg .rad/pi.' is neither in"),
        (("Magnitude", "Phase [100 rad]"), POLAR, "'Phase .100 rad.' is neither in"),
        (("Magnitude", "Phase [mdeg]"), POLAR, "'Phase .mdeg.' is neither in"),
        (("Magnitude", "Phase [0.1 °]"), POLAR, "'Phase .0.1 °.' is neither in"),
        (("Magnitude", "Phase [deg]"), (-np.abs(VALUES[:, 0]), 50.0 * np.angle(VALUES[:, 0])), "negative magnitudes"),
        (("Real [mm/N]", "Imag [mm/N]"), parts(), "'mm/N', which is receptance; correct the 'quantity'"),
        (("Real [N/(m/s^2)]", "Imag [N/(m/s^2)]"), parts(), r"'N/\(m/s\^2\)', which is force over response; correct"),
    ],
    ids=[
        "no unit of phases",
        "grad",
        "mrad",
        "pi rad",
        "pi",
        "rad by pi",
        "hundreds",
        "mdeg",
        "tenths",
        "negative",
        "receptance",
        "force over response",
    ],
)
def test_what_the_header_of_an_analyser_cannot_mean_is_refused(tmp_path, names, columns, says):
    analyser_text(tmp_path, names, *columns)
    text = message(tmp_path, entry("frf.txt", **STATED))
    assert re.search(rf"frf\.txt: .*{says}", text), text


@pytest.mark.parametrize(
    ("stated", "name", "says"),
    [
        (
            "Phase [rad]",
            "phase_deg",
            "gives phases in 'Phase .rad.', where 'columns' .* says phase_deg; write phase_rad",
        ),
        (
            "Phase [deg]",
            "phase_rad",
            "gives phases in 'Phase .deg.', where 'columns' .* says phase_rad; write phase_deg",
        ),
        ("Phase [pi rad]", "phase_rad", "'Phase .pi rad.' is neither in degrees nor in radians"),
    ],
)
def test_what_columns_says_of_phases_must_not_contradict_the_header(tmp_path, stated, name, says):
    analyser_text(tmp_path, ("Magnitude", stated), *POLAR)
    columns = f'columns = ["frequency_hz", "magnitude", "{name}"]'
    assert re.search(says, message(tmp_path, entry("frf.txt", **STATED) + "\n" + columns))


@pytest.mark.parametrize("stated", ["Phase H1 [deg]", "Phase 2, deg (-180 to 180)", "Phase [°]"])
def test_numbers_beside_a_name_are_no_factors_of_its_unit(tmp_path, stated):
    analyser_text(tmp_path, ("Magnitude", stated), POLAR[0], np.degrees(POLAR[1]))
    np.testing.assert_allclose(read(tmp_path, entry("frf.txt", **STATED)).frfs.values[:, 0], VALUES[:, 0], rtol=1e-9)


def test_units_with_brackets_within_are_read(tmp_path):
    analyser_text(tmp_path, ("Real [(mm/s^2)/(N)]", "Imag [(mm/s^2)/(N)]"), *parts(1e3))
    frfs = read(tmp_path, entry("frf.txt", **STATED)).frfs
    np.testing.assert_allclose(frfs.values[:, 0], VALUES[:, 0], rtol=DIGITS)


def test_units_of_force_over_response_are_read(tmp_path):
    analyser_text(tmp_path, ("Real [kN/(m/s^2)]", "Imag [kN/(m/s^2)]"), *parts(1e-3, 1.0 / (VALUES[:, 0] + 1.0)))
    frfs = read(tmp_path, entry("frf.txt", quantity="apparent_mass", **STATED)).frfs
    np.testing.assert_allclose(frfs.values[:, 0], VALUES[:, 0] + 1.0, rtol=1e-12)


def test_a_unit_that_is_not_the_headers_is_said(tmp_path):
    analyser_text(tmp_path, ("Real [g/N]", "Imag [g/N]"), *parts())
    result = read(tmp_path, entry("frf.txt", unit="m/s^2/N", **STATED))
    np.testing.assert_allclose(result.frfs.values[:, 0], VALUES[:, 0], rtol=DIGITS)
    assert any("in 'm/s^2/N', as its [[frf]] says, where its header says 'g/N'" in text for text in result.warnings)


@pytest.mark.parametrize("unit", ["V/V", "EU/EU", "V", "mV/N"])
@pytest.mark.parametrize("keys", [{}, {"columns": ("frequency_hz", "real", "imag")}], ids=["header", "columns stated"])
def test_values_in_a_unit_of_no_motion_over_force_are_refused(tmp_path, unit, keys):
    analyser_text(tmp_path, (f"Real [{unit}]", f"Imag [{unit}]"), *parts())
    text = message(tmp_path, entry("frf.txt", **STATED, **keys))
    assert re.search(rf"frf\.txt: .*'{unit}', which is no unit of accelerance; write.*'unit' of its \[\[frf\]\]", text)


@pytest.mark.parametrize(
    "unit", ["counts", "ADC counts", "raw", "EU", "Eng. Units", "a.u.", "arb. units", "w.E.", "% FS", "Skt", "LSB"]
)
@pytest.mark.parametrize("keys", [{}, {"columns": ("frequency_hz", "real", "imag")}], ids=["header", "columns stated"])
def test_values_without_a_scale_are_refused_in_round_brackets_too(tmp_path, unit, keys):
    analyser_text(tmp_path, (f"Real ({unit})", f"Imag ({unit})"), *parts())
    assert f"'{unit}', which is no unit of accelerance" in message(tmp_path, entry("frf.txt", **STATED, **keys))
    read(tmp_path, entry("frf.txt", unit="m/s^2/N", **STATED, **keys))


@pytest.mark.parametrize("remark", ["Hand", "Ch 1", "1", "rms", "linear", "run 3", "point 4", "left", "x: 1, y: 2"])
def test_remarks_in_round_brackets_are_no_units(tmp_path, remark):
    analyser_text(tmp_path, (f"Real ({remark})", f"Imag ({remark})"), *parts())
    result = read(tmp_path, entry("frf.txt", **STATED))
    np.testing.assert_allclose(result.frfs.values[:, 0], VALUES[:, 0], rtol=DIGITS)


@pytest.mark.parametrize("skip_rows", [0, 1])
def test_units_of_a_header_hold_where_columns_are_stated(tmp_path, skip_rows):
    analyser_text(tmp_path, ("Real [mm/s2/N]", "Imag [mm/s2/N]"), *parts(1e3))
    columns = ("frequency_hz", "real", "imag")
    result = read(tmp_path, entry("frf.txt", columns=columns, skip_rows=skip_rows, **STATED))
    np.testing.assert_allclose(result.frfs.values[:, 0], VALUES[:, 0], rtol=DIGITS)


def test_a_row_of_units_that_are_none_of_the_quantity_is_refused(tmp_path):
    rows = np.column_stack([LINES_HZ, *parts()])
    header = "Frequency\tReal\tImaginary\nHz\tV/V\tV/V"
    np.savetxt(tmp_path / "frf.txt", rows, fmt="%.16e", delimiter="\t", header=header, comments="", encoding="utf-8")
    assert "'V/V', which is no unit of accelerance" in message(tmp_path, entry("frf.txt", **STATED))
