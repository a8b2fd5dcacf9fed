"""From a test to FRFs with their uncertainty, whatever its kind."""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.ingest.estimation.frf_files import estimate_frf_files
from frf_ipz.ingest.estimation.hammer import estimate_hammer
from frf_ipz.ingest.estimation.random import estimate_random
from frf_ipz.progress import Progress, silent

if TYPE_CHECKING:
    from frf_ipz.ingest.campaign import VibrationTest
    from frf_ipz.ingest.frf_estimate import FrfEstimate
    from frf_ipz.ingest.options import IngestOptions

KINDS = {"hammer": estimate_hammer, "random": estimate_random, "frf": estimate_frf_files}


def estimate_frfs(test: VibrationTest, options: IngestOptions, *, progress: Progress = silent) -> FrfEstimate:
    """Estimate the FRFs of a test.

    Parameters
    ----------
    test : VibrationTest
        What was measured, from `read_test`.
    options : IngestOptions
        The user's choice.
    progress : Progress
        Called with the share of the work that is done.

    Returns
    -------
    FrfEstimate
        FRFs in SI with variance and coherence, the table of records, what was chosen, warnings.

    Raises
    ------
    InputError
        If a recording cannot be used: which file, which line, what to do.
    """
    result = KINDS[test.kind](test, options, progress)
    progress(1.0, "FRFs estimated")
    return result
