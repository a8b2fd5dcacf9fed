"""`test.toml`: its keys as the contract names them, read into a `VibrationTest`; checked, with paths resolved."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from frf_ipz.arguments import require_file
from frf_ipz.dofs import AnyDof, Dof, as_direction, parse_label
from frf_ipz.errors import FileFormatError, InputError, QuantityError, did_you_mean, errors_of_file
from frf_ipz.frf import FrfLabel
from frf_ipz.ingest.campaign import (
    PARTICULARS,
    RATE_VARIABLE,
    TIME_VARIABLE,
    Channel,
    SecondRecorder,
    TestSetup,
    VibrationTest,
    setup_labels,
)
from frf_ipz.ingest.formats.frf_conventions import read_frf_source
from frf_ipz.ingest.formats.frf_file import FrfSource, frf_label
from frf_ipz.ingest.formats.modes_file import ModesSource
from frf_ipz.ingest.formats.recording import TableKeys
from frf_ipz.ingest.formats.registry import read_frf_file, read_modes_file
from frf_ipz.ingest.formats.transmissibility import no_reference
from frf_ipz.ingest.units import sensitivity_factor, unit_factor
from frf_ipz.meshes.registry import read_mesh
from frf_ipz.option_types import ColumnNumber, Count, CountOrNone, Day, NotNegative, Positive, Ratio, Truth
from frf_ipz.quantities import RECIPROCALS, FrfQuantity
from frf_ipz.toml_files import STRICT, read_toml

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from frf_ipz.dofs import PortDof

TRANSMISSIBILITY = "transmissibility"
ENTRY_OF_KIND = {"hammer": "hit", "random": "record", "frf": "frf", "modes": "modes"}

WITHOUT_CHANNELS = {"frf": "FRFs say themselves what they connect", "modes": "modes name their DOFs themselves"}


@dataclass(frozen=True, slots=True, kw_only=True)
class TestKeys:
    """``[test]``: what the test is called, and of which kind it is.

    Parameters
    ----------
    name : str
        What the user calls it.
    kind : str
        Impacts of a hammer, long records of a shaker, FRFs that were estimated elsewhere, or modes without any FRF.
    nominal_damping_ratio : float, optional
        Damping ratio of all modes, for models that state no damping.
    unknown_scale : str
        Absolute scale that is not known: of no channel, of all together, or of each; such gains are fitted, not
        diagnosed.
    time_column : str or int
        Name of the column that is the time, or its number; the first column where it is left out, whatever it is
        called, where it grows by equal steps. Times of day are read too.
    sample_rate_hz : float, optional
        Samples a second, for recordings without a column of time, or with too few digits in it.
    header_row : int, optional
        Line of the columns' names in the recordings, counted from 1; found where it is left out.
    applied_exponential_window_s : float, optional
        Time constant of a window that the analyser has already put on the responses, 1 at the first sample, s. Its
        damping is taken back.
    operator : str
        Who measured; shown on the page, as the keys below, and used for nothing else.
    date : str
        When it was measured: a date, such as 2026-11-27, or any text.
    equipment, customer : str
        What it was measured with, and for whom.
    serial_number : str
        Of the machine that was measured.
    geometry : str
        File with the measured nodes and the lines or elements between them, for drawings where there is no FE model:
        any that ``[matrices] nodes`` takes, such as a universal file.
    """

    __pydantic_config__ = STRICT

    kind: Literal["hammer", "random", "frf", "modes"]
    name: str = ""
    nominal_damping_ratio: Ratio | None = None
    unknown_scale: Literal["none", "common", "per_channel"] = "none"
    time_column: str | ColumnNumber = ""
    sample_rate_hz: Positive | None = None
    header_row: Count | None = None
    applied_exponential_window_s: Positive | None = None
    operator: str = ""
    date: Day = ""
    equipment: str = ""
    customer: str = ""
    serial_number: str = ""
    geometry: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelKeys:
    """``[[channel]]``: one column of the recordings, and what it measures.

    Parameters
    ----------
    column : str
        Header of its column; or its number, counted from 1, in files without a header or with a name twice.
    role : str
        The input is the force; there is one, or several of shakers that act at once.
    quantity : str
        What is measured; at a rotation, force stands for the moment, and the others for angular motion.
    unit : str, optional
        Of the column: anything that pint reads. Not needed where the files have a row of units.
    sensitivity : str, optional
        Instead of the unit, for example ``"10.2 mV/g_0"``: the column is then in the numerator's unit.
    wrong_file_unit : str, optional
        A unit that the files state for this column and that is wrong, as programs of acquisition put one there by
        themselves: it is passed over, and `unit` or `sensitivity` counts.
    dof : str, optional
        Where an output sits, or one of several forces acts; a ``[[hit]]`` or ``[[record]]`` may say otherwise.
    mass_kg : float
        The sensor's own mass, where it is known: part of the model while the sensor sits there.
    """

    __pydantic_config__ = STRICT

    column: str | ColumnNumber
    role: Literal["input", "output"]
    quantity: Literal["force", "acceleration", "velocity", "displacement"]
    unit: str | None = None
    sensitivity: str | None = None
    wrong_file_unit: str | None = None
    dof: str | None = None
    mass_kg: NotNegative = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondRecorderKeys:
    """``second_recorder`` of ``[[hit]]`` or ``[[record]]``: some channels stand in files of their own.

    Parameters
    ----------
    files : tuple of str
        Globs; sorted, they are as many as the entry's own ``files`` and in the same order.
    columns : dict of str to str
        Column of a channel that this recorder has, and what its files call it; ``time`` and ``sample_rate_hz`` too.
    common : dict of str to str
        Column of a channel that the first recorder has, and what this one calls the same signal: the records are
        aligned by it. Without it both are taken to begin by one trigger, as the times in their files say.
    """

    __pydantic_config__ = STRICT

    files: tuple[str, ...]
    columns: dict[str, str]
    common: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class SetupKeys:
    """``[[hit]]`` of a hammer or ``[[record]]`` of a shaker: one entry for each excited DOF.

    Parameters
    ----------
    dof : str
        Where the force acts, with its sign; left out where several forces act at once.
    files : tuple of str
        Globs, relative to the file or absolute.
    input_dofs : dict of str to str
        Column of a force and where it acts in these files, where several act at once and the channel does not say it.
    output_dofs : dict of str to str
        Column of a roving sensor and where it sits in these files.
    variables : dict of str to str
        Column of a channel, and what these files call it, where that differs; ``time`` and ``sample_rate_hz`` too.
        In files of arrays a name, or a column as in ``data(:,2)`` (counted from 1) or ``data[:,1]`` (from 0).
    second_recorder : SecondRecorderKeys, optional
        Files of a second recorder that ran at the same time, with the channels that it has.
    """

    __pydantic_config__ = STRICT

    files: tuple[str, ...]
    dof: str = ""
    input_dofs: dict[str, str] = field(default_factory=dict)
    output_dofs: dict[str, str] = field(default_factory=dict)
    variables: dict[str, str] = field(default_factory=dict)
    second_recorder: SecondRecorderKeys | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FrfKeys:
    """``[[frf]]``: a file of FRFs.

    Parameters
    ----------
    file : str
        Its path.
    quantity : str
        Displacement, velocity or acceleration over force; or force over one of them, whose reciprocals are taken. The
        output is where the motion was measured, and the input where the force acts, in both. A transmissibility is a
        response over that of a reference, its input; it is multiplied by the FRF of the reference, another ``[[frf]]``.
    force_dof : str, optional
        Where the force acts, for a transmissibility.
    unit : str, optional
        Of the values; SI where it is left out and the file does not say.
    output_dof, input_dof : str or tuple of str, optional
        Needed for a file that does not say what it connects; lists for a file of arrays that holds several FRFs.
    columns : tuple of str
        What the columns of a text file with one FRF are: ``frequency_hz``, ``frequency_rad_s``, or ``frequency`` in
        the unit that the header states; ``real`` and ``imag``, or ``magnitude`` or
        ``magnitude_db`` with ``phase_deg`` or ``phase_rad``; ``coherence``, ``variance``, ``skip``.
    skip_rows : int
        Lines before the numbers of a text file; further lines of text are skipped without being counted.
    direction : str
        Direction of the nodes of a universal file that have none, such as ``"z"`` or ``"-z"``.
    sets : tuple of int
        Which data sets of a universal file to read, counted from 1; all FRFs where it is left out.
    conjugated : bool
        The file has the time convention exp(-i omega t): its FRFs are the complex conjugate of ours.
    variables : dict of str to str
        What stands where in a file of arrays: ``frequency_hz`` or ``frequency_rad_s``, or ``frequency_step_hz`` with
        ``frequency_start_hz``, or ``sample_rate_hz`` where the lines go to half of it; ``frf``, or ``real`` and
        ``imag``, or ``magnitude`` or ``magnitude_db`` with ``phase_deg`` or ``phase_rad``; ``coherence``, ``variance``.
        Found by names and shapes where it is left out.
    level : float, optional
        Amplitude of the excitation, N, where the test holds the same FRFs at several: the fit is of the weakest, and
        the others show how its modes move.
    """

    __pydantic_config__ = STRICT

    file: str
    quantity: Literal[
        "receptance", "mobility", "accelerance", "dynamic_stiffness", "impedance", "apparent_mass", "transmissibility"
    ]
    unit: str | None = None
    force_dof: str | None = None
    output_dof: str | tuple[str, ...] | None = None
    input_dof: str | tuple[str, ...] | None = None
    columns: tuple[str, ...] = ()
    skip_rows: CountOrNone = 0
    direction: str = ""
    sets: tuple[Count, ...] = ()
    conjugated: Truth = False
    variables: dict[str, str] = field(default_factory=dict)
    level: Positive | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ModesKeys:
    """``[[modes]]``: a file of modes that were identified elsewhere.

    Parameters
    ----------
    file : str
        Universal file with data sets 55 or 2414; or CSV
        ``mode,frequency_hz,damping_ratio[,frequency_std_hz,damping_ratio_std],dof,real,imag`` with one row a mode and
        DOF.
    input_dofs : tuple of str
        Where forces act in the FRFs that the model predicts; the points of interest where it is left out.
    quantity : str
        What these FRFs are.
    """

    __pydantic_config__ = STRICT

    file: str
    input_dofs: tuple[str, ...] = ()
    quantity: Literal["receptance", "mobility", "accelerance"] = "accelerance"


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
    modes : tuple of ModesKeys
        ``[[modes]]`` of kind ``modes``: one.
    """

    __pydantic_config__ = STRICT

    test: TestKeys
    channel: tuple[ChannelKeys, ...] = ()
    hit: tuple[SetupKeys, ...] = ()
    record: tuple[SetupKeys, ...] = ()
    frf: tuple[FrfKeys, ...] = ()
    modes: tuple[ModesKeys, ...] = ()


def read_test_keys(path: Path) -> CampaignFileKeys:
    """Read what a test says, and no file that it names.

    Parameters
    ----------
    path : Path
        ``test.toml``.

    Returns
    -------
    CampaignFileKeys
        Its keys, each for itself.

    Raises
    ------
    FileFormatError
        If keys are wrong or missing.
    """
    return read_toml(require_file(path).resolve(), CampaignFileKeys, required="test")


def read_test(path: str | Path) -> VibrationTest:
    """Read a test.

    Parameters
    ----------
    path : str or Path
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

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import frf_ipz
    >>> text = '''
    ... [test]
    ... kind = "frf"
    ... [[frf]]
    ... file = "tip.csv"
    ... quantity = "accelerance"
    ... '''
    >>> table = '''frequency_hz,output_dof,input_dof,real,imag
    ... 10,11:+z,6:+z,0.1,0.01
    ... 20,11:+z,6:+z,0.3,0.02
    ... '''
    >>> with TemporaryDirectory() as folder:
    ...     _ = (Path(folder) / "test.toml").write_text(text)
    ...     _ = (Path(folder) / "tip.csv").write_text(table)
    ...     [str(label) for label in frf_ipz.read_test(f"{folder}/test.toml").labels]
    ['11:+z / 6:+z']
    """
    path = require_file(path).resolve()
    keys = read_test_keys(path)
    _check_sections(path, keys)
    channels = _read_channels(path, keys)
    entries = keys.hit or keys.record
    setups = tuple(
        _read_setup(path, entry, channels, f"[[{ENTRY_OF_KIND[keys.test.kind]}]] {entry.dof}".rstrip())
        for entry in entries
    )
    setups = tuple(_with_port_units(setup, channels) for setup in setups)
    _check_units(path, channels, setups)
    _check_files_once(path, setups)
    stated = tuple(_read_source(path, entry) for entry in keys.frf)
    sources = tuple(_with_reference(source, stated) for source in stated)
    labels = [label for setup in setups for label in setup_labels(channels, setup)]
    labels += [label for source in sources for label in _labels_of_source(source)]
    modes_source = next((_read_modes_source(path, entry) for entry in keys.modes), None)
    modes = None if modes_source is None else read_modes_file(modes_source)
    labels += [] if modes is None else modes.labels
    geometry_path = path.parent / keys.test.geometry if keys.test.geometry else None
    return VibrationTest(
        path=path,
        name=keys.test.name or path.parent.name,
        kind=keys.test.kind,
        nominal_damping_ratio=keys.test.nominal_damping_ratio,
        unknown_scale=keys.test.unknown_scale,
        table=TableKeys(
            time_column=str(keys.test.time_column),
            sample_rate_hz=keys.test.sample_rate_hz,
            header_row=keys.test.header_row,
        ),
        applied_window_s=keys.test.applied_exponential_window_s,
        channels=channels,
        setups=setups,
        frf_sources=sources,
        modes_path=None if modes_source is None else modes_source.path,
        modes=modes,
        geometry_path=geometry_path,
        geometry=None if geometry_path is None else read_mesh(geometry_path).geometry(),
        particulars={name: text for name in PARTICULARS if (text := getattr(keys.test, name).strip())},
        labels=tuple(dict.fromkeys(labels)),
    )


def _labels_of_source(source: FrfSource) -> list[FrfLabel]:
    if source.reference is not None:
        return [frf.label for frf in read_frf_source(source)]
    if source.output_dof is not None and source.input_dof is not None:
        return [frf_label(source.output_dof, source.input_dof, source.quantity)]
    return [frf.label for frf in read_frf_file(source)]


def _check_sections(path: Path, keys: CampaignFileKeys) -> None:
    kind = keys.test.kind
    entry = ENTRY_OF_KIND[kind]
    present = [name for name in ENTRY_OF_KIND.values() if getattr(keys, name)]
    for name in present:
        if name != entry:
            raise FileFormatError(path, f"a test of kind '{kind}' has [[{entry}]] entries", where=f"key '{name}'")
    if kind == "random" and keys.test.applied_exponential_window_s is not None:
        problem = "an exponential window belongs to impacts: on the record of a shaker it distorts; record without it"
        raise FileFormatError(path, problem, where="key 'test.applied_exponential_window_s'")
    if not present:
        raise FileFormatError(path, f"a test of kind '{kind}' needs at least one [[{entry}]]")
    if kind in WITHOUT_CHANNELS and keys.channel:
        problem = f"a test of kind '{kind}' has no channels: its {WITHOUT_CHANNELS[kind]}"
        raise FileFormatError(path, problem, where="key 'channel'")
    if len(keys.modes) > 1:
        problem = f"has {len(keys.modes)} [[modes]]; put all modes into one file, each with a row for each DOF"
        raise FileFormatError(path, problem, where="key 'modes'")


def _read_channels(path: Path, keys: CampaignFileKeys) -> tuple[Channel, ...]:
    if keys.test.kind in WITHOUT_CHANNELS:
        return ()
    channels = [_read_channel(path, entry) for entry in keys.channel]
    for column, count in Counter(channel.column for channel in channels).items():
        if count > 1:
            raise FileFormatError(
                path,
                f"{count} channels have the column '{column}'; name each column once; where "
                "the file calls several so, write their numbers, as in column = 2",
            )
    inputs = [channel for channel in channels if channel.role == "input"]
    if len(inputs) != 1 and (keys.test.kind != "random" or not inputs):
        several = "; several forces at once belong to a test of kind 'random'" if inputs else ""
        problem = f"needed is exactly one [[channel]] with role = 'input'; given are {len(inputs)}{several}"
        raise FileFormatError(path, problem)
    if len(inputs) == 1 and inputs[0].dof is not None:
        problem = "an input has no 'dof' where it is the only one: the [[hit]] or [[record]] says where it acts"
        raise FileFormatError(path, problem, where=f"[[channel]] '{inputs[0].column}'")
    outputs = [channel for channel in channels if channel.role == "output"]
    if not outputs:
        raise FileFormatError(path, "needed is at least one [[channel]] with role = 'output'")
    return (*inputs, *outputs)


def _read_channel(path: Path, keys: ChannelKeys) -> Channel:
    where = f"[[channel]] '{keys.column}'"
    if (keys.role == "input") != (keys.quantity == "force"):
        problem = f"the input is a force and an output a motion; given are role '{keys.role}' and '{keys.quantity}'"
        raise FileFormatError(path, problem, where=where)
    if keys.unit is not None and keys.sensitivity is not None:
        raise FileFormatError(path, "has both 'unit' and 'sensitivity'; a sensitivity replaces the unit", where=where)
    if keys.wrong_file_unit is not None and keys.unit is None and keys.sensitivity is None:
        raise FileFormatError(path, "'wrong_file_unit' needs the right 'unit', or a 'sensitivity'", where=where)
    if keys.role == "input" and keys.mass_kg:
        raise FileFormatError(path, "an input has no 'mass_kg': the shaker is no part of the structure", where=where)
    return Channel(
        column=str(keys.column),
        role=keys.role,
        quantity=keys.quantity,
        unit=keys.unit or "",
        sensitivity=keys.sensitivity or "",
        wrong_file_unit=keys.wrong_file_unit or "",
        dof=None if keys.dof is None else _parse_dof(path, keys.dof, where),
        mass_kg=keys.mass_kg,
    )


def bind_ports(test: VibrationTest, ports: Mapping[PortDof, PortDof]) -> VibrationTest:
    """Find the ports that a test names in its model, and check the units of their channels.

    Parameters
    ----------
    test : VibrationTest
        As it was read.
    ports : mapping of PortDof to PortDof
        Those of the model, as `StructuralModel.port_dofs` lists them.

    Returns
    -------
    VibrationTest
        With the units of the ports.

    Raises
    ------
    FileFormatError
        If it names a port that the model does not have.
    QuantityError
        If a channel at an angle is measured as a length, or the other way round.
    """
    with errors_of_file(test.path):
        bound = test.with_ports(ports)
    if not test.signals:
        _check_units(test.path, bound.channels, bound.setups)
    return bound


def _with_port_units(setup: TestSetup, channels: tuple[Channel, ...]) -> TestSetup:
    """Take from the units of channels whether ports are angles, until a model says so."""
    ends = zip((*setup.input_dofs, *setup.output_dofs), channels, strict=True)
    dofs = [_with_port_unit(dof, channel) for dof, channel in ends]
    n_inputs = len(setup.input_dofs)
    return replace(
        setup,
        input_dof=dofs[0],
        further_input_dofs=tuple(dofs[1:n_inputs]),
        output_dofs=tuple(dofs[n_inputs:]),
    )


def _with_port_unit(dof: AnyDof, channel: Channel) -> AnyDof:
    if isinstance(dof, Dof) or not (channel.unit or channel.sensitivity):
        return dof
    convert = sensitivity_factor if channel.sensitivity else unit_factor
    try:
        convert(channel.sensitivity or channel.unit, channel.quantity, rotational=True)
    except InputError:
        return dof
    return replace(dof, unit="rad")


def _check_units(path: Path, channels: tuple[Channel, ...], setups: tuple[TestSetup, ...]) -> None:
    """Refuse units that cannot be right before anything is read; a moment or a rotation has its own."""
    for setup in setups:
        for channel, dof in zip(channels, (*setup.input_dofs, *setup.output_dofs), strict=True):
            if not channel.unit and not channel.sensitivity:
                continue
            convert = sensitivity_factor if channel.sensitivity else unit_factor
            try:
                convert(channel.sensitivity or channel.unit, channel.quantity, rotational=dof.direction.startswith("r"))
            except InputError as error:
                raise QuantityError(f"{path}, [[channel]] '{channel.column}' at {dof}: {error}") from None


def _read_setup(path: Path, keys: SetupKeys, channels: tuple[Channel, ...], where: str) -> TestSetup:
    outputs = {channel.column: channel.dof for channel in channels if channel.role == "output"}
    input_dofs = _read_input_dofs(path, keys, [channel for channel in channels if channel.role == "input"], where)
    for column, text in keys.output_dofs.items():
        if column not in outputs:
            problem = f"'output_dofs' names '{column}', which is no output channel; {did_you_mean(column, outputs)}"
            raise FileFormatError(path, problem, where=where)
        outputs[column] = _parse_dof(path, text, where)
    missing = [column for column, dof in outputs.items() if dof is None]
    if missing:
        problem = f"the output '{missing[0]}' has no DOF: give its channel a 'dof', or name it in 'output_dofs'"
        raise FileFormatError(path, problem, where=where)
    output_dofs = tuple(dof for dof in outputs.values() if dof is not None)
    _check_motions(path, tuple(channel for channel in channels if channel.role == "output"), output_dofs, where)
    files = [file for pattern in keys.files for file in _expand_pattern(path, pattern, where)]
    if not files:
        raise FileFormatError(path, "'files' is empty; name at least one recording", where=where)
    files = list(dict.fromkeys(files))
    columns = [channel.column for channel in channels]
    second = keys.second_recorder
    return TestSetup(
        input_dof=input_dofs[0],
        further_input_dofs=input_dofs[1:],
        output_dofs=output_dofs,
        files=tuple(files),
        variables=_read_variables(path, keys.variables, columns, where),
        second_recorder=None if second is None else _read_second_recorder(path, second, files, columns, where),
    )


def _read_second_recorder(
    path: Path, keys: SecondRecorderKeys, files: Sequence[Path], columns: Sequence[str], where: str
) -> SecondRecorder:
    where = f"{where}, second_recorder"
    own = _read_variables(path, keys.columns, columns, where, key="columns")
    common = _read_variables(path, keys.common, columns, where, key="common")
    moved = [name for name, _ in own if name in columns]
    if not moved or len(moved) == len(columns):
        problem = "'columns' names the channels that this recorder has: at least one, and not all of them"
        raise FileFormatError(path, problem, where=where)
    if len(common) > 1 or any(name in moved or name not in columns for name, _ in common):
        problem = "'common' names one channel that the first recorder has, and what this one calls it"
        raise FileFormatError(path, f'{problem}, as in common = {{ force = "trigger" }}', where=where)
    found = dict.fromkeys(file for pattern in keys.files for file in _expand_pattern(path, pattern, where))
    if len(found) != len(files):
        problem = f"its 'files' are {len(found)} and those of the first recorder {len(files)}"
        raise FileFormatError(path, f"{problem}; each record has one file of each recorder, in one order", where=where)
    both = next((file for file in found if file in files), None)
    if both is not None:
        raise FileFormatError(path, f"{both.name} is a file of both recorders; correct 'files'", where=where)
    return SecondRecorder(files=tuple(found), columns=own, common=common[0] if common else None)


def _read_input_dofs(path: Path, keys: SetupKeys, inputs: list[Channel], where: str) -> tuple[AnyDof, ...]:
    """Find where the forces act: by the entry, or by the channels where several act at once."""
    if len(inputs) == 1:
        if not keys.dof:
            raise FileFormatError(path, "needs 'dof': where the force acts, as in dof = \"18:+z\"", where=where)
        if keys.input_dofs:
            raise FileFormatError(path, "has 'input_dofs', and the test has one input; write 'dof'", where=where)
        return (_parse_dof(path, keys.dof, where),)
    known = {channel.column: channel.dof for channel in inputs}
    if keys.dof:
        problem = f"has one 'dof', and the test has {len(inputs)} inputs; give each input channel its 'dof'"
        raise FileFormatError(path, f"{problem}, or name them in 'input_dofs'", where=where)
    for column, text in keys.input_dofs.items():
        if column not in known:
            problem = f"'input_dofs' names '{column}', which is no input channel; {did_you_mean(column, known)}"
            raise FileFormatError(path, problem, where=where)
        known[column] = _parse_dof(path, text, where)
    for column, dof in known.items():
        if dof is None:
            problem = f"the input '{column}' has no DOF: give its channel a 'dof', or name it in 'input_dofs'"
            raise FileFormatError(path, problem, where=where)
    dofs = tuple(dof for dof in known.values() if dof is not None)
    if len({dof.name for dof in dofs}) < len(dofs):
        raise FileFormatError(path, "two inputs act at the same DOF; correct a 'dof', or take one out", where=where)
    return dofs


def _read_variables(
    path: Path, variables: Mapping[str, str], columns: Iterable[str], where: str, *, key: str = "variables"
) -> tuple[tuple[str, str], ...]:
    known = [*columns, TIME_VARIABLE, RATE_VARIABLE]
    for name in variables:
        if name not in known:
            problem = f"'{key}' names '{name}', which is no column of a [[channel]]; {did_you_mean(name, known)}"
            raise FileFormatError(path, problem, where=where)
    return tuple(variables.items())


def _check_motions(path: Path, outputs: tuple[Channel, ...], dofs: tuple[AnyDof, ...], where: str) -> None:
    """Refuse two outputs that would measure the same motion: FRFs are distinguished by DOFs and quantity."""
    channel_of_motion: dict[tuple[AnyDof, str], Channel] = {}
    for channel, dof in zip(outputs, dofs, strict=True):
        first = channel_of_motion.setdefault((dof.unsigned, channel.quantity), channel)
        if first is not channel:
            problem = f"'{first.column}' and '{channel.column}' both measure the {channel.quantity} at {dof}"
            raise FileFormatError(path, f"{problem}; correct a 'dof', or take one channel out", where=where)


def _check_files_once(path: Path, setups: tuple[TestSetup, ...]) -> None:
    setup_of_file: dict[Path, TestSetup] = {}
    for setup in setups:
        for file in setup.files:
            first = setup_of_file.setdefault(file, setup)
            if first is not setup:
                problem = f"{file.name} belongs to the entries of {first.input_dof} and of {setup.input_dof}"
                raise FileFormatError(path, f"{problem}; a recording has one excited DOF")


def _read_source(path: Path, keys: FrfKeys) -> FrfSource:
    where = f"[[frf]] '{keys.file}'"
    return FrfSource(
        path=path.parent / keys.file,
        quantity=RECIPROCALS.get(keys.quantity)
        or (FrfQuantity.ACCELERANCE if keys.quantity == TRANSMISSIBILITY else FrfQuantity(keys.quantity)),
        force_dof=_read_force(path, keys, where),
        is_reciprocal=keys.quantity in RECIPROCALS,
        unit=keys.unit or "",
        output_dofs=_parse_dofs(path, keys.output_dof, where),
        input_dofs=_parse_dofs(path, keys.input_dof, where),
        variables=tuple(keys.variables.items()),
        columns=keys.columns,
        skip_rows=keys.skip_rows,
        direction=_parse_direction(path, keys.direction, where),
        sets=keys.sets,
        is_conjugated=keys.conjugated,
        level_N=keys.level,
    )


def _read_force(path: Path, keys: FrfKeys, where: str) -> AnyDof | None:
    if (keys.quantity == TRANSMISSIBILITY) != (keys.force_dof is not None):
        problem = "a transmissibility, and no other quantity, needs 'force_dof': where the force acts"
        raise FileFormatError(path, problem, where=where)
    return None if keys.force_dof is None else _parse_dof(path, keys.force_dof, where)


def _with_reference(source: FrfSource, sources: Sequence[FrfSource]) -> FrfSource:
    """Find the file with the FRF of the reference of a transmissibility."""
    if source.force_dof is None:
        return source
    ratio = read_frf_file(source)[0]
    for other in sources:
        if other.force_dof is None and any(
            (label.output_dof, label.input_dof) == (ratio.input_dof, source.force_dof)
            for label in _labels_of_source(other)
        ):
            return replace(source, reference=other, quantity=other.quantity)
    raise no_reference(source, ratio)


def _read_modes_source(path: Path, keys: ModesKeys) -> ModesSource:
    where = f"[[modes]] '{keys.file}'"
    return ModesSource(
        path=path.parent / keys.file,
        input_dofs=tuple(_parse_dof(path, text, where) for text in keys.input_dofs),
        quantity=FrfQuantity(keys.quantity),
    )


def _parse_direction(path: Path, text: str, where: str) -> str:
    with errors_of_file(path, where=where):
        return as_direction(text)


def _parse_dofs(path: Path, texts: str | tuple[str, ...] | None, where: str) -> tuple[AnyDof, ...]:
    given = () if texts is None else (texts,) if isinstance(texts, str) else texts
    return tuple(_parse_dof(path, text, where) for text in given)


def _parse_dof(path: Path, text: str, where: str) -> AnyDof:
    with errors_of_file(path, where=where):
        return parse_label(text)


def _expand_pattern(path: Path, pattern: str, where: str) -> list[Path]:
    """Find the files that a pattern names; it is relative to the folder of `test.toml`, or absolute."""
    folder, relative = path.parent, Path(pattern)
    if relative.is_absolute():
        folder, relative = Path(relative.anchor), relative.relative_to(relative.anchor)
    try:
        files = sorted(file for file in folder.glob(str(relative)) if file.is_file())
    except (ValueError, NotImplementedError, OSError) as error:
        raise FileFormatError(path, f"'{pattern}' is no valid pattern of files: {error}", where=where) from None
    if not files:
        raise FileFormatError(path, f"no file fits '{pattern}' in {folder}; correct 'files'", where=where)
    return files
