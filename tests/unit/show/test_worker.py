"""Work beside the server: one at a time, stopped by a newer wish, never silent about a failure."""

from threading import Event

import pytest

from frf_ipz.errors import InputError
from frf_ipz.show.worker import Worker

SOON_S = 20.0  # far beyond what any of this takes, so that a fault ends the test


def test_progress_can_be_read_while_it_works():
    started, go_on = Event(), Event()

    def work(progress):
        progress(0.4, "fitting")
        started.set()
        assert go_on.wait(SOON_S)

    worker = Worker()
    worker.start(work)
    assert started.wait(SOON_S)
    assert (worker.status.running, worker.status.fraction, worker.status.text) == (True, 0.4, "fitting")
    go_on.set()
    worker.wait(SOON_S)
    assert (worker.status.running, worker.status.error) == (False, "")


def test_a_newer_wish_stops_the_work_and_begins_anew():
    begun, ended, first_waits, go_on = [], [], Event(), Event()

    def work(progress):
        begun.append(1)
        first_waits.set()
        assert go_on.wait(SOON_S)
        progress(0.5, "")
        ended.append(1)

    worker = Worker()
    worker.start(work)
    assert first_waits.wait(SOON_S)
    worker.start(work)
    worker.start(work)
    go_on.set()
    worker.wait(SOON_S)
    assert (len(begun), len(ended)) == (2, 1)
    assert not worker.status.running


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (InputError("the file is wrong"), "the file is wrong"),
        (KeyError("x"), "a fault of the program: KeyError: 'x'"),
    ],
)
def test_a_failure_is_said_and_the_next_wish_is_worked_on(fault, message):
    faults = [fault, None]

    def work(progress):
        progress(0.1, "")
        if (now := faults.pop(0)) is not None:
            raise now

    worker = Worker()
    worker.start(work)
    worker.wait(SOON_S)
    assert worker.status.error == message
    worker.start(work)
    worker.wait(SOON_S)
    assert worker.status.error == ""


def test_stopping_ends_the_work_at_its_next_word():
    waits, go_on, ended = Event(), Event(), []

    def work(progress):
        waits.set()
        assert go_on.wait(SOON_S)
        progress(0.5, "")
        ended.append(1)

    worker = Worker()
    worker.start(work)
    assert waits.wait(SOON_S)
    worker.cancel()
    assert worker.status.text == "stopping"
    go_on.set()
    worker.wait(SOON_S)
    assert not ended
