"""Pictures of what an update has changed hold its numbers."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from frf_ipz.plotting.registry import run_pictures
from frf_ipz.plotting.updating import describe_flexibility_change, describe_stiffness_change
from frf_ipz.report.sections.updating import build
from frf_ipz.runs.picture_data import changed_parts
from frf_ipz.runs.results import Results
from synthetic_run import parts_of, synthetic_folder, with_results

FACTOR = 0.8


@pytest.fixture(scope="module")
def run():
    return Results(synthetic_folder())


def layer(picture, name):
    return next(layer for layer in picture.layers if layer.name == name)


def test_ratios_are_drawn_as_changes_in_percent(run):
    picture = describe_stiffness_change(changed_parts(run))
    change = layer(picture, "change")
    np.testing.assert_allclose(
        change.y, 100 * (changed_parts(run)["stiffness_ratio"] - 1), rtol=1e-12, atol=1e-12
    )  # % of 1
    np.testing.assert_array_equal(change.x, changed_parts(run)["x_m"])
    assert "90 % band" in picture.title


def test_without_a_band_none_is_claimed(run):
    none = changed_parts(run).assign(stiffness_ratio_low=np.nan, stiffness_ratio_high=np.nan)
    picture = describe_stiffness_change(none)
    assert [layer.name for layer in picture.layers] == ["change"]
    assert "band" not in picture.title


def test_a_structure_in_the_plane_is_coloured(run):
    flat = changed_parts(run).assign(z_m=np.linspace(0, 1, len(changed_parts(run))) ** 2)
    picture = describe_stiffness_change(flat)
    (points,) = picture.layers
    np.testing.assert_allclose(points.values, 100 * (changed_parts(run)["stiffness_ratio"] - 1), rtol=1e-12, atol=1e-12)
    assert points.scale_title
    assert picture.panels[0].is_to_scale


def test_parts_beyond_their_band_are_named(run):
    notes = build(run).notes
    assert any("softer than modelled" in note for note in notes)


def test_a_model_that_is_softer_throughout_gives_way_everywhere_alike(run):
    softer = replace(run.updated_model.nominal, stiffness=FACTOR * run.updated_model.nominal.stiffness)
    updated = replace(run.updated_model, model=softer)
    (points,) = describe_flexibility_change(updated, run.geometry, run.labels).layers
    np.testing.assert_allclose(points.y, 100 * (1 / FACTOR - 1), rtol=1e-6, atol=0)  # eigenvalues of both


def test_without_parts_the_flexibility_is_drawn(run):
    names = [
        figure.picture.name
        for figure in build(with_results(run, updated_model=replace(run.updated_model, parts=pd.DataFrame()))).blocks
    ]
    assert "flexibility" in names
    assert "change" not in names


def test_a_model_of_springs_has_masses_in_a_row(run):
    across = [picture.x.title for picture in run_pictures(run, "structure")]
    schematic = with_results(run, geometry=replace(run.geometry, is_schematic=True))
    in_a_row = [picture.x.title for picture in run_pictures(schematic, "structure")]
    assert (across, in_a_row) == (["Position, m"], ["Masses in a row"])
    assert len(parts_of(synthetic_folder().results["model"])) == len(changed_parts(run))
