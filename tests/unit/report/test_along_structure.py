"""Pictures of what an update has changed hold its numbers."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from frf_ipz.report.along_structure import picture_of_parts, pictures_of_flexibility
from frf_ipz.report.contents import read_contents
from frf_ipz.report.sections.updating import build
from frf_ipz.runs.results import Results
from synthetic_run import parts_of, synthetic_folder

FACTOR = 0.8


@pytest.fixture(scope="module")
def run():
    return read_contents(Results(synthetic_folder()))


def trace(picture, name):
    return [item for item in picture.traces if item["name"] == name][-1]


def test_ratios_are_drawn_as_changes_in_percent(run):
    picture = picture_of_parts(run.parts)
    change = trace(picture, "change")
    np.testing.assert_allclose(change["y"], 100 * (run.parts["stiffness_ratio"] - 1), rtol=1e-12, atol=1e-12)  # % of 1
    np.testing.assert_array_equal(change["x"], run.parts["x_m"])
    assert "90 % band" in picture.title


def test_without_a_band_none_is_claimed(run):
    none = run.parts.assign(stiffness_ratio_low=np.nan, stiffness_ratio_high=np.nan)
    picture = picture_of_parts(none)
    assert [item["name"] for item in picture.traces] == ["change"]
    assert "band" not in picture.title


def test_a_structure_in_the_plane_is_coloured(run):
    flat = run.parts.assign(z_m=np.linspace(0, 1, len(run.parts)) ** 2)
    points = picture_of_parts(flat).traces[0]
    np.testing.assert_allclose(
        points["marker"]["color"], 100 * (run.parts["stiffness_ratio"] - 1), rtol=1e-12, atol=1e-12
    )
    assert points["marker"]["cmin"] == -points["marker"]["cmax"]


def test_parts_beyond_their_band_are_named(run):
    notes = build(run).notes
    assert any("softer than modelled" in note for note in notes)


def test_a_model_that_is_softer_throughout_gives_way_everywhere_alike(run):
    softer = replace(run.updated.nominal, stiffness=FACTOR * run.updated.nominal.stiffness)
    updated = replace(run.updated, model=softer)
    (picture,) = pictures_of_flexibility(replace(run, updated=updated), updated)
    np.testing.assert_allclose(picture.traces[0]["y"], 100 * (1 / FACTOR - 1), rtol=1e-6, atol=0)  # eigenvalues of both


def test_without_parts_the_flexibility_is_drawn(run):
    names = [
        getattr(block, "name", "")
        for block in build(replace(run, updated=replace(run.updated, parts=pd.DataFrame()))).blocks
    ]
    assert "flexibility" in names
    assert "change" not in names


def test_a_model_of_springs_has_masses_in_a_row(run):
    assert not run.is_lumped
    assert replace(run, geometry=replace(run.geometry, is_schematic=True)).is_lumped
    assert len(parts_of(synthetic_folder().results["model"])) == len(run.parts)
