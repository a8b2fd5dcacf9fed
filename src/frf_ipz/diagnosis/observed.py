"""From a test to what a diagnosis looks at: blows where they started from rest, FRFs elsewhere."""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.diagnosis.observations import Blow, Observations, Sensor
from frf_ipz.errors import InputError
from frf_ipz.ingest.blows import read_blows

if TYPE_CHECKING:
    from frf_ipz.frf import FrfSet
    from frf_ipz.ingest import blows as recorded
    from frf_ipz.ingest.options import IngestOptions
    from frf_ipz.ingest.test_file import Test


def observe(
    test: Test, options: IngestOptions, frfs: FrfSet, *, band_hz: tuple[float, float] | None = None
) -> Observations:
    """Gather what a diagnosis looks at.

    Parameters
    ----------
    test : Test
        The test.
    options : IngestOptions
        How its recordings are used.
    frfs : FrfSet
        The FRFs that were estimated from it, or elsewhere.
    band_hz : pair of float, optional
        Band to look at, Hz; all lines above 0 where it is left out.

    Returns
    -------
    Observations
        Blows or records where all of them started from rest and the scale is known; else the FRFs.

    Raises
    ------
    InputError
        If a recording cannot be used, or there is no line above 0 Hz.
    """
    lines = frfs.frequency_hz[frfs.frequency_hz > 0]
    if not len(lines):
        raise InputError(f"{test.path}: there is no frequency line above 0 Hz; a diagnosis needs some")
    band = band_hz or (float(lines[0]), float(lines[-1]))
    blows: tuple[Blow, ...] = ()
    if test.kind != "frf" and frfs.unknown_scale == "none":
        blows = tuple(_blow(blow, test.input_channel.column) for blow in read_blows(test, options))
        if not all(blow.rested for blow in blows):
            blows = ()
    return Observations(kind=test.kind if blows else "frf", blows=blows, band_hz=band, frfs=frfs)


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
