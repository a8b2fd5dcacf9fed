"""Results show themselves: as a line, a table, a picture, and in a notebook."""

from dataclasses import fields, is_dataclass

import numpy as np
import pandas as pd
import pytest

from frf_ipz.assessment.assessment import Assessment, Check, Verdict
from frf_ipz.display import Drawn, Tabulated
from frf_ipz.errors import InputError
from frf_ipz.export.frames import FRAMES
from frf_ipz.plotting.result_pictures import DRAWINGS
from frf_ipz.runs.results import Results
from synthetic_run import synthetic_folder

LONGEST = 700  # characters of one line of text


@pytest.fixture(scope="module")
def run():
    return Results(synthetic_folder(diagnosed=True))


@pytest.fixture(scope="module")
def shown(run):
    results = [run.estimate, run.frfs, run.fit, run.pairs, run.updated_model, run.prediction, run.diagnosis]
    results.append(Assessment.of_checks([Check(name="fit", verdict=Verdict.WITH_CARE)]))
    return {type(result): result for result in [*results, synthetic_folder().results["model"]]}


def test_every_type_that_says_so_has_tables_and_pictures(shown):
    assert {kind for kind in shown if issubclass(kind, Tabulated)} == set(FRAMES)
    assert {kind for kind in shown if issubclass(kind, Drawn)} == set(DRAWINGS)


@pytest.mark.parametrize(("kind", "name"), [(kind, name) for kind, names in FRAMES.items() for name in names])
def test_every_table_is_a_frame(shown, kind, name):
    frame = shown[kind].to_frame(name)
    assert isinstance(frame, pd.DataFrame)
    assert len(frame.columns)


@pytest.mark.parametrize(("kind", "name"), [(kind, name) for kind, names in DRAWINGS.items() for name in names])
def test_every_picture_is_drawn(shown, kind, name):
    ax = shown[kind].plot(name)
    assert ax.lines or ax.collections or ax.patches or ax.images


def test_a_table_or_picture_that_is_not_there_is_answered_with_the_closest(run):
    with pytest.raises(InputError, match="ModalFit has no table 'pole'; did you mean 'poles'"):
        run.fit.to_frame("pole")
    with pytest.raises(InputError, match="FrfSet has no picture 'phase'; did you mean 'phases'"):
        run.frfs.plot("phase")


def test_the_tables_of_a_run_are_those_of_its_results(run):
    np.testing.assert_allclose(run.to_frame("poles")["frequency_hz"], run.fit.to_frame()["frequency_hz"])
    assert run.to_frame("pairs")["after_hz"].notna().sum() == len(run.pairs.targets)
    assert run.pairs.to_frame()["after_hz"].isna().all()
    with pytest.raises(InputError, match="did you mean 'poles'"):
        run.to_frame("poless")


def test_a_run_draws_its_pictures_and_writes_its_page(run, tmp_path):
    assert run.plot("prediction").axes
    run.write_report(str(tmp_path / "page.html"))
    assert (tmp_path / "page.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    with pytest.raises(InputError, match="cannot be written"):
        run.write_report(tmp_path / "nowhere" / "page.html")


def test_a_notebook_shows_the_line_and_the_table(run):
    html = run.fit._repr_html_()
    assert html.startswith("<p>ModalFit: ")
    assert "frequency_hz" in html


def held(value, depth=2):
    """All dataclasses in a value, a few levels down."""
    if not is_dataclass(value) or isinstance(value, type) or depth < 0:
        return []
    return [value, *(inner for item in fields(value) for inner in held(getattr(value, item.name, None), depth - 1))]


def test_texts_of_results_are_short(run, shown):
    texts = [repr(inner) for result in [*shown.values(), run.reduced_model, run.geometry] for inner in held(result)]
    texts.append(repr(run.state_space_arrays))
    assert [text for text in texts if len(text) > LONGEST or "\n" in text] == []
