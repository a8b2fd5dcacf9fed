"""The result of ingest: FRFs, and the records behind them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from frf_ipz.arrays import FloatArray
from frf_ipz.display import Drawn, Tabulated
from frf_ipz.frf import FrfSet
from frf_ipz.late_imports import import_late
from frf_ipz.modes import ModalParameters
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    import pandas as pd
else:
    pd = import_late("pandas")

COHERENCES = ("frequency_hz", "output_dof", "input_dof", "ordinary_coherence", "multiple_coherence")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trace:
    """Part of a channel of one record, thinned for drawing.

    Parameters
    ----------
    name : str
        Which record, as in the table of records.
    channel : str
        Column of the recording.
    unit : str
        SI unit of `values`.
    time_s, values : (n_points,) array
        Points to draw; minima and maxima are kept.
    """

    name: str
    channel: str
    unit: str
    time_s: FloatArray
    values: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrfEstimate(Tabulated, Drawn):
    """FRFs and the quality of the records that they were estimated from.

    Parameters
    ----------
    frfs : FrfSet
        The estimated FRFs.
    records : DataFrame
        One row a record: ``record`` (file, or file#number), ``input_dof``, ``peak_force_N``, ``pulse_s``, ``used``
        (bool), ``weight``, ``marks`` (what is wrong, joined by "; "), and what was measured to say so:
        ``second_pulse_ratio`` (height over the first), ``remaining_amplitude`` (share of its amplitude that the slowest
        mode still has at the end) and ``slowest_mode_hz``, ``snr_db``, ``force_noise_N``, ``force_band_hz`` (up to
        where the force's spectrum stays within 20 dB of its largest value), ``step_s``, ``samples``, ``trigger_s``,
        ``unlike_others`` (bool: all responses contradict those of the other impacts, and no fault explains it).
        Empty for FRFs that were estimated elsewhere.
    traces : tuple of Trace
        Forces and responses to draw.
    choices : tuple of str
        What was chosen, and by what: windows, segments, lines.
    warnings : tuple of str
        Whatever the user has to know.
    modes : ModalParameters, optional
        Modes of a test that has no FRFs; `frfs` is then empty, and has the lines on which a model is evaluated.
    coherences : DataFrame
        Where several forces act at once, one row an FRF and line: ``frequency_hz, output_dof, input_dof,
        ordinary_coherence, multiple_coherence``; the coherence of `frfs` is then the multiple one. Else empty.

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
    >>> estimate = frf_ipz.estimate_frfs(test)
    >>> estimate.records["peak_force_N"].round(1).tolist()
    [38.0, 57.1, 76.1]
    """

    frfs: FrfSet
    records: pd.DataFrame
    traces: tuple[Trace, ...] = ()
    choices: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    modes: ModalParameters | None = None
    coherences: pd.DataFrame = field(default_factory=lambda: pd.DataFrame(columns=list(COHERENCES)))

    def __repr__(self) -> str:
        if self.modes is not None:
            n_modes, n_dofs = len(self.modes.damping_ratio), len(self.modes.dofs)
            return f"FrfEstimate: no FRF; {counted(n_modes, 'mode')} at {counted(n_dofs, 'DOF')}"
        used = int(self.records["used"].sum()) if len(self.records) else 0
        of_records = (
            f"{used} of {counted(len(self.records), 'record')}" if len(self.records) else "FRFs estimated elsewhere"
        )
        return f"FrfEstimate: {of_records}; {self.frfs!r}"
