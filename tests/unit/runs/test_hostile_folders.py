"""Looking at anybody's results: none of their code, nothing outside touched, one line, 500 MB at most."""

import os
import shutil
import sys
from functools import partial

import pytest

from hostile_folders import KINDS, write_folder
from looking import Watch, content, in_a_child, look


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    return write_folder(tmp_path_factory.mktemp("good") / "results")


def _look(folder, out):
    os.chdir(folder)
    return "\n".join(Watch(out).look(folder, out)[0])


@pytest.mark.skipif(sys.platform != "linux", reason="measured by what Linux tells of a process")
@pytest.mark.parametrize("name", KINDS)
def test_looking_does_no_harm_and_says_what_is_wrong_in_one_line(tmp_path, good, name):
    folder, user, out = tmp_path / "results", tmp_path / "user", tmp_path / "out"
    shutil.copytree(good, folder)
    user.mkdir()
    out.mkdir()
    (user / "precious.txt").write_text("years of work")
    KINDS[name](folder, user)
    before = content(tmp_path)
    assert in_a_child(partial(_look, folder, out)) == ""
    assert (user / "precious.txt").exists()
    after = {path: data for path, data in content(tmp_path).items() if not path.is_relative_to(out)}
    assert after.keys() == before.keys()
    assert after == before


def test_a_good_folder_is_shown_without_a_word(tmp_path, good):
    wrong, said = look(good, tmp_path)
    assert wrong == []
    assert said == {}
