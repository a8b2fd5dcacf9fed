"""Recordings of any format in memory, as their files have them; and those of the SEP-005 convention.

SEP-005 is a convention of the SDyPy project for time series in memory: a list of dicts with ``data``, ``name``,
``unit_str`` and ``fs`` or ``time``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.arguments import require_each, require_type, take_array
from frf_ipz.arrays import FloatArray, read_only
from frf_ipz.display import Concise
from frf_ipz.dofs import Dof, as_dof
from frf_ipz.errors import FileFormatError, InputError, QuantityError, ShapeError, did_you_mean
from frf_ipz.ingest.campaign import Recording
from frf_ipz.ingest.formats.recording import TableKeys
from frf_ipz.ingest.formats.registry import look_at_recording, open_recording
from frf_ipz.ingest.recording_files import UniformTimeCheck
from frf_ipz.ingest.units import is_stated, unit_factor
from frf_ipz.late_imports import import_late
from frf_ipz.quantities import RESPONSES

if TYPE_CHECKING:
    import pandas as pd
else:
    pd = import_late("pandas")

WILDCARDS = "*?["


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class RecordedSignals(Concise):
    """The signals of one recording, in the units of its file.

    Parameters
    ----------
    name : str
        Of the file.
    names, units : tuple of str
        Of each signal; a unit is empty where the file does not say it.
    values : (n_signals, n_samples) array
        In these units.
    sample_rate_hz : float
        Hz.
    dofs : tuple of Dof or None
        Where each was measured, as far as the file says.
    start_s : float
        Time of the first sample, s.
    notes : tuple of str
        What had to be chosen.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> time = np.arange(512) / 1024.0
    >>> channels = [
    ...     {"name": "hammer", "data": np.exp(-((time - 0.1) ** 2) / 1e-5), "fs": 1024.0, "unit_str": "kN"},
    ...     {"name": "tip", "data": np.sin(200 * time), "fs": 1024.0, "unit_str": "g"},
    ... ]
    >>> signals = frf_ipz.RecordedSignals.from_sep005(channels)
    >>> signals
    RecordedSignals: sep005, 2 signals (hammer in kN, tip in g), 512 samples at 1024 Hz
    >>> recording = signals.to_recording(force="hammer", input_dof="18:+z", output_dofs={"tip": "20:+z"})
    >>> recording.quantity, round(recording.force.max())
    ('acceleration', 985)
    """

    name: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: FloatArray
    sample_rate_hz: float
    dofs: tuple[Dof | None, ...]
    start_s: float = 0.0
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", read_only(np.atleast_2d(self.values)))

    def __repr__(self) -> str:
        listed = [f"{name} in {unit}" if unit else name for name, unit in zip(self.names, self.units, strict=True)]
        length = f"{self.values.shape[1]} samples at {self.sample_rate_hz:g} Hz"
        return f"RecordedSignals: {self.name}, {len(listed)} signals ({', '.join(listed)}), {length}"

    @property
    def time(self) -> FloatArray:
        """When the samples were taken, s, (n_samples,) array."""
        return np.asarray(self.start_s + np.arange(self.values.shape[1]) / self.sample_rate_hz)

    def to_frame(self) -> pd.DataFrame:
        """Give the signals as a table.

        Returns
        -------
        DataFrame
            One column a signal, in the units of the file; the index is the time in s.
        """
        index = pd.Index(self.time, name="time")
        return pd.DataFrame(self.values.T, columns=list(self.names), index=index)

    def to_recording(
        self,
        *,
        force: str,
        input_dof: Dof | str,
        output_dofs: Mapping[str, Dof | str],
        units: Mapping[str, str] | None = None,
    ) -> Recording:
        """Make a recording for `VibrationTest.from_recordings`, in SI.

        Parameters
        ----------
        force : str
            Which signal is the force.
        input_dof : Dof or str
            Where it acts.
        output_dofs : mapping of str to Dof or str
            The responses, and where they were measured.
        units : mapping of str to str, optional
            Units of signals whose file does not say them.

        Returns
        -------
        Recording
            Its responses have one quantity, which follows from their units.

        Raises
        ------
        InputError
            If there is no such signal.
        QuantityError
            If a unit is missing, or is none of a force or a motion.
        """
        output_places = [self._place(name) for name in output_dofs]
        stated = [dict(units or {}).get(name, unit) for name, unit in zip(self.names, self.units, strict=True)]
        force_place = self._place(force)
        for place in (force_place, *output_places):
            if not is_stated(stated[place]):
                problem = f"{self.name}: '{self.names[place]}' has no unit"
                raise QuantityError(f"{problem}; give it, as in units={{'{self.names[place]}': 'm/s^2'}}")
        dofs = [as_dof(dof) for dof in output_dofs.values()]
        rotational = [dof.direction.startswith("r") for dof in dofs]
        quantities = {
            _response_of(stated[place], rotational=turns)
            for place, turns in zip(output_places, rotational, strict=True)
        }
        if len(quantities) != 1:
            names = ", ".join(sorted(quantities))
            raise QuantityError(f"{self.name}: the responses are {names}; a recording has responses of one quantity")
        (quantity,) = quantities
        turns_input = as_dof(input_dof).direction.startswith("r")
        factors = [
            unit_factor(stated[place], quantity, rotational=turns)
            for place, turns in zip(output_places, rotational, strict=True)
        ]
        return Recording(
            force=self.values[force_place] * unit_factor(stated[force_place], "force", rotational=turns_input),
            responses=self.values[output_places] * np.array(factors)[:, None],
            sample_rate_hz=self.sample_rate_hz,
            input_dof=input_dof,
            output_dofs=dofs,
            quantity=quantity,
        )

    @classmethod
    def from_sep005(cls, channels: Sequence[Mapping[str, Any]], *, name: str = "sep005") -> RecordedSignals:
        """Take time series as the SEP-005 convention of SDyPy has them.

        Parameters
        ----------
        channels : sequence of mapping
            Each with ``data``, ``name``, ``unit_str`` and ``fs`` in Hz or ``time`` in s.
        name : str
            What to call the recording.

        Returns
        -------
        RecordedSignals
            All of them.

        Raises
        ------
        InputError
            If a key is missing, or channels have different rates.
        ShapeError
            If their lengths differ, or a sample is no number.
        """
        require_each("channels", channels, Mapping)
        if not channels:
            raise InputError("channels is empty; SEP-005 has one dict a channel")
        missing = [key for channel in channels for key in ("data", "name", "unit_str") if key not in channel]
        if missing or any("fs" not in channel and "time" not in channel for channel in channels):
            what = missing[0] if missing else "fs' or 'time"
            raise InputError(f"a channel has no '{what}'; SEP-005 asks for data, name, unit_str, and fs or time")
        n_samples = len(channels[0]["data"])
        values = np.vstack(
            [take_array(f"channel '{one['name']}'", one["data"], np.float64, (n_samples,)) for one in channels]
        )
        rates = [_rate_of(channel, n_samples) for channel in channels]
        if np.ptp(rates) > 1e-6 * max(rates):  # relative: what few digits of a time make of one rate
            problem = f"channels have rates from {min(rates):g} to {max(rates):g} Hz"
            raise InputError(f"{problem}; a recording has one: resample")
        start = channels[0].get("time")
        return cls(
            name=name,
            names=tuple(str(channel["name"]) for channel in channels),
            units=tuple(str(channel["unit_str"]).strip("_ ") for channel in channels),
            values=values,
            sample_rate_hz=rates[0],
            dofs=(None,) * len(channels),
            start_s=0.0 if start is None or not len(start) else float(start[0]),
        )

    def to_sep005(self) -> list[dict[str, Any]]:
        """Give the signals as the SEP-005 convention of SDyPy has them.

        Returns
        -------
        list of dict
            One a signal, with ``data``, ``name``, ``unit_str``, ``fs`` and ``time``.
        """
        return [
            {
                "data": values,
                "name": name,
                "unit_str": unit,
                "fs": self.sample_rate_hz,
                "time": self.time,
            }
            for name, unit, values in zip(self.names, self.units, self.values, strict=True)
        ]

    def _place(self, name: str) -> int:
        if name not in self.names:
            raise InputError(f"{self.name} has no signal '{name}'; {did_you_mean(name, self.names)}")
        return self.names.index(name)


def read_recordings(
    path: str | Path, *, sample_rate_hz: float | None = None, time_column: str = ""
) -> tuple[RecordedSignals, ...]:
    """Read recordings of any format, told by their content.

    Parameters
    ----------
    path : str or Path
        A file; or a pattern such as ``day1/*.mat``.
    sample_rate_hz : float, optional
        Samples a second, for files that do not say when their samples were taken, Hz.
    time_column : str
        Name of the time, where it is not found.

    Returns
    -------
    tuple of RecordedSignals
        One a file, in the order of their names.

    Raises
    ------
    FileFormatError
        If there is no such file, it cannot be read, or its time is not uniform.
    InputError
        If the rate is not positive.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np, frf_ipz
    >>> with TemporaryDirectory() as folder:
    ...     np.savez(Path(folder) / "hit.npz", force=np.ones(100), tip=np.arange(100.0), fs=2048.0)
    ...     (signals,) = frf_ipz.read_recordings(f"{folder}/*.npz")
    >>> signals.names, signals.sample_rate_hz
    (('force', 'tip'), 2048.0)
    """
    require_type("path", path, str, Path)
    require_type("sample_rate_hz", sample_rate_hz, float, int, np.number, optional=True)
    require_type("time_column", time_column, str)
    if sample_rate_hz is not None and not 0.0 < sample_rate_hz < np.inf:
        raise InputError(f"sample_rate_hz is {sample_rate_hz:g}; it is positive")
    keys = TableKeys(sample_rate_hz=sample_rate_hz, time_column=time_column)
    return tuple(_read(file, keys) for file in _files(Path(path)))


def _files(path: Path) -> list[Path]:
    text = str(path)
    if path.exists() or not any(sign in text for sign in WILDCARDS):
        return [path]
    relative = path.relative_to(path.anchor)
    try:
        files = sorted(file for file in Path(path.anchor or ".").glob(str(relative)) if file.is_file())
    except (ValueError, NotImplementedError, OSError) as error:
        raise FileFormatError(path, f"is no valid pattern of files: {error}") from None
    if not files:
        raise FileFormatError(path, "no file fits this pattern")
    return files


def _read(path: Path, keys: TableKeys) -> RecordedSignals:
    contents = look_at_recording(path, keys)
    columns = [column for column in contents.columns if column.name != keys.time_column]
    recording = open_recording(path, [column.name for column in columns], keys)
    blocks = []
    factor = unit_factor(recording.units[0], "time") if recording.units[0] else 1.0
    time_check = UniformTimeCheck(recording, factor)
    for block in recording.blocks:
        time_check.add(block[:, 0])
        block[:, 0] *= factor
        blocks.append(block)
    time_check.finish()
    table = np.concatenate(blocks)
    return RecordedSignals(
        name=path.name,
        names=tuple(column.label or column.name for column in columns),
        units=tuple(unit if is_stated(unit) else "" for unit in recording.units[1:]),
        values=np.ascontiguousarray(table[:, 1:].T),
        sample_rate_hz=float((len(table) - 1) / (table[-1, 0] - table[0, 0])),
        dofs=tuple(column.dof for column in columns),
        start_s=float(table[0, 0]),
        notes=recording.notes,
    )


def _response_of(unit: str, *, rotational: bool) -> str:
    for quantity in RESPONSES:
        try:
            unit_factor(unit, quantity, rotational=rotational)
        except QuantityError:
            continue
        return quantity
    raise QuantityError(f"'{unit}' is no unit of a motion; expected is one like m/s^2, g, mm/s or um")


def _rate_of(channel: Mapping[str, Any], n_samples: int) -> float:
    if channel.get("fs") is not None:
        rate_hz = float(channel["fs"])
    else:
        time = np.asarray(channel["time"], np.float64)
        if len(time) != n_samples or n_samples < 2:
            raise ShapeError(f"the time of channel '{channel['name']}' has {len(time)} samples; needed are {n_samples}")
        rate_hz = float((n_samples - 1) / (time[-1] - time[0])) if time[-1] > time[0] else 0.0
    if not 0.0 < rate_hz < np.inf:
        raise InputError(f"the rate of channel '{channel['name']}' is {rate_hz:g} Hz; it is positive")
    return rate_hz
