"""A vibration test: its channels, its set-ups and their files, the FRFs that it gives; the masses of its sensors.

`campaign_file` reads one from `test.toml`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arguments import require_choice, require_each, require_type, take_array
from frf_ipz.arrays import FloatArray, read_only
from frf_ipz.display import Concise
from frf_ipz.dofs import AnyDof, Dof, PortDof, as_dof, as_dofs, bind_port
from frf_ipz.errors import InputError, QuantityError, did_you_mean
from frf_ipz.frf import SCALES, FrfLabel, FrfSet
from frf_ipz.ingest.formats.frf_file import FrfSource
from frf_ipz.ingest.formats.recording import TableKeys
from frf_ipz.ingest.units import numerator_of
from frf_ipz.modes import ModalParameters
from frf_ipz.quantities import RESPONSES, frf_quantity_of
from frf_ipz.structure import Geometry

if TYPE_CHECKING:
    from collections.abc import Iterable

UNITS = dict(zip(RESPONSES, ("m", "m/s", "m/s^2"), strict=True))
TIME_VARIABLE, RATE_VARIABLE = "time", "sample_rate_hz"  # of `variables`, besides the columns of channels
PARTICULARS = ("operator", "date", "equipment", "customer", "serial_number")  # shown, and used for nothing else
ROTATIONAL_UNITS = dict(zip(RESPONSES, ("rad", "rad/s", "rad/s^2"), strict=True))


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
    wrong_file_unit : str
        What files state and is wrong; it is passed over.
    dof : Dof, optional
        Where an output sits, unless a set-up says otherwise.
    mass_kg : float
        The sensor's own mass.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> time = np.arange(4000) / 2000.0
    >>> recordings = []
    >>> for peak in (40.0, 60.0, 80.0):
    ...     force = np.zeros(4000)
    ...     force[200:206] = peak * np.sin(np.pi * np.arange(6) / 5)
    ...     decay = np.exp(-20 * time) * np.sin(2 * np.pi * 80 * time)
    ...     response = np.convolve(force, np.gradient(np.gradient(decay, 5e-4), 5e-4))[:4000] * 5e-4 * 1e-3
    ...     recordings.append(
    ...         frf_ipz.Recording(
    ...             force=force, responses=response, sample_rate_hz=2000.0, input_dof="1:+z", output_dofs=["1:+z"]
    ...         )
    ...     )
    >>> test = frf_ipz.VibrationTest.from_recordings(recordings)
    >>> [(channel.column, channel.role, channel.unit) for channel in test.channels]
    [('force', 'input', 'N'), ('output 1', 'output', 'm/s^2')]
    """

    column: str
    role: str
    quantity: str
    unit: str = ""
    sensitivity: str = ""
    wrong_file_unit: str = ""
    dof: AnyDof | None = None
    mass_kg: float = 0.0

    @property
    def column_unit(self) -> str:
        """The unit the column is in, as far as the test states it; empty where the files have to."""
        return numerator_of(self.sensitivity) if self.sensitivity else self.unit


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondRecorder:
    """A second recorder's files of the same records.

    Parameters
    ----------
    files : tuple of Path
        One for each file of the set-up, in the same order.
    columns : tuple of pairs of str
        Channels that it recorded, and what its files call them; ``time`` or ``sample_rate_hz`` too.
    common : pair of str, optional
        A channel that both recorded, and what the second calls it; without it both begin by one trigger.
    """

    files: tuple[Path, ...]
    columns: tuple[tuple[str, str], ...]
    common: tuple[str, str] | None = None


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class TestSetup(Concise):
    """Recordings with the force at one DOF and the sensors in one layout.

    Parameters
    ----------
    input_dof : Dof or PortDof
        Where the force acts, with its sign.
    output_dofs : tuple of Dof
        Where the outputs sit, in the order of the output channels.
    files : tuple of Path
        The recordings, sorted.
    variables : tuple of pairs of str
        Columns of channels, ``time`` or ``sample_rate_hz``, and what these files call them.
    further_input_dofs : tuple of Dof or PortDof
        Where the other forces act, in the order of their channels, where several act at once.
    second_recorder : SecondRecorder, optional
        Where some channels stand in files of their own.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> time = np.arange(4000) / 2000.0
    >>> recordings = []
    >>> for peak in (40.0, 60.0, 80.0):
    ...     force = np.zeros(4000)
    ...     force[200:206] = peak * np.sin(np.pi * np.arange(6) / 5)
    ...     decay = np.exp(-20 * time) * np.sin(2 * np.pi * 80 * time)
    ...     response = np.convolve(force, np.gradient(np.gradient(decay, 5e-4), 5e-4))[:4000] * 5e-4 * 1e-3
    ...     recordings.append(
    ...         frf_ipz.Recording(
    ...             force=force, responses=response, sample_rate_hz=2000.0, input_dof="1:+z", output_dofs=["1:+z"]
    ...         )
    ...     )
    >>> test = frf_ipz.VibrationTest.from_recordings(recordings)
    >>> setup = test.setups[0]
    >>> str(setup.input_dof), len(setup.files)
    ('1:+z', 3)
    """

    input_dof: AnyDof
    output_dofs: tuple[AnyDof, ...]
    files: tuple[Path, ...]
    variables: tuple[tuple[str, str], ...] = ()
    further_input_dofs: tuple[AnyDof, ...] = ()
    second_recorder: SecondRecorder | None = None

    @property
    def input_dofs(self) -> tuple[AnyDof, ...]:
        """Where all forces act."""
        return (self.input_dof, *self.further_input_dofs)

    def names_in_files(self, columns: Sequence[str]) -> tuple[str, ...]:
        """Give what the files call some columns.

        Parameters
        ----------
        columns : sequence of str
            As the channels have them.

        Returns
        -------
        tuple of str
            As the files have them.
        """
        called = dict(self.variables)
        return tuple(called.get(column, column) for column in columns)

    def keys_for_files(self, keys: TableKeys) -> TableKeys:
        """Add to what the test says of all tables what is said of the time in these files.

        Parameters
        ----------
        keys : TableKeys
            Of the test.

        Returns
        -------
        TableKeys
            Of these files.
        """
        called = dict(self.variables)
        return replace(
            keys,
            time_column=called.get(TIME_VARIABLE, keys.time_column),
            rate_variable=called.get(RATE_VARIABLE, keys.rate_variable),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Recording(Concise):
    """A recording in memory: a force and the responses to it, in SI units, at a constant rate.

    Parameters
    ----------
    force : (n_samples,) array
        N, or N m where the input is a rotation.
    responses : (n_outputs, n_samples) array
        m, m/s or m/s^2 (rad, rad/s, rad/s^2 at rotations), as `quantity` says.
    sample_rate_hz : float
        Hz.
    input_dof : Dof or str
        Where the force acts, such as ``"18:+z"``.
    output_dofs : sequence of Dof or str
        Where the sensors sit, one a row of `responses`.
    quantity : str
        ``acceleration``, ``velocity`` or ``displacement``.

    Raises
    ------
    ShapeError
        If shapes disagree or a value is not finite.
    QuantityError
        If there is no such quantity.
    InputError
        If a label is none, or the rate is not positive.

    Examples
    --------
    >>> time = np.arange(1000) / 1000
    >>> one = Recording(
    ...     force=(time < 0.002) * 50.0,
    ...     responses=np.exp(-3 * time)[None] * np.sin(300 * time),
    ...     sample_rate_hz=1000.0,
    ...     input_dof="18:+z",
    ...     output_dofs=["20:+z"],
    ... )
    >>> VibrationTest.from_recordings([one]).labels[0].unit
    'm/s^2/N'
    """

    force: FloatArray
    responses: FloatArray
    sample_rate_hz: float
    input_dof: AnyDof | str
    output_dofs: Sequence[AnyDof | str]
    quantity: str = "acceleration"

    def __post_init__(self) -> None:
        output_dofs = as_dofs(self.output_dofs, name="output_dofs")
        force = take_array("the force of a recording", self.force, np.float64)
        responses = np.atleast_2d(self.responses)
        responses = take_array("the responses of a recording", responses, np.float64, (len(output_dofs), len(force)))
        if not output_dofs:
            raise InputError("output_dofs is empty; a recording has at least one response")
        require_type("sample_rate_hz", self.sample_rate_hz, float, int, np.number)
        if self.quantity not in RESPONSES:
            raise QuantityError(f"'{self.quantity}' is no response; {did_you_mean(str(self.quantity), RESPONSES)}")
        if not 0 < self.sample_rate_hz < np.inf:
            raise InputError(f"the rate of a recording is {self.sample_rate_hz:g} Hz; it is positive")
        changed = {
            "force": read_only(force),
            "responses": read_only(responses),
            "input_dof": as_dof(self.input_dof),
            "output_dofs": output_dofs,
        }
        for name, value in changed.items():
            object.__setattr__(self, name, value)

    @property
    def table(self) -> FloatArray:
        """Time in s, force and responses as columns, (n_samples, 2 + n_outputs) array."""
        time = np.arange(len(self.force)) / self.sample_rate_hz
        return np.column_stack([time, self.force, self.responses.T])


@dataclass(frozen=True, kw_only=True, repr=False)
class VibrationTest(Concise):
    """A test: what was measured, where, and in which files.

    Parameters
    ----------
    path : Path
        ``test.toml``; a name where the test is in memory.
    name : str
        What the user calls it.
    kind : str
        ``hammer``, ``random``, ``frf`` or ``modes``.
    nominal_damping_ratio : float, optional
        For models that state no damping.
    unknown_scale : str
        ``none``, ``common`` or ``per_channel``.
    channels : tuple of Channel
        The input first; none of kind ``frf``.
    setups : tuple of TestSetup
        One an excited DOF and layout of sensors; none of kind ``frf``.
    frf_sources : tuple of FrfSource
        Files with FRFs, of kind ``frf``.
    labels : tuple of FrfLabel
        The FRFs that the test gives, each once.
    table : TableKeys
        Where the time, the rate and the names stand in the recordings, as far as the test says so.
    applied_window_s : float, optional
        Time constant of an exponential window that the responses in the files have already been given, s.
    signals : mapping of Path to (n_samples, 2 + n_outputs) array
        Recordings that are in memory: time in s, force, responses, SI. They are not read from a file.
    frfs : FrfSet, optional
        FRFs that are in memory.
    modes_path : Path, optional
        File of the modes, of kind ``modes``.
    modes : ModalParameters, optional
        Modes that were identified elsewhere, of kind ``modes``; `labels` then name what a model predicts between their
        DOFs, and no FRF was measured.
    particulars : mapping of str to str
        Who measured, when, with what, for whom, and which machine: ``operator``, ``date``, ``equipment``,
        ``customer``, ``serial_number``, as far as they are stated.
    geometry_path : Path, optional
        File of `geometry`.
    geometry : Geometry, optional
        Where the nodes are, for drawings where there is no FE model.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> time = np.arange(4000) / 2000.0
    >>> recordings = []
    >>> for peak in (40.0, 60.0, 80.0):
    ...     force = np.zeros(4000)
    ...     force[200:206] = peak * np.sin(np.pi * np.arange(6) / 5)
    ...     decay = np.exp(-20 * time) * np.sin(2 * np.pi * 80 * time)
    ...     response = np.convolve(force, np.gradient(np.gradient(decay, 5e-4), 5e-4))[:4000] * 5e-4 * 1e-3
    ...     recordings.append(
    ...         frf_ipz.Recording(
    ...             force=force, responses=response, sample_rate_hz=2000.0, input_dof="1:+z", output_dofs=["1:+z"]
    ...         )
    ...     )
    >>> test = frf_ipz.VibrationTest.from_recordings(recordings)
    >>> test.kind, [str(label) for label in test.labels]
    ('hammer', ['1:+z / 1:+z'])
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
    table: TableKeys = field(default_factory=TableKeys)
    applied_window_s: float | None = None
    signals: Mapping[Path, FloatArray] = field(default_factory=dict, repr=False)
    frfs: FrfSet | None = field(default=None, repr=False)
    modes_path: Path | None = None
    modes: ModalParameters | None = field(default=None, repr=False)
    particulars: Mapping[str, str] = field(default_factory=dict, repr=False)
    geometry_path: Path | None = field(default=None, repr=False)
    geometry: Geometry | None = field(default=None, repr=False)

    @classmethod
    def from_recordings(
        cls,
        recordings: Sequence[Recording],
        *,
        kind: str = "hammer",
        name: str = "test",
        nominal_damping_ratio: float | None = None,
        unknown_scale: str = "none",
    ) -> VibrationTest:
        """Make a test from recordings in memory.

        Parameters
        ----------
        recordings : sequence of Recording
            All with the same number of outputs of the same quantity; sensors may rove.
        kind : str
            ``hammer`` or ``random`` (shaker, long records).
        name : str
            What it is called.
        nominal_damping_ratio : float, optional
            For models that state no damping.
        unknown_scale : str
            ``none``, ``common`` or ``per_channel``.

        Returns
        -------
        VibrationTest
            As if it had been read from files.

        Raises
        ------
        InputError
            If there is no recording, there is no such kind, or the recordings do not fit each other.

        Examples
        --------
        >>> import numpy as np, frf_ipz
        >>> time = np.arange(4000) / 2000.0
        >>> recordings = []
        >>> for peak in (40.0, 60.0, 80.0):
        ...     force = np.zeros(4000)
        ...     force[200:206] = peak * np.sin(np.pi * np.arange(6) / 5)
        ...     decay = np.exp(-20 * time) * np.sin(2 * np.pi * 80 * time)
        ...     response = np.convolve(force, np.gradient(np.gradient(decay, 5e-4), 5e-4))[:4000] * 5e-4 * 1e-3
        ...     recordings.append(
        ...         frf_ipz.Recording(
        ...             force=force, responses=response, sample_rate_hz=2000.0, input_dof="1:+z", output_dofs=["1:+z"]
        ...         )
        ...     )
        >>> test = frf_ipz.VibrationTest.from_recordings(recordings)
        >>> len(test.recordings)
        3
        """
        require_each("recordings", recordings, Recording)
        require_choice("unknown_scale", unknown_scale, SCALES)
        if kind not in ("hammer", "random"):
            raise InputError(f"'{kind}' is no kind of test; {did_you_mean(str(kind), ('hammer', 'random'))}")
        layouts = {(len(recording.output_dofs), recording.quantity) for recording in recordings}
        if len(layouts) != 1:
            raise InputError(
                "recordings of one test have the same number of outputs of the same quantity, at least one"
            )
        ((count, quantity),) = layouts
        channels = [Channel(column="force", role="input", quantity="force", unit="N")]
        channels += [
            Channel(column=f"output {place + 1}", role="output", quantity=quantity, unit=UNITS[quantity])
            for place in range(count)
        ]
        paths = [Path(f"recording {place + 1}") for place in range(len(recordings))]
        layout_files: dict[tuple[AnyDof, tuple[AnyDof, ...]], list[Path]] = {}
        for path, recording in zip(paths, recordings, strict=True):
            layout_files.setdefault(
                (as_dof(recording.input_dof), tuple(map(as_dof, recording.output_dofs))), []
            ).append(path)
        setups = tuple(
            TestSetup(input_dof=force, output_dofs=sensors, files=tuple(files))
            for (force, sensors), files in layout_files.items()
        )
        labels = dict.fromkeys(label for setup in setups for label in setup_labels(tuple(channels), setup))
        return cls(
            path=Path(name),
            name=name,
            kind=kind,
            nominal_damping_ratio=nominal_damping_ratio,
            unknown_scale=unknown_scale,
            channels=tuple(channels),
            setups=setups,
            frf_sources=(),
            labels=tuple(labels),
            signals={path: recording.table for path, recording in zip(paths, recordings, strict=True)},
        )

    @classmethod
    def from_frfs(
        cls, frfs: FrfSet, *, name: str = "test", nominal_damping_ratio: float | None = None
    ) -> VibrationTest:
        """Make a test from FRFs in memory.

        Parameters
        ----------
        frfs : FrfSet
            The FRFs.
        name : str
            What it is called.
        nominal_damping_ratio : float, optional
            For models that state no damping.

        Returns
        -------
        VibrationTest
            As if they had been read from a file.

        Examples
        --------
        >>> import numpy as np, frf_ipz
        >>> beam = frf_ipz.make_beam(
        ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
        ...     left="clamped", modal_ratio=0.01,
        ... )
        >>> lines = np.arange(5, 400.0, 0.5)
        >>> tip, middle = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
        >>> labels = [frf_ipz.FrfLabel(output, tip, frf_ipz.FrfQuantity.ACCELERANCE) for output in (middle, tip)]
        >>> values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * lines)[:, :, None]
        >>> frfs = frf_ipz.FrfSet.from_arrays(
        ...     lines, values, outputs=[middle, tip], inputs=[tip], variance=np.full(values.shape, 1e-4)
        ... )
        >>> frf_ipz.VibrationTest.from_frfs(frfs, name="beam").output_dofs == frfs.output_dofs
        True
        """
        require_type("frfs", frfs, FrfSet)
        return cls(
            path=Path(name),
            name=name,
            kind="frf",
            nominal_damping_ratio=nominal_damping_ratio,
            unknown_scale=frfs.unknown_scale,
            channels=(),
            setups=(),
            frf_sources=(),
            labels=frfs.labels,
            frfs=frfs,
        )

    @classmethod
    def from_modes(
        cls, modes: ModalParameters, *, name: str = "test", nominal_damping_ratio: float | None = None
    ) -> VibrationTest:
        """Make a test from modes in memory.

        Parameters
        ----------
        modes : ModalParameters
            The modes.
        name : str
            What the test is called.
        nominal_damping_ratio : float, optional
            For models that state no damping.

        Returns
        -------
        VibrationTest
            Of kind ``modes``.

        Examples
        --------
        >>> import frf_ipz
        >>> modes = frf_ipz.ModalParameters(
        ...     natural_frequency_hz=[12.5], damping_ratio=[0.02], shapes=[[0.4], [1.0]], dofs=["6:+z", "11:+z"],
        ...     input_dofs=["11:+z"],
        ... )
        >>> frf_ipz.VibrationTest.from_modes(modes).kind
        'modes'
        """
        require_type("modes", modes, ModalParameters)
        return cls(
            path=Path(name),
            name=name,
            kind="modes",
            nominal_damping_ratio=nominal_damping_ratio,
            unknown_scale="none",
            channels=(),
            setups=(),
            frf_sources=(),
            labels=modes.labels,
            modes=modes,
        )

    def with_forces_at(self, points: Sequence[AnyDof]) -> VibrationTest:
        """Let forces of a test of modes that names none act at the points of interest; without any, at its first DOF.

        Parameters
        ----------
        points : sequence of Dof
            Points of interest.

        Returns
        -------
        VibrationTest
            The same for any other test.
        """
        if self.modes is None or self.modes.input_dofs:
            return self
        modes = replace(self.modes, input_dofs=tuple(points) or self.modes.dofs[:1])
        return replace(self, modes=modes, labels=modes.labels)

    def with_ports(self, ports: Mapping[PortDof, PortDof]) -> VibrationTest:
        """Find the ports that the test names, so that their units are known.

        Parameters
        ----------
        ports : mapping of PortDof to PortDof
            Those of the model, as `StructuralModel.port_dofs` lists them.

        Returns
        -------
        VibrationTest
            The same test.

        Raises
        ------
        InputError
            If it names a port that the model does not have.
        """

        def bound(label: FrfLabel) -> FrfLabel:
            return replace(
                label, output_dof=bind_port(label.output_dof, ports), input_dof=bind_port(label.input_dof, ports)
            )

        def found(dof: AnyDof | None) -> AnyDof | None:
            return None if dof is None else bind_port(dof, ports)

        return replace(
            self,
            channels=tuple(replace(channel, dof=found(channel.dof)) for channel in self.channels),
            setups=tuple(
                replace(
                    setup,
                    input_dof=bind_port(setup.input_dof, ports),
                    further_input_dofs=tuple(bind_port(dof, ports) for dof in setup.further_input_dofs),
                    output_dofs=tuple(bind_port(dof, ports) for dof in setup.output_dofs),
                )
                for setup in self.setups
            ),
            frf_sources=tuple(
                replace(
                    source,
                    output_dofs=tuple(bind_port(dof, ports) for dof in source.output_dofs),
                    input_dofs=tuple(bind_port(dof, ports) for dof in source.input_dofs),
                )
                for source in self.frf_sources
            ),
            labels=tuple(map(bound, self.labels)),
            frfs=None if self.frfs is None else replace(self.frfs, labels=tuple(map(bound, self.frfs.labels))),
            modes=None
            if self.modes is None
            else replace(
                self.modes,
                dofs=tuple(bind_port(dof, ports) for dof in self.modes.dofs),
                input_dofs=tuple(bind_port(dof, ports) for dof in self.modes.input_dofs),
            ),
        )

    @property
    def input_channel(self) -> Channel:
        """The force; the first of several."""
        return self.channels[0]

    @property
    def input_channels(self) -> tuple[Channel, ...]:
        """The forces: several where shakers act at once."""
        return tuple(channel for channel in self.channels if channel.role == "input")

    @property
    def output_channels(self) -> tuple[Channel, ...]:
        """The responses."""
        return tuple(channel for channel in self.channels if channel.role == "output")

    @property
    def output_dofs(self) -> tuple[AnyDof, ...]:
        """Where sensors sit in any of the FRFs, each once."""
        return tuple(dict.fromkeys([*(self.modes.dofs if self.modes else ()), *(x.output_dof for x in self.labels)]))

    @property
    def input_dofs(self) -> tuple[AnyDof, ...]:
        """Where forces act in any of the FRFs, each once."""
        return tuple(dict.fromkeys(label.input_dof for label in self.labels))

    @property
    def recordings(self) -> tuple[tuple[TestSetup, Path], ...]:
        """Every recording with its set-up, in the order of the test."""
        return tuple((setup, path) for setup in self.setups for path in setup.files)

    @property
    def has_frf_levels(self) -> bool:
        """Whether FRFs that were estimated elsewhere are given at several levels of excitation."""
        return len({source.level_N for source in self.frf_sources} - {None}) > 1

    @property
    def files(self) -> tuple[Path, ...]:
        """All files of measurements, each once."""
        recordings = [path for _, path in self.recordings if path not in self.signals]
        recordings += [path for setup in self.setups if setup.second_recorder for path in setup.second_recorder.files]
        modes = [] if self.modes_path is None else [self.modes_path]
        return tuple(dict.fromkeys([*recordings, *(source.path for source in self.frf_sources), *modes]))

    @cached_property
    def sensor_masses(self) -> dict[int, float]:
        """Known masses of the sensors by node, kg.

        A roving sensor counts at each node with the share of recordings during which it sat there: to first order in
        the mass, that is the structure whose FRFs are the mean over all recordings.
        """
        return self._mean_masses(self.setups)

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
        return self._mean_masses([setup for setup in self.setups if label in setup_labels(self.channels, setup)])

    def _mean_masses(self, setups: Iterable[TestSetup]) -> dict[int, float]:
        setups = list(setups)
        n_files = sum(len(setup.files) for setup in setups)
        masses: Counter[int] = Counter()
        for setup in setups:
            for channel, dof in zip(self.output_channels, setup.output_dofs, strict=True):
                if channel.mass_kg and isinstance(dof, Dof):
                    masses[dof.node] += channel.mass_kg * len(setup.files) / n_files  # type: ignore[assignment] # kg, no count
        return dict(masses)


def setup_labels(channels: tuple[Channel, ...], setup: TestSetup) -> tuple[FrfLabel, ...]:
    """Name the FRFs that a set-up gives.

    Parameters
    ----------
    channels : tuple of Channel
        The input first.
    setup : TestSetup
        The set-up.

    Returns
    -------
    tuple of FrfLabel
        One an output channel, in their order; where several forces act at once, one a force of each.
    """
    inputs = [channel.column for channel in channels if channel.role == "input"]
    outputs = [channel for channel in channels if channel.role == "output"]
    return tuple(
        FrfLabel(dof, force, frf_quantity_of(channel.quantity), channel.column, column)
        for channel, dof in zip(outputs, setup.output_dofs, strict=True)
        for column, force in zip(inputs, setup.input_dofs, strict=True)
    )
