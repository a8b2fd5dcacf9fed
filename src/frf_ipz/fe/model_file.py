"""``model.toml`` into a structural model. Each kind of model is a module of `fe.kinds`, found by its file name."""

from __future__ import annotations

import pkgutil
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, cast

from frf_ipz.arguments import as_path
from frf_ipz.errors import FileFormatError, did_you_mean
from frf_ipz.fe import kinds
from frf_ipz.fe.model_options import ModelSection
from frf_ipz.fe.model_ports import with_stated_ports
from frf_ipz.option_types import Name
from frf_ipz.toml_files import read_toml

if TYPE_CHECKING:
    from collections.abc import Mapping

    from frf_ipz.structure import StructuralModel


class Kind(Protocol):
    """Interface of a module of `fe.kinds`.

    Parameters
    ----------
    KIND : str
        Its name in ``[model] kind``.
    FILE : type
        Options dataclass of the whole file.
    """

    KIND: str
    FILE: type

    def files(self, file: Any, path: Path) -> tuple[Path, ...]:  # noqa: ANN401 - each kind has its own dataclass
        """Files besides ``model.toml`` that the model is made of.

        Parameters
        ----------
        file : FILE
            Content of ``model.toml``.
        path : Path
            Its path.

        Returns
        -------
        tuple of Path
            The files.
        """

    def read(self, file: Any, path: Path) -> StructuralModel:  # noqa: ANN401 - each kind has its own dataclass
        """Check the options and build the model.

        Parameters
        ----------
        file : FILE
            Content of ``model.toml``.
        path : Path
            Its path.

        Returns
        -------
        StructuralModel
            The model.
        """


@dataclass(frozen=True, slots=True, kw_only=True)
class _KindKey:
    """The key that determines how the rest of the file is read."""

    __pydantic_config__ = {"extra": "ignore"}  # noqa: RUF012 - pydantic's own attribute

    kind: Name = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Head:
    """The section with the kind, whatever else it holds: wrong keys of all sections are named at once."""

    __pydantic_config__ = {"extra": "ignore"}  # noqa: RUF012 - pydantic's own attribute

    model: _KindKey


@dataclass(frozen=True, slots=True, kw_only=True)
class _Model:
    """The section with the kind, checked."""

    __pydantic_config__ = {"extra": "ignore"}  # noqa: RUF012 - pydantic's own attribute

    model: ModelSection


def read_model(path: str | Path) -> StructuralModel:
    """Read an FE model.

    Parameters
    ----------
    path : str or Path
        Its ``model.toml``.

    Returns
    -------
    StructuralModel
        The model, with all its DOFs, the held ones included.

    Raises
    ------
    FileFormatError
        If a file is missing or something in it does not fit: says which file, where, and what to do.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import frf_ipz
    >>> text = '''
    ... [model]
    ... kind = "beam"
    ... [beam]
    ... length_m = 0.5
    ... width_m = 0.02
    ... thickness_m = 0.005
    ... youngs_modulus_Pa = 70e9
    ... density_kg_m3 = 2700.0
    ... elements = 10
    ... left = "clamped"
    ... '''
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "model.toml"
    ...     _ = path.write_text(text)
    ...     frf_ipz.read_model(path)
    StructuralModel: model (beam), 20 free DOFs, 11 nodes
    """
    path = as_path(path)
    kind, file = _read_options(path)
    model = kind.read(file.model.system.options_in_si(file), path)
    return with_stated_ports(model, getattr(file, "port", ()), path)  # a user's own kind may have none


def model_files(path: Path) -> tuple[Path, ...]:
    """Name all files that a model is made of.

    Parameters
    ----------
    path : Path
        Its ``model.toml``.

    Returns
    -------
    tuple of Path
        ``model.toml`` first; the others need not exist.

    Raises
    ------
    FileFormatError
        If ``model.toml`` cannot be read.
    """
    kind, file = _read_options(path)
    return (path, *kind.files(file, path))


def model_kinds() -> Mapping[str, Kind]:
    """Find the kinds of models.

    Returns
    -------
    mapping of str to Kind
        Modules of `fe.kinds` by the name of their kind.
    """
    modules = [
        cast("Kind", import_module(f"{kinds.__name__}.{module.name}"))
        for module in pkgutil.iter_modules(kinds.__path__)
    ]
    return {module.KIND: module for module in modules}


def _read_options(path: Path) -> tuple[Kind, Any]:
    head = read_toml(path, _Head, required="model")
    available = model_kinds()
    if head.model.kind not in available:
        read_toml(path, _Model)
        advice = did_you_mean(head.model.kind, available)
        raise FileFormatError(path, f"'{head.model.kind}' is no kind of model; {advice}", where="key 'model.kind'")
    kind = available[head.model.kind]
    return kind, read_toml(path, kind.FILE)
