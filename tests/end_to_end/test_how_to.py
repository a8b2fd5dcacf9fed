"""The Python lines of the how-to guides run as they stand, and print what their pages say."""

import contextlib
from pathlib import Path

import pytest

from page_blocks import assert_same, run_page

HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("arrays", 4),
        ("ports", 1),
        ("own_effect", 1),
        pytest.param("fleets", 2, marks=pytest.mark.slow),  # compares states, and runs a fleet: each has quick tests
        ("extend", 2),
        ("modes_only", 1),
        ("other_software", 1),
    ],
)
def test_page(name, count, tmp_path):
    with contextlib.chdir(tmp_path):
        texts = run_page((HOW_TO / f"{name}.md").read_text(encoding="utf-8"))
    assert len(texts) == count
    for expected, printed in texts:
        assert_same(expected, printed)
