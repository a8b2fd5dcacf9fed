"""Pictures and files of a run, as the page offers them."""

import pytest

import frf_ipz
from frf_ipz.cli.pictures import picture_list
from frf_ipz.errors import InputError
from frf_ipz.runs.results import Results
from frf_ipz.show.downloads import downloads, picture_file
from synthetic_run import synthetic_folder


@pytest.fixture(scope="module")
def run():
    return Results(synthetic_folder())


@pytest.mark.parametrize(
    ("kind", "begins", "media_type"), [("svg", b"<?xml", "image/svg+xml"), ("png", b"\x89PNG", "image/png")]
)
def test_a_picture_is_drawn_as_its_kind(run, kind, begins, media_type):
    content, told = picture_file(run, f"frfs.{kind}")
    assert content.startswith(begins)
    assert told == media_type


@pytest.mark.parametrize("name", ["frfs.pdf", "frfs", "../frfs.exe", "no-such.svg"])
def test_what_is_no_picture_is_refused(run, name):
    with pytest.raises(InputError, match=r"no kind of picture|no picture"):
        picture_file(run, name)


def test_every_file_and_picture_that_is_offered_is_there(demo):
    run = frf_ipz.open_results(demo / "out")
    (form,) = downloads(run, "files/").blocks
    assert {"poles.parquet", "statespace.json"} <= set(form.data["files"])
    assert all((demo / "out" / name).is_file() for name in form.data["files"])
    assert "prediction" in form.data["pictures"]
    assert (
        form.data["pictures"] == picture_list(demo / "out").splitlines()[1:]
    )  # each is drawn by the tests of the command line


def test_nothing_is_offered_before_the_first_run(run):
    assert downloads(run, "files/") is None
