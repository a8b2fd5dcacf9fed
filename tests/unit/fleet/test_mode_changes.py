"""Two tests of one structure: what has moved is said with its deviation, what has not is left alone."""

import math
from dataclasses import replace

import numpy as np
import pytest

import frf_ipz
from frf_ipz.cli.comparison import compare_folders
from frf_ipz.fleet.comparison_page import write_comparison
from frf_ipz.fleet.machine_record import Roots
from frf_ipz.fleet.mode_changes import ModeChange, ModeOutcome, _matched_places

LINES = np.arange(5.0, 400.0, 0.5)
OUTPUTS = ("11:+z", "6:+z")
BEAM = {
    "length_m": 0.5,
    "width_m": 0.02,
    "thickness_m": 0.005,
    "density_kg_m3": 2700,
    "elements": 10,
    "left": "clamped",
    "modal_ratio": 0.01,
}


def run(out, *, seed, modulus_Pa=70e9, scale="none", **changes):
    beam = frf_ipz.make_beam(**BEAM, youngs_modulus_Pa=modulus_Pa, **changes)
    labels = [frf_ipz.FrfLabel(frf_ipz.parse_dof(dof), frf_ipz.parse_dof("11:+z"), "accelerance") for dof in OUTPUTS]
    values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * LINES)
    std = 0.01 * np.median(np.abs(values))
    noise = std / np.sqrt(2) * np.random.default_rng(seed).normal(size=(*values.shape, 2)).view(complex)[..., 0]
    frfs = frf_ipz.FrfSet.from_arrays(
        LINES,
        (values + noise)[:, :, None],
        outputs=OUTPUTS,
        inputs=["11:+z"],
        variance=np.full((*values.shape, 1), std**2),
        unknown_scale=scale,
    )
    return frf_ipz.Campaign(frfs).run(out)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("states")
    spring = frf_ipz.BeamPointSpring(node=11, stiffness_N_m=300.0)
    return {
        "before": run(folder / "before", seed=1),
        "again": run(folder / "again", seed=2),
        "softer": run(folder / "softer", seed=3, modulus_Pa=68e9, scale="common"),
        "held": run(folder / "held", seed=4, point_spring=[spring]),
    }


def test_nothing_has_moved_where_nothing_was_changed(runs):
    found = frf_ipz.compare_runs(runs["before"], runs["again"])
    assert found.statement == "No frequency of 3 modes has moved beyond its deviations."
    assert found.additions == ()
    assert [mode.outcome for mode in found.modes] == [ModeOutcome.SAME] * 3


def test_a_softer_structure_is_said_to_be_softer_or_heavier(runs):
    found = frf_ipz.compare_runs(runs["before"], runs["softer"])
    true = math.sqrt(68 / 70) - 1
    assert found.statement == "3 of 3 modes have moved, by -1.4 %: the structure is softer or heavier."
    assert "amplitudes of FRFs do not either where their scale is unknown" in found.additions[-1]
    for mode in found.modes:
        assert abs(mode.change - true) < 4 * mode.change_std
        assert mode.mac > 0.99


def test_a_mode_that_has_moved_far_is_still_the_same_mode(runs):
    """A spring at the tip lifts the first mode by half, beyond what matching with a model allows, and no other so."""
    found = frf_ipz.compare_runs(runs["before"], runs["held"])
    assert [mode.outcome for mode in found.modes] == [ModeOutcome.MOVED, ModeOutcome.MOVED, ModeOutcome.SAME]
    assert found.modes[0].change > 0.25
    assert found.direction == "the structure is stiffer or lighter"
    assert "compare_states does" in found.additions[-1]


def test_what_differs_from_test_to_test_is_no_change(runs):
    found = frf_ipz.compare_runs(runs["before"], runs["softer"], frequency_scatter=0.02)
    assert found.of(ModeOutcome.MOVED) == []


def test_opposite_changes_are_said_to_be_of_parts(runs):
    found = frf_ipz.compare_runs(runs["before"], runs["softer"])
    up = replace(found.modes[0], after_hz=found.modes[0].before_hz * 1.02)
    assert replace(found, modes=(up, *found.modes[1:])).direction.startswith("parts of the structure are softer")


def test_changed_damping_is_said_beside(runs):
    found = frf_ipz.compare_runs(runs["before"], runs["again"])
    damped = replace(found.modes[1], damping_sigma=9.0, after_damping=0.015, outcome=ModeOutcome.DAMPING)
    texts = replace(found, modes=(found.modes[0], damped, found.modes[2])).additions
    assert texts == ("Damping has changed in 1 mode, by +50 % of its value.",)


def test_modes_of_one_test_only_are_listed(runs):
    found = frf_ipz.compare_runs(runs["before"], runs["again"])
    alone = ModeChange(before_hz=200.0, before_hz_std=0.1, outcome=ModeOutcome.GONE)
    assert replace(found, modes=(*found.modes, alone)).additions == ("Found in the test before only: 200 Hz.",)


@pytest.mark.parametrize(("shape", "is_one"), [([1.0, 0.5, 0.2], True), ([1.0, -1.5, 0.9], False)])
def test_modes_that_stand_alone_are_one_only_with_one_shape(shape, is_one):
    def roots(hz, first):
        shapes = np.column_stack([first, [1.0, -1.0, 0.5]]).astype(complex)
        nothing = np.zeros(2)
        return Roots(
            frf=("", ""),
            frequency_hz=np.array(hz),
            damping_ratio=np.full(2, 0.01),
            frequency_std_hz=nothing,
            damping_ratio_std=nothing,
            counterpart=np.full(2, -1),
            shapes=shapes,
            dofs=("1:z", "2:z", "3:z"),
        )

    places = _matched_places([roots([20.0, 120.0], [1.0, 0.5, 0.2]), roots([40.0, 121.0], shape)])
    assert places == ([(0, 0), (1, 1)] if is_one else [(0, -1), (-1, 0), (1, 1)])


def test_the_page_and_the_table_say_what_is_said(runs, tmp_path):
    text = compare_folders(
        runs["before"].path, runs["held"].path, tmp_path / "out", frequency_scatter=None, damping_scatter=None
    )
    page = (tmp_path / "out" / "compare.html").read_text(encoding="utf-8")
    found = frf_ipz.compare_runs(runs["before"], runs["held"])
    assert found.statement in text
    assert found.statement.replace("+", "&#43;") in page or found.statement in page
    assert "11:+z / 11:+z, accelerance" in page
    table = (tmp_path / "out" / "compare.csv").read_text(encoding="utf-8").splitlines()
    assert len(table) == 4
    assert table[0].startswith("before_hz,before_hz_std,after_hz")


def test_names_of_a_run_cannot_become_markup(runs, tmp_path):
    hostile = frf_ipz.Campaign(runs["before"].frfs, name="</script><b>x").run()
    found = frf_ipz.compare_runs(runs["before"], hostile)
    write_comparison(found, runs["before"], hostile, tmp_path / "page.html")
    assert "<b>x" not in (tmp_path / "page.html").read_text(encoding="utf-8")


def test_a_run_without_a_fit_is_refused(runs):
    without = frf_ipz.Campaign(runs["before"].frfs).run(until="ingest")
    with pytest.raises(frf_ipz.InputError, match="has no fit; run: frf-ipz fit"):
        frf_ipz.compare_runs(runs["before"], without)
