"""Finds effects: the modules of the catalogue, and classes in users' own files; force laws have their own finder."""

from __future__ import annotations

import pkgutil
from importlib import import_module
from typing import TYPE_CHECKING

from frf_ipz.diagnosis import catalogue
from frf_ipz.diagnosis.catalogue.class_finder import classes_in, read_class
from frf_ipz.diagnosis.catalogue.effect import Effect
from frf_ipz.diagnosis.nonlinear.laws.finder import shipped_laws
from frf_ipz.diagnosis.nonlinear.laws.law import Law
from frf_ipz.errors import InputError, did_you_mean

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.diagnosis.options import DiagnoseOptions


def shipped_effects() -> dict[str, Effect]:
    """Find every effect of the catalogue.

    Returns
    -------
    dict of str to Effect
        By name.
    """
    found: dict[str, Effect] = {}
    for folder in pkgutil.walk_packages(catalogue.__path__, f"{catalogue.__name__}."):
        if not folder.ispkg:
            found |= {item.name: item() for item in classes_in(import_module(folder.name), Effect)}
    return found


def chosen_effects(options: DiagnoseOptions, folder: Path) -> dict[str, Effect]:
    """Find the effects that are to be looked for, without force laws.

    Parameters
    ----------
    options : DiagnoseOptions
        Which ones.
    folder : Path
        Where paths of users' files start.

    Returns
    -------
    dict of str to Effect
        By name, those of the contract first.

    Raises
    ------
    InputError
        If an effect or a file is not known, or a class in it is no effect.
    """
    shipped = shipped_effects()
    known = (*shipped, *shipped_laws())
    for name in options.effects:
        if name not in known:
            raise InputError(f"[diagnose] effects names '{name}', which is no effect; {did_you_mean(name, known)}")
    chosen = {name: effect for name, effect in shipped.items() if not options.effects or name in options.effects}
    for reference in options.extra_effects:
        found = read_class(reference, folder, (Effect, Law))
        if issubclass(found, Effect):
            chosen[found.name] = found()
    return chosen
