"""What who tests does: impacts that share a file, dc offsets of converters, recorders that begin late."""

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.testing import assert_allclose

from frf_testbench.simulator.cases.case import make_case
from frf_testbench.simulator.cases.records import digitise, peak_motion, simulate_records
from frf_testbench.simulator.cases.system import build_system
from frf_testbench.simulator.effects.effect import Effect
from frf_testbench.simulator.set_up import draw_set_up
from frf_testbench.simulator.signals.channels import Noise
from frf_testbench.simulator.signals.laws import PowerSpring
from frf_testbench.simulator.signals.receptance import solve_modes
from frf_testbench.simulator.specimens import draw_specimen
from frf_testbench.simulator.structures.structure import Point

ROUND = 5e-5  # what comes round in the transforms of the short and of the long record
SHORT = 1500  # samples from impact to impact: the structure still moves
RINGS = 200  # samples around an impact in which its filter rings, cut off where a record begins or ends with them


@cache
def a_case():
    return make_case(31, "null", structure="frame", analyse=False)


def beyond_superposition(system):
    """Second impact of a file, beyond what the first leaves and the second does alone, over the largest signals."""

    def recorded(*excitations, **changes):
        return simulate_records(replace(system, set_up=replace(system.set_up, **changes)), excitations)[0]

    first, second = a_case().excitations[:2]
    shared = recorded(first, second, in_one_file=True, n_samples=SHORT)[1]
    left = recorded(first, in_one_file=False, n_samples=2 * SHORT)[0, :, SHORT:]
    alone = recorded(second, in_one_file=False, n_samples=SHORT)[0]
    peaks = np.abs(alone).max(axis=1)[:, None]
    assert np.abs(left / peaks)[1:, RINGS:-RINGS].max() > 0.05
    return np.abs((shared - left - alone) / peaks)[:, RINGS:-RINGS].max(axis=1)


def test_what_an_impact_leaves_is_there_when_the_next_of_the_file_comes():
    assert beyond_superposition(a_case().system).max() < ROUND


def test_a_law_feels_what_the_impact_before_has_left():
    system = a_case().system
    motion = (Point(system.set_up.excited_points[0][0], system.specimen.direction), None)
    largest, _ = peak_motion(system, a_case().excitations, motion)
    hardening = 1e5 / largest**2  # N/m at the largest motion
    law = PowerSpring(stiffness=hardening, power=3)
    effect = Effect(name="cubic_stiffness", location={}, parameters={}, law=law, law_motion=motion)
    force, *motion = beyond_superposition(build_system(system.specimen, system.set_up, system.scatter, (effect,)))
    assert force < ROUND
    assert max(motion) > 100 * ROUND


def test_converters_have_the_same_dc_offset_in_all_records():
    set_up = replace(a_case().system.set_up, dc_offset=1e-3, bits=24)
    signals = np.zeros((3, 2, 1000))
    signals[:, :, 10] = [[2.0, 50.0]] * 3
    quiet = (Noise(rms=1e-9), Noise(rms=1e-9))
    stored, _ = digitise(np.random.default_rng(5), signals, quiet, set_up)
    constants = np.median(stored, axis=2)
    assert_allclose(constants, constants[:1].repeat(3, axis=0), rtol=1e-2)
    assert (np.abs(constants[0]) < [2e-3, 50e-3]).all()
    assert (np.abs(constants[0]) > [1e-5, 25e-5]).all()


def test_some_recorders_begin_just_before_the_impact_and_some_run_on():
    specimen = draw_specimen(np.random.default_rng(1), "frame")
    drawn = specimen.build()
    modes = solve_modes(drawn)
    tests = [draw_set_up(np.random.default_rng(seed), specimen, drawn, modes) for seed in range(200)]
    hammered = [test for test in tests if test.kind == "hammer"]
    free = np.array([(test.start_s - 0.5 * test.contact_s) * test.rate_hz for test in hammered])
    assert free.min() >= 3 - 1e-9
    assert 0.1 < np.mean(free < 24) < 0.3
    assert 0.1 < np.mean([test.in_one_file for test in hammered]) < 0.3
    assert 0.2 < np.mean([test.dc_offset > 0 for test in tests]) < 0.4
    assert not any(test.in_one_file for test in tests if test.kind != "hammer")
