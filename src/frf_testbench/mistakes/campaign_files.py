"""The files of a written campaign, as a user would edit them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

if TYPE_CHECKING:
    from collections.abc import Callable


@dataclass(frozen=True, slots=True)
class CampaignFiles:
    """A folder with ``test.toml``, ``model.toml``, ``pipeline.toml`` and recordings.

    Parameters
    ----------
    folder : Path
        The folder.
    """

    folder: Path

    @property
    def test(self) -> str:
        """What ``test.toml`` says."""
        return (self.folder / "test.toml").read_text(encoding="utf-8")

    @property
    def model(self) -> str:
        """What ``model.toml`` says."""
        return (self.folder / "model.toml").read_text(encoding="utf-8")

    @property
    def is_beam(self) -> bool:
        """Tell whether the model is a beam."""
        return 'kind = "beam"' in self.model

    @property
    def has_matrices(self) -> bool:
        """Tell whether the model comes as matrices."""
        return 'kind = "matrices"' in self.model

    @property
    def outputs(self) -> list[str]:
        """Columns of the output channels."""
        return re.findall(r'column = "([^"]+)"\nrole = "output"', self.test)

    @property
    def sensor_dofs(self) -> list[str]:
        """DOFs of the output channels."""
        return re.findall(r'role = "output"[^\[]*?dof = "([^"]+)"', self.test)

    @property
    def channels_and_records(self) -> tuple[str, str]:
        """``test.toml`` up to its first ``[[hit]]`` or ``[[record]]``, and from there on."""
        start = re.search(r"^\[\[(?:hit|record)\]\]", self.test, re.MULTILINE)
        place = len(self.test) if start is None else start.start()
        return self.test[:place], self.test[place:]

    @property
    def excited_dofs(self) -> list[str]:
        """DOFs of the hits or records."""
        return re.findall(r'\[\[(?:hit|record)\]\]\ndof = "([^"]+)"', self.test)

    def edit_test(self, edit: Callable[[str], str]) -> None:
        """Change ``test.toml``.

        Parameters
        ----------
        edit : callable
            Gives the new text from the old.
        """
        (self.folder / "test.toml").write_text(edit(self.test), encoding="utf-8")

    def edit_model(self, edit: Callable[[str], str]) -> None:
        """Change ``model.toml``.

        Parameters
        ----------
        edit : callable
            Gives the new text from the old.
        """
        (self.folder / "model.toml").write_text(edit(self.model), encoding="utf-8")

    def scale_value(self, key: str, factor: float) -> None:
        """Multiply a number of ``model.toml`` wherever its key stands.

        Parameters
        ----------
        key : str
            The key.
        factor : float
            By what.
        """
        pattern = re.compile(rf"^({key} = )([-+\d.eE]+)", re.MULTILINE)
        self.edit_model(lambda text: pattern.sub(lambda hit: f"{hit[1]}{float(hit[2]) * factor!r}", text))

    def scale_matrix(self, stem: str, factor: float) -> None:
        """Multiply all matrices of one kind, the groups' too.

        Parameters
        ----------
        stem : str
            ``M`` or ``K``.
        factor : float
            By what.
        """
        for path in [self.folder / f"{stem}.mtx", *self.folder.glob(f"{stem}_*.mtx")]:
            head, size, *entries = path.read_text(encoding="utf-8").splitlines()
            rows = [entry.split() for entry in entries]
            lines = [f"{i} {j} {float(value) * factor:.14e}" for i, j, value in rows]
            path.write_text("\n".join([head, size, *lines]) + "\n", encoding="utf-8")

    def edit_recordings(self, edit: Callable[[pd.DataFrame], pd.DataFrame]) -> None:
        """Change every recording.

        Parameters
        ----------
        edit : callable
            Gives the new table from the old.
        """
        for path in sorted(self.folder.glob("hits/*.csv")) + sorted(self.folder.glob("records/*.csv")):
            edit(pd.read_csv(path)).to_csv(path, index=False, float_format="%.9g")
