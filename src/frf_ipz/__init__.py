"""From hammer tests and a nearly right FE model to a controller-ready model."""

from __future__ import annotations

__version__ = "0.1.0"
