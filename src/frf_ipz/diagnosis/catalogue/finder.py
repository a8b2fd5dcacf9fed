"""Finds the effects of the catalogue, and classes of effects and force laws in users' own files."""

from __future__ import annotations

import inspect
import pkgutil
from importlib import import_module, util
from typing import TYPE_CHECKING, Any

from frf_ipz.diagnosis import catalogue
from frf_ipz.diagnosis.catalogue.effect import Effect
from frf_ipz.errors import InputError, did_you_mean
from frf_ipz.input_files import read_bytes

if TYPE_CHECKING:
    from pathlib import Path
    from types import ModuleType

WHERE = "[diagnose] extra_effects"


def read_class(reference: str, folder: Path, kinds: tuple[type, ...]) -> type:
    """Read a class from a user's file.

    Parameters
    ----------
    reference : str
        ``file.py:ClassName``.
    folder : Path
        Where paths start.
    kinds : tuple of type
        What it must derive from one of.

    Returns
    -------
    type
        Not abstract.

    Raises
    ------
    InputError
        If the file cannot be loaded, or has no such class.
    """
    file_name, _, class_name = reference.rpartition(":")
    path = folder / file_name
    if not file_name or not class_name:
        raise InputError(f"{WHERE}: '{reference}' is not understood; write it as 'file.py:ClassName'")
    if not path.is_file():
        raise InputError(f"{WHERE}: there is no file {path}; paths are relative to the pipeline file")
    classes: dict[str, type] = {item.__name__: item for item in classes_in(_load(path), kinds)}
    if class_name not in classes:
        raise InputError(f"{WHERE}: {path} has no effect '{class_name}'; {did_you_mean(class_name, classes)}")
    return classes[class_name]


def classes_in(module: ModuleType, kinds: type | tuple[type, ...]) -> list[Any]:
    """List the classes of some kinds that a module itself defines.

    Parameters
    ----------
    module : module
        Shipped, or a user's.
    kinds : type or tuple of type
        What they must derive from one of.

    Returns
    -------
    list of type
        Not abstract, by name.
    """
    classes = [item for _, item in inspect.getmembers(module, inspect.isclass) if item.__module__ == module.__name__]
    return [item for item in classes if issubclass(item, kinds) and not inspect.isabstract(item)]


def _load(path: Path) -> ModuleType:
    spec = util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise InputError(f"{WHERE}: {path} is no Python file")
    module = util.module_from_spec(spec)
    source = read_bytes(path)
    try:
        exec(compile(source, str(path), "exec"), module.__dict__)  # the text itself: a cached one may be older
    except (Exception, SystemExit) as error:  # whatever a user's file may raise
        raise InputError(f"{WHERE}: {path} cannot be loaded: {type(error).__name__}: {error}") from error
    return module


def shipped_effects() -> dict[str, Effect]:
    """Find every effect of the catalogue.

    Returns
    -------
    dict of str to Effect
        By name.
    """
    effects: dict[str, Effect] = {}
    for module in pkgutil.walk_packages(catalogue.__path__, f"{catalogue.__name__}."):
        if not module.ispkg:
            effects |= {item.name: item() for item in classes_in(import_module(module.name), Effect)}
    return effects
