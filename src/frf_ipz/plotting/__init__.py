"""Pictures: each is described once, and drawn on paper by the functions named here, on the page by the report.

``frf_ipz.plotting.plot_frfs(frfs)`` gives Matplotlib axes. Matplotlib is loaded with the first such function.
"""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
