"""A test as the user describes it in `test.toml`: channels, struck DOFs, files; checked, with paths resolved."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from frf_ipz.dofs import Dof, parse_dof
from frf_ipz.errors import FileFormatError, InputError, QuantityError, did_you_mean
from frf_ipz.frf import FrfLabel
from frf_ipz.ingest.campaign_keys import CampaignFileKeys, ChannelKeys, FrfKeys, SetupKeys
from frf_ipz.ingest.file_patterns import expand_pattern
from frf_ipz.ingest.formats.frf_file import FrfSource
from frf_ipz.ingest.formats.registry import read_frfs
from frf_ipz.ingest.units import numerator_of, sensitivity_factor, unit_factor
from frf_ipz.quantities import FrfQuantity, frf_quantity_of
from frf_ipz.toml_files import read_toml

if TYPE_CHECKING:
    from collections.abc import Iterable

ENTRIES = {"hammer": "hit", "random": "record", "frf": "frf"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """A column of the recordings.

    Parameters
    ----------
    column : str
        Its header, or its number in files without one.
    role : str
        ``input`` or ``output``.
    quantity : str
        ``force``, ``acceleration``, ``velocity`` or ``displacement``.
    unit, sensitivity : str
        At most one is not empty; where both are, the files' row of units counts.
    dof : Dof, optional
        Where an output sits, unless a run says otherwise.
    mass_kg : float
        The sensor's own mass.
    """

    column: str
    role: str
    quantity: str
    unit: str = ""
    sensitivity: str = ""
    dof: Dof | None = None
    mass_kg: float = 0.0

    @property
    def column_unit(self) -> str:
        """The unit the column is in, as far as the test says; empty where the files have to."""
        return numerator_of(self.sensitivity) if self.sensitivity else self.unit


@dataclass(frozen=True, slots=True, kw_only=True)
class TestSetup:
    """Recordings with the force at one DOF and the sensors in one place.

    Parameters
    ----------
    input_dof : Dof
        Where the force acts, with its sign.
    output_dofs : tuple of Dof
        Where the outputs sit, in the order of the output channels.
    files : tuple of Path
        The recordings, sorted.
    """

    input_dof: Dof
    output_dofs: tuple[Dof, ...]
    files: tuple[Path, ...]


@dataclass(frozen=True, kw_only=True)
class VibrationTest:
    """A test: what was measured, where, and in which files.

    Parameters
    ----------
    path : Path
        ``test.toml``.
    name : str
        What the user calls it.
    kind : str
        ``hammer``, ``random`` or ``frf``.
    nominal_damping_ratio : float, optional
        For models that state no damping.
    unknown_scale : str
        ``none``, ``common`` or ``per_channel``.
    channels : tuple of Channel
        The input first; none of kind ``frf``.
    setups : tuple of TestSetup
        One a struck DOF and layout of sensors; none of kind ``frf``.
    frf_sources : tuple of FrfSource
        Files with FRFs, of kind ``frf``.
    labels : tuple of FrfLabel
        The FRFs that the test gives, each once.
    """

    path: Path
    name: str
    kind: str
    nominal_damping_ratio: float | None
    unknown_scale: str
    channels: tuple[Channel, ...]
    setups: tuple[TestSetup, ...]
    frf_sources: tuple[FrfSource, ...]
    labels: tuple[FrfLabel, ...]

    @property
    def input_channel(self) -> Channel:
        """The force."""
        return self.channels[0]

    @property
    def output_channels(self) -> tuple[Channel, ...]:
        """The responses."""
        return self.channels[1:]

    @property
    def output_dofs(self) -> tuple[Dof, ...]:
        """Where sensors sit in any of the FRFs, each once."""
        return tuple(dict.fromkeys(label.output_dof for label in self.labels))

    @property
    def input_dofs(self) -> tuple[Dof, ...]:
        """Where forces act in any of the FRFs, each once."""
        return tuple(dict.fromkeys(label.input_dof for label in self.labels))

    @property
    def files(self) -> tuple[Path, ...]:
        """All files of measurements, each once."""
        recordings = [file for setup in self.setups for file in setup.files]
        return tuple(dict.fromkeys([*recordings, *(source.path for source in self.frf_sources)]))

    @cached_property
    def sensor_masses(self) -> dict[int, float]:
        """Known masses of the sensors by node, kg.

        A sensor that moves from hit to hit counts at each node with the share of recordings during which it sat there:
        to first order in the mass, that is the structure whose FRFs are the mean over all recordings.
        """
        return self._masses(self.setups)

    def masses_with(self, label: FrfLabel) -> dict[int, float]:
        """Give the known masses of the sensors while one FRF was measured.

        Parameters
        ----------
        label : FrfLabel
            One of `labels`.

        Returns
        -------
        dict of int to float
            Node and mass, kg.
        """
        return self._masses([setup for setup in self.setups if label in setup_labels(self.channels, setup)])

    def _masses(self, setups: Iterable[TestSetup]) -> dict[int, float]:
        setups = list(setups)
        n_files = sum(len(setup.files) for setup in setups)
        masses: Counter[int] = Counter()
        for setup in setups:
            for channel, dof in zip(self.output_channels, setup.output_dofs, strict=True):
                if channel.mass_kg:
                    masses[dof.node] += channel.mass_kg * len(setup.files) / n_files  # type: ignore[assignment] # kg, no count
        return dict(masses)


def read_test(path: Path) -> VibrationTest:
    """Read a test.

    Parameters
    ----------
    path : Path
        ``test.toml``.

    Returns
    -------
    VibrationTest
        Checked, with all globs expanded; the recordings are not read yet.

    Raises
    ------
    FileFormatError
        If a key is wrong or missing, a name is unknown or used twice, or no file fits a glob.
    QuantityError
        If a unit is none of its quantity.
    """
    path = path.resolve()
    keys = read_toml(path, CampaignFileKeys, required="test")
    _check_sections(path, keys)
    channels = _read_channels(path, keys)
    entries = keys.hit or keys.record
    setups = tuple(
        _read_setup(path, entry, channels, f"[[{ENTRIES[keys.test.kind]}]] {entry.dof}") for entry in entries
    )
    _check_units(path, channels, setups)
    _check_files_once(path, setups)
    sources = tuple(_read_source(path, entry) for entry in keys.frf)
    labels = [label for setup in setups for label in setup_labels(channels, setup)]
    labels += [label for source in sources for label in _labels_of_source(source)]
    return VibrationTest(
        path=path,
        name=keys.test.name or path.parent.name,
        kind=keys.test.kind,
        nominal_damping_ratio=keys.test.nominal_damping_ratio,
        unknown_scale=keys.test.unknown_scale,
        channels=channels,
        setups=setups,
        frf_sources=sources,
        labels=tuple(dict.fromkeys(labels)),
    )


def setup_labels(channels: tuple[Channel, ...], setup: TestSetup) -> tuple[FrfLabel, ...]:
    """Name the FRFs that a run gives.

    Parameters
    ----------
    channels : tuple of Channel
        The input first.
    setup : TestSetup
        The run.

    Returns
    -------
    tuple of FrfLabel
        One an output channel, in their order.
    """
    return tuple(
        FrfLabel(dof, setup.input_dof, frf_quantity_of(channel.quantity), channel.column, channels[0].column)
        for channel, dof in zip(channels[1:], setup.output_dofs, strict=True)
    )


def frf_label(output_dof: Dof, input_dof: Dof, quantity: FrfQuantity) -> FrfLabel:
    """Name an FRF that was estimated elsewhere; its channels are called after its DOFs.

    Parameters
    ----------
    output_dof, input_dof : Dof
        What it connects.
    quantity : FrfQuantity
        What it is.

    Returns
    -------
    FrfLabel
        The label.
    """
    return FrfLabel(output_dof, input_dof, quantity, f"output {output_dof}", f"input {input_dof}")


def _labels_of_source(source: FrfSource) -> list[FrfLabel]:
    if source.output_dof is not None and source.input_dof is not None:
        return [frf_label(source.output_dof, source.input_dof, source.quantity)]
    return [frf_label(frf.output_dof, frf.input_dof, source.quantity) for frf in read_frfs(source)]


def _check_sections(path: Path, keys: CampaignFileKeys) -> None:
    kind = keys.test.kind
    wanted = ENTRIES[kind]
    given = [name for name in ("hit", "record", "frf") if getattr(keys, name)]
    for name in given:
        if name != wanted:
            raise FileFormatError(path, f"a test of kind '{kind}' has [[{wanted}]] entries", where=f"key '{name}'")
    if not given:
        raise FileFormatError(path, f"a test of kind '{kind}' needs at least one [[{wanted}]]")
    if kind == "frf" and keys.channel:
        problem = "a test of kind 'frf' has no channels: its FRFs say themselves what they connect"
        raise FileFormatError(path, problem, where="key 'channel'")
    ratio = keys.test.nominal_damping_ratio
    if ratio is not None and not 0.0 <= ratio < 1.0:
        problem = f"must be a damping ratio from 0 to below 1; given is {ratio:g}"
        raise FileFormatError(path, problem, where="key 'test.nominal_damping_ratio'")


def _read_channels(path: Path, keys: CampaignFileKeys) -> tuple[Channel, ...]:
    if keys.test.kind == "frf":
        return ()
    channels = [_read_channel(path, entry) for entry in keys.channel]
    for column, count in Counter(channel.column for channel in channels).items():
        if count > 1:
            raise FileFormatError(path, f"{count} channels have the column '{column}'; name each column once")
    inputs = [channel for channel in channels if channel.role == "input"]
    if len(inputs) != 1:
        raise FileFormatError(path, f"needed is exactly one [[channel]] with role = 'input'; given are {len(inputs)}")
    outputs = [channel for channel in channels if channel.role == "output"]
    if not outputs:
        raise FileFormatError(path, "needed is at least one [[channel]] with role = 'output'")
    return (inputs[0], *outputs)


def _read_channel(path: Path, keys: ChannelKeys) -> Channel:
    where = f"[[channel]] '{keys.column}'"
    if (keys.role == "input") != (keys.quantity == "force"):
        problem = f"the input is a force and an output a motion; given are role '{keys.role}' and '{keys.quantity}'"
        raise FileFormatError(path, problem, where=where)
    if keys.unit is not None and keys.sensitivity is not None:
        raise FileFormatError(path, "has both 'unit' and 'sensitivity'; a sensitivity replaces the unit", where=where)
    if keys.role == "input" and (keys.dof or keys.mass_kg):
        raise FileFormatError(path, "an input has no 'dof' and no 'mass_kg': the hits say where it acts", where=where)
    if keys.mass_kg < 0.0:
        raise FileFormatError(path, f"'mass_kg' is negative ({keys.mass_kg:g})", where=where)
    return Channel(
        column=str(keys.column),
        role=keys.role,
        quantity=keys.quantity,
        unit=keys.unit or "",
        sensitivity=keys.sensitivity or "",
        dof=None if keys.dof is None else _dof(path, keys.dof, where),
        mass_kg=keys.mass_kg,
    )


def _check_units(path: Path, channels: tuple[Channel, ...], setups: tuple[TestSetup, ...]) -> None:
    """Refuse units that cannot be right before anything is read; a moment or a rotation has its own."""
    for setup in setups:
        for channel, dof in zip(channels, (setup.input_dof, *setup.output_dofs), strict=True):
            if not channel.unit and not channel.sensitivity:
                continue
            convert = sensitivity_factor if channel.sensitivity else unit_factor
            try:
                convert(channel.sensitivity or channel.unit, channel.quantity, rotational=dof.direction.startswith("r"))
            except InputError as error:
                raise QuantityError(f"{path}, [[channel]] '{channel.column}' at {dof}: {error}") from None


def _read_setup(path: Path, keys: SetupKeys, channels: tuple[Channel, ...], where: str) -> TestSetup:
    outputs = {channel.column: channel.dof for channel in channels[1:]}
    for column, text in keys.output_dofs.items():
        if column not in outputs:
            problem = f"'output_dofs' names '{column}', which is no output channel; {did_you_mean(column, outputs)}"
            raise FileFormatError(path, problem, where=where)
        outputs[column] = _dof(path, text, where)
    missing = [column for column, dof in outputs.items() if dof is None]
    if missing:
        problem = f"the output '{missing[0]}' has no DOF: give its channel a 'dof', or name it in 'output_dofs'"
        raise FileFormatError(path, problem, where=where)
    _check_places(path, channels[1:], tuple(dof for dof in outputs.values() if dof is not None), where)
    files = [file for pattern in keys.files for file in expand_pattern(path, pattern, where=where)]
    if not files:
        raise FileFormatError(path, "'files' is empty; name at least one recording", where=where)
    return TestSetup(
        input_dof=_dof(path, keys.dof, where),
        output_dofs=tuple(dof for dof in outputs.values() if dof is not None),
        files=tuple(dict.fromkeys(files)),
    )


def _check_places(path: Path, outputs: tuple[Channel, ...], dofs: tuple[Dof, ...], where: str) -> None:
    """Refuse two outputs that would measure the same motion: FRFs are told apart by DOFs and quantity."""
    owners: dict[tuple[int, str, str], Channel] = {}
    for channel, dof in zip(outputs, dofs, strict=True):
        other = owners.setdefault((dof.node, dof.direction, channel.quantity), channel)
        if other is not channel:
            problem = f"'{other.column}' and '{channel.column}' both measure the {channel.quantity} at {dof}"
            raise FileFormatError(path, f"{problem}; correct a 'dof', or take one channel out", where=where)


def _check_files_once(path: Path, setups: tuple[TestSetup, ...]) -> None:
    owners: dict[Path, TestSetup] = {}
    for setup in setups:
        for file in setup.files:
            other = owners.setdefault(file, setup)
            if other is not setup:
                problem = f"{file.name} belongs to the entries of {other.input_dof} and of {setup.input_dof}"
                raise FileFormatError(path, f"{problem}; a recording has one place of the force")


def _read_source(path: Path, keys: FrfKeys) -> FrfSource:
    where = f"[[frf]] '{keys.file}'"
    return FrfSource(
        path=path.parent / keys.file,
        quantity=FrfQuantity(keys.quantity),
        unit=keys.unit or "",
        output_dof=None if keys.output_dof is None else _dof(path, keys.output_dof, where),
        input_dof=None if keys.input_dof is None else _dof(path, keys.input_dof, where),
        columns=keys.columns,
        skip_rows=keys.skip_rows,
    )


def _dof(path: Path, text: str, where: str) -> Dof:
    try:
        return parse_dof(text)
    except InputError as error:
        raise FileFormatError(path, str(error), where=where) from None
