import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from frf_ipz.diagnosis.nonlinear.laws.finder import shipped_laws
from frf_ipz.diagnosis.nonlinear.laws.law import StepCompliance
from frf_ipz.diagnosis.nonlinear.model.time_stepping import (
    LocationCompliance,
    discretise_modes,
    step_in_time,
    step_tangent,
)

OMEGA, RATIO, STEP_S, N_TIMES = 2 * np.pi * 5.0, 0.02, 1e-4, 6000
SECOND_ORDER = 2e-5  # of the largest motion: the force is linear within steps of 1/2000 of a period
SAME = 1e-10  # of the largest force: rounding errors of 3000 steps
DERIVATIVE = 1e-6  # relative: central differences of time histories, with 6 digits left


def oscillator(*, hold=False):
    modes = discretise_modes(np.array([OMEGA]), np.array([RATIO]), STEP_S, hold=hold)
    return LocationCompliance(modes=modes, weights=np.ones(1))


def linear_motion():
    """Free vibration of a unit mass from a velocity of 1 m/s: motion and velocity, (1, n_times) each."""
    time = STEP_S * np.arange(N_TIMES)
    pole = OMEGA * (-RATIO + 1j * np.sqrt(1 - RATIO**2))
    z = np.exp(pole * time)
    return (z.imag / pole.imag)[None], ((pole * z).imag / pole.imag)[None]


def test_hardening_oscillator_is_integrated():
    k3 = 3e6
    history = step_in_time(shipped_laws()["cubic_stiffness"], (k3, 0.0), oscillator(), *linear_motion())

    def derivative(_, y):
        return [y[1], -2 * RATIO * OMEGA * y[1] - OMEGA**2 * y[0] - k3 * y[0] ** 3]

    time = STEP_S * np.arange(N_TIMES)
    solution = solve_ivp(derivative, (0, time[-1]), [0, 1.0], t_eval=time, rtol=1e-10, atol=1e-14).y[0]
    assert np.abs(solution - linear_motion()[0][0]).max() > 0.5 * np.abs(solution).max()  # the law matters
    assert_allclose(history.motion[0], solution, rtol=0, atol=20 * SECOND_ORDER * np.abs(solution).max())


def test_friction_shortens_every_half_swing_alike_and_then_sticks():
    friction = 0.5
    modes = discretise_modes(np.array([OMEGA]), np.array([1e-9]), STEP_S, hold=True)
    time = STEP_S * np.arange(N_TIMES)
    motion, velocity = np.cos(OMEGA * time)[None] * 3e-3, -OMEGA * np.sin(OMEGA * time)[None] * 3e-3
    compliance = LocationCompliance(modes=modes, weights=np.ones(1))
    history = step_in_time(shipped_laws()["dry_friction"], (friction, 0.0), compliance, motion, velocity)
    drop, half = 2 * friction / OMEGA**2, np.pi / OMEGA
    turns = np.array([np.interp(half * k, time, history.motion[0]) for k in range(3)])
    expected = [3e-3, -(3e-3 - drop), 3e-3 - 2 * drop]
    assert_allclose(turns, expected, rtol=0, atol=1e-2 * drop)  # a half swing ends within one of 1000 steps
    assert_allclose(history.velocity[0, -200:], 0.0, atol=1e-9)
    assert abs(history.force[0, -1]) < friction


@pytest.mark.parametrize(
    ("name", "numbers"), [("cubic_stiffness", (3e6, 0.0)), ("gap_contact", (4e3, 4e-3)), ("dry_friction", (12.0, 0.0))]
)
def test_the_tangent_follows_small_changes(name, numbers):
    law = shipped_laws()[name]
    compliance, (w, v) = oscillator(hold=law.holds), linear_motion()
    history = step_in_time(law, numbers, compliance, w, v)
    change = 0.3 * np.stack([w, v], 1)[:, None]
    solution = step_tangent(law, compliance, history, change)

    def force(scale=0.0, strength=0.0):
        return step_in_time(
            law, (numbers[0] * (1 + strength), numbers[1]), compliance, w * (1 + 0.3 * scale), v * (1 + 0.3 * scale)
        ).force

    h = 1e-6
    by_change = (force(scale=h) - force(scale=-h)) / (2 * h)
    by_strength = (force(strength=h) - force(strength=-h)) / (2 * h)
    assert np.linalg.norm(by_change) > 0
    for tangent, difference in zip(solution.swapaxes(0, 1), (by_change, by_strength), strict=False):
        assert np.linalg.norm(tangent - difference) <= DERIVATIVE * np.linalg.norm(difference)


class StepByStep:
    """A law whose force is asked for one step after the other."""

    def __init__(self, law, compliance):
        self.law, self.modes, self.outputs = law, compliance.modes, compliance.output_weights.T
        self.per_unit = compliance.per_unit_force()

    def force(self, numbers, motion, velocity):
        step, modes = StepCompliance(*self.per_unit, *numbers), self.modes
        z, forces = np.zeros((len(modes.poles), len(motion)), complex), np.zeros(motion.shape)
        for k in range(motion.shape[1]):
            w, v = (self.outputs @ z).imag
            forces[:, k] = self.law.solve(motion[:, k] + w, velocity[:, k] + v, step)
            z = modes.turn[:, None] * z - (modes.turn * modes.after + modes.before)[:, None] * forces[:, k]
        return forces


@pytest.mark.parametrize(
    ("name", "numbers", "most_asked"),
    [
        ("cubic_stiffness", (3e6, 0.0), 0.5),
        ("cubic_stiffness", (-3e4, 0.0), 0.5),
        ("gap_contact", (4e3, 4e-3), 0.5),
        ("dry_friction", (12.0, 0.0), 2.0),
        ("dry_friction", (0.5, 0.0), 2.0),
    ],
)
def test_steps_that_are_taken_at_once_give_what_steps_one_by_one_give(name, numbers, most_asked):
    """Two modes, two segments, and a last block that is shorter; the law is asked less often than there are steps."""
    law = shipped_laws()[name]
    modes = discretise_modes(np.array([OMEGA, 7.3 * OMEGA]), np.array([RATIO, 0.01]), STEP_S, hold=law.holds)
    compliance, (w, v) = LocationCompliance(modes=modes, weights=np.array([1.0, 0.6])), linear_motion()
    motion, velocity = np.concatenate([w, 0.3 * w])[:, :3001], np.concatenate([v, 0.3 * v])[:, :3001]
    expected = StepByStep(law, compliance).force(numbers, motion, velocity)
    asked = 0

    class Counted(type(law)):
        def solve(self, w, v, step):
            """Count."""
            nonlocal asked
            asked += 1
            return super().solve(w, v, step)

    force = step_in_time(Counted(), numbers, compliance, motion, velocity).force
    assert np.abs(expected).max() > 0
    assert_allclose(force, expected, rtol=0, atol=SAME * np.abs(expected).max())
    assert asked < most_asked * motion.shape[1]


def test_a_motion_that_diverges_is_not_a_number_to_its_end():
    law, compliance = shipped_laws()["cubic_stiffness"], oscillator()
    with np.errstate(all="ignore"):
        force = step_in_time(law, (-3e8, 0.0), compliance, *linear_motion()).force
    assert not np.isfinite(force[0, -1])


def test_the_tangent_follows_a_small_force_beside_a_law():
    law, compliance, (w, v) = shipped_laws()["cubic_stiffness"], oscillator(), linear_motion()
    k3, spring = 3e6, 2e3

    class LawAndSpring(type(law)):
        part = 0.0

        def solve(self, w, v, step):
            """With a spring beside it."""
            del v
            force = np.zeros_like(w)
            for _ in range(8):  # the motion by the force of a step is small
                moved = w - step.motion * force
                force = k3 * moved**3 + self.part * spring * moved
            return force

    def force(part):
        law_and_spring = LawAndSpring()
        law_and_spring.part = part
        return step_in_time(law_and_spring, (k3, 0.0), compliance, w, v).force

    history = step_in_time(law, (k3, 0.0), compliance, w, v)
    no_changes = np.zeros((len(w), 0, 2, w.shape[1]))
    solution = step_tangent(law, compliance, history, no_changes, spring * history.motion[None])[:, -1]
    h = 1e-5
    expected = (force(h) - force(-h)) / (2 * h)
    assert np.linalg.norm(expected) > 0
    assert np.linalg.norm(solution - expected) <= DERIVATIVE * np.linalg.norm(expected)


@pytest.mark.parametrize("turned", [0.05, 0.3, 0.6])
def test_aliasing_of_sampling_is_corrected(turned):
    """The response to a force of a frequency that turns so far in a step, against the exact receptance."""
    step = turned / OMEGA
    modes = discretise_modes(np.array([OMEGA]), np.array([0.1]), step)
    pulse = np.zeros((1, 4096))
    pulse[0, 0] = 1 / step
    w = np.linspace(0.2, 1.2, 11) * OMEGA
    turns = np.exp(-1j * w[:, None] * step * np.arange(4096)) * step
    solution = turns @ modes.displacement(modes.drive(pulse))[0]
    exact = 1 / (OMEGA**2 - w**2 + 0.2j * OMEGA * w)
    linear_holds = turned**2 / 12  # droop of a force that is linear within a step
    assert np.abs(solution / exact - 1).max() < 0.1 * linear_holds


def test_a_stop_with_long_steps_is_integrated():
    """Steps of 1/20 of a period on the stop: after ten contacts, the motion still fits."""
    numbers, step = (3 * OMEGA**2, 0.01), 0.005
    time = step * np.arange(400)
    pole = OMEGA * (-RATIO + 1j * np.sqrt(1 - RATIO**2))
    z = np.exp(pole * time)
    modes = discretise_modes(np.array([OMEGA]), np.array([RATIO]), step)
    history = step_in_time(
        shipped_laws()["gap_contact"],
        numbers,
        LocationCompliance(modes=modes, weights=np.ones(1)),
        (z.imag / pole.imag)[None],
        ((pole * z).imag / pole.imag)[None],
    )

    def derivative(_, y):
        return [y[1], -2 * RATIO * OMEGA * y[1] - OMEGA**2 * y[0] - numbers[0] * max(y[0] - numbers[1], 0)]

    solution = solve_ivp(derivative, (0, time[-1]), [0, 1.0], t_eval=time, rtol=1e-10, atol=1e-14, max_step=step).y[0]
    assert np.linalg.norm(history.motion[0] - solution) < 0.025 * np.linalg.norm(
        solution
    )  # forces linear in a step miss 0.046


@pytest.mark.parametrize("per_period", [33.4, 40.37, 47.7])
def test_held_friction_is_neither_early_nor_late(per_period):
    """Turns of a free vibration lie anywhere in a step; forces held over the step before their time miss by 0.04."""
    friction, first, step = 0.5, 10e-3, 1 / (5.0 * per_period)
    time = step * np.arange(int(3.9 * per_period))
    modes = discretise_modes(np.array([OMEGA]), np.array([1e-9]), step, hold=True)
    motion, velocity = first * np.cos(OMEGA * time)[None], -first * OMEGA * np.sin(OMEGA * time)[None]
    compliance = LocationCompliance(modes=modes, weights=np.ones(1))
    history = step_in_time(shipped_laws()["dry_friction"], (friction, 0.0), compliance, motion, velocity)
    swing, drop = np.floor(OMEGA * time / np.pi), friction / OMEGA**2
    exact = (first - (2 * swing + 1) * drop) * np.cos(OMEGA * time) + drop * (-1) ** swing
    assert np.linalg.norm(history.motion[0] - exact) < 0.02 * np.linalg.norm(exact - motion[0])
