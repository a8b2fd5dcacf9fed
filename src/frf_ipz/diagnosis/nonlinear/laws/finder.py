"""Finding force laws: the modules of this folder."""

from __future__ import annotations

import pkgutil
from importlib import import_module
from typing import TYPE_CHECKING

from frf_ipz.diagnosis.catalogue.finder import classes_in
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


def select_laws(options: DiagnoseOptions) -> tuple[Law, ...]:
    """Select the shipped laws that are searched for.

    Parameters
    ----------
    options : DiagnoseOptions
        Which effects; all shipped laws where none are named.

    Returns
    -------
    tuple of Law
        Possibly none.
    """
    return tuple(law for name, law in shipped_laws().items() if not options.effects or name in options.effects)
