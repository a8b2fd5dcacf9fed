"""Nonlinear laws against an adaptive integrator."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from frf_testbench.simulator.effects.nonlinear import draw_law_location
from frf_testbench.simulator.signals.forces import Impact
from frf_testbench.simulator.signals.laplace import LaplaceGrid
from frf_testbench.simulator.signals.laws import BoucWen, Coulomb, Gap, PowerSpring, SquareDrag, TwoSided
from frf_testbench.simulator.signals.receptance import ModalReceptance
from frf_testbench.simulator.signals.time_stepping import integrate_law_force, step_weights

OMEGA = 2 * np.pi * np.array([20.0, 57.0, 130.0])
RATIO = np.full(3, 0.005)
SHAPES = np.array([[1.0, -0.8, 0.7], [0.6, 0.9, -0.5]])  # struck point, place of the law
IMPACT = Impact(peak_n=50.0, start_s=0.01, contact_s=0.004)
STIFFNESS = 1 / np.sum(SHAPES[1] ** 2 / OMEGA**2)  # of the place
SWING = 7.5e-4  # of the place without a law, m
SMOOTH = 2e-3  # change of the responses when the steps are doubled again, for smooth laws

MODEL = ModalReceptance(omega_rad_s=OMEGA, damping_ratio=RATIO, shapes=SHAPES, static=np.zeros((2, 2)))


def simulate(law, oversampling):
    grid = LaplaceGrid(n_samples=250, rate_hz=500.0, oversampling=oversampling)
    excitation = grid.spectrum(IMPACT.force(grid.fine_time_s), all_lines=True)
    w = MODEL(grid.fine_s, [1], [0])[:, 0, 0] * excitation
    step = 1 / (500.0 * oversampling)
    force = integrate_law_force(
        MODEL, np.array([0.0, 1.0]), law, grid.fine_signal(w)[None], grid.fine_signal(grid.fine_s * w)[None], step
    )[0]
    felt = grid.spectrum(force) * (np.exp(grid.s * step / 2) if law.is_constant_within_step else 1.0)
    direct = MODEL(grid.s, [1], [0])[:, 0, 0] * grid.spectrum(IMPACT.force(grid.fine_time_s))
    return grid.signal(direct - MODEL(grid.s, [1], [1])[:, 0, 0] * felt)


def integrate(force):
    def derivative(time, state):
        q, p = state[:3], state[3:]
        load = SHAPES[0] * IMPACT.force(np.array([time]))[0] - SHAPES[1] * force(SHAPES[1] @ q, SHAPES[1] @ p)
        return np.concatenate([p, load - 2 * RATIO * OMEGA * p - OMEGA**2 * q])

    time = np.arange(250) / 500.0
    done = solve_ivp(
        derivative, (0, 0.5), np.zeros(6), method="DOP853", t_eval=time, rtol=1e-8, atol=1e-11, max_step=1e-3
    )
    return SHAPES[1] @ done.y[:3]


@pytest.mark.parametrize(
    ("law", "force"),
    [
        (PowerSpring(stiffness=STIFFNESS / SWING**2, power=3), lambda w, _v: STIFFNESS / SWING**2 * w**3),
        (PowerSpring(stiffness=0.2 * STIFFNESS / SWING, power=2), lambda w, _v: 0.2 * STIFFNESS / SWING * w**2),
        (Gap(stiffness=0.5 * STIFFNESS, gap=0.3 * SWING), lambda w, _v: 0.5 * STIFFNESS * max(w - 0.3 * SWING, 0.0)),
        (
            TwoSided(stiffness=0.5 * STIFFNESS, gap=0.3 * SWING),
            lambda w, _v: 0.5 * STIFFNESS * np.sign(w) * max(abs(w) - 0.3 * SWING, 0.0),
        ),
        (
            SquareDrag(drag=0.1 * STIFFNESS / (SWING * OMEGA[0] ** 2)),
            lambda _w, v: 0.1 * STIFFNESS / (SWING * OMEGA[0] ** 2) * v * abs(v),
        ),
    ],
    ids=["cubic", "quadratic", "gap", "two-sided", "drag"],
)
def test_laws_move_the_structure_as_an_adaptive_integrator_says(law, force):
    expected = integrate(force)
    error = np.linalg.norm(simulate(law, 32) - expected) / np.linalg.norm(expected)
    assert error < SMOOTH
    assert np.linalg.norm(expected - integrate(lambda _w, _v: 0.0)) > 0.02 * np.linalg.norm(expected)  # the law matters


def test_friction_agrees_with_a_steep_smooth_law_and_stops_the_motion():
    friction = 0.02 * STIFFNESS * SWING
    expected = integrate(lambda _w, v: friction * np.tanh(v / (2e-4 * SWING * OMEGA[0])))
    got = simulate(Coulomb(friction=friction), 64)
    assert np.linalg.norm(got - expected) / np.linalg.norm(expected) < 0.03  # the smooth law creeps
    stuck = simulate(Coulomb(friction=20 * STIFFNESS * SWING), 16)
    free = integrate(lambda _w, _v: 0.0)
    assert np.abs(stuck).max() < 0.02 * np.abs(free).max()  # one step of motion before it is held


def test_hysteresis_is_a_spring_in_small_motions_and_slips_in_large_ones():
    small = simulate(BoucWen(stiffness=0.5 * STIFFNESS, yield_m=1e3 * SWING), 32)
    expected = integrate(lambda w, _v: 0.5 * STIFFNESS * w)
    assert np.linalg.norm(small - expected) / np.linalg.norm(expected) < 0.01  # explicit in the slope
    law = BoucWen(stiffness=1.0, yield_m=0.1)
    law.restart(1)
    for w in np.linspace(0, 5, 2000):
        force = law.force(np.array([w]), np.zeros(1), 0.0, 0.0)
    assert_allclose(force, 0.1, rtol=1e-3)  # the slip force, approached exponentially


def test_a_structure_that_runs_away_is_refused():
    with pytest.raises(FloatingPointError):
        simulate(PowerSpring(stiffness=-50 * STIFFNESS / SWING**2, power=3), 16)


@pytest.mark.parametrize(
    ("law", "force"),
    [
        (PowerSpring(stiffness=3.0, power=3), lambda w, _v: 3 * w**3),
        (Gap(stiffness=5.0, gap=0.2), lambda w, _v: 5 * np.maximum(w - 0.2, 0)),
        (TwoSided(stiffness=5.0, gap=0.2), lambda w, _v: 5 * np.sign(w) * np.maximum(np.abs(w) - 0.2, 0)),
        (SquareDrag(drag=2.0), lambda _w, v: 2 * v * np.abs(v)),
    ],
    ids=["cubic", "gap", "two-sided", "drag"],
)
def test_a_law_knows_that_its_force_moves_its_place(law, force):
    w, v = np.linspace(-1, 1, 21), np.linspace(2, -2, 21)
    law.restart(w.size)
    got = law.force(w, v, 0.05, 0.3)
    assert_allclose(got, force(w - 0.05 * got, v - 0.3 * got), rtol=1e-6, atol=1e-9)  # three steps of Newton's method


def test_a_law_sits_where_impacts_move_something():
    target = SimpleNamespace(
        specimen=SimpleNamespace(drawing=None),
        nodes=(1, 2),
        point=int,
        peak_motion=lambda motion: (float(motion[0] == 2), 0.0),
    )
    for seed in range(10):
        assert draw_law_location(np.random.default_rng(seed), target) == ((2, None), {"nodes": [2]})


def test_weights_of_a_step_are_integrals():
    u = (np.arange(200_000) + 0.5) / 200_000
    for a in (-0.001 + 0.005j, -0.02 + 0.3j, -0.3 + 4j):
        decay, first, last = step_weights(np.array([a]))
        kernel = np.exp(a * (1 - u))
        assert_allclose(decay[0], np.exp(a), rtol=1e-12)
        assert_allclose(first[0], np.mean(kernel * (1 - u)), rtol=1e-8)  # midpoint rule on 200 000 steps
        assert_allclose(last[0], np.mean(kernel * u), rtol=1e-8)


@pytest.mark.parametrize("law", [Coulomb(friction=0.02), SquareDrag(drag=20.0)], ids=["friction", "drag"])
def test_a_stiff_mode_and_its_static_compliance_feel_the_same_law(law):
    high = 2 * np.pi * 3000.0
    shapes = np.hstack([SHAPES, [[0.0], [20.0]]])
    summed = ModalReceptance(
        omega_rad_s=np.append(OMEGA, high), damping_ratio=np.append(RATIO, 0.3), shapes=shapes, static=np.zeros((2, 2))
    )
    static = replace(MODEL, static=np.diag([0.0, (20.0 / high) ** 2]))
    time = np.arange(4000) / 20_000
    motion = 1e-3 * np.sin(2 * np.pi * 25 * time) * np.minimum(time / 0.02, 1)
    velocity = np.gradient(motion, time)
    one, other = (
        integrate_law_force(model, np.array([0.0, 1.0]), law, motion[None], velocity[None], 1 / 20_000)[0]
        for model in (summed, static)
    )
    assert np.linalg.norm(one - other) < 0.05 * np.linalg.norm(one)  # the stiff mode is not quite static
