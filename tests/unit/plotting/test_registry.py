"""Every picture draws from the results of a run, and says so where they are missing."""

import subprocess
import sys
import warnings
from dataclasses import replace

import pytest

from frf_ipz.errors import InputError
from frf_ipz.plotting.registry import PICTURES, draw, picture_names
from frf_ipz.plotting.style import FORMATS, save_figure
from synthetic_run import Folder, synthetic_folder, synthetic_law

OF_A_DIAGNOSIS = {"mismatch", "ranking", "proof"}
STARTS = {"svg": b"<?xml", "pdf": b"%PDF", "png": b"\x89PNG"}


@pytest.fixture(scope="module")
def folder():
    synthetic = synthetic_folder(diagnosed=True)
    synthetic.results["diagnose"] = replace(synthetic.results["diagnose"], law_in_time=synthetic_law())
    return synthetic


@pytest.mark.parametrize("name", sorted(PICTURES))
def test_every_picture_draws_something_with_titled_axes(folder, name):
    figure = draw(name, folder)
    drawn = [ax for ax in figure.axes if ax.lines or ax.collections or ax.patches or ax.images]
    assert drawn
    assert drawn[0].get_xlabel() or drawn[0].get_ylabel()


@pytest.mark.parametrize("file_format", FORMATS)
def test_files_are_what_they_say(folder, tmp_path, file_format):
    path = tmp_path / f"picture.{file_format}"
    save_figure(draw("frfs", folder), path, file_format=file_format)
    assert path.read_bytes().startswith(STARTS[file_format])


def test_text_in_vector_files_stays_text(folder, tmp_path):
    save_figure(draw("frfs", folder), tmp_path / "picture.svg", file_format="svg")
    assert ">Frequency, Hz</text>" in (tmp_path / "picture.svg").read_text(encoding="utf-8")


def test_a_wrong_name_is_answered_with_the_closest():
    with pytest.raises(InputError, match="did you mean 'poles'"):
        draw("pole", synthetic_folder())


@pytest.mark.parametrize("name", sorted(OF_A_DIAGNOSIS))
def test_a_missing_stage_is_named(name):
    with pytest.raises(InputError, match="needs the result of 'diagnose'"):
        draw(name, synthetic_folder())


def test_a_run_with_one_level_has_no_picture_of_levels(folder):
    levels = replace(folder.results["levels"], modes=folder.results["levels"].modes.iloc[:0])
    with pytest.raises(InputError, match="no input was excited at several levels"):
        draw("levels", Folder(results={"levels": levels}, manifest={}, stale=()))


def test_a_run_without_a_law_has_no_picture_of_one():
    with pytest.raises(InputError, match="no force law"):
        draw("law", synthetic_folder(diagnosed=True))


def test_the_force_of_a_law_is_drawn_where_no_record_was_simulated(folder):
    force_alone = replace(folder.results["diagnose"], law_in_time=replace(synthetic_law(), record=""))
    figure = draw("law", Folder(results={"diagnose": force_alone}, manifest={}, stale=()))
    assert figure.axes[0].get_ylabel() == "Force of the law, N"


def test_names_are_in_the_order_of_the_chain():
    names = picture_names()
    assert names.index("frfs") < names.index("poles") < names.index("pairs") < names.index("prediction")


def test_no_window_system_is_asked_for():
    code = "import sys, frf_ipz.plotting.registry; sys.exit('matplotlib.pyplot' in sys.modules)"
    with warnings.catch_warnings():
        assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
