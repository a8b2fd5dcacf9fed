"""A test of modes that were identified elsewhere: there is no FRF to estimate, the modes are handed on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import InputError
from frf_ipz.frf import FrfSet
from frf_ipz.ingest.estimation.record_table import empty_record_table
from frf_ipz.ingest.frf_estimate import FrfEstimate

if TYPE_CHECKING:
    from frf_ipz.ingest.campaign import VibrationTest
    from frf_ipz.ingest.options import IngestOptions
    from frf_ipz.progress import Progress


def hand_on_modes(test: VibrationTest, options: IngestOptions, progress: Progress) -> FrfEstimate:
    """Hand the modes of a test on.

    Parameters
    ----------
    test : VibrationTest
        Of kind ``modes``.
    options : IngestOptions
        Not used: nothing is estimated.
    progress : Progress
        Not used.

    Returns
    -------
    FrfEstimate
        The modes, no FRF, and the lines on which a model is evaluated.

    Raises
    ------
    InputError
        If the test has no modes.
    """
    del options, progress
    modes = test.modes
    if modes is None:
        raise InputError(f"{test.path}: a test of kind 'modes' needs modes; name their file as [[modes]]")
    lines = modes.lines_hz
    nothing = np.zeros((len(lines), 0))
    frfs = FrfSet(
        frequency_hz=lines,
        values=nothing.astype(complex),
        labels=(),
        variance=nothing,
        coherence=nothing,
        averages=np.zeros(0, np.int64),
    )
    return FrfEstimate(frfs=frfs, records=empty_record_table(), modes=modes)
