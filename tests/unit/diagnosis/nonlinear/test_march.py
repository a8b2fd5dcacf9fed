import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from frf_ipz.diagnosis.nonlinear.fitting.time_stepping import Yielding, make_modes, step_in_time, step_tangent
from frf_ipz.diagnosis.nonlinear.laws.finder import shipped_laws

OMEGA, RATIO, STEP_S, N_TIMES = 2 * np.pi * 5.0, 0.02, 1e-4, 6000
SECOND_ORDER = 2e-5  # of the largest motion: the force is linear within steps of 1/2000 of a period
DERIVATIVE = 1e-6  # relative: central differences of a march, with 6 digits left


def oscillator(*, constant=False):
    modes = make_modes(np.array([OMEGA]), np.array([RATIO]), STEP_S, constant=constant)
    return Yielding(modes=modes, weights=np.ones(1))


def linear_motion():
    """Free vibration of a unit mass from a velocity of 1 m/s: motion and velocity, (1, n_times) each."""
    time = STEP_S * np.arange(N_TIMES)
    pole = OMEGA * (-RATIO + 1j * np.sqrt(1 - RATIO**2))
    z = np.exp(pole * time)
    return (z.imag / pole.imag)[None], ((pole * z).imag / pole.imag)[None]


def test_hardening_oscillator_is_integrated():
    k3 = 3e6
    done = step_in_time(shipped_laws()["cubic_stiffness"], (k3, 0.0), oscillator(), *linear_motion())

    def derivative(_, y):
        return [y[1], -2 * RATIO * OMEGA * y[1] - OMEGA**2 * y[0] - k3 * y[0] ** 3]

    time = STEP_S * np.arange(N_TIMES)
    found = solve_ivp(derivative, (0, time[-1]), [0, 1.0], t_eval=time, rtol=1e-10, atol=1e-14).y[0]
    assert np.abs(found - linear_motion()[0][0]).max() > 0.5 * np.abs(found).max()  # the law matters
    assert_allclose(done.motion[0], found, rtol=0, atol=20 * SECOND_ORDER * np.abs(found).max())


def test_friction_takes_the_same_off_every_half_swing_and_then_sticks():
    friction = 0.5
    modes = make_modes(np.array([OMEGA]), np.array([1e-9]), STEP_S, constant=True)
    time = STEP_S * np.arange(N_TIMES)
    motion, velocity = np.cos(OMEGA * time)[None] * 3e-3, -OMEGA * np.sin(OMEGA * time)[None] * 3e-3
    place = Yielding(modes=modes, weights=np.ones(1))
    done = step_in_time(shipped_laws()["dry_friction"], (friction, 0.0), place, motion, velocity)
    drop, half = 2 * friction / OMEGA**2, np.pi / OMEGA
    turns = np.array([np.interp(half * k, time, done.motion[0]) for k in range(3)])
    expected = [3e-3, -(3e-3 - drop), 3e-3 - 2 * drop]
    assert_allclose(turns, expected, rtol=0, atol=1e-2 * drop)  # a half swing ends within one of 1000 steps
    assert_allclose(done.velocity[0, -200:], 0.0, atol=1e-9)
    assert abs(done.force[0, -1]) < friction


@pytest.mark.parametrize(
    ("name", "numbers"), [("cubic_stiffness", (3e6, 0.0)), ("gap_contact", (4e3, 4e-3)), ("dry_friction", (12.0, 0.0))]
)
def test_small_changes_are_followed(name, numbers):
    law = shipped_laws()[name]
    place, (w, v) = oscillator(constant=law.holds), linear_motion()
    done = step_in_time(law, numbers, place, w, v)
    change = np.stack([0.3 * w, 0.3 * v])[None]
    found = step_tangent(law, place, done, change)

    def force(scale=0.0, strength=0.0):
        return step_in_time(
            law, (numbers[0] * (1 + strength), numbers[1]), place, w * (1 + 0.3 * scale), v * (1 + 0.3 * scale)
        ).force

    h = 1e-6
    by_change = (force(scale=h) - force(scale=-h)) / (2 * h)
    by_strength = (force(strength=h) - force(strength=-h)) / (2 * h)
    assert np.linalg.norm(by_change) > 0
    for mine, other in zip(found, (by_change, by_strength), strict=False):
        assert np.linalg.norm(mine - other) <= DERIVATIVE * np.linalg.norm(other)


def test_a_small_force_besides_a_law_is_followed():
    law, place, (w, v) = shipped_laws()["cubic_stiffness"], oscillator(), linear_motion()
    k3, spring = 3e6, 2e3

    class Both(type(law)):
        part = 0.0

        def solve(self, w, v, step):
            """With a spring besides."""
            del v
            force = np.zeros_like(w)
            for _ in range(8):  # what a step gives way by is small
                moved = w - step.motion * force
                force = k3 * moved**3 + self.part * spring * moved
            return force

    def force(part):
        both = Both()
        both.part = part
        return step_in_time(both, (k3, 0.0), place, w, v).force

    done = step_in_time(law, (k3, 0.0), place, w, v)
    found = step_tangent(law, place, done, np.zeros((0, 2, *w.shape)), spring * done.motion[None])[-1]
    h = 1e-5
    expected = (force(h) - force(-h)) / (2 * h)
    assert np.linalg.norm(expected) > 0
    assert np.linalg.norm(found - expected) <= DERIVATIVE * np.linalg.norm(expected)


@pytest.mark.parametrize("turned", [0.05, 0.3, 0.6])
def test_what_sampling_folds_down_is_taken_back(turned):
    """The response to a force of a frequency that turns so far in a step, against the exact receptance."""
    step = turned / OMEGA
    modes = make_modes(np.array([OMEGA]), np.array([0.1]), step)
    pulse = np.zeros((1, 4096))
    pulse[0, 0] = 1 / step
    w = np.linspace(0.2, 1.2, 11) * OMEGA
    turns = np.exp(-1j * w[:, None] * step * np.arange(4096)) * step
    found = turns @ modes.displacement(modes.drive(pulse))[0]
    exact = 1 / (OMEGA**2 - w**2 + 0.2j * OMEGA * w)
    linear_holds = turned**2 / 12  # what a force that is linear within a step droops by
    assert np.abs(found / exact - 1).max() < 0.1 * linear_holds


def test_a_stop_is_hit_as_hard_with_long_steps_as_in_truth():
    """Steps of 1/20 of a period on the stop: ten blows against it later, the motion still fits."""
    numbers, step = (3 * OMEGA**2, 0.01), 0.005
    time = step * np.arange(400)
    pole = OMEGA * (-RATIO + 1j * np.sqrt(1 - RATIO**2))
    z = np.exp(pole * time)
    modes = make_modes(np.array([OMEGA]), np.array([RATIO]), step)
    done = step_in_time(
        shipped_laws()["gap_contact"],
        numbers,
        Yielding(modes=modes, weights=np.ones(1)),
        (z.imag / pole.imag)[None],
        ((pole * z).imag / pole.imag)[None],
    )

    def derivative(_, y):
        return [y[1], -2 * RATIO * OMEGA * y[1] - OMEGA**2 * y[0] - numbers[0] * max(y[0] - numbers[1], 0)]

    found = solve_ivp(derivative, (0, time[-1]), [0, 1.0], t_eval=time, rtol=1e-10, atol=1e-14, max_step=step).y[0]
    assert np.linalg.norm(done.motion[0] - found) < 0.025 * np.linalg.norm(found)  # forces linear in a step miss 0.046


@pytest.mark.parametrize("per_period", [33.4, 40.37, 47.7])
def test_held_friction_is_neither_early_nor_late(per_period):
    """Turns of a free vibration lie anywhere in a step; forces held over the step before their time miss by 0.04."""
    friction, first, step = 0.5, 10e-3, 1 / (5.0 * per_period)
    time = step * np.arange(int(3.9 * per_period))
    modes = make_modes(np.array([OMEGA]), np.array([1e-9]), step, constant=True)
    motion, velocity = first * np.cos(OMEGA * time)[None], -first * OMEGA * np.sin(OMEGA * time)[None]
    place = Yielding(modes=modes, weights=np.ones(1))
    done = step_in_time(shipped_laws()["dry_friction"], (friction, 0.0), place, motion, velocity)
    swing, drop = np.floor(OMEGA * time / np.pi), friction / OMEGA**2
    exact = (first - (2 * swing + 1) * drop) * np.cos(OMEGA * time) + drop * (-1) ** swing
    assert np.linalg.norm(done.motion[0] - exact) < 0.02 * np.linalg.norm(exact - motion[0])
