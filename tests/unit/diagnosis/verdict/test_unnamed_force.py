"""A force at one location that springs, dampers and masses only imitate."""

import re

import numpy as np
import pytest

from diagnosed import BAND_HZ, beam, labels, measured, observed
from frf_ipz.diagnosis.diagnose import diagnose
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.fe.response import compute_frfs
from frf_ipz.quantities import FrfQuantity

pytestmark = pytest.mark.slow

IMITATORS = ("attached_resonator", "viscoelastic_joint")
NOISY = 0.004  # with less, two imitators are sought before: that takes longer
DELAY_S = 5e-4
SEEN = 0.05  # of an order: what this noise allows
OUTPUTS, STRUCK = ("17:+z", "9:-z"), "6:+z"


def with_force(model, node, stiffness):
    """Factors by which a dynamic stiffness between a node and the ground changes FRFs, [Sherman1950] on receptances."""

    def receptance(s, outputs, inputs):
        return compute_frfs(model, labels(outputs, inputs, FrfQuantity.RECEPTANCE), s)

    def factors(frequency_hz):
        s, at = 2j * np.pi * frequency_hz, (f"{node}:+z",)
        plain, to_struck = receptance(s, OUTPUTS, (STRUCK,)), receptance(s, at, (STRUCK,))
        from_node = receptance(s, OUTPUTS, at)
        given_back = 1 / (1 / stiffness(s)[:, None] + receptance(s, at, at))
        return 1 - from_node * given_back * to_struck / plain

    return factors


@pytest.fixture(scope="module")
def nominal(tmp_path_factory):
    return beam(tmp_path_factory.mktemp("beam"))


def diagnosed(model, stiffness, effects=IMITATORS):
    frfs = measured(model, factors=with_force(model, 12, stiffness), noise=NOISY)
    return diagnose(observed(frfs), model, options=DiagnoseOptions(effects=effects))


@pytest.mark.parametrize("order", [pytest.param(0.3, marks=pytest.mark.slow), 0.5])
def test_a_fractional_damper_is_not_named_by_what_imitates_it(nominal, order):
    middle = 2 * np.pi * np.sqrt(np.prod(BAND_HZ))
    diagnosis = diagnosed(nominal, lambda s: 300.0 * (s / middle) ** order)
    assert diagnosis.verdict == "unexplained"
    assert diagnosis.mismatch_location == {"nodes": [12]}
    match = re.search(r"at node 12 \(x = 0.344 m\) that grows with the power (\S+) of frequency", diagnosis.statement)
    assert float(match[1]) == pytest.approx(order, abs=SEEN)


def test_a_joint_that_relaxes_once_is_named(nominal):
    time = 1 / (2 * np.pi * 100.0)
    diagnosis = diagnosed(nominal, lambda s: 300.0 * s * time / (1 + s * time))
    assert diagnosis.verdict == "explained"
    assert [finding.effect for finding in diagnosis.findings] == ["viscoelastic_joint"]


def test_a_late_force_is_not_named_by_what_looks_like_it(nominal):
    """Control by a sensor's signal that comes late takes stiffness away, and damps."""
    diagnosis = diagnosed(nominal, lambda s: -40.0 * np.exp(-s * DELAY_S), effects=("local_damper", "added_mass"))
    assert diagnosis.verdict == "unexplained"
    assert diagnosis.mismatch_location == {"nodes": [12]}
    assert "at node 12 (x = 0.344 m) that takes stiffness away, with a loss factor of" in diagnosis.statement
