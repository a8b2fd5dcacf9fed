"""Finding force laws: the modules of this folder, and classes in users' own files."""

from __future__ import annotations

import pkgutil
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from frf_ipz.diagnosis.catalogue.effect import Effect
from frf_ipz.diagnosis.catalogue.finder import classes_in, read_class
from frf_ipz.diagnosis.nonlinear import laws
from frf_ipz.diagnosis.nonlinear.laws.law import Law

if TYPE_CHECKING:
    from frf_ipz.diagnosis.options import DiagnoseOptions


def shipped_laws() -> dict[str, Law]:
    """Find every law of this folder.

    Returns
    -------
    dict of str to Law
        By name.
    """
    found_laws: dict[str, Law] = {}
    for module in pkgutil.iter_modules(laws.__path__, f"{laws.__name__}."):
        found_laws |= {law_class.name: law_class() for law_class in classes_in(import_module(module.name), Law)}
    return found_laws


def select_laws(options: DiagnoseOptions, folder: Path = Path()) -> tuple[Law, ...]:
    """Select the laws that are searched for.

    Parameters
    ----------
    options : DiagnoseOptions
        Which effects; all shipped laws where none are named, and users' own besides.
    folder : Path
        Where paths of users' files start.

    Returns
    -------
    tuple of Law
        Possibly none.

    Raises
    ------
    InputError
        If a user's file cannot be read.
    """
    shipped = (law for name, law in shipped_laws().items() if not options.effects or name in options.effects)
    classes = (read_class(reference, folder, (Effect, Law)) for reference in options.extra_effects)
    return (*shipped, *(law_class() for law_class in classes if issubclass(law_class, Law)))
