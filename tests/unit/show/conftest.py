import pytest

from demo_case import copy_demo, made_demo


@pytest.fixture(scope="session")
def original(tmp_path_factory):
    return made_demo(tmp_path_factory)


@pytest.fixture
def demo(original, tmp_path):
    return copy_demo(original, tmp_path)
