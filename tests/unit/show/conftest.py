import pytest

from demo_case import copy_demo, make_demo


@pytest.fixture(scope="session")
def original(tmp_path_factory):
    return make_demo(tmp_path_factory.mktemp("made"))


@pytest.fixture
def demo(original, tmp_path):
    return copy_demo(original, tmp_path)
