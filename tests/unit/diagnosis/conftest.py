"""A chain of four masses, struck by a hammer and measured, integrated by SciPy's adaptive Runge-Kutta method."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from frf_ipz.diagnosis.observations import Observations, ObservedRecord, Sensor
from frf_ipz.dofs import parse_dof
from frf_ipz.fe.model_file import read_model
from frf_ipz.quantities import FrfQuantity

MASS_KG, STIFFNESS_N_M, RATIO = 1.0, 4e4, 0.01
N = 4
RATE_HZ, N_SAMPLES = 400.0, 1600  # the highest mode is at 60 Hz
PULSE_S, PULSE_START_S = 0.012, 0.2
BAND_HZ = (4.0, 75.0)
LEVELS_N = (100.0, 55.0, 30.0, 15.0)
NOISE = 1e-5  # of the largest response
INTEGRATION = 1e-9  # relative: far below the noise


@pytest.fixture(scope="session")
def chain_like(tmp_path_factory):
    """Makes models of the chain, of another damping or stiffness."""

    def make(*, ratio=RATIO, stiffness_n_m=STIFFNESS_N_M):
        text = (
            f'[model]\nkind = "lumped"\nname = "chain"\n[damping]\nmodal_ratio = {ratio}\n[lumped]\ndirection = "x"\n'
        )
        for node in range(1, N + 1):
            text += f"[[lumped.mass]]\nnode = {node}\nmass_kg = {MASS_KG}\n"
            text += (
                f'[[lumped.spring]]\nid = "k{node}"\nnodes = [{node - 1}, {node}]\nstiffness_N_m = {stiffness_n_m}\n'
            )
        path = tmp_path_factory.mktemp("chain") / "model.toml"
        path.write_text(text, encoding="utf-8")
        return read_model(path)

    return make


@pytest.fixture(scope="session")
def chain(chain_like):
    """Model, and the same as matrices."""
    K = STIFFNESS_N_M * (2 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1))
    K[-1, -1] = STIFFNESS_N_M
    values, shapes = np.linalg.eigh(K / MASS_KG)
    C = shapes @ np.diag(2 * RATIO * np.sqrt(values)) @ shapes.T * MASS_KG
    return SimpleNamespace(model=chain_like(), M=MASS_KG * np.eye(N), K=K, C=C)


def pulse(time_s, peak_n):
    """Smooth impact, without anything above the sampling rate's half."""
    part = np.clip((time_s - PULSE_START_S) / PULSE_S, 0, 1)
    return peak_n * np.sin(np.pi * part) ** 4


@pytest.fixture(scope="session")
def strike(chain):
    """Strikes node 1 at several levels, with a force at locations: law(w, v) times a vector of DOF."""

    free = np.block([[np.zeros((N, N)), np.eye(N)], [-chain.K / MASS_KG, -chain.C / MASS_KG]])

    @cache
    def run(law=None, where=(0, 0, 1, 0), seed=1):
        where = np.array(where, float)
        time = np.arange(N_SAMPLES) / RATE_HZ
        rng = np.random.default_rng(seed)
        accelerations = []
        for peak in LEVELS_N:

            def derivative(t, y, peak=peak):
                rate = free @ y
                if PULSE_START_S < t < PULSE_START_S + PULSE_S:
                    rate[N] += pulse(t, peak) / MASS_KG
                if law is not None:
                    rate[N:] -= where * (law(where @ y[:N], where @ y[N:]) / MASS_KG)
                return rate

            solution = solve_ivp(
                derivative,
                (0, time[-1]),
                np.zeros(2 * N),
                method="DOP853",  # of high order: fewer steps
                t_eval=time,
                rtol=INTEGRATION,
                atol=1e-14,
                max_step=2e-3,
            )
            accelerations.append(
                np.array([derivative(t, y)[N:] for t, y in zip(time, solution.y.T, strict=True)])[:, [1, 3]].T
            )
        largest = np.abs(accelerations).max()
        sensors = tuple(
            Sensor(channel=f"acc_{node}", dof=parse_dof(f"{node}:+x"), quantity=FrfQuantity.ACCELERANCE)
            for node in (2, 4)
        )
        records = tuple(
            ObservedRecord(
                name=f"impact {peak:g} N",
                input_channel="force",
                input_dof=parse_dof("1:+x"),
                sensors=sensors,
                step_s=1 / RATE_HZ,
                force=pulse(time, peak) + NOISE * peak * rng.standard_normal(N_SAMPLES),
                responses=acceleration + NOISE * largest * rng.standard_normal(acceleration.shape),
            )
            for peak, acceleration in zip(LEVELS_N, accelerations, strict=True)
        )
        return Observations(kind="hammer", records=records, band_hz=BAND_HZ)

    return run


@pytest.fixture(scope="session")
def random_records():
    def make(observations, loud_s):
        """Turn impacts into records of a shaker from rest, thirty times as strong about a time."""
        records = []
        for seed, record in enumerate(observations.records[:2]):
            time = record.step_s * np.arange(record.n_samples)
            noise = np.convolve(np.random.default_rng(seed).standard_normal(len(time)), np.ones(8) / 8, "same")
            force = noise * np.clip(20 * time / time[-1], 0, 1) * (1 + 29 * np.exp(-(((time - loud_s) / 0.05) ** 2)))
            records.append(replace(record, force=force, responses=np.tile(force, (len(record.sensors), 1))))
        return replace(observations, kind="random", records=tuple(records))

    return make
