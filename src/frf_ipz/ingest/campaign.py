"""A vibration test: its channels, its set-ups and their files, the FRFs that it gives; the masses of its sensors.

`campaign_file` reads one from `test.toml`.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from frf_ipz.dofs import Dof
from frf_ipz.frf import FrfLabel
from frf_ipz.ingest.formats.frf_file import FrfSource
from frf_ipz.ingest.units import numerator_of
from frf_ipz.quantities import frf_quantity_of

if TYPE_CHECKING:
    from collections.abc import Iterable


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """A column of the recordings.

    Parameters
    ----------
    column : str
        Its header, or its number in files without one.
    role : str
        ``input`` or ``output``.
    quantity : str
        ``force``, ``acceleration``, ``velocity`` or ``displacement``.
    unit, sensitivity : str
        At most one is not empty; where both are, the files' row of units counts.
    dof : Dof, optional
        Where an output sits, unless a set-up says otherwise.
    mass_kg : float
        The sensor's own mass.
    """

    column: str
    role: str
    quantity: str
    unit: str = ""
    sensitivity: str = ""
    dof: Dof | None = None
    mass_kg: float = 0.0

    @property
    def column_unit(self) -> str:
        """The unit the column is in, as far as the test states it; empty where the files have to."""
        return numerator_of(self.sensitivity) if self.sensitivity else self.unit


@dataclass(frozen=True, slots=True, kw_only=True)
class TestSetup:
    """Recordings with the force at one DOF and the sensors in one layout.

    Parameters
    ----------
    input_dof : Dof
        Where the force acts, with its sign.
    output_dofs : tuple of Dof
        Where the outputs sit, in the order of the output channels.
    files : tuple of Path
        The recordings, sorted.
    """

    input_dof: Dof
    output_dofs: tuple[Dof, ...]
    files: tuple[Path, ...]


@dataclass(frozen=True, kw_only=True)
class VibrationTest:
    """A test: what was measured, where, and in which files.

    Parameters
    ----------
    path : Path
        ``test.toml``.
    name : str
        What the user calls it.
    kind : str
        ``hammer``, ``random`` or ``frf``.
    nominal_damping_ratio : float, optional
        For models that state no damping.
    unknown_scale : str
        ``none``, ``common`` or ``per_channel``.
    channels : tuple of Channel
        The input first; none of kind ``frf``.
    setups : tuple of TestSetup
        One an excited DOF and layout of sensors; none of kind ``frf``.
    frf_sources : tuple of FrfSource
        Files with FRFs, of kind ``frf``.
    labels : tuple of FrfLabel
        The FRFs that the test gives, each once.
    """

    path: Path
    name: str
    kind: str
    nominal_damping_ratio: float | None
    unknown_scale: str
    channels: tuple[Channel, ...]
    setups: tuple[TestSetup, ...]
    frf_sources: tuple[FrfSource, ...]
    labels: tuple[FrfLabel, ...]

    @property
    def input_channel(self) -> Channel:
        """The force."""
        return self.channels[0]

    @property
    def output_channels(self) -> tuple[Channel, ...]:
        """The responses."""
        return self.channels[1:]

    @property
    def output_dofs(self) -> tuple[Dof, ...]:
        """Where sensors sit in any of the FRFs, each once."""
        return tuple(dict.fromkeys(label.output_dof for label in self.labels))

    @property
    def input_dofs(self) -> tuple[Dof, ...]:
        """Where forces act in any of the FRFs, each once."""
        return tuple(dict.fromkeys(label.input_dof for label in self.labels))

    @property
    def recordings(self) -> tuple[tuple[TestSetup, Path], ...]:
        """Every recording with its set-up, in the order of the test."""
        return tuple((setup, path) for setup in self.setups for path in setup.files)

    @property
    def files(self) -> tuple[Path, ...]:
        """All files of measurements, each once."""
        recordings = [path for _, path in self.recordings]
        return tuple(dict.fromkeys([*recordings, *(source.path for source in self.frf_sources)]))

    @cached_property
    def sensor_masses(self) -> dict[int, float]:
        """Known masses of the sensors by node, kg.

        A roving sensor counts at each node with the share of recordings during which it sat there: to first order in
        the mass, that is the structure whose FRFs are the mean over all recordings.
        """
        return self._mean_masses(self.setups)

    def masses_with(self, label: FrfLabel) -> dict[int, float]:
        """Give the known masses of the sensors while one FRF was measured.

        Parameters
        ----------
        label : FrfLabel
            One of `labels`.

        Returns
        -------
        dict of int to float
            Node and mass, kg.
        """
        return self._mean_masses([setup for setup in self.setups if label in setup_labels(self.channels, setup)])

    def _mean_masses(self, setups: Iterable[TestSetup]) -> dict[int, float]:
        setups = list(setups)
        n_files = sum(len(setup.files) for setup in setups)
        masses: Counter[int] = Counter()
        for setup in setups:
            for channel, dof in zip(self.output_channels, setup.output_dofs, strict=True):
                if channel.mass_kg:
                    masses[dof.node] += channel.mass_kg * len(setup.files) / n_files  # type: ignore[assignment] # kg, no count
        return dict(masses)


def setup_labels(channels: tuple[Channel, ...], setup: TestSetup) -> tuple[FrfLabel, ...]:
    """Name the FRFs that a set-up gives.

    Parameters
    ----------
    channels : tuple of Channel
        The input first.
    setup : TestSetup
        The set-up.

    Returns
    -------
    tuple of FrfLabel
        One an output channel, in their order.
    """
    return tuple(
        FrfLabel(dof, setup.input_dof, frf_quantity_of(channel.quantity), channel.column, channels[0].column)
        for channel, dof in zip(channels[1:], setup.output_dofs, strict=True)
    )
