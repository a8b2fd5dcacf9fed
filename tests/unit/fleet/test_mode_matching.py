"""Modes are matched over machines by their counterparts and shapes, and not by their order."""

import numpy as np
import pytest

from frf_ipz.fleet.machine_record import Roots
from frf_ipz.fleet.mode_matching import match_roots

SHAPES = np.linalg.qr(np.random.default_rng(0).normal(size=(6, 6)))[0] + 0j
HZ = np.array([20.0, 50.0, 52.0, 110.0])


def poles(chosen, *, factor=1.0, counterpart=None, hz=HZ, seed=0):
    chosen = np.array(chosen)
    rng = np.random.default_rng(seed)
    scales = np.exp(2j * np.pi * rng.random(len(chosen)))
    noise = 0.03 * rng.normal(size=(6, len(chosen)))
    return Roots(
        frf=("",) * len(chosen),
        frequency_hz=factor * hz[chosen],
        damping_ratio=np.full(len(chosen), 0.01),
        frequency_std_hz=np.full(len(chosen), 1e-3),
        damping_ratio_std=np.full(len(chosen), 1e-4),
        counterpart=np.full(len(chosen), -1) if counterpart is None else np.array(counterpart),
        shapes=scales * (SHAPES[:, chosen] + noise),
        dofs=tuple(f"{node}:z" for node in range(6)),
    )


def test_a_mode_that_one_machine_lacks_shifts_no_other():
    found = match_roots([poles([0, 1, 2, 3]), poles([0, 2, 3], seed=1), poles([1, 3], seed=2)])
    assert [numbers.tolist() for numbers in found] == [[1, 2, 3, 4], [1, 3, 4], [2, 4]]


def test_close_modes_that_have_changed_places_are_told_by_their_shapes():
    swapped = np.array([20.0, 52.5, 51.0, 110.0])
    found = match_roots([poles([0, 1, 2, 3]), poles([0, 2, 1, 3], hz=swapped, seed=1)])
    assert [numbers.tolist() for numbers in found] == [[1, 2, 3, 4], [1, 3, 2, 4]]


@pytest.mark.parametrize("factor", [0.9, 1.1])
def test_a_machine_that_is_softer_as_a_whole_keeps_its_modes(factor):
    paired = [0, 1, 2, -1]
    machines = [poles([0, 1, 2, 3], counterpart=paired), poles([0, 1, 2, 3], factor=factor, counterpart=paired)]
    assert [numbers.tolist() for numbers in match_roots(machines)] == [[1, 2, 3, 4]] * 2


def test_the_counterpart_in_the_model_counts_before_all():
    found = match_roots([poles([1], counterpart=[4]), poles([2], counterpart=[4]), poles([1], counterpart=[5])])
    assert found[0] == found[1]
    assert found[0] != found[2]


def test_zeros_are_numbered_in_each_frf():
    frf = ("3:z / 1:z", "3:z / 1:z", "2:z / 1:z")
    zeros = [
        Roots(
            frf=frf[:count],
            frequency_hz=np.array([30.0, 60.0, 30.5])[:count],
            damping_ratio=np.full(count, 0.01),
            frequency_std_hz=np.full(count, 1e-3),
            damping_ratio_std=np.full(count, 1e-4),
            counterpart=np.full(count, -1),
            shapes=np.zeros((0, count), complex),
        )
        for count in (3, 1)
    ]
    assert [numbers.tolist() for numbers in match_roots(zeros)] == [[1, 2, 1], [1]]


def test_no_machines_and_machines_without_modes():
    assert match_roots([]) == []
    assert [numbers.tolist() for numbers in match_roots([poles(np.zeros(0, int)), poles([0])])] == [[], [1]]
