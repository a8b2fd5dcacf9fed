"""Finds effects: the modules of the catalogue, and classes in users' own files."""

from __future__ import annotations

import inspect
import pkgutil
from importlib import import_module, util
from pathlib import Path
from typing import TYPE_CHECKING

from frf_ipz.diagnosis import catalogue
from frf_ipz.diagnosis.catalogue.effect import Effect
from frf_ipz.errors import InputError, did_you_mean

if TYPE_CHECKING:
    from types import ModuleType

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
            found |= {effect.name: effect for effect in _effects_in(import_module(folder.name))}
    return found


def chosen_effects(options: DiagnoseOptions, folder: Path) -> dict[str, Effect]:
    """Find the effects that are to be looked for.

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
    known = shipped_effects()
    for name in options.effects:
        if name not in known:
            raise InputError(f"[diagnose] effects names '{name}', which is no effect; {did_you_mean(name, known)}")
    chosen = {name: effect for name, effect in known.items() if not options.effects or name in options.effects}
    for reference in options.extra_effects:
        effect = _from_file(reference, folder)
        chosen[effect.name] = effect
    return chosen


def _effects_in(module: ModuleType) -> list[Effect]:
    classes = [item for _, item in inspect.getmembers(module, inspect.isclass) if item.__module__ == module.__name__]
    return [item() for item in classes if issubclass(item, Effect) and not inspect.isabstract(item)]


def _from_file(reference: str, folder: Path) -> Effect:
    where = "[diagnose] extra_effects"
    file_name, _, class_name = reference.rpartition(":")
    path = folder / file_name
    if not file_name or not class_name:
        raise InputError(f"{where}: '{reference}' is not understood; write it as 'file.py:ClassName'")
    if not path.is_file():
        raise InputError(f"{where}: there is no file {path}; paths are relative to the pipeline file")
    spec = util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise InputError(f"{where}: {path} is no Python file")
    module = util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # whatever a user's file may raise
        raise InputError(f"{where}: {path} cannot be loaded: {type(error).__name__}: {error}") from error
    found = {type(effect).__name__: effect for effect in _effects_in(module)}
    if class_name not in found:
        raise InputError(f"{where}: {path} has no effect '{class_name}'; {did_you_mean(class_name, found)}")
    return found[class_name]
