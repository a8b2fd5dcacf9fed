"""Progress of long commands: an estimate, few refreshes on a terminal, a line a minute in a file."""

import pytest

from frf_ipz.cli import progress_display
from frf_ipz.cli.progress_display import Estimate, in_words, showing_progress


@pytest.fixture
def clock(monkeypatch):
    times = [100.0]
    monkeypatch.setattr(progress_display.time, "monotonic", lambda: times[0])
    return times


def test_the_time_that_is_left_follows_from_what_is_done(clock):
    estimate = Estimate()
    clock[0] += 60.0
    estimate.update(0.25, "10 of 40 machines")
    assert estimate.line == "10 of 40 machines, 1 min so far, about 3 min left"


@pytest.mark.parametrize("fraction", [0.0, 0.01, 1.0])
def test_nothing_is_promised_at_the_beginning_and_at_the_end(clock, fraction):
    estimate = Estimate()
    clock[0] += 5.0
    estimate.update(fraction, "fit")
    assert estimate.remaining == ""


def test_what_is_being_done_is_one_line():
    estimate = Estimate()
    estimate.update(0.0, "a\x1b[2J\nb")
    assert estimate.line == "a\\x1b[2J\\nb, 0 s so far"


@pytest.mark.parametrize(("seconds", "words"), [(59.4, "59 s"), (61, "1 min"), (3600, "1 h 00 min")])
def test_times_in_words(seconds, words):
    assert in_words(seconds) == words


def test_a_file_gets_a_line_now_and_then_although_nothing_moves(monkeypatch, capsys):
    said = []
    monkeypatch.setattr(progress_display, "LINE_EVERY_S", 0.01)
    monkeypatch.setattr(progress_display, "say_progress", said.append)
    with showing_progress(quiet=False) as show:
        show(0.5, "3 of 6 machines")
        while len(said) < 3:
            progress_display.time.sleep(0.005)
    assert all(line.startswith("3 of 6 machines, ") for line in said[1:])
    assert capsys.readouterr().out == ""


def test_quiet_says_nothing(monkeypatch, capsys):
    monkeypatch.setattr(progress_display, "LINE_EVERY_S", 0.001)
    with showing_progress(quiet=True) as show:
        show(0.5, "fit")
        progress_display.time.sleep(0.02)
    assert capsys.readouterr() == ("", "")
