"""Universal files as analysers write them: units, labels, exponents, directions, data sets that stand there twice."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import data_sets
import frf_ipz
from data_sets import BOTH_ENDS
from frf_ipz.errors import InputError
from synthetic_campaign import Structure

LINES_HZ = np.arange(5.0, 301.0)
VALUES = Structure().accelerance(2j * np.pi * LINES_HZ)[:, 0]
DIGITS = 1e-10  # relative: twelve digits are written
GRAVITY, POUND_FORCE, INCH = 9.80665, 4.4482216152605, 0.0254


def data_set(
    *,
    kind=4,
    ends=BOTH_ENDS,
    ordinate=("12", "Acceleration", "m/s2"),
    denominator=("13", "Excit. force", "N"),
    abscissa=("18", "Frequency", "Hz"),
    values=VALUES,
    start=5.0,
    number=None,
):
    axes = abscissa, ordinate, denominator
    return data_sets.data_set(values, axes=axes, kind=kind, ends=ends, start=start, number=number)


def units_164(length, force):
    return f"    -1\n   164\n         9user                         2\n{length:25.17e}{force:25.17e}\n    -1\n".replace(
        "e+", "D+"
    ).replace("e-", "D-")


def read(folder, text, **options):
    path = folder / "frf.uff"
    path.write_bytes(text.encode("latin-1"))
    return frf_ipz.read_frfs(path, **options)


def message(folder, text, **options):
    with pytest.raises(InputError) as caught:
        read(folder, text, **options)
    assert "frf.uff" in str(caught.value)
    return str(caught.value)


def expect(frfs, values=VALUES, label="5:+z / 3:+z"):
    assert [str(name) for name in frfs.labels] == [label]
    np.testing.assert_allclose(frfs.frequency_hz, LINES_HZ)
    assert np.abs(frfs.values[:, 0] - values).max() <= DIGITS * np.abs(values).max()


@pytest.mark.parametrize(
    ("ordinate", "denominator", "factor"),
    [
        ("mm/s2", "N", 1e-3),
        ("m/s2", "N", 1.0),
        ("ms-2", "Newtons", 1.0),
        ("g/N", "NONE", GRAVITY),
        ("(1/N)*(g)", "NONE", GRAVITY),
        ("(1/N)*(mm/s²)", "NONE", 1e-3),
        ("in/s2", "lbf", INCH / POUND_FORCE),
        ("IN/SEC2", "LBF", INCH / POUND_FORCE),
        ("g", "lb", GRAVITY / POUND_FORCE),
        ("g/N", "N", GRAVITY),
        ("NONE", "NONE", 1.0),
        ("", "", 1.0),
    ],
)
def test_labels_of_units_are_read_as_analysers_write_them(tmp_path, ordinate, denominator, factor):
    text = data_set(ordinate=("12", "a", ordinate), denominator=("13", "f", denominator), values=VALUES / factor)
    expect(read(tmp_path, text))


@pytest.mark.parametrize(
    ("ordinate", "denominator"),
    [
        ("m/s2", "NONE"),
        ("EU", "EU"),
        ("V", "V"),
        ("NONE", "N"),
        ("m/s", "N"),
        ("rad/s2", "N"),
        ("dB", "NONE"),
        ("m/sq", "N"),
    ],
)
def test_a_label_that_cannot_be_used_is_refused(tmp_path, ordinate, denominator):
    text = data_set(ordinate=("12", "a", ordinate), denominator=("13", "f", denominator))
    says = r"data set 1: the unit .* cannot be used.*give the 'unit' in its \[\[frf\]\]"
    assert re.search(says, message(tmp_path, text))
    expect(read(tmp_path, text, unit="m/s^2/N"))


@pytest.mark.parametrize("direction", ["4", "5", "-6"])
def test_a_rotation_in_a_unit_of_translations_is_refused(tmp_path, direction):
    for unit in ("m/s2", "g"):
        ends = f"      NONE         5{direction:>4s}       NONE         3   3"
        text = data_set(ends=ends, ordinate=("12", "a", unit))
        assert re.search(r"5:[+-]r. / 3:\+z has a unit like rad/s\^2/N", message(tmp_path, text))


def test_factors_of_data_set_164_are_used_where_there_is_no_label(tmp_path):
    nothing = {"ordinate": ("12", "a", "NONE"), "denominator": ("13", "f", "NONE"), "values": VALUES * 1000.0}
    expect(read(tmp_path, units_164(1000.0, 1.0) + data_set(**nothing)))
    expect(read(tmp_path, units_164(1000.0, 1.0) + data_set(ordinate=("12", "a", "mm/s2"), values=VALUES * 1000.0)))
    text = units_164(1000.0, 1.0) + data_set(ordinate=("12", "a", "m/s2"))
    assert "data set 164 another unit; say which by 'unit'" in message(tmp_path, text)
    assert "data set 164 are 0 and 1" in message(tmp_path, units_164(0.0, 1.0) + data_set())


@pytest.mark.parametrize("letter", ["D", "d", "E", ""])
def test_any_exponent_of_fortran_is_read(tmp_path, letter):
    expect(read(tmp_path, data_set(number=lambda value: f"{value:20.11e}".replace("e", letter).rjust(20))))


def test_numbers_without_blanks_between_them_are_read_by_their_columns(tmp_path):
    expect(read(tmp_path, data_set(number=lambda value: f"{value:+20.13e}")))


@pytest.mark.parametrize("wrong", ["1,5", "1_0", "x", "0x1F", "1.2.3", "********"])
def test_what_is_no_number_is_refused_with_its_line(tmp_path, wrong):
    lines = data_set().split("\n")
    lines[20] = f"{wrong:>20s}" + lines[20][20:]
    assert re.search(rf"line 21: '{re.escape(wrong)}'", message(tmp_path, "\n".join(lines)))


@pytest.mark.parametrize("kind", ["58", "164"])
def test_a_data_set_without_its_first_mark_is_refused(tmp_path, kind):
    """It was lost without a word."""
    second = data_set(ends=BOTH_ENDS.replace("5 ", "6 ")) if kind == "58" else units_164(1.0, 1.0)
    second = second.removeprefix("    -1\n")
    text = message(tmp_path, data_set() + second)
    assert f"line {data_set().count(chr(10)) + 1}: a data set {kind} begins without the line of -1" in text


def test_a_line_with_a_number_too_many_is_refused(tmp_path):
    """Its columns are those of the others, and what stands beyond them was not read."""
    lines = data_set().splitlines()
    lines[30] += "  1.23450e+00"
    text = message(tmp_path, "\n".join([*lines, ""]))
    assert "holds 593 numbers where its head promises 592" in text


def test_a_file_that_is_cut_off_is_refused(tmp_path):
    text = data_set()
    for length in (len(text) // 2, 300, 20, len(text) - 40):
        assert "frf.uff" in message(tmp_path, text[:length])


@pytest.mark.parametrize(
    "ends",
    [
        "PF-I-0301y+         5   3 Hammer_Pt_3         3   3",
        "ABCDEFGHIJ1         5   3 KLMNOPQRST2         3   3",
        f"{'':10s}         5   3 {'':10s}         3   3",
        f"{'my part':10s}         5   3 {'my part':10s}         3   3",
    ],
)
def test_names_do_not_shift_the_nodes(tmp_path, ends):
    expect(read(tmp_path, data_set(ends=ends)))


@pytest.mark.parametrize(
    "ends", ["      NONE         0   3       NONE         3   3", "      NONE         5   3       NONE         0   3"]
)
def test_node_0_is_refused(tmp_path, ends):
    assert "node 0 is the ground; name output_dof and input_dof" in message(tmp_path, data_set(ends=ends))
    expect(read(tmp_path, data_set(ends=ends), output="5:z", input="3:z"))


SCALAR = "      NONE{:10d}   0       NONE         3   0"


def test_a_direction_may_be_given_for_all_frfs_that_have_none(tmp_path):
    text = "".join(data_set(ends=SCALAR.format(node)) for node in (1, 2, 5))
    assert 'direction = "z"' in message(tmp_path, text)
    assert "'output_dof' cannot name one for all" in message(tmp_path, text, output="1:z", input="3:z")
    frfs = read(tmp_path, text, direction="-y")
    assert [str(label) for label in frfs.labels] == ["1:-y / 3:-y", "2:-y / 3:-y", "5:-y / 3:-y"]
    frfs = read(tmp_path, text, direction="z", input="9:x")
    assert [str(label) for label in frfs.labels] == ["1:+z / 9:+x", "2:+z / 9:+x", "5:+z / 9:+x"]
    with pytest.raises(InputError, match="'w' is no direction"):
        read(tmp_path, text, direction="w")


def test_an_frf_that_stands_there_twice(tmp_path):
    expect(read(tmp_path, data_set() + data_set()))
    text = message(tmp_path, data_set() + data_set(values=2 * VALUES))
    assert re.search(r"data sets 1 and 2 are both the FRF of node 5 .* sets = \[1, 2\]", text)


def write_test(folder, text, keys):
    (folder / "frf.uff").write_bytes(text.encode("latin-1"))
    (folder / "test.toml").write_text(
        f'[test]\nkind = "frf"\n[[frf]]\nfile = "frf.uff"\nquantity = "accelerance"\n{keys}\n', encoding="utf-8"
    )
    return frf_ipz.estimate_frfs(frf_ipz.read_test(folder / "test.toml"))


def test_data_sets_are_chosen_in_the_test_file(tmp_path):
    text = data_set() + data_set(values=2 * VALUES)
    expect(write_test(tmp_path, text, "sets = [2]").frfs, 2 * VALUES)
    with pytest.raises(InputError, match="'sets' names 3, which is no FRF; FRFs are the sets 1, 2"):
        write_test(tmp_path, text, "sets = [2, 3]")
    expect(write_test(tmp_path, data_set(ends=SCALAR.format(5)), 'direction = "z"').frfs)


def test_what_is_taken_for_granted_is_said(tmp_path):
    text = data_set(ordinate=("12", "a", "NONE"), denominator=("13", "f", "NONE"))
    assert "states no unit of 5:+z / 3:+z: taken as m/s^2/N" in write_test(tmp_path, text, "").warnings[0]
    twice = write_test(tmp_path, data_set() + data_set(), "")
    assert "data sets 1 and 2 are the same" in twice.warnings[0]


def test_a_line_at_0_hz_that_is_not_finite_is_left_out_and_said(tmp_path):
    values = np.concatenate([[complex(np.nan, np.nan)], VALUES])
    result = write_test(tmp_path, data_set(values=values, start=4.0).replace("  4.00000e+00", "  0.00000e+00"), "")
    assert result.frfs.frequency_hz[0] == 1.0
    assert "the line at 0 Hz of 5:+z / 3:+z is not finite: left out" in result.warnings[0]
    values[0], values[7] = 0.0, complex(np.inf, 0.0)
    text = data_set(values=values, start=4.0)
    (line,) = (number for number, line in enumerate(text.splitlines(), start=1) if "inf" in line.lower())
    assert f"data set 1, line {line}: the FRF 5:+z / 3:+z is not finite at 11 Hz" in message(tmp_path, text)


def test_frequencies_in_rad_s(tmp_path):
    frfs = read(tmp_path, data_set(abscissa=("18", "Omega", "rad/s")))
    np.testing.assert_allclose(frfs.frequency_hz, LINES_HZ / (2 * np.pi))
    assert "'octaves' is no unit of frequency" in message(tmp_path, data_set(abscissa=("18", "x", "octaves")))


def test_time_histories_are_refused_as_what_they_are(tmp_path):
    text = message(tmp_path, data_set(kind=1))
    assert (
        "1 of type 1 (time response); time responses are recordings: name the file under [[hit]] or [[record]]" in text
    )


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_damaged_files_give_errors_of_ours(data, tmp_path_factory):
    path = tmp_path_factory.mktemp("damaged") / "frf.uff"
    content = bytearray(units_164(1.0, 1.0).encode() + data_set(values=VALUES[:20]).encode("latin-1"))
    for _ in range(data.draw(st.integers(1, 6))):
        place = data.draw(st.integers(0, len(content) - 1))
        change = data.draw(st.sampled_from(["replace", "remove", "insert", "cut"]))
        text = data.draw(st.one_of(st.binary(max_size=3), st.sampled_from([b"\n", b"-1\n", b"58b", b"NaN", b"1e999"])))
        content[place : place + (0 if change == "insert" else len(text))] = b"" if change == "remove" else text
        content = content[:place] if change == "cut" and place > 40 else content
    path.write_bytes(content)
    try:
        frfs = frf_ipz.read_frfs(path)
    except InputError as error:
        assert "frf.uff" in str(error)  # noqa: PT017  both ends are right
    else:
        assert np.isfinite(frfs.values).all()
