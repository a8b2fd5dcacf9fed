"""FRFs at points of interest that are known after all: only to judge a prediction, never to make it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import FileFormatError
from frf_ipz.frf import FrfLabel, FrfSet
from frf_ipz.ingest.formats.frf_file import FrfSource
from frf_ipz.ingest.formats.registry import read_frfs

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.quantities import FrfQuantity


def read_reference(path: Path, quantity: FrfQuantity) -> FrfSet:
    """Read FRFs that were kept aside.

    Parameters
    ----------
    path : Path
        A CSV or UFF of FRFs in SI, as in a test of kind ``frf``.
    quantity : FrfQuantity
        What was measured in the test; the FRFs kept aside are of the same quantity.

    Returns
    -------
    FrfSet
        On the lines of the file.

    Raises
    ------
    FileFormatError
        If it cannot be read, or its FRFs have different lines.
    """
    frfs = read_frfs(FrfSource(path=path, quantity=quantity))
    lines = frfs[0].frequency_hz
    if not all(np.array_equal(frf.frequency_hz, lines) for frf in frfs):
        raise FileFormatError(path, "its FRFs have different frequency lines; give all of them on the same lines")
    values = np.stack([frf.values for frf in frfs], axis=1)
    unknown = np.full(values.shape, np.nan)
    return FrfSet(
        frequency_hz=lines,
        values=values,
        labels=tuple(FrfLabel(frf.output_dof, frf.input_dof, quantity) for frf in frfs),
        variance=unknown,
        coherence=unknown,
        averages=np.zeros(len(frfs), int),
    )
