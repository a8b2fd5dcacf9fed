"""Every picture draws from the results of a run, and says so where they are missing."""

import html
import io
import subprocess
import sys
import warnings
from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.errors import InputError
from frf_ipz.plotting.figures import FORMATS, draw_pictures, save_figure
from frf_ipz.plotting.picture import Axis, Line, Panel, Picture
from frf_ipz.plotting.registry import PICTURES, describe, picture_names, run_pictures
from frf_ipz.report.page import SECTIONS
from frf_ipz.report.section import pictures_of
from frf_ipz.runs.results import Results
from hostile_run import hostile_folder
from synthetic_run import Folder, synthetic_folder, synthetic_law

OF_A_DIAGNOSIS = {"mismatch", "ranking", "proof"}
STARTS = {"svg": b"<?xml", "pdf": b"%PDF", "png": b"\x89PNG"}


def draw(name, folder):
    return draw_pictures(describe(name, Results(folder)))


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
    levels = replace(folder.results["levels"], labels=(), modes=folder.results["levels"].modes.iloc[:0])
    with pytest.raises(InputError, match="no input was excited at several levels"):
        draw("levels", Folder(results={"levels": levels}, manifest={"stages": {"levels": {}}}, stale=()))


def test_a_run_without_a_law_has_no_picture_of_one():
    with pytest.raises(InputError, match="no force law"):
        draw("law", synthetic_folder(diagnosed=True))


def test_the_force_of_a_law_is_drawn_where_no_record_was_simulated(folder):
    force_alone = replace(folder.results["diagnose"], law_in_time=replace(synthetic_law(), record=""))
    figure = draw("law", Folder(results={"diagnose": force_alone}, manifest={"stages": {"diagnose": {}}}, stale=()))
    assert figure.axes[0].get_ylabel() == "Force of the law, N"


def test_names_are_in_the_order_of_the_chain_and_those_of_a_run_are_what_it_holds():
    names = picture_names()
    held = picture_names(Results(synthetic_folder()))
    assert set(names) - set(held) == {*OF_A_DIAGNOSIS, "law", "expected-misfit", "data-checks", "levels"}
    assert names.index("frfs") < names.index("poles") < names.index("pairs") < names.index("prediction")


def test_every_picture_of_the_report_has_a_name_on_the_command_line(folder):
    run = Results(folder)
    sections = [build(run) for build in SECTIONS]
    shown = [picture.name for picture, _ in pictures_of([section for section in sections if section is not None])]
    assert set(shown) - {"flexibility"} == {
        picture.name for name in PICTURES if name != "flexibility" for picture in run_pictures(run, name)
    }
    assert len(set(shown)) == len(shown)


@pytest.mark.parametrize(
    ("modules", "heavy"),
    [
        ("frf_ipz.plotting, frf_ipz.plotting.registry, frf_ipz.report.page", {"matplotlib"}),
        ("frf_ipz.plotting.plots", {"matplotlib.pyplot", "plotly"}),
    ],
)
def test_descriptions_and_the_report_need_no_matplotlib_and_drawing_no_window(modules, heavy):
    code = f"import sys, {modules}; sys.exit(not {heavy}.isdisjoint(sys.modules))"
    with warnings.catch_warnings():
        assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_functions_are_shown_to_those_who_look_for_them():
    code = (
        "import sys, frf_ipz; names = dir(frf_ipz.plotting); "
        "sys.exit('matplotlib' in sys.modules or not {'plot_frfs', 'plot_fit', 'draw_pictures'} <= set(names))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.slow
def test_names_that_look_like_formulas_or_fields_are_drawn_as_they_are():
    run = Results(hostile_folder())
    for name in picture_names(run):
        if name != "change":
            save_figure(draw_pictures(describe(name, run)), io.BytesIO(), file_format="svg")


def test_a_name_that_looks_like_a_formula_is_written_as_it_is():
    line = Line(name=r"_$\frac^$", colour=0, x=np.arange(3.0), y=np.arange(3.0))
    picture = Picture(name="p", title="", alt="", panels=(Panel(y=Axis(title=r"$\alpha$, m"), layers=(line,)),))
    stream = io.BytesIO()
    save_figure(draw_pictures([picture]), stream, file_format="svg")
    text = html.unescape(stream.getvalue().decode())
    assert r"_$\frac^$" in text
    assert r"$\alpha$, m" in text
