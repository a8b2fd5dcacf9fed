"""Ring-downs of oscillators whose law is known, integrated by SciPy's Runge-Kutta method of order 8."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from frf_ipz.errors import InputError
from frf_testbench.studies.ringdown import fit_amplitude_law, name_family, track_ringdown

FREQUENCY_HZ, RATIO = 10.0, 0.002
OMEGA = 2 * np.pi * FREQUENCY_HZ
RATE_HZ, DURATION_S, WINDOW_S = 400.0, 8.0, 0.8
STARTS_M = (1.0, 0.7, 0.5)
NOISE = 1e-4
SIGMAS = 5.0  # standard deviations: of some ten windows none is farther off
BY_SECOND_ORDER = 0.1  # relative: amplitudes change within a window, and the laws are those of first order in them


def ring(force, start):
    time = np.arange(round(DURATION_S * RATE_HZ)) / RATE_HZ

    def derivative(_, y):
        return [y[1], -(OMEGA**2) * y[0] - 2 * RATIO * OMEGA * y[1] - force(*y)]

    found = solve_ivp(derivative, (0, time[-1]), [start, 0], t_eval=time, method="DOP853", rtol=1e-9, max_step=0.01)
    return found.y[0] + NOISE * np.random.default_rng(5).standard_normal(len(time))


def laws_of(force):
    tracks = [track_ringdown(ring(force, start), 1 / RATE_HZ, [FREQUENCY_HZ], WINDOW_S)[0] for start in STARTS_M]
    return fit_amplitude_law(tracks, "frequency_hz"), fit_amplitude_law(tracks, "damping_ratio")


def two_modes():
    time = np.arange(2000) / 500.0
    signal = np.zeros(2000)
    for hz, ratio, size in ((12.0, 0.004, 1.0), (31.0, 0.002, 0.3)):
        omega = 2 * np.pi * hz
        signal += size * np.exp(-ratio * omega * time) * np.cos(omega * np.sqrt(1 - ratio**2) * time + size)
    return signal + 1e-3 * np.random.default_rng(3).standard_normal(2000)


def test_two_linear_modes_keep_their_poles():
    tracks = track_ringdown(two_modes(), 1 / 500.0, [12.1, 30.8], 0.5)
    for track, hz, ratio in zip(tracks, (12.0, 31.0), (0.004, 0.002), strict=True):
        assert len(track.time_s) > 8
        assert np.all(np.abs(track.frequency_hz - hz) < SIGMAS * track.frequency_std_hz)
        assert np.all(np.abs(track.damping_ratio - ratio) < SIGMAS * track.damping_ratio_std)
        assert track.frequency_std_hz.max() < 0.02


@pytest.mark.parametrize("unit", [1e-9, 1e6])
def test_deviations_do_not_depend_on_the_unit(unit):
    here, there = (track_ringdown(size * two_modes(), 1 / 500.0, [12.1, 30.8], 0.5)[0] for size in (1.0, unit))
    assert_allclose(there.frequency_std_hz, here.frequency_std_hz, rtol=1e-6)
    assert_allclose(there.damping_ratio_std, here.damping_ratio_std, rtol=1e-6)
    assert_allclose(there.amplitude, unit * here.amplitude, rtol=1e-6)


def test_deviations_do_not_depend_on_the_unit_of_time():
    faster = 1e5
    slow = track_ringdown(two_modes(), 1 / 500.0, [12.1, 30.8], 0.5)[1]
    fast = track_ringdown(two_modes(), 1 / 500.0 / faster, [12.1 * faster, 30.8 * faster], 0.5 / faster)[1]
    assert_allclose(fast.frequency_std_hz, faster * slow.frequency_std_hz, rtol=1e-6)


def test_a_cubic_spring_raises_the_frequency_with_the_square_of_the_amplitude():
    part = 0.04  # k3 / k1 at a unit amplitude
    frequency, damping = laws_of(lambda x, _: part * OMEGA**2 * x**3)
    assert frequency.power == pytest.approx(2.0, rel=BY_SECOND_ORDER)
    assert frequency.change == pytest.approx(3 / 8 * part * FREQUENCY_HZ, rel=BY_SECOND_ORDER)
    assert frequency.offset == pytest.approx(FREQUENCY_HZ, rel=1e-4)
    assert not damping.holds
    assert "cubic" in name_family(frequency, damping)


def test_friction_damps_small_amplitudes_more():
    friction = 3e-4 * OMEGA**2
    frequency, damping = laws_of(lambda _, v: friction * np.tanh(v / 1e-3))
    assert damping.power == pytest.approx(-1.0, abs=0.1)
    assert damping.change == pytest.approx(2 * friction / (np.pi * OMEGA**2), rel=BY_SECOND_ORDER)
    assert "friction" in name_family(frequency, damping)


def test_windows_below_an_amplitude_are_left_out():
    track = track_ringdown(ring(lambda *_: 0.0, 1.0), 1 / RATE_HZ, [FREQUENCY_HZ], WINDOW_S)[0]
    kept = track.above(0.7)
    assert 0 < len(kept.amplitude) < len(track.amplitude)
    assert kept.amplitude.min() > 0.7


@pytest.mark.parametrize(("window_s", "problem"), [(100.0, "longer than"), (0.05, "too short")])
def test_a_window_that_cannot_work_is_refused(window_s, problem):
    with pytest.raises(InputError, match=problem):
        track_ringdown(np.ones(4000), 1 / RATE_HZ, [FREQUENCY_HZ, 12.0], window_s)


def test_one_ringdown_is_not_enough():
    with pytest.raises(InputError, match="two ring-downs"):
        fit_amplitude_law([], "frequency_hz")
