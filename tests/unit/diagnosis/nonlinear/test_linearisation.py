"""A force law as spring and damper: harmonic balance for a sine, and its DOFs in a model."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from diagnosed import lumped
from frf_ipz.diagnosis.apply import correct_model
from frf_ipz.diagnosis.nonlinear.laws.cubic_stiffness import CubicStiffness
from frf_ipz.diagnosis.nonlinear.laws.dry_friction import DryFriction
from frf_ipz.diagnosis.nonlinear.linearisation import linearise
from frf_ipz.diagnosis.result import Diagnosis, DiagnosisVerdict, LinearisedLaw, Misfit
from frf_ipz.dofs import Dof
from frf_ipz.runs.codec import load_result, save_result

OMEGA, AMPLITUDES = 300.0, np.array([2e-4, 1e-4])
SINE = 1e-3  # relative: whole periods in steps
NODE, SPRING = (Dof(2, "x"),), (Dof(2, "x"), Dof(3, "x"))


def swinging(law, strength, shape=0.0):
    time = np.arange(4000) * 2 * np.pi / OMEGA / 1000
    motion = AMPLITUDES[:, None] * np.sin(OMEGA * time)
    velocity = AMPLITUDES[:, None] * OMEGA * np.cos(OMEGA * time)
    return SimpleNamespace(law=law, strength=strength, shape=shape, motion=motion, velocity=velocity, location=0)


def test_a_cubic_spring_is_that_of_harmonic_balance():
    linear = linearise(swinging(CubicStiffness(), 1e12), SimpleNamespace(ends=[NODE]))
    assert_allclose(linear.motion_rms_m, AMPLITUDES[::-1] / np.sqrt(2), rtol=SINE)
    assert_allclose(linear.stiffness_by_record, 0.75e12 * AMPLITUDES[::-1] ** 2, rtol=SINE)
    assert np.abs(linear.damping_by_record * OMEGA).max() < SINE * linear.stiffness
    assert linear.stiffness_by_record[0] < linear.stiffness < linear.stiffness_by_record[1]
    assert "weakest record, 7.07e-05 m rms" in linear.statement


def test_friction_is_the_damper_of_harmonic_balance():
    linear = linearise(swinging(DryFriction(), 0.5, shape=1e-9), SimpleNamespace(ends=[NODE]))
    assert_allclose(linear.damping_by_record, 4 * 0.5 / (np.pi * AMPLITUDES[::-1] * OMEGA), rtol=0.01)


def test_a_spring_never_gives_energy():
    dying = swinging(CubicStiffness(), 1e12)
    time = np.arange(4000) * 2 * np.pi / OMEGA / 1000
    dying.motion = AMPLITUDES[:, None] * np.exp(-20.0 * time) * np.cos(OMEGA * time)
    dying.velocity = np.gradient(dying.motion, time, axis=1)
    linear = linearise(dying, SimpleNamespace(ends=[NODE]))
    assert (linear.damping_by_record >= 0).all()
    assert (linear.stiffness_by_record > 0).all()


def test_an_impact_that_did_not_move_the_location_does_not_count():
    still = swinging(CubicStiffness(), 1e12)
    still.motion[1], still.velocity[1] = 0.0, 0.0
    assert linearise(still, SimpleNamespace(ends=[NODE])).motion_rms_m.shape == (1,)


@pytest.mark.parametrize("ends", [NODE, SPRING])
def test_the_linear_model_has_spring_and_damper(tmp_path, ends):
    model = lumped(tmp_path)
    nothing = Misfit(training=0.0, held_out=0.0, training_noise=0.0, held_out_noise=0.0)
    law = LinearisedLaw(
        ends=ends,
        stiffness=5e4,
        damping=3.0,
        motion_rms_m=np.array([1e-4]),
        stiffness_by_record=np.array([5e4]),
        damping_by_record=np.array([3.0]),
    )
    diagnosis = Diagnosis(
        verdict=DiagnosisVerdict.EXPLAINED,
        findings=(),
        alternatives=(),
        mismatch_hz=np.zeros(0),
        mismatch_where="",
        mismatch=pd.DataFrame(),
        before=nothing,
        updated=nothing,
        after=nothing,
        held_out_kind="records",
        linearised_law=law,
    )
    changed = correct_model(diagnosis, model)
    motion = dict(zip(reversed(ends), (1.0, -1.0), strict=False))
    row = np.array([motion.get(dof, 0.0) for dof in model.all_dofs])
    assert_allclose((changed.stiffness_all - model.stiffness_all).toarray(), 5e4 * np.outer(row, row))
    assert_allclose((changed.damping_all - model.damping_all).toarray(), 3.0 * np.outer(row, row))
    save_result(diagnosis, tmp_path / "d.result")
    loaded = load_result(tmp_path / "d.result")
    assert loaded.to_json()["linear_model"] == diagnosis.to_json()["linear_model"]
    assert loaded.to_json()["linear_model"]["between"] == [dof.name for dof in ends]
    assert "linear_model" not in replace(diagnosis, linearised_law=None).to_json()
