"""What is imported when it is used, so that a command starts without what it may not need.

An import inside a function would say the same again at each place where the module is used. This stands where imports
stand, under the ``else`` of the ``TYPE_CHECKING`` under which type checkers see the import itself.
"""

from __future__ import annotations

import gc
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from types import ModuleType


class _LateModule:
    """Stands for a module."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, attribute: str) -> Any:  # noqa: ANN401 - anything that a module may hold
        return getattr(_load(self._name), attribute)


class _LateFunction:
    """Stands for a function of a module."""

    def __init__(self, module: str, name: str) -> None:
        self._module, self._name = module, name

    def __call__(self, *args: Any, **options: Any) -> Any:  # noqa: ANN401 - those of the function
        return getattr(_load(self._module), self._name)(*args, **options)


def _load(name: str) -> ModuleType:
    """Import a module, and look for no garbage while it is imported: what modules make stays, and is much."""
    is_collecting = gc.isenabled()
    gc.disable()
    try:
        return import_module(name)
    finally:
        if is_collecting:
            gc.enable()


def import_late(module: str, function: str = "") -> Any:  # noqa: ANN401 - a module or a function
    """Import a module when something of it is used, or a function when it is called.

    Parameters
    ----------
    module : str
        Its full name.
    function : str
        Name of a function in it.

    Returns
    -------
    object
        Has the attributes of the module, or is called as the function is.

    Examples
    --------
    >>> fractions, sqrt = import_late("fractions"), import_late("math", "sqrt")
    >>> fractions.Fraction(1, 2), sqrt(4)
    (Fraction(1, 2), 2.0)
    """
    return _LateFunction(module, function) if function else _LateModule(module)
