"""The section on the state space tells motions at rest from modes."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from frf_ipz.plotting.wording import number
from frf_ipz.report.sections.state_space import build
from frf_ipz.runs.results import Results
from synthetic_run import synthetic_folder, with_results

PORTS = ("dt", "state_names", "input_names", "input_units", "output_names", "output_units", "notes")


@pytest.fixture(scope="module")
def run():
    return Results(synthetic_folder())


def poles(run):
    return build(run).blocks[1].rows


def test_every_mode_has_a_row(run):
    frequencies = [float(row[0]) for row in poles(run)]
    assert len(frequencies) == len(run.state_space_arrays.A) / 2
    assert frequencies == sorted(frequencies)


def test_a_free_body_moves_at_no_frequency(run):
    size = len(run.state_space_arrays.A)
    a = np.zeros((size + 2, size + 2))
    a[:size, :size], a[size, size + 1], a[size + 1, size] = run.state_space_arrays.A, 1.0, 1e-9
    ports = {name: getattr(run.state_space_arrays, name) for name in PORTS}
    rows = poles(with_results(run, state_space_arrays=SimpleNamespace(A=a, **ports)))
    assert [row for row in rows if "rigid" in row[0]] == [["0 (rigid body)", "", "model only"]] * 2
    assert rows[2:] == poles(run)


def test_poles_that_no_measured_mode_supports_are_marked_and_said(run):
    section = build(run)
    table = section.blocks[1]
    measured = [pair.measured_value for pair in run.pairs.targets if pair.kind == "pole"]
    supported = [row for place, row in enumerate(table.rows) if place not in table.marked]
    assert [row[2] for row in supported] == [
        f"measured at {number(abs(value) / (2 * np.pi), 6)} Hz" for value in measured
    ]
    assert all(float(row[0]) == pytest.approx(float(row[2].split()[2]), rel=0.02) for row in supported)
    assert {row[2] for place, row in enumerate(table.rows) if place in table.marked} == {"model only"}
    assert f"{len(table.marked)} poles of {len(table.rows)}, marked below, come from the FE model only" in section.lead


def test_without_a_pair_all_poles_come_from_the_model(run):
    alone = with_results(run, pairs=replace(run.pairs, rows=()))
    table = build(alone).blocks[1]
    assert table.marked == frozenset(range(len(table.rows)))
