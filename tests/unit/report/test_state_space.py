"""The section on the state space tells motions at rest from modes."""

from types import SimpleNamespace

import numpy as np
import pytest

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
    assert [row for row in rows if "rigid" in row[0]] == [["0 (rigid body)", ""]] * 2
    assert rows[2:] == poles(run)
