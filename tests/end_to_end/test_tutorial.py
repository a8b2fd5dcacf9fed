"""The tutorial's commands and Python lines run as they stand, and print what its pages say."""

import contextlib
import re
import shutil
from pathlib import Path

import pytest

import frf_ipz
from page_blocks import assert_same, run_page

ROOT = Path(__file__).parents[2]


def page(name):
    return (ROOT / "docs" / "tutorial" / f"{name}.md").read_text(encoding="utf-8")


def toml_blocks(name):
    return re.findall(r"```toml\n(.*?)```", page(name), re.DOTALL)


def correct_settings():
    """What the page tells the reader to write, after `init`."""
    sensor, pipeline = toml_blocks("campaign")
    test = Path("beam/test.toml")
    text = test.read_text(encoding="utf-8")
    assert text.count('\ndof = "2:+z" ') == 1
    text = text.replace('\ndof = "2:+z" ', f"\n{sensor.strip()} ")
    test.write_text("\n".join(line.removesuffix("CHECK") for line in text.splitlines()), encoding="utf-8")
    Path("beam/pipeline.toml").write_text(pipeline, encoding="utf-8")


def state_damping():
    """What the page tells the reader to write."""
    damping = toml_blocks("diagnosis")[0].strip()
    model = Path("beam/model.toml")
    text = model.read_text(encoding="utf-8")
    assert text.count("modal_ratio = 0.001") == 1
    model.write_text(text.replace("modal_ratio = 0.001", damping), encoding="utf-8")


@pytest.fixture(scope="module")
def repository(tmp_path_factory):
    """A folder with the data of the repository, where the campaign was set up and run; with what that printed."""
    folder = tmp_path_factory.mktemp("tutorial")
    shutil.copytree(ROOT / "data", folder / "data")
    with contextlib.chdir(folder):
        texts = run_page(page("campaign"), {1: correct_settings})
    return folder, texts


def test_campaign(repository):
    _, texts = repository
    assert len(texts) == 3
    for expected, printed in texts:
        assert_same(expected, printed)


@pytest.mark.parametrize(("name", "count"), [("report", 1), ("python", 7)])
def test_page(repository, name, count):
    folder, _ = repository
    with contextlib.chdir(folder):
        texts = run_page(page(name))
    assert len(texts) == count
    for expected, printed in texts:
        assert_same(expected, printed)


def test_robust_control_of_the_same_beam(repository):
    """The how-to guide that goes on where the tutorial ends."""
    folder, _ = repository
    guide = (ROOT / "docs" / "how-to" / "robust_control.md").read_text(encoding="utf-8")
    (section,) = re.findall(r"```toml\n(.*?)```", guide, re.DOTALL)
    pipeline = folder / "beam" / "robust.toml"
    pipeline.write_text(toml_blocks("campaign")[1] + section, encoding="utf-8")
    frf_ipz.run_pipeline(pipeline, folder / "robust" / "results", until="export")
    with contextlib.chdir(folder / "robust"):
        ((expected, printed),) = run_page(guide)
    assert_same(expected, printed)


@pytest.mark.slow
def test_diagnosis(repository):
    folder, _ = repository
    with contextlib.chdir(folder):
        state_damping()
        texts = run_page(page("diagnosis"))
    assert len(texts) == 3
    for expected, printed in texts:
        assert_same(expected, printed)


def test_a_wrong_number_or_word_is_seen():
    assert_same("4 modes: 16.25 Hz", "4 modes:  16.251 Hz\n")
    for wrong in ("5 modes: 16.25 Hz", "4 modes: 17.25 Hz", "4 poles: 16.25 Hz"):
        with pytest.raises(AssertionError):
            assert_same("4 modes: 16.25 Hz", wrong)
