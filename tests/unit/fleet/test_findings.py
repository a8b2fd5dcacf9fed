"""Whose a finding is: the model's where machines share it, a machine's own where it has it alone."""

import numpy as np
import pytest

from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.result import Estimate, Finding
from frf_ipz.fleet.findings import add_up_findings
from frf_ipz.fleet.machine_record import MachineRecord


def mass(node, kg, *, gain=15.0, also=()):
    return Finding(
        effect="added_mass",
        location=Location.at_node(node),
        location_set=tuple(Location.at_node(other) for other in (node, *also)),
        parameters={"mass_kg": Estimate(value=kg, std=0.01, low=kg - 0.02, high=kg + 0.02)},
        probability=0.99,
        log_evidence_gain=gain,
    )


def spring(node):
    return Finding(
        effect="grounded_spring",
        location=Location.at_node(node),
        parameters={"stiffness_N_m": Estimate(value=1e4, std=100.0, low=9.8e3, high=1.02e4)},
        log_evidence_gain=30.0,
    )


def record(name, *findings, verdict=None, is_searched=True):
    verdict = verdict or ("explained" if findings else "consistent")
    return MachineRecord(machine=name, status="done", verdict=verdict, findings=findings, is_searched=is_searched)


def test_what_all_have_is_the_models_and_what_one_has_is_its_own():
    rng = np.random.default_rng(0)
    machines = [[mass(5, 0.1 + 0.005 * rng.normal())] for _ in range(20)]
    machines[3].append(spring(7))
    found = add_up_findings([record(f"m{k}", *each) for k, each in enumerate(machines)])
    assert [(each.effect, each.of) for each in found] == [("added_mass", "model"), ("grounded_spring", "m3")]
    common = found[0]
    assert common.log_evidence == pytest.approx(20 * 15.0)
    assert common.probability > 0.999
    assert common.value == pytest.approx(0.1, abs=3 * common.std)
    assert common.std < 0.01  # better known than from any one machine
    assert found[1].value == 1e4


def test_neighbouring_locations_of_one_cause_are_one_hypothesis():
    records = [record(f"m{k}", mass(5 + k % 2, 0.1, also=(4, 5, 6))) for k in range(10)]
    (common,) = add_up_findings(records)
    assert (common.of, common.location) == ("model", '{"nodes": [5]}')
    assert len(common.machines) == 10


def test_a_few_of_many_have_it_each_for_itself():
    records = [record(f"m{k}", *([mass(5, 0.1)] if k < 3 else [])) for k in range(60)]
    found = add_up_findings(records)
    assert [each.of for each in found] == ["m0", "m1", "m2"]


def test_one_machine_in_which_it_was_missed_does_not_hide_a_fault_of_the_model():
    records = [record(f"m{k}", *([mass(5, 0.1)] if k else [])) for k in range(20)]
    assert add_up_findings(records)[0].of == "model"


def test_a_search_that_was_cut_short_or_explains_nothing_speaks_against_nothing():
    shown = [record(f"m{k}", mass(5, 0.1, gain=40.0)) for k in range(3)]
    silent = [record(f"s{k}", is_searched=False) for k in range(5)]
    lost = [record(f"u{k}", verdict="unexplained") for k in range(5)]
    assert [each.of for each in add_up_findings([*shown, *silent, *lost])] == ["model"]
    sound = [record(f"c{k}") for k in range(10)]
    assert [each.of for each in add_up_findings([*shown, *sound])] == ["m0", "m1", "m2"]


def test_a_machine_with_another_size_has_a_fault_of_its_own_besides():
    rng = np.random.default_rng(1)
    records = [record(f"m{k:02d}", mass(5, 0.1 + 0.005 * rng.normal() + (0.4 if k == 4 else 0.0))) for k in range(20)]
    found = add_up_findings(records)
    assert [each.of for each in found] == ["model", "m04"]
    assert found[0].value == pytest.approx(0.1, abs=0.01)
    assert found[1].value > 0.4


def test_machines_without_a_diagnosis_say_nothing():
    records = [MachineRecord(machine="m1", status="done"), MachineRecord(machine="m2", status="failed")]
    assert add_up_findings(records) == []
