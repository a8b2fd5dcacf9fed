"""Changes of pipeline.toml: what is written, and that all else in the file stays."""

import tomllib
from pathlib import Path

import pytest

from frf_ipz.errors import InputError
from frf_ipz.identification.options import PinnedPole
from frf_ipz.show.changes import to_change
from frf_ipz.show.pipeline_text import changed_text, parse, write_text

PATH = Path("pipeline.toml")
TEXT = """# my beam
[pipeline]
test = "test.toml"   # as measured

[fit]
# order matters to nobody
band_hz = [10.0, 700.0]  # Hz
pin_hz = [
  100.0, # sure of it
]

[predict]
points = ["49:+z"]
"""


def after(*wishes, text=TEXT):
    for wish in wishes:
        text = changed_text(text, to_change(wish, PATH), PATH)
    return text


def fit_of(text):
    return parse(text, PATH).fit


def test_a_rejection_is_added_and_every_other_line_stays():
    text = after({"kind": "reject", "hz": 143.21987654, "why": "mains "})
    assert [(pole.hz, pole.why) for pole in fit_of(text).strike] == [(143.22, "mains")]
    assert [line for line in text.splitlines() if "strike" not in line] == TEXT.splitlines()


def test_a_rejection_needs_a_reason():
    with pytest.raises(InputError, match="say why"):
        after({"kind": "reject", "hz": 143.2, "why": "  "})


def test_a_rejection_removes_the_pin_beside_it_and_a_pin_the_rejection():
    rejected = after({"kind": "reject", "hz": 100.5, "why": "no mode"})
    assert fit_of(rejected).pin_hz == ()
    pinned = fit_of(after({"kind": "pin", "hz": 101.0}, text=rejected))
    assert (pinned.pin_hz, pinned.strike) == ((101.0,), ())


def test_a_pin_replaces_the_one_beside_it():
    assert fit_of(after({"kind": "pin", "hz": 101.0}, {"kind": "pin", "hz": 250.0})).pin_hz == (101.0, 250.0)


def test_a_pin_keeps_its_reason_and_needs_none():
    text = after({"kind": "pin", "hz": 250.0, "why": " seen  by eye "}, {"kind": "pin", "hz": 400.0})
    assert tomllib.loads(text)["fit"]["pin_hz"] == [100.0, {"hz": 250.0, "why": "seen by eye"}, 400.0]
    assert fit_of(text).pinned == (
        PinnedPole(hz=100.0),
        PinnedPole(hz=250.0, why="seen by eye"),
        PinnedPole(hz=400.0),
    )
    assert "# sure of it" in text


@pytest.mark.parametrize(
    "wish", [{"kind": "pin", "hz": 250.0, "on": False}, {"kind": "reject", "hz": 251.0, "why": "no"}]
)
def test_a_pin_with_a_reason_is_taken_away_as_any_other(wish):
    assert fit_of(after({"kind": "pin", "hz": 250.0, "why": "seen"}, wish)).pin_hz == (100.0,)


def test_pins_written_as_tables_are_kept_as_tables():
    text = '[pipeline]\ntest = "t.toml"\n[[fit.pin_hz]]\nhz = 60.0 # loud\n'
    changed = after({"kind": "pin", "hz": 143.2}, text=text)
    assert fit_of(changed).pinned == (PinnedPole(hz=60.0), PinnedPole(hz=143.2))
    assert "# loud" in changed


@pytest.mark.parametrize(
    ("pin", "message"),
    [
        ('{ hz = 1.0, wy = "x" }', r"'fit\.pin_hz\.\[1\]\.wy'.*unknown key 'wy'; did you mean 'why'"),
        ('"high"', r"'fit\.pin_hz\.\[1\]'.*number"),
    ],
)
def test_a_pin_that_is_none_is_named(pin, message):
    with pytest.raises(InputError, match=message):
        parse(f'[pipeline]\ntest = "t.toml"\n[fit]\npin_hz = [{pin}]\n', PATH)


def test_taking_back_takes_only_that_entry():
    wishes = [{"kind": "reject", "hz": hz, "why": "x"} for hz in (50.0, 50.4)]
    text = after(*wishes, {"kind": "reject", "hz": 50.4, "on": False})
    assert [pole.hz for pole in fit_of(text).strike] == [50.0]


def test_taking_all_back_gives_the_text_that_was_there():
    wish = {"kind": "reject", "hz": 143.2, "why": "mains"}
    assert after(wish, {**wish, "on": False}) == TEXT


def test_rejections_written_as_tables_are_kept_as_tables():
    text = TEXT.replace("[predict]", '[[fit.strike]]\nhz = 60.0 # hum\nwhy = "mains"\n\n[predict]')
    changed = after({"kind": "reject", "hz": 143.2, "why": "a cable"}, text=text)
    assert [pole.hz for pole in fit_of(changed).strike] == [60.0, 143.2]
    assert changed.count("[[fit.strike]]") == 2
    assert "# hum" in changed
    emptied = after(*({"kind": "reject", "hz": hz, "on": False} for hz in (60.0, 143.2)), text=changed)
    assert fit_of(emptied).strike == ()


def test_ranges_and_the_band():
    text = after({"kind": "exclude", "low_hz": 49.5, "high_hz": 50.5}, {"kind": "band", "low_hz": 0, "high_hz": 300})
    assert fit_of(text).exclude_hz == ((49.5, 50.5),)
    assert fit_of(text).band_hz == (0.0, 300.0)
    text = after(
        {"kind": "exclude", "low_hz": 49.5, "high_hz": 50.5, "on": False}, {"kind": "band", "on": False}, text=text
    )
    assert (fit_of(text).exclude_hz, fit_of(text).band_hz) == ((), None)


def test_records_are_kept_dropped_and_left_to_the_checks():
    drop = {"kind": "record", "name": "hits/p18_03.csv", "use": "drop"}
    text = after(drop)
    assert parse(text, PATH).ingest.drop == ("hits/p18_03.csv",)
    text = after({**drop, "use": "keep"}, text=text)
    ingest = parse(text, PATH).ingest
    assert (ingest.keep, ingest.drop) == (("hits/p18_03.csv",), ())
    assert parse(after({**drop, "use": "checks"}, text=text), PATH).ingest.keep == ()


def test_points_are_added_once_and_taken_back():
    text = after({"kind": "point", "dof": "24:z"}, {"kind": "point", "dof": "24:+z"})
    assert parse(text, PATH).predict.points == ("49:+z", "24:+z")
    assert parse(after({"kind": "point", "dof": "49:z", "on": False}, text=text), PATH).predict.points == ("24:+z",)


def test_sensors_are_hidden_once_whatever_their_sign_and_shown_again():
    text = after(
        {"kind": "sensor", "dof": "24:+z"}, {"kind": "sensor", "dof": "24:-z"}, {"kind": "sensor", "dof": "7:x"}
    )
    assert parse(text, PATH).ingest.hide == ("24:-z", "7:+x")
    assert parse(after({"kind": "sensor", "dof": "24:z", "on": False}, text=text), PATH).ingest.hide == ("7:+x",)


def test_a_reduction_is_replaced_as_a_whole_and_taken_back():
    text = after({"kind": "retain", "dofs": ["9:z", "29:-z", "9:+z"]})
    assert parse(text, PATH).reduce.dofs == ("9:z", "29:z")
    assert parse(after({"kind": "retain", "dofs": ["7:z"]}, text=text), PATH).reduce.dofs == ("7:z",)
    assert parse(after({"kind": "retain", "on": False}, text=text), PATH).reduce.dofs == ()


def test_a_section_that_is_missing_is_made():
    text = after({"kind": "pin", "hz": 5.0}, text='[pipeline]\ntest = "t.toml"\n')
    assert tomllib.loads(text) == {"pipeline": {"test": "t.toml"}, "fit": {"pin_hz": [5.0]}}


def test_text_of_others_cannot_break_out_of_its_string():
    why = 'x"\n[pipeline]\ntest = "/etc/passwd" \u0000 # \\'
    text = after({"kind": "reject", "hz": 5.0, "why": why})
    assert tomllib.loads(text)["pipeline"] == {"test": "test.toml"}
    assert tomllib.loads(text)["fit"]["strike"][0]["why"] == " ".join(why.split())


@pytest.mark.parametrize(
    ("wish", "message"),
    [
        ({"kind": "rejec", "hz": 1.0}, "did you mean 'reject'"),
        ("reject", "there is no change"),
        ({"kind": "pin", "hz": 1.0, "command": "rm"}, "unknown key 'command'"),
        ({"kind": "pin"}, "'hz' is missing"),
        ({"kind": "pin", "hz": "high"}, "number"),
        ({"kind": "pin", "hz": float("nan")}, "is no frequency"),
        ({"kind": "pin", "hz": -3.0}, "is no frequency"),
        ({"kind": "exclude", "low_hz": 9.0, "high_hz": 8.0}, "is no band"),
        ({"kind": "record", "name": "a.csv", "use": "burn"}, "'keep', 'drop' or 'checks'"),
        ({"kind": "point", "dof": "tip:z"}, "is no DOF label"),
        ({"kind": "sensor", "dof": "tip:z"}, "is no DOF label"),
        ({"kind": "retain", "dofs": ["9:z", "tip:z"]}, "is no DOF label"),
        ({"kind": "retain", "dofs": []}, "name the DOFs"),
    ],
)
def test_invalid_limits_are_refused(wish, message):
    with pytest.raises(InputError, match=message):
        after(wish)


def test_a_file_keeps_its_line_ends_and_its_mode(tmp_path):
    path = tmp_path / "pipeline.toml"
    path.write_bytes(TEXT.replace("\n", "\r\n").encode())
    path.chmod(0o640)
    write_text(path, after({"kind": "pin", "hz": 250.0}))
    assert path.read_bytes().count(b"\r\n") == path.read_bytes().count(b"\n") > 1
    assert path.stat().st_mode & 0o777 == 0o640
    assert [path.name for path in tmp_path.iterdir()] == ["pipeline.toml"]
