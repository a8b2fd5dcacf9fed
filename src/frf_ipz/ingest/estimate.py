"""From a test to FRFs with their uncertainty, whatever its kind."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from frf_ipz.arguments import require_type
from frf_ipz.ingest.campaign import VibrationTest
from frf_ipz.ingest.options import IngestOptions
from frf_ipz.late_imports import import_late
from frf_ipz.progress import Progress, silent

if TYPE_CHECKING:
    from frf_ipz.ingest.estimation.frf_files import estimate_frf_files
    from frf_ipz.ingest.estimation.hammer import estimate_hammer
    from frf_ipz.ingest.estimation.modes import hand_on_modes
    from frf_ipz.ingest.estimation.random import estimate_random
    from frf_ipz.ingest.frf_estimate import FrfEstimate
    from frf_ipz.ingest.recording_files import RecordingFiles
else:
    estimate_frf_files = import_late("frf_ipz.ingest.estimation.frf_files", "estimate_frf_files")
    estimate_hammer = import_late("frf_ipz.ingest.estimation.hammer", "estimate_hammer")
    estimate_random = import_late("frf_ipz.ingest.estimation.random", "estimate_random")
    hand_on_modes = import_late("frf_ipz.ingest.estimation.modes", "hand_on_modes")
    RecordingFiles = import_late("frf_ipz.ingest.recording_files", "RecordingFiles")

FROM_RECORDINGS = {"hammer": estimate_hammer, "random": estimate_random}
OF_IMPACTS = ("force_window_s", "exponential_window_s")
OF_RECORDINGS = ("estimator", *OF_IMPACTS, "segment_s", "keep", "drop")
FROM_RESULTS = {"frf": estimate_frf_files, "modes": hand_on_modes}


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
    >>> frf_ipz.estimate_frfs(test)
    FrfEstimate: 3 of 3 records; FrfSet: 1 FRF (accelerance) on 2001 lines from 0 to 1000 Hz, 1:+z / 1:+z
    """
    require_type("test", test, VibrationTest)
    require_type("options", options, IngestOptions, optional=True)
    return estimate_from(RecordingFiles(test=test), options or IngestOptions(), progress)


def estimate_from(files: RecordingFiles, options: IngestOptions, progress: Progress = silent) -> FrfEstimate:
    """Estimate the FRFs of a test whose recordings may have been read before.

    Parameters
    ----------
    files : RecordingFiles
        The recordings of the test; none for a test of FRFs or of modes.
    options : IngestOptions
        The user's choice.
    progress : Progress
        Called with the share of the work that is done.

    Returns
    -------
    FrfEstimate
        As `estimate_frfs` gives it.

    Raises
    ------
    InputError
        If a recording cannot be used.
    """
    kind = files.test.kind
    if kind in FROM_RESULTS:
        result = FROM_RESULTS[kind](files.test, options, progress)
    else:
        result = FROM_RECORDINGS[kind](files, options, progress)
    progress(1.0, "FRFs estimated")
    idle = _idle_keys(files.test, options)
    return replace(result, warnings=(*result.warnings, *idle)) if idle else result


def _idle_keys(test: VibrationTest, options: IngestOptions) -> tuple[str, ...]:
    """Name keys of ``[ingest]`` that have no effect on a test of its kind."""
    several = len(test.input_channels) > 1
    keys, kind = {
        "frf": (OF_RECORDINGS, "FRFs were estimated elsewhere"),
        "modes": (OF_RECORDINGS, "modes were identified elsewhere"),
        "hammer": (("segment_s",), "impacts are not cut into segments"),
        "random": (OF_IMPACTS if several else OF_IMPACTS[:1], "it is a test with a shaker"),
    }[test.kind]
    default = IngestOptions()
    idle = [key for key in keys if getattr(options, key) != getattr(default, key)]
    return (f"[ingest] {', '.join(idle)}: no effect, as {kind}",) if idle else ()
