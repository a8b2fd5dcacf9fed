"""What was measured, record by record, calibrated and in the signs of the test: the raw material of a diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray, read_only, require_shape
from frf_ipz.dofs import Dof
from frf_ipz.frf import FrfSet
from frf_ipz.identification.measured_lines import measured_lines
from frf_ipz.identification.options import FitOptions
from frf_ipz.ingest.records import read_records
from frf_ipz.quantities import FrfQuantity

if TYPE_CHECKING:
    from frf_ipz.ingest import records as recorded
    from frf_ipz.ingest.campaign import VibrationTest
    from frf_ipz.ingest.options import IngestOptions

BLOCK = 128  # samples


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sensor:
    """An output channel as it was used in one blow or record.

    Parameters
    ----------
    channel : str
        Column of the recordings.
    dof : Dof
        Where it sat, with its sign.
    quantity : FrfQuantity
        What it measures, as the FRF over a force.
    """

    channel: str
    dof: Dof
    quantity: FrfQuantity


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ObservedRecord:
    """One blow of a hammer, or one record of a shaker.

    Parameters
    ----------
    name : str
        As in the table of blows.
    input_channel : str
        Column of the force.
    input_dof : Dof
        Where it was struck, with its sign: the force on the model's DOF is this sign times `force`.
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
        What it was cut from.
    number : int
        1 for the first blow of its recording: what that has left may still move the structure at the next.
    start_s : float
        Time of its first sample in its recording, s.
    dc_offset_std : (n_sensors,) array, optional
        What constant parts of the responses may be left, one standard deviation, SI; none where it is left out.
    """

    name: str
    input_channel: str
    input_dof: Dof
    sensors: tuple[Sensor, ...]
    step_s: float
    force: FloatArray
    responses: FloatArray
    starts_at_rest: bool = True
    recording: str = ""
    number: int = 1
    start_s: float = 0.0
    dc_offset_std: FloatArray | None = None

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
        """Another blow came before it in the same recording."""
        return self.number > 1

    @property
    def level(self) -> float:
        """Largest force, N: what tells weak from strong blows."""
        return float(np.abs(self.force).max())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Observations:
    """All blows or records of a test that are used.

    Parameters
    ----------
    kind : str
        ``hammer``, ``random`` or ``frf``; with the last there are no blows.
    records : tuple of ObservedRecord
        In the order of the test.
    band_hz : pair of float
        Band that is looked at, Hz.
    frfs : FrfSet, optional
        FRFs on lines: what is looked at where there are no blows, or some did not start at rest.
    exclude_hz : tuple of pairs of float
        Stretches of the band that are not looked at, Hz.
    """

    kind: str
    records: tuple[ObservedRecord, ...]
    band_hz: tuple[float, float]
    frfs: FrfSet | None = None
    exclude_hz: tuple[tuple[float, float], ...] = ()

    @property
    def input_dofs(self) -> tuple[Dof, ...]:
        """Struck DOFs, each once."""
        return tuple(dict.fromkeys(record.input_dof for record in self.records))

    @property
    def start_at_rest(self) -> bool:
        """There are blows or records, and the structure was at rest at the beginning of each."""
        return bool(self.records) and all(record.starts_at_rest for record in self.records)

    def mask_band(self, frequency_hz: FloatArray, width_hz: float) -> BoolArray:
        """Say which frequencies are in the band, and not in or next to a stretch that is left out.

        Parameters
        ----------
        frequency_hz : (n,) array
            Hz.
        width_hz : float
            How far a line sees, Hz: it is kept that far from what is left out.

        Returns
        -------
        (n,) bool array
            True where it is looked at.
        """
        kept = (frequency_hz >= self.band_hz[0]) & (frequency_hz <= self.band_hz[1])
        for low, high in self.exclude_hz:
            kept &= (frequency_hz < low - width_hz) | (frequency_hz > high + width_hz)
        return np.asarray(kept)

    def records_at(self, input_dof: Dof) -> tuple[ObservedRecord, ...]:
        """Give the blows at one DOF, the strongest first.

        Parameters
        ----------
        input_dof : Dof
            One of `input_dofs`.

        Returns
        -------
        tuple of ObservedRecord
            Its blows.
        """
        mine = [record for record in self.records if record.input_dof == input_dof]
        return tuple(sorted(mine, key=lambda record: -record.level))


def transform_records(
    records: Sequence[ObservedRecord], s: ComplexArray
) -> tuple[tuple[ComplexArray, ComplexArray], ...]:
    """Transform force and responses of blows at any complex frequency, ``sum x(t) exp(-s t) dt``.

    For a structure at rest before the blow the ratio of the two is exactly its transfer function at s, but for what is
    left of the motion at the end of the record times ``exp(-Re s T)``.

    Parameters
    ----------
    records : sequence of ObservedRecord
        Of any length and step.
    s : (n_lines,) complex array
        rad/s, with a real part that is not negative.

    Returns
    -------
    tuple of pairs
        Of each blow the force, (n_lines,) complex array, N s, and the responses, (n_lines, n_sensors).
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
    test: VibrationTest, options: IngestOptions, frfs: FrfSet, *, fit: FitOptions | None = None
) -> Observations:
    """Gather what a diagnosis looks at.

    Parameters
    ----------
    test : VibrationTest
        The test.
    options : IngestOptions
        How its recordings are used.
    frfs : FrfSet
        The FRFs that were estimated from it, or elsewhere.
    fit : FitOptions, optional
        Says which band to look at, and which stretches of it not; without a band, the one that carries signal is
        taken.

    Returns
    -------
    Observations
        Blows or records where the scale of the channels is known, and the FRFs.

    Raises
    ------
    InputError
        If a recording cannot be used, or too few lines are left in the band.
    """
    chosen = fit or FitOptions()
    band = measured_lines(frfs, chosen).band_hz
    records: tuple[ObservedRecord, ...] = ()
    if test.kind != "frf" and frfs.unknown_scale == "none":
        records = tuple(
            _record(record, test) for record in read_records(test, options) if set(record.labels) & set(test.labels)
        )
    kind = test.kind if records else "frf"
    return Observations(kind=kind, records=records, band_hz=band, frfs=frfs, exclude_hz=chosen.exclude_hz)


def _record(record: recorded.Record, test: VibrationTest) -> ObservedRecord:
    """Take of a blow what the FRFs of the test were estimated from: the user may have hidden a sensor."""
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
