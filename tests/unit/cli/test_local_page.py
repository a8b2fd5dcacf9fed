"""The page of ``show`` runs no code that a folder brings along, unless the user says so."""

import pytest

from frf_ipz.cli import local_page
from frf_ipz.errors import InputError
from frf_ipz.progress import silent
from small_campaign import PIPELINE, write_campaign

EFFECTS = '[diagnose]\nextra_effects = ["harm.py:Harm"]\n'


@pytest.fixture
def served(monkeypatch):
    """What the server was given to run pipelines with."""
    given = []
    monkeypatch.setattr(local_page, "serve", lambda _folder, run, _read, **_: given.append(run))
    return given


@pytest.fixture
def pipeline(tmp_path):
    write_campaign(tmp_path)
    (tmp_path / "harm.py").write_text("raise SystemExit('run')")
    path = tmp_path / "pipeline.toml"
    path.write_text(PIPELINE + EFFECTS, encoding="utf-8")
    return path


def test_effects_of_a_folder_are_not_run_without_asking(served, pipeline, tmp_path):
    local_page.serve_page(tmp_path, port=0, browser=False)
    with pytest.raises(InputError, match=r"harm\.py:Harm.*--run-effects"):
        served[0](pipeline, tmp_path / "out", progress=silent)
    assert not (tmp_path / "out").exists()


def test_a_pipeline_is_run_without_them_or_where_the_user_says_so(served, pipeline, tmp_path, monkeypatch):
    ran = []
    monkeypatch.setattr(local_page, "_run", lambda path, out, *, progress: ran.append(path))  # noqa: ARG005
    local_page.serve_page(tmp_path, port=0, browser=False, run_effects=True)
    served[0](pipeline, tmp_path / "out", progress=silent)
    pipeline.write_text(PIPELINE, encoding="utf-8")
    local_page.serve_page(tmp_path, port=0, browser=False)
    served[1](pipeline, tmp_path / "out", progress=silent)
    assert ran == [pipeline, pipeline]
