"""Fixtures shared by all tests."""

from pathlib import Path

import pytest

SHARED = Path(__file__).parents[2] / "shared"


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
