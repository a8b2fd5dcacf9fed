"""What `test.toml` says: channels, DOFs, files, masses of sensors."""

import pytest

from frf_ipz.dofs import Dof
from frf_ipz.errors import FileFormatError
from frf_ipz.ingest.campaign import setup_labels
from frf_ipz.ingest.campaign_file import read_test
from frf_ipz.ingest.estimate import estimate_frfs
from frf_ipz.ingest.frf_estimate import FrfEstimate, Trace
from frf_ipz.ingest.options import IngestOptions
from frf_ipz.ingest.survey.selection import is_named
from synthetic_campaign import Structure, hammer_campaign, impact, write_csv, write_test

ROVING = """
[[hit]]
dof = "7:+z"
files = ["a/*.csv"]
[[hit]]
dof = "7:+z"
files = ["b/*.csv", "b/1.csv"]
output_dofs = { acc_2 = "5:-y" }
"""


@pytest.fixture
def roving(tmp_path):
    signals = impact(Structure(), n_samples=256)
    for name in ("a/1", "b/1", "b/2", "b/3"):
        write_csv(tmp_path / f"{name}.csv", signals, 1 / 2048)
    path = write_test(
        tmp_path, ROVING, head='name = "a shelf"\nnominal_damping_ratio = 0.002\nunknown_scale = "common"'
    )
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace('dof = "2:+z"', 'dof = "2:+z"\nmass_kg = 0.008'), encoding="utf-8")
    return path


def test_the_channels_dofs_and_files_of_a_test(roving):
    test = read_test(roving)
    assert (test.name, test.kind, test.nominal_damping_ratio) == ("a shelf", "hammer", 0.002)
    assert test.unknown_scale == "common"
    assert test.input_channel.column == "force"
    assert [channel.column for channel in test.output_channels] == ["acc_1", "acc_2"]
    assert [str(dof) for dof in test.output_dofs] == ["1:+z", "2:+z", "5:-y"]
    assert test.input_dofs == (Dof(7, "z", 1),)
    assert [file.name for file in test.files] == ["1.csv", "1.csv", "2.csv", "3.csv"]
    assert all(file.is_absolute() for file in test.files)


PARTICULARS = """
operator = "A. Meier"
date = {date}
equipment = "hammer 2302-10, sensor 352A21"
customer = "  "
serial_number = "0047"
"""


@pytest.mark.parametrize(
    ("date", "text"),
    [
        ("2026-11-27", "2026-11-27"),
        ("2026-11-27T08:30:00", "2026-11-27T08:30:00"),
        ('"2026-11-27, night shift"', "2026-11-27, night shift"),
        ('"27 November"', "27 November"),
    ],
)
def test_who_measured_and_when(tmp_path, date, text):
    path = hammer_campaign(tmp_path, heights=(100.0,), n_samples=256)
    add_to_test(path, PARTICULARS.format(date=date))
    assert read_test(path).particulars == {
        "operator": "A. Meier",
        "date": text,
        "equipment": "hammer 2302-10, sensor 352A21",
        "serial_number": "0047",
    }


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (
            'date = "2026-13-45"',
            r"key 'test.date': must be a day of the calendar, as YYYY-MM-DD; given is '2026-13-45'",
        ),
        ("date = 20261127", r"key 'test.date': must be a date such as 2026-11-27, or a text; given is 20261127"),
        ("operator = 12", r"key 'test.operator': must be a valid string; given is 12"),
        ('serial_no = "47"', r"unknown key 'serial_no'; did you mean 'serial_number'"),
    ],
)
def test_particulars_that_are_none(tmp_path, line, message):
    path = hammer_campaign(tmp_path, heights=(100.0,), n_samples=256)
    add_to_test(path, line)
    with pytest.raises(FileFormatError, match=message):
        read_test(path)


def add_to_test(path, lines):
    path.write_text(path.read_text(encoding="utf-8").replace("[test]", f"[test]\n{lines}", 1), encoding="utf-8")


@pytest.mark.parametrize("dof", ['dof = "7:+z"', 'dof = "2:+z"', 'acc_2 = "5:-y"'])
def test_nothing_is_measured_at_the_ground(roving, dof):
    key, _, label = dof.partition(" = ")
    text = roving.read_text(encoding="utf-8")
    roving.write_text(text.replace(dof, f'{key} = "0:{label[3:]}', 1), encoding="utf-8")
    with pytest.raises(FileFormatError, match=r"test.toml, .*'0:..' is at node 0, which is the ground; name the node"):
        read_test(roving)


def test_a_test_without_a_name_is_called_after_its_folder(tmp_path):
    path = hammer_campaign(tmp_path / "shelf", heights=(100.0,), n_samples=256)
    assert read_test(path).name == "shelf"


def test_a_roving_sensor_gives_its_own_labels(roving):
    test = read_test(roving)
    assert [str(label) for label in setup_labels(test.channels, test.setups[1])] == ["1:+z / 7:+z", "5:-y / 7:+z"]
    assert [str(label) for label in test.labels] == ["1:+z / 7:+z", "2:+z / 7:+z", "5:-y / 7:+z"]
    assert test.labels[2].sign == -1


def test_the_mass_of_a_sensor_sits_where_the_sensor_sits(roving):
    test = read_test(roving)
    reference, first, second = test.labels
    assert test.masses_with(first) == {2: pytest.approx(0.008)}
    assert test.masses_with(second) == {5: pytest.approx(0.008)}
    assert test.masses_with(reference) == {2: pytest.approx(0.002), 5: pytest.approx(0.006)}  # 1 and 3 recordings
    assert test.sensor_masses == {2: pytest.approx(0.002), 5: pytest.approx(0.006)}


def test_sensors_at_one_node_weigh_together(tmp_path):
    path = hammer_campaign(tmp_path, heights=(100.0,), n_samples=256)
    text = path.read_text(encoding="utf-8").replace('dof = "2:+z"', 'dof = "1:+x"')
    path.write_text(text.replace('unit = "m/s^2"', 'unit = "m/s^2"\nmass_kg = 0.003'), encoding="utf-8")
    assert read_test(path).sensor_masses == {1: pytest.approx(0.006)}


def test_equal_tests_have_equal_reprs(roving):
    assert repr(read_test(roving)) == repr(read_test(roving))


def test_traces_are_drawn_of_every_force_and_some_responses(roving):
    result = estimate_frfs(read_test(roving), options=IngestOptions())
    assert isinstance(result, FrfEstimate)
    assert all(isinstance(trace, Trace) for trace in result.traces)
    forces = [trace for trace in result.traces if trace.unit == "N"]
    responses = [trace for trace in result.traces if trace.unit == "m/s^2"]
    assert [trace.name for trace in forces] == list(result.records.record)
    assert {trace.channel for trace in responses} == {"acc_1", "acc_2"}
    assert max(trace.values.max() for trace in forces) == pytest.approx(100.0, rel=0.05)


@pytest.mark.parametrize(
    ("name", "pattern", "expected"),
    [
        ("hits/p_1.csv", "hits/p_1.csv", True),
        ("hits/p_1.csv", "p_1.csv", True),
        ("hits/p_1.csv", "1.csv", False),
        ("hits/p_1.csv#2", "p_1.csv", True),
        ("hits/p_1.csv#2", "hits/p_1.csv#2", True),
        ("hits/p_1.csv#2", "p_1.csv#1", False),
        ("hits/p_1.csv", "other/p_1.csv", False),
    ],
)
def test_records_are_named_by_the_end_of_their_path(name, pattern, expected):
    assert is_named(name, [pattern]) is expected
