"""Fixtures shared by all tests."""

import gc
import os
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("ci", derandomize=True, deadline=None)  # every run tries the same examples
settings.register_profile("dev", deadline=None)
settings.register_profile("long", deadline=None, max_examples=10_000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))
SHARED = Path(__file__).parents[2] / "shared"


def pytest_collection_finish():
    """What has been collected stays to the end: no search for garbage needs to go through it, and there are many."""
    gc.collect()
    gc.freeze()


def _folder(name):
    folder = SHARED / name
    if not folder.is_dir():
        pytest.skip(f"needs the folder {name}/ of measurements by others, which is not part of the repository")
    return folder


@pytest.fixture(scope="session")
def recordings():
    """Real measurements made by others."""
    return _folder("recordings")


@pytest.fixture(scope="session")
def practice():
    """Blind cases with their answers."""
    return _folder("practice")


@pytest.fixture(scope="session")
def bench_fit():
    """Truth sets and scoring of the fitting bench."""
    return _folder("bench_fit")
