"""Whatever is wrong with a test or its files is one clear message: the place, what was expected, what to do."""

import re

import numpy as np
import pytest

from frf_ipz.errors import InputError
from frf_ipz.ingest.campaign_file import read_test
from frf_ipz.ingest.estimate import estimate_frfs
from frf_ipz.ingest.options import IngestOptions
from synthetic_campaign import hammer_campaign


@pytest.fixture
def path(tmp_path):
    return hammer_campaign(tmp_path, n_samples=512)


def change(path, old, new, count=-1):
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, count), encoding="utf-8")


def message(path, **options):
    with pytest.raises(InputError) as caught:
        estimate_frfs(read_test(path), options=IngestOptions(**options))
    text = str(caught.value)
    assert "\n" not in text
    assert "Traceback" not in text
    return text


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('unit = "N"', 'unti = "N"', "unknown key.*unti.*did you mean 'unit'"),
        ("[test]", "[tset]", r"has no section \[test\]"),
        ("[test]", "[test", "is not valid TOML"),
        ('kind = "hammer"', 'kind = "hamer"', "test.kind.*hammer.*random.*frf"),
        ('kind = "hammer"', 'kind = "random"', r"key 'hit'.*'random' has \[\[record\]\] entries"),
        ('unit = "N"', 'unit = "Newtons-ish"', r"\[\[channel\]\] 'force'.*'Newtons-ish' is no unit that can be read"),
        ('unit = "N"', 'unit = "0 N"', r"\[\[channel\]\] 'force'.*'0 N' is no unit of force: it is 0 N"),
        ('unit = "N"', 'unit = "N NaN"', "'N NaN' is no unit of force: it is nan N"),
        ('unit = "N"', 'unit = "mV"', r"'mV' is no unit of force; .*, as in sensitivity = \"10 mV/N\""),
        ('unit = "N"', 'unit = "mm"', r"\[\[channel\]\] 'force'.*'mm' is no unit of force; expected is N, kN or lbf"),
        ('unit = "m/s^2"', 'unit = "kg"', "'kg' is no unit of acceleration; expected is m/s.2 or g"),
        ('unit = "N"', 'sensitivity = "10 mV"', "'10 mV' is no ratio of units; write it as in '10.2 mV/g'"),
        ('unit = "N"', 'sensitivity = "0 mV/N"', "is zero"),
        ('unit = "N"', 'sensitivity = "10 mV/m"', "is not per unit of force"),
        ('unit = "N"', 'unit = "N"\nsensitivity = "1 mV/N"', "has both 'unit' and 'sensitivity'"),
        ('unit = "N"', 'unit = "N"\ndof = "1:z"', "an input has no 'dof'"),
        ('quantity = "force"', 'quantity = "acceleration"', "the input is a force and an output a motion"),
        ('role = "input"', 'role = "output"', "the input is a force and an output a motion"),
        ('column = "acc_2"', 'column = "acc_1"', "2 channels have the column 'acc_1'; name each column once"),
        ('dof = "1:+z"', 'dof = "1:+w"', r"\[\[channel\]\] 'acc_1'.*1:\+w"),
        ('dof = "1:+z"', 'dof = "z"', r"\[\[channel\]\] 'acc_1'"),
        ('dof = "1:+z"\n', "", r"\[\[hit\]\] 7:\+z: the output 'acc_1' has no DOF"),
        (
            'dof = "1:+z"',
            'dof = "1:+z"\nmass_kg = -0.004',
            "mass_kg'.*must be greater than or equal to 0; given is -0.004",
        ),
        ('dof = "2:+z"', 'dof = "1:-z"', "'acc_1' and 'acc_2' both measure the acceleration at 1:-z; correct a 'dof'"),
        ('files = ["hits/*.csv"]', 'files = ["hits/*.txt"]', r"no file fits 'hits/\*\.txt'.*correct 'files'"),
        ('files = ["hits/*.csv"]', "files = []", "files"),
        (
            'files = ["hits/*.csv"]',
            'files = ["hits/*.csv"]\noutput_dofs = { acc_3 = "3:z" }',
            "did you mean 'acc_[12]'",
        ),
        (
            "[[hit]]",
            '[[hit]]\ndof = "8:+z"\nfiles = ["hits/*_01.csv"]\n[[hit]]',
            r"p7_01\.csv belongs to the entries of 8:\+z and of 7:\+z",
        ),
        ("[test]", "[test]\nnominal_damping_ratio = 1.5", "nominal_damping_ratio.*must be less than 1; given is 1.5"),
        ("[test]", '[test]\nunknown_scale = "some"', "unknown_scale"),
        ('column = "acc_2"', 'column = "acc_3"', r"p7_01\.csv, line 1: has no column 'acc_3'; did you mean 'acc_[12]'"),
    ],
)
def test_mistakes_in_the_test_file(path, old, new, says):
    change(path, old, new, 1)
    text = message(path)
    assert re.search(says, text), text
    assert "test.toml" in text or "p7_01.csv" in text


def test_a_test_file_that_is_missing(tmp_path):
    assert re.search(r"absent\.toml.*no such file", message(tmp_path / "absent.toml"))


def test_no_input_and_no_output(path):
    text = path.read_text(encoding="utf-8")
    channels = text.split("[[channel]]")
    path.write_text("[[channel]]".join([channels[0], *channels[2:]]), encoding="utf-8")
    assert "exactly one [[channel]] with role = 'input'; given are 0" in message(path)
    path.write_text(text.split("[[channel]]", 2)[0] + "[[channel]]" + channels[1] + HITS, encoding="utf-8")
    assert "at least one [[channel]] with role = 'output'" in message(path)


HITS = '[[hit]]\ndof = "7:+z"\nfiles = ["hits/*.csv"]\n'


def test_a_hammer_test_without_hits(path):
    change(path, HITS, "")
    assert "needs at least one [[hit]]" in message(path)


@pytest.mark.parametrize(
    ("number", "edit", "says"),
    [
        (100, lambda text: text.replace(text.split(",")[2], "x1.5"), "line 100, column 'acc_1'.*'x1.5'.*number"),
        (100, lambda text: text.replace(text.split(",")[2], "NaN"), "line 100, column 'acc_1'.*'NaN'"),
        (100, lambda text: text.replace(text.split(",")[2], ""), "line 100, column 'acc_1': holds nothing"),
        (100, lambda text: text.replace(text.split(",")[2], "inf"), "line 100, column 'acc_1'.*'inf'"),
        (100, lambda text: text.replace(text.split(",")[2], "1e200"), "line 100: .*infinite or absurdly large"),
        (100, lambda text: text.replace(text.split(",")[2], "1e999"), "line 100: .*infinite or absurdly large"),
        (100, lambda text: text.replace(",", ",\r", 1), "line 10[0-9]"),
        (100, lambda _: ",,,", "line 100, column 'time': holds nothing"),
        (100, lambda text: text.replace(text.split(",")[1], "1,5"), "line 100.*5 values.*4 columns.*decimal comma"),
        (100, lambda text: text.rpartition(",")[0], "line 100.*3 values.*4 columns"),
        (513, lambda text: text.rpartition(",")[0], "line 513.*3 of 4 values: the file is cut off"),
        (100, lambda text: "-1" + text[text.index(",") :], "line 100, column 'time': the time is not uniform"),
        (1, lambda text: text.replace("time", "frequency"), "line 1: has no column 'time'"),
        (1, lambda text: text.replace("acc_2", "acc_1"), "2 columns 'acc_1'; give each its own name"),
        (1, lambda text: text.replace("time,", ""), "line 2: has 4 values where the header has 3 columns.*header_row"),
        (1, lambda text: text + ",more", "line 2: has 4 values where the header has 5 columns|line 2"),
        (2, lambda text: "s,mm,m/s^2,m/s^2\n" + text, "column 'force'.*is in 'mm' by the file and in 'N' by the test"),
        (2, lambda text: "s,kN,m/s^2,m/s^2\n" + text, "column 'force'.*is in 'kN' by the file and in 'N' by the test"),
        (2, lambda text: "tick,N,m/s^2,m/s^2\n" + text, "column 'time'.*'tick' is no unit that can be read"),
        (2, lambda text: "x" + text, "line 2, column 'time'.*'x"),
    ],
)
def test_faults_in_a_recording(path, number, edit, says):
    csv = path.parent / "hits" / "p7_02.csv"
    lines = csv.read_text(encoding="utf-8").splitlines()
    lines[number - 1] = edit(lines[number - 1])
    csv.write_text("\n".join(lines) + "\n", encoding="utf-8")
    text = message(path)
    assert re.search(says, text), text
    assert "p7_02.csv" in text


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "is empty; measure or export it again"),
        (b"\n\n", "is empty; measure or export it again"),
        (b"time,force,acc_1,acc_2\n", "no line that begins with a number"),
        (b"time,force,acc_1,acc_2\n0,1,2,3\n1,2,3,4\n", "holds 2 samples; a recording needs at least 16"),
        (b"PK\x03\x04\x00\x00rubbish", "holds zero bytes"),
    ],
)
def test_files_that_are_no_recordings(path, content, says):
    (path.parent / "hits" / "p7_02.csv").write_bytes(content)
    text = message(path)
    assert re.search(says, text), text
    assert "p7_02.csv" in text


def test_a_recording_that_is_a_folder_is_no_recording(path):
    (path.parent / "hits" / "p7_04.csv").mkdir()
    assert len(estimate_frfs(read_test(path), options=IngestOptions()).records) == 3


def test_recordings_of_unequal_length(path):
    csv = path.parent / "hits" / "p7_02.csv"
    lines = csv.read_text(encoding="utf-8").splitlines()
    csv.write_text("\n".join(lines[:400]) + "\n", encoding="utf-8")
    assert re.search(r"p7_02\.csv: holds 399 samples where the others hold 512.*keep", message(path))


def test_a_force_without_an_impact(path):
    csv = path.parent / "hits" / "p7_02.csv"
    table = np.loadtxt(csv, delimiter=",", skiprows=1)
    for force in (np.zeros(512), np.random.default_rng(1).standard_normal(512)):
        table[:, 1] = force
        np.savetxt(csv, table, delimiter=",", header="time,force,acc_1,acc_2", comments="")
        assert re.search(r"p7_02\.csv: no impact found: the column 'force' rises to .* N at most", message(path))


def test_a_column_without_any_unit(path):
    change(path, 'unit = "N"\n', "")
    assert re.search("column 'force': has no unit: give the .*channel.* a 'unit' or a 'sensitivity'", message(path))


def test_all_records_of_one_dof_with_a_different_step(path):
    csv = path.parent / "late" / "1.csv"
    table = np.loadtxt(path.parent / "hits" / "p7_01.csv", delimiter=",", skiprows=1)
    table[:, 0] *= 2
    csv.parent.mkdir()
    np.savetxt(csv, table, delimiter=",", header="time,force,acc_1,acc_2", comments="")
    path.write_text(
        path.read_text(encoding="utf-8") + '[[hit]]\ndof = "8:+z"\nfiles = ["late/*.csv"]\n', encoding="utf-8"
    )
    assert re.search(r"all records at 8:\+z have the time step 0\.000976.* s.*export them with one step", message(path))


def test_a_unit_that_the_files_state_wrongly_is_passed_over_where_the_test_says_so(path):
    for csv in (path.parent / "hits").glob("*.csv"):
        head, _, rows = csv.read_text(encoding="utf-8").partition("\n")
        csv.write_text(f"{head}\ns,Volts,m/s^2,m/s^2\n{rows}", encoding="utf-8")
    assert 'where the file\'s is, say wrong_file_unit = "Volts"' in message(path)
    change(path, 'unit = "N"', 'unit = "N"\nwrong_file_unit = "g"')
    assert "is in 'Volts' by the file and in 'N' by the test" in message(path)
    change(path, '"g"', '"Volts"')
    assert estimate_frfs(read_test(path)).records["peak_force_N"].max() > 1.0
    change(path, 'unit = "N"\n', "")
    assert "'wrong_file_unit' needs the right 'unit', or a 'sensitivity'" in message(path)
