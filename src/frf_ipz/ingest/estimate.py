"""From a test to FRFs with their uncertainty, whatever its kind."""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.ingest.estimation.frf_files import estimate_frf_files
from frf_ipz.ingest.estimation.hammer import estimate_hammer
from frf_ipz.ingest.estimation.random import estimate_random
from frf_ipz.ingest.options import IngestOptions
from frf_ipz.progress import Progress, silent

if TYPE_CHECKING:
    from frf_ipz.ingest.campaign import VibrationTest
    from frf_ipz.ingest.frf_estimate import FrfEstimate

KINDS = {"hammer": estimate_hammer, "random": estimate_random, "frf": estimate_frf_files}


def estimate_frfs(
    test: VibrationTest, *, options: IngestOptions | None = None, progress: Progress = silent
) -> FrfEstimate:
    """Estimate the FRFs of a test.

    Parameters
    ----------
    test : VibrationTest
        What was measured, from `read_test`.
    options : IngestOptions, optional
        How recordings become FRFs.
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

    Examples
    --------
    >>> import frf_ipz
    >>> test = frf_ipz.read_test("data/raw/cantilever/test.toml")  # doctest: +SKIP
    >>> frf_ipz.estimate_frfs(test).frfs.n_frfs  # doctest: +SKIP
    2
    """
    result = KINDS[test.kind](test, options or IngestOptions(), progress)
    progress(1.0, "FRFs estimated")
    return result
