"""The keys of `test.toml`, as the contract names them; `test_file` makes a `Test` of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from frf_ipz.toml_files import STRICT


@dataclass(frozen=True, slots=True, kw_only=True)
class TestKeys:
    """The section ``[test]``.

    Parameters
    ----------
    name : str
        What the user calls it.
    kind : str
        ``hammer``, ``random`` or ``frf``.
    nominal_damping_ratio : float, optional
        For models that state no damping.
    unknown_scale : str
        ``none``, ``common`` or ``per_channel``.
    """

    __pydantic_config__ = STRICT

    kind: Literal["hammer", "random", "frf"]
    name: str = ""
    nominal_damping_ratio: float | None = None
    unknown_scale: Literal["none", "common", "per_channel"] = "none"


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelKeys:
    """One ``[[channel]]``.

    Parameters
    ----------
    column : str
        Header of its column; in files without a header its number, the time being column 1.
    role : str
        ``input`` or ``output``.
    quantity : str
        ``force``, ``acceleration``, ``velocity`` or ``displacement``.
    unit : str, optional
        Of the column; not needed where the files have a row of units.
    sensitivity : str, optional
        Instead of the unit.
    dof : str, optional
        Where an output sits; a hit may say otherwise.
    mass_kg : float
        The sensor's own mass.
    """

    __pydantic_config__ = STRICT

    column: str | int
    role: Literal["input", "output"]
    quantity: Literal["force", "acceleration", "velocity", "displacement"]
    unit: str | None = None
    sensitivity: str | None = None
    dof: str | None = None
    mass_kg: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SetupKeys:
    """One ``[[hit]]`` or ``[[record]]``.

    Parameters
    ----------
    dof : str
        Where the force acts.
    files : tuple of str
        Globs.
    output_dofs : dict of str to str
        Column of a roving sensor and where it sits during these.
    """

    __pydantic_config__ = STRICT

    dof: str
    files: tuple[str, ...]
    output_dofs: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class FrfKeys:
    """One ``[[frf]]``.

    Parameters
    ----------
    file : str
        Path of the file.
    quantity : str
        ``receptance``, ``mobility`` or ``accelerance``.
    unit : str, optional
        Of the values; SI where it is left out and the file does not say.
    output_dof, input_dof : str, optional
        Needed for a file that does not say what it connects.
    columns : tuple of str
        What the columns of a text file are.
    skip_rows : int
        Lines before the numbers of a text file; further lines of text are skipped without being counted.
    """

    __pydantic_config__ = STRICT

    file: str
    quantity: Literal["receptance", "mobility", "accelerance"]
    unit: str | None = None
    output_dof: str | None = None
    input_dof: str | None = None
    columns: tuple[str, ...] = ()
    skip_rows: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignFileKeys:
    """The whole file.

    Parameters
    ----------
    test : TestKeys
        ``[test]``.
    channel : tuple of ChannelKeys
        ``[[channel]]``.
    hit, record : tuple of SetupKeys
        ``[[hit]]`` of kind ``hammer``, ``[[record]]`` of kind ``random``.
    frf : tuple of FrfKeys
        ``[[frf]]`` of kind ``frf``.
    """

    __pydantic_config__ = STRICT

    test: TestKeys
    channel: tuple[ChannelKeys, ...] = ()
    hit: tuple[SetupKeys, ...] = ()
    record: tuple[SetupKeys, ...] = ()
    frf: tuple[FrfKeys, ...] = ()
