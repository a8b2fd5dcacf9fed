"""What was measured, record by record, calibrated and in the signs of the test: the raw material of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arguments import require_type
from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray, read_only, require_shape
from frf_ipz.diagnosis.options import WITHOUT_FRFS
from frf_ipz.display import Concise
from frf_ipz.dofs import AnyDof
from frf_ipz.errors import InputError
from frf_ipz.frf import FrfSet
from frf_ipz.identification.measured_lines import measured_lines
from frf_ipz.identification.options import FitOptions
from frf_ipz.ingest.campaign import VibrationTest
from frf_ipz.ingest.options import IngestOptions
from frf_ipz.ingest.recording_files import RecordingFiles
from frf_ipz.ingest.records import read_records
from frf_ipz.quantities import FrfQuantity

if TYPE_CHECKING:
    from frf_ipz.ingest import records as recorded

BLOCK = 128  # samples


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sensor:
    """An output channel as it was used in one record.

    Parameters
    ----------
    channel : str
        Column of the recordings.
    dof : Dof or PortDof
        Its position and direction, with its sign.
    quantity : FrfQuantity
        What it measures, as the FRF over a force.
    """

    channel: str
    dof: AnyDof
    quantity: FrfQuantity


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ResidualMotion:
    """Motion that an earlier impact has left in a record, as far as it is not known.

    Parameters
    ----------
    poles : (n_poles,) complex array
        Of the modes that move, rad/s.
    start_s : float
        Time in the recording at which the amplitudes are those of the columns.
    columns : (n_sensors, 2 n_poles, n_columns) array
        Amplitudes of decaying cosines, then of sines, as independent columns of one standard deviation each; those of
        all records of a channel are the same columns.
    """

    poles: ComplexArray
    start_s: float
    columns: FloatArray

    def transform(self, s: ComplexArray, sensor: int, record: ObservedRecord) -> ComplexArray:
        """Transform the columns of a sensor over a record.

        Parameters
        ----------
        s : (n_points,) complex array
            rad/s.
        sensor : int
            Row of the responses.
        record : ObservedRecord
            Whose residual motion it is; its first samples may have been cut.

        Returns
        -------
        (n_points, n_columns) complex array
            SI times s.
        """
        count, step = len(self.poles), record.step_s
        begun = np.exp(self.poles * (record.start_s - self.start_s))[:, None]
        half = (self.columns[sensor, :count] - 1j * self.columns[sensor, count:]) * begun / 2
        total = np.zeros((len(s), self.columns.shape[2]), np.complex128)
        for poles, amplitudes in ((self.poles, half), (self.poles.conj(), half.conj())):
            turn = np.exp((poles - s[:, None]) * step)
            total += step * (1 - turn**record.n_samples) / (1 - turn) @ amplitudes
        return total


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class ObservedRecord(Concise):
    """One impact of a hammer, or one run of a shaker, with its responses.

    Parameters
    ----------
    name : str
        As in the table of records.
    input_channel : str
        Column of the force.
    input_dof : Dof or PortDof
        Where it was excited, with its sign: the force on the model's DOF is this sign times `force`.
    sensors : tuple of Sensor
        Rows of `responses`.
    step_s : float
        Time from sample to sample, s; the first sample is at time 0.
    force : (n_samples,) array
        N.
    responses : (n_sensors, n_samples) array
        SI units of the sensors' quantities, as recorded: a sensor of negative sign shows minus the model's motion.
    starts_at_rest : bool
        The structure was at rest at the first sample.
    recording : str
        The recording that it was cut from.
    number : int
        1 for the first record of its recording: the structure may still move from it in the next one.
    start_s : float
        Time of its first sample in its recording, s.
    dc_offset_std : (n_sensors,) array, optional
        Standard deviation of offsets that may remain in the responses, SI; none where it is left out.
    residual_motion : ResidualMotion, optional
        What may remain in the responses of motion that an earlier impact has left.
    noise_levels : mapping of str to float, optional
        Of channels, the noise power of this record over that of the mean of all records; not measured where it is left
        out.
    """

    name: str
    input_channel: str
    input_dof: AnyDof
    sensors: tuple[Sensor, ...]
    step_s: float
    force: FloatArray
    responses: FloatArray
    starts_at_rest: bool = True
    recording: str = ""
    number: int = 1
    start_s: float = 0.0
    dc_offset_std: FloatArray | None = None
    residual_motion: ResidualMotion | None = None
    noise_levels: Mapping[str, float] | None = None

    def __post_init__(self) -> None:
        require_shape(f"the force of {self.name}", self.force, (None,))
        require_shape(f"the responses of {self.name}", self.responses, (len(self.sensors), len(self.force)))
        for name in ("force", "responses"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return len(self.force)

    @property
    def duration_s(self) -> float:
        """Length of the record, s."""
        return self.n_samples * self.step_s

    @property
    def has_predecessor(self) -> bool:
        """True if another record came before it in the same recording."""
        return self.number > 1

    @property
    def level(self) -> float:
        """Largest force, N: distinguishes weak from strong records."""
        return float(np.abs(self.force).max())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Observations(Concise):
    """All records of a test that are used.

    Parameters
    ----------
    kind : str
        ``hammer``, ``random`` or ``frf``; with the last there are no records.
    records : tuple of ObservedRecord
        In the order of the test.
    band_hz : pair of float
        Analysed band, Hz.
    frfs : FrfSet, optional
        FRFs on lines: analysed where there are no records, or some did not start at rest.
    exclude_hz : tuple of pairs of float
        Parts of the band that are left out, Hz.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> stiffness = 1e5 * np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    >>> dofs = ["1:x", "2:x", "3:x"]
    >>> masses = np.diag([2.0, 1.0, 1.0])
    >>> model = frf_ipz.StructuralModel.from_matrices(masses, stiffness, dofs=dofs, modal_damping=0.01)
    >>> heavier = frf_ipz.StructuralModel.from_matrices(
    ...     masses + np.diag([0.0, 0.0, 0.2]), stiffness, dofs=dofs, modal_damping=0.01
    ... )
    >>> lines = np.arange(5, 100.0, 0.5)
    >>> first, accelerance = frf_ipz.Dof(1, "x"), frf_ipz.FrfQuantity.ACCELERANCE
    >>> labels = [frf_ipz.FrfLabel(frf_ipz.parse_dof(dof), first, accelerance) for dof in dofs]
    >>> values = frf_ipz.compute_frfs(heavier, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=dofs, inputs=["1:x"], variance=np.full(values.shape, 2e-6)
    ... )
    >>> observations = frf_ipz.observe(frf_ipz.VibrationTest.from_frfs(frfs), frfs=frfs)
    >>> observations.kind, observations.band_hz, observations.start_at_rest
    ('frf', (5.0, 99.5), False)
    """

    kind: str
    records: tuple[ObservedRecord, ...]
    band_hz: tuple[float, float]
    frfs: FrfSet | None = None
    exclude_hz: tuple[tuple[float, float], ...] = ()

    @property
    def input_dofs(self) -> tuple[AnyDof, ...]:
        """Excited DOFs, each once."""
        return tuple(dict.fromkeys(record.input_dof for record in self.records))

    @property
    def start_at_rest(self) -> bool:
        """True if there are records, and the structure was at rest at the beginning of each."""
        return bool(self.records) and all(record.starts_at_rest for record in self.records)

    def mask_band(self, frequency_hz: FloatArray, width_hz: float) -> BoolArray:
        """Mask the frequencies in the band that are not in or next to an excluded part.

        Parameters
        ----------
        frequency_hz : (n,) array
            Hz.
        width_hz : float
            Resolution of a line, Hz: it is kept that far from what is left out.

        Returns
        -------
        (n,) bool array
            True where it is analysed.
        """
        is_inside = (frequency_hz >= self.band_hz[0]) & (frequency_hz <= self.band_hz[1])
        for low, high in self.exclude_hz:
            is_inside &= (frequency_hz < low - width_hz) | (frequency_hz > high + width_hz)
        return np.asarray(is_inside)

    def records_at(self, input_dof: AnyDof) -> tuple[ObservedRecord, ...]:
        """List the records with the input at one DOF, the strongest first.

        Parameters
        ----------
        input_dof : Dof or PortDof
            One of `input_dofs`.

        Returns
        -------
        tuple of ObservedRecord
            Its records.
        """
        records = [record for record in self.records if record.input_dof == input_dof]
        return tuple(sorted(records, key=lambda record: -record.level))


def transform_records(
    records: Sequence[ObservedRecord], s: ComplexArray
) -> tuple[tuple[ComplexArray, ComplexArray], ...]:
    """Transform force and responses of records at any complex frequency, ``sum x(t) exp(-s t) dt``.

    For a structure at rest before the record the ratio of the two is exactly its transfer function at s, but for the
    motion that remains at the end of the record times ``exp(-Re s T)``.

    Parameters
    ----------
    records : sequence of ObservedRecord
        Of any length and step.
    s : (n_lines,) complex array
        rad/s, with a real part that is not negative.

    Returns
    -------
    tuple of pairs
        Of each record the force, (n_lines,) complex array, N s, and the responses, (n_lines, n_sensors).
    """
    return tuple(_transform(record, s) for record in records)


def _transform(record: ObservedRecord, s: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Sum in two steps, within blocks and over blocks: fewer exponentials than points times samples."""
    signals = np.vstack([record.force, record.responses])
    n_blocks = -(-record.n_samples // BLOCK)
    padded = np.zeros((len(signals), n_blocks * BLOCK))
    padded[:, : record.n_samples] = signals
    within = np.exp(-np.outer(s, np.arange(BLOCK) * record.step_s)) * record.step_s
    over = np.exp(-np.outer(s, np.arange(n_blocks) * BLOCK * record.step_s))
    blocks = padded.reshape(len(signals) * n_blocks, BLOCK).T
    inner = (within.real @ blocks + 1j * (within.imag @ blocks)).reshape(len(s), len(signals), n_blocks)
    total = np.einsum("kca,ka->kc", inner, over)
    return total[:, 0], total[:, 1:]


def observe(
    test: VibrationTest, *, frfs: FrfSet, ingest: IngestOptions | None = None, fit: FitOptions | None = None
) -> Observations:
    """Gather what a diagnosis works with.

    Parameters
    ----------
    test : VibrationTest
        The test.
    frfs : FrfSet
        The FRFs that were estimated from it, or elsewhere.
    ingest : IngestOptions, optional
        How its recordings are used.
    fit : FitOptions, optional
        Says which band to analyse, and which parts of it not; without a band, the one that carries signal is
        taken.

    Returns
    -------
    Observations
        Records where the scale of the channels is known, and the FRFs.

    Raises
    ------
    InputError
        If a recording cannot be used, too few lines are left in the band, or the test has modes and no FRFs.

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
    >>> estimate = frf_ipz.estimate_frfs(test)
    >>> observations = frf_ipz.observe(test, frfs=estimate.frfs)
    >>> len(observations.records), observations.start_at_rest
    (3, True)
    """
    require_type("test", test, VibrationTest)
    require_type("frfs", frfs, FrfSet)
    require_type("ingest", ingest, IngestOptions, optional=True)
    require_type("fit", fit, FitOptions, optional=True)
    return observe_from(RecordingFiles(test=test), frfs=frfs, ingest=ingest, fit=fit)


def observe_from(
    files: RecordingFiles, *, frfs: FrfSet, ingest: IngestOptions | None = None, fit: FitOptions | None = None
) -> Observations:
    """Gather what a diagnosis works with, from recordings that may have been read before.

    Parameters
    ----------
    files : RecordingFiles
        The recordings of the test; none for a test of FRFs.
    frfs : FrfSet
        The FRFs that were estimated from it, or elsewhere.
    ingest : IngestOptions, optional
        How its recordings are used.
    fit : FitOptions, optional
        Which band to analyse, and which parts of it not.

    Returns
    -------
    Observations
        As `observe` gives them.

    Raises
    ------
    InputError
        As `observe` does.
    """
    test = files.test
    if test.modes is not None:
        raise InputError(WITHOUT_FRFS)
    chosen = fit or FitOptions()
    band = measured_lines(frfs, chosen).band_hz
    records: tuple[ObservedRecord, ...] = ()
    # records with several forces at once are analysed by their FRFs
    if test.kind != "frf" and frfs.unknown_scale == "none" and len(test.input_channels) == 1:
        records = tuple(
            _select_sensors(record, test)
            for record in read_records(files, ingest or IngestOptions())
            if set(record.labels) & set(test.labels)
        )
    kind = test.kind if records else "frf"
    return Observations(kind=kind, records=records, band_hz=band, frfs=frfs, exclude_hz=chosen.exclude_hz)


def _select_sensors(record: recorded.Record, test: VibrationTest) -> ObservedRecord:
    """Select the sensors of a record whose FRFs were estimated: the user may have hidden one."""
    rows = [row for row, label in enumerate(record.labels) if label in test.labels]
    labels = [record.labels[row] for row in rows]
    return ObservedRecord(
        name=record.name,
        input_channel=test.input_channel.column,
        input_dof=labels[0].input_dof,
        sensors=tuple(
            Sensor(channel=label.output_channel, dof=label.output_dof, quantity=label.quantity) for label in labels
        ),
        step_s=record.step_s,
        force=record.force,
        responses=record.responses[rows],
        starts_at_rest=record.starts_at_rest,
        recording=record.recording,
        number=record.number,
        start_s=record.start_s,
    )
