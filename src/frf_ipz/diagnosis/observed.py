"""From a test to what a diagnosis looks at: blows or records, and the FRFs that were estimated from them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.diagnosis.observations import Blow, Observations, Sensor
from frf_ipz.identification.lines.measured import measured_lines
from frf_ipz.identification.options import FitOptions
from frf_ipz.ingest.blows import read_blows

if TYPE_CHECKING:
    from frf_ipz.frf import FrfSet
    from frf_ipz.ingest import blows as recorded
    from frf_ipz.ingest.options import IngestOptions
    from frf_ipz.ingest.test_file import Test


def observe(test: Test, options: IngestOptions, frfs: FrfSet, *, fit: FitOptions | None = None) -> Observations:
    """Gather what a diagnosis looks at.

    Parameters
    ----------
    test : Test
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
    blows: tuple[Blow, ...] = ()
    if test.kind != "frf" and frfs.unknown_scale == "none":
        blows = tuple(_blow(blow, test.input_channel.column) for blow in read_blows(test, options))
    kind = test.kind if blows else "frf"
    return Observations(kind=kind, blows=blows, band_hz=band, frfs=frfs, exclude_hz=chosen.exclude_hz)


def _blow(blow: recorded.Blow, input_channel: str) -> Blow:
    return Blow(
        name=blow.name,
        input_channel=input_channel,
        input_dof=blow.labels[0].input_dof,
        sensors=tuple(
            Sensor(channel=label.output_channel, dof=label.output_dof, quantity=label.quantity) for label in blow.labels
        ),
        step_s=blow.step_s,
        force=blow.force,
        responses=blow.responses,
        rested=blow.rested,
    )
