"""Times of peers in the same run, gathered into a file that the page of the validation is written from."""

import json
import os
import platform
from pathlib import Path

import pytest

TIMINGS = Path(__file__).parents[2] / "results" / "timings.json"


class Timings:
    """How many times faster the package is than a peer, or than what nothing can be faster than."""

    def __init__(self):
        self.bars = []

    def add(self, group, name, ratio, required):
        """Note a ratio; `required` is the least that is asked for."""
        bar = {"group": group, "name": name, "value": float(f"{ratio:.3g}")}
        self.bars.append({**bar, "requirement": f"at least {required:g}", "passes": bool(ratio >= required)})


@pytest.fixture(scope="session")
def timings():
    gathered = Timings()
    yield gathered
    if gathered.bars:
        TIMINGS.parent.mkdir(exist_ok=True)
        notes = (
            "How many times as fast as a peer that does the same, or as the calls of LAPACK alone: CPU seconds of one "
            f"thread, both in the same run of `make bench`. {platform.system()} on {platform.machine()}, "
            f"{os.cpu_count()} cores, Python {platform.python_version()}."
        )
        page = {"title": "Speed against peers", "notes": [notes], "bars": gathered.bars}
        TIMINGS.write_text(json.dumps(page, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
