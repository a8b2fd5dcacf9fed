"""From hammer tests and a nearly right FE model to a controller-ready model.

The public names stand in ``__init__.pyi`` and are loaded when they are first used.
"""

from __future__ import annotations

import lazy_loader

__version__ = "0.19.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
