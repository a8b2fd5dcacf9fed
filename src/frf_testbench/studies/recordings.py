"""Where the recordings of the studies come from, and what to say when they are not there.

None of them is part of the repository: they belong to those who measured them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

PUBLISHED = (
    ". These recordings were made by others and are not part of the repository; get them where they were published"
)


class StudyError(ValueError):
    """A study cannot be made with what it was given."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingSource:
    """A set of recordings.

    Parameters
    ----------
    files : tuple of str
        Files that its folder must hold.
    content : str
        What was measured, where it was published, and in which form it is read.
    """

    files: tuple[str, ...]
    content: str


SOURCES = {
    "cantilever_masses": RecordingSource(
        files=(
            "mass_positions.xlsx",
            *(f"Beam_healthy/P-{number}.txt" for number in range(1, 71)),
            *(f"Beam_damage_2.96/P-{number}-1.txt" for number in range(1, 71)),
        ),
        content="FRFs of a cantilever with six masses in 70 layouts, published as 'Dataset Beam-signal_Healthy.zip', "
        "'Dateset Beam-signal_Damaged-2.96.zip' and 'Mass position.xlsx': 70 text files (Hz, dB, degrees) in each of "
        "Beam_healthy/ and Beam_damage_2.96/, and the layouts as mass_positions.xlsx",
    ),
    "double_beam_ringdown": RecordingSource(
        files=tuple(f"ringdown_{number:02}.csv" for number in range(1, 13)),
        content="twelve ring-downs of a jointed double beam after impacts of a hammer, laser vibrometer at the tip, "
        "5120 Hz: ringdown_01.csv to ringdown_12.csv with the columns time and velocity_m_s",
    ),
    "silverbox": RecordingSource(
        files=("SNLS80mV.csv",),
        content="SNLS80mV.csv of the Silverbox, an electronic oscillator (T. Wigren and J. Schoukens, Three free data "
        "sets for development and benchmarking in nonlinear system identification, European Control Conference 2013; "
        "www.nonlinearbenchmark.org), with the columns V1 and V2",
    ),
    "steel_beam_5x3": RecordingSource(
        files=("test.toml", "model.toml", "frf.csv"),
        content="FRFs of a flexible steel beam of 500 mm, five position sensors at 45, 145, 245, 345 and 445 mm, "
        "actuators at the first, third and fifth, 0.25 Hz, with their test.toml and model.toml",
    ),
    "freefree_beam": RecordingSource(
        files=("test.toml", "model.toml", *(f"Hxysv{number:05}.txt" for number in range(1, 10))),
        content="nine accelerances of a free beam by a roving hammer, 0 to 1000 Hz, as the analyser's text files "
        "Hxysv00001.txt to Hxysv00009.txt, with their test.toml and model.toml",
    ),
}


def require_recordings(folder: Path, *names: str) -> str:
    """Make sure that a folder holds recordings.

    Parameters
    ----------
    folder : Path
        The folder; where several sets are possible its name says which one it holds.
    *names : str
        Sets of `SOURCES` that the study can work on.

    Returns
    -------
    str
        The set that the folder holds.

    Raises
    ------
    StudyError
        If it holds none of them; the message says where they come from.
    """
    name = names[0] if len(names) == 1 else folder.resolve().name
    if name not in names:
        contents = "; ".join(f"{known} has to hold {SOURCES[known].content}" for known in names)
        raise StudyError(
            f"{folder} is none of the folders {' and '.join(names)} that this study reads. {contents}{PUBLISHED}"
        )
    missing = [file for file in SOURCES[name].files if not (folder / file).is_file()]
    if missing:
        where = f"there is no {missing[0]} in {folder}" if folder.is_dir() else f"there is no folder {folder}"
        raise StudyError(f"{where}. It has to hold {SOURCES[name].content}{PUBLISHED}")
    return name
