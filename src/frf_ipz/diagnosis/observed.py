"""From a test to what a diagnosis looks at: blows or records, and the FRFs that were estimated from them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.diagnosis.observations import Observations, ObservedRecord, Sensor
from frf_ipz.identification.measured_lines import measured_lines
from frf_ipz.identification.options import FitOptions
from frf_ipz.ingest.records import read_records

if TYPE_CHECKING:
    from frf_ipz.frf import FrfSet
    from frf_ipz.ingest import records as recorded
    from frf_ipz.ingest.campaign import VibrationTest
    from frf_ipz.ingest.options import IngestOptions


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
        rested=record.starts_at_rest,
        recording=record.recording,
        number=record.number,
        start_s=record.start_s,
    )
