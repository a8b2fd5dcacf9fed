"""Double beam: how its two modes depend on amplitude, from twelve ring-downs after impacts of different force.

``frf-testbench study double_beam_ringdown FOLDER``. There is no force and no model: each ring-down is followed from
window to window.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from frf_ipz.progress import silent
from frf_testbench.studies.recordings import SOURCES, require_recordings
from frf_testbench.studies.ringdown import fit_amplitude_law, name_family, track_ringdown

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.progress import Progress

FREQUENCIES_HZ = (122.5, 243.6)
WINDOW_S = 0.15
LEAST_M_S = (0.0, 0.1)  # below, the second harmonic of the first mode hides the second mode
QUANTITIES = ("frequency_hz", "damping_ratio")


def study_double_beam_ringdown(folder: Path, *, progress: Progress = silent) -> dict[str, pd.DataFrame]:
    """Fit frequency and damping of both modes as offset + change A^power of the tip's velocity A, in m/s.

    Parameters
    ----------
    folder : Path
        Holds ``ringdown_01.csv`` to ``ringdown_12.csv``.
    progress : Progress
        Receives the progress.

    Returns
    -------
    dict of str to DataFrame
        The laws, and which family they belong to.

    Raises
    ------
    StudyError
        If the folder does not hold the recordings.
    """
    files = SOURCES[require_recordings(folder, "double_beam_ringdown")].files
    ringdowns = []
    for number, file in enumerate(files):
        progress(number / len(files), f"following {file}")
        time, velocity = pd.read_csv(folder / file).to_numpy().T
        step = (time[-1] - time[0]) / (len(time) - 1)
        ringdowns.append(track_ringdown(velocity, step, FREQUENCIES_HZ, WINDOW_S))
    rows, families = [], []
    for mode, lowest in enumerate(LEAST_M_S):
        tracks = [ringdown[mode].above(lowest) for ringdown in ringdowns]
        amplitude = np.concatenate([track.amplitude for track in tracks])
        ends = np.array([amplitude.min(), amplitude.max()])
        laws = {quantity: fit_amplitude_law(tracks, quantity) for quantity in QUANTITIES}
        for quantity, law in laws.items():
            weak, strong = law.at(ends)
            rows.append({
                "mode": mode + 1, "quantity": quantity, "windows": len(amplitude),
                "weakest_m_s": ends[0], "strongest_m_s": ends[1], "at_weakest": weak, "at_strongest": strong,
                "offset": law.offset, "change": law.change,
                "power": law.power, "power_low": law.power_low, "power_high": law.power_high,
                "misfit": law.misfit, "misfit_of_constant": law.misfit_of_constant,
            })  # fmt: skip
        families.append({"mode": mode + 1, "family": name_family(laws["frequency_hz"], laws["damping_ratio"])})
    return {
        "frequency and damping over amplitude (power with its 95 % interval)": pd.DataFrame(rows),
        "what moves the modes like that": pd.DataFrame(families),
    }
