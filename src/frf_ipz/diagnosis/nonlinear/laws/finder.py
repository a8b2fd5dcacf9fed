"""Finds force laws: the modules of this folder, and classes in users' own files."""

from __future__ import annotations

import inspect
import pkgutil
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from frf_ipz.diagnosis.catalogue.effect import Effect
from frf_ipz.diagnosis.catalogue.users_files import read_class
from frf_ipz.diagnosis.nonlinear import laws
from frf_ipz.diagnosis.nonlinear.laws.law import Law

if TYPE_CHECKING:
    from types import ModuleType

    from frf_ipz.diagnosis.options import DiagnoseOptions


def shipped_laws() -> dict[str, Law]:
    """Find every law of this folder.

    Returns
    -------
    dict of str to Law
        By name.
    """
    found: dict[str, Law] = {}
    for module in pkgutil.iter_modules(laws.__path__, f"{laws.__name__}."):
        found |= {law.name: law for law in laws_in(import_module(module.name))}
    return found


def laws_in(module: ModuleType) -> list[Law]:
    """List the laws that a module defines.

    Parameters
    ----------
    module : module
        Of this folder, or a user's.

    Returns
    -------
    list of Law
        One of each class.
    """
    classes = [item for _, item in inspect.getmembers(module, inspect.isclass) if item.__module__ == module.__name__]
    return [item() for item in classes if issubclass(item, Law) and not inspect.isabstract(item)]


def chosen_laws(options: DiagnoseOptions, folder: Path = Path()) -> tuple[Law, ...]:
    """Give the laws that are to be looked for.

    Parameters
    ----------
    options : DiagnoseOptions
        Which effects; all shipped laws where none are named, and users' own besides.
    folder : Path
        Where paths of users' files start.

    Returns
    -------
    tuple of Law
        Perhaps none.

    Raises
    ------
    InputError
        If a user's file cannot be read.
    """
    shipped = (law for name, law in shipped_laws().items() if not options.effects or name in options.effects)
    classes = (read_class(reference, folder, (Effect, Law)) for reference in options.extra_effects)
    return (*shipped, *(found() for found in classes if issubclass(found, Law)))
