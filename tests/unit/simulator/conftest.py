"""The simulator is no part of the package: it is found by its folder."""

import sys
from pathlib import Path

ROOT = Path(__file__).parents[3]
for folder in ("pipelines", "data"):
    if str(ROOT / folder) not in sys.path:
        sys.path.insert(0, str(ROOT / folder))
