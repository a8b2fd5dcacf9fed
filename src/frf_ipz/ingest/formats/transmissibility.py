"""Transmissibilities: response over the response of a reference, made FRFs by the FRF of that reference."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import FileFormatError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.ingest.formats.frf_file import FrfSource, MeasuredFrf

SAME_LINE = 1e-5  # relative: universal files state the step with six digits
FEWEST_LINES = 2


def over_force(
    source: FrfSource, ratios: Sequence[MeasuredFrf], references: Sequence[MeasuredFrf]
) -> list[MeasuredFrf]:
    """Multiply transmissibilities by the FRF of their reference.

    Parameters
    ----------
    source : FrfSource
        The file with the transmissibilities, and where the force acts.
    ratios : sequence of MeasuredFrf
        Its functions: the input is the reference.
    references : sequence of MeasuredFrf
        FRFs among which is that of the reference.

    Returns
    -------
    list of MeasuredFrf
        FRFs over the force, on the lines that both have, in the unit of the reference's FRF.

    Raises
    ------
    FileFormatError
        If the FRF of a reference is not there, or shares no lines.
    """
    frfs = []
    for ratio in ratios:
        wanted = (ratio.input_dof, source.force_dof)
        reference = next((frf for frf in references if (frf.output_dof, frf.input_dof) == wanted), None)
        if reference is None:
            raise no_reference(source, ratio)
        nearest = np.abs(reference.frequency_hz[:, None] - ratio.frequency_hz[None, :]).argmin(axis=1)
        same = np.abs(ratio.frequency_hz[nearest] - reference.frequency_hz) <= SAME_LINE * reference.frequency_hz
        if same.sum() < FEWEST_LINES:
            problem = f"the transmissibility of {ratio.output_dof} over {ratio.input_dof} has no lines in common with"
            raise FileFormatError(source.path, f"{problem} {reference.source.path.name}; export them alike")
        factor, values = ratio.values[nearest[same]], reference.values[same]
        variance = None if reference.variance is None else np.abs(factor) ** 2 * reference.variance[same]
        note = f"{source.path.name}: {ratio.output_dof} over {ratio.input_dof}, times {reference.label}"
        frfs.append(
            replace(
                reference,
                source=replace(reference.source, path=source.path),
                output_dof=ratio.output_dof,
                frequency_hz=reference.frequency_hz[same],
                values=factor * values,
                coherence=None,
                variance=variance,
                notes=(*ratio.notes, note),
            )
        )
    return frfs


def no_reference(source: FrfSource, ratio: MeasuredFrf) -> FileFormatError:
    """Make the error for a transmissibility whose reference has no FRF in the test.

    Parameters
    ----------
    source : FrfSource
        The file.
    ratio : MeasuredFrf
        One of its functions.

    Returns
    -------
    FileFormatError
        Says what is needed.
    """
    problem = f"a transmissibility knows no force: the test needs the FRF {ratio.input_dof} / {source.force_dof} too"
    way_out = "name its file in another [[frf]]; a base that moves is no force, and such tests are not read"
    return FileFormatError(source.path, f"{problem}; {way_out}")
