"""A search ends when its time is over, keeps what it has, and says what it did not look at."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosed import BAND_HZ, beam, measured, observed
from frf_ipz.diagnosis.deadline import Deadline, DeadlineError
from frf_ipz.diagnosis.diagnose import find_causes
from frf_ipz.diagnosis.effect_selection import EffectCatalogue
from frf_ipz.diagnosis.evidence.inference_problem import pose_problem
from frf_ipz.diagnosis.measured.data_split import split_data
from frf_ipz.diagnosis.options import DiagnoseOptions

EFFECTS = ("added_mass",)


class Clock:
    """Each look at it takes a second: the time is that of so many hypotheses."""

    def __init__(self):
        self.looks = 0

    def __call__(self):
        self.looks += 1
        return float(self.looks)


@pytest.fixture
def search(tmp_path):
    def run(thickness_m, *, seconds=None, only_where_they_differ=False, at_check=lambda: None):
        nominal = beam(tmp_path)
        frfs = measured(beam(tmp_path, thickness_m=thickness_m))
        clock = Clock()
        diagnosis = find_causes(
            nominal,
            observed(frfs, BAND_HZ),
            EffectCatalogue(options=DiagnoseOptions(effects=EFFECTS), folder=tmp_path),
            deadline=Deadline(seconds=seconds, clock=clock, at_check=at_check),
            only_where_they_differ=only_where_they_differ,
        )
        return diagnosis, clock.looks

    return run


def test_time_is_over_after_its_seconds():
    clock = Clock()
    deadline = Deadline(seconds=2.5, clock=clock)
    deadline.check()
    deadline.check()
    with pytest.raises(DeadlineError):
        deadline.check()


def test_a_search_ends_between_hypotheses_where_nobody_waits(search):
    class Unwanted(Exception):  # noqa: N818  as what ends a search for another reason than time
        pass

    looks = []

    def look():
        looks.append(1)
        if len(looks) == 3:
            raise Unwanted

    with pytest.raises(Unwanted):
        search(0.0052, at_check=look)
    assert len(looks) == 3


def test_a_search_without_time_says_what_it_did_not_look_at(search):
    diagnosis, looks = search(0.0052, seconds=3.0)
    assert not diagnosis.is_complete
    assert "any effect" in diagnosis.not_searched
    assert diagnosis.not_searched in diagnosis.statement
    assert diagnosis.to_json()["complete"] is False
    assert looks < 10  # between one hypothesis and the next


def test_a_search_without_time_says_that_it_does_not_know_what_would_show(search):
    diagnosis, _ = search(0.0052, seconds=0.5)
    assert not diagnosis.detectability
    assert "how small an effect" in diagnosis.statement


def test_a_long_fit_ends_between_its_steps(tmp_path):
    observations = observed(measured(beam(tmp_path, thickness_m=0.0052)), BAND_HZ)
    posed = pose_problem(beam(tmp_path), split_data(observations), BAND_HZ, DiagnoseOptions(), {})
    clock = Clock()
    problem = replace(posed, deadline=Deadline(seconds=4.5, clock=clock))
    with pytest.raises(DeadlineError):
        problem.fit_exactly(problem.fit_roughly((), np.zeros(0)))
    assert clock.looks == 6  # one when the clock starts, one for the hypothesis, and then one a step


@pytest.mark.slow
def test_a_search_that_is_cut_keeps_the_fits_it_has(search):
    whole, looks = search(0.0052, seconds=1e9)
    assert whole.is_complete
    cut, _ = search(0.0052, seconds=0.9 * looks)
    assert not cut.is_complete
    assert cut.alternatives or cut.findings


def test_no_cause_is_searched_for_where_nothing_differs(search):
    diagnosis, _ = search(0.005, only_where_they_differ=True)
    assert diagnosis.verdict == "consistent"
    assert diagnosis.statement.startswith("Nothing missing was seen")
    assert diagnosis.is_complete
    assert diagnosis.numbers["hypotheses"] == 0
