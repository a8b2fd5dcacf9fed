"""The proof is no part of the package: it is found by its folder."""

import sys
from pathlib import Path

PIPELINES = str(Path(__file__).parents[3] / "pipelines")
if PIPELINES not in sys.path:
    sys.path.insert(0, PIPELINES)
