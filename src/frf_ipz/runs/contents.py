"""What a run holds, read once: every section takes what it draws from here."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from frf_ipz.fe.response import compute_frfs
from frf_ipz.structure import Geometry
from frf_ipz.updating.targets import Target, target_rows

if TYPE_CHECKING:
    from collections.abc import Mapping

    from frf_ipz.arrays import ComplexArray, IntArray
    from frf_ipz.diagnosis.measured.levels import LevelDependence
    from frf_ipz.diagnosis.result import Diagnosis
    from frf_ipz.dofs import Dof
    from frf_ipz.export.state_space import StateSpaceModel
    from frf_ipz.frf import FrfLabel, FrfSet
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.ingest.frf_estimate import FrfEstimate
    from frf_ipz.pairing.pairs import Pairs
    from frf_ipz.prediction.prediction import Prediction
    from frf_ipz.runs.results import Results
    from frf_ipz.structure import ReducedModel
    from frf_ipz.updating.updated_model import UpdatedModel

SHOWN_AT_FIRST = 6  # FRFs; the others are a click away


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RunContents:
    """Results of all stages of a run; None where a stage has not run.

    Parameters
    ----------
    manifest : mapping
        What `run.json` says.
    estimate, fit, reduced, pairs, updated, prediction, state_space : results of stages
        As the stages gave them.
    diagnosis : Diagnosis, optional
        What is missing from the model.
    levels : LevelDependence, optional
        Weak beside strong records.
    geometry : Geometry, optional
        Where the nodes of the FE model are.
    reference : FrfSet, optional
        Measured FRFs at points of interest that were kept aside.
    stale : frozenset of str
        Stages whose result was made before the last change.
    """

    manifest: Mapping[str, Any]
    estimate: FrfEstimate | None = None
    fit: ModalFit | None = None
    reduced: ReducedModel | None = None
    pairs: Pairs | None = None
    updated: UpdatedModel | None = None
    prediction: Prediction | None = None
    state_space: StateSpaceModel | None = None
    diagnosis: Diagnosis | None = None
    levels: LevelDependence | None = None
    geometry: Geometry | None = None
    reference: FrfSet | None = None
    stale: frozenset[str] = frozenset()

    @property
    def parts(self) -> pd.DataFrame:
        """Change of the stiffness of every part of the FE model by the update; empty where that is not known."""
        return pd.DataFrame() if self.updated is None else self.updated.parts

    @property
    def is_lumped(self) -> bool:
        """The model is made of springs: its geometry is a row of masses, not positions."""
        return self.geometry is not None and self.geometry.is_schematic

    @property
    def frfs(self) -> FrfSet | None:
        """The measured FRFs."""
        return None if self.estimate is None else self.estimate.frfs

    @property
    def labels(self) -> tuple[FrfLabel, ...]:
        """What each measured FRF connects."""
        frfs = self.frfs
        return () if frfs is None else frfs.labels

    @property
    def band_hz(self) -> tuple[float, float]:
        """What pictures over frequency show at first: the band of the fit, else all that was measured."""
        if self.fit is not None:
            return self.fit.band_hz
        frfs = self.frfs
        if frfs is not None:
            return float(frfs.frequency_hz[0]), float(frfs.frequency_hz[-1])
        return 0.0, 1.0

    @property
    def points(self) -> tuple[Dof, ...]:
        """The points of interest."""
        return () if self.prediction is None else tuple(dict.fromkeys(x.output_dof for x in self.prediction.labels))

    @property
    def hidden_frfs(self) -> list[int]:
        """FRFs that are not shown at first."""
        return list(range(SHOWN_AT_FIRST, len(self.labels)))

    def used_lines(self) -> IntArray:
        """Lines of the FRFs that were fitted; all of them without a fit.

        Returns
        -------
        (n_used,) int array
            Places on the frequency axis.
        """
        frfs = self.frfs
        if frfs is None:
            return np.zeros(0, int)
        return np.arange(frfs.n_lines) if self.fit is None else np.flatnonzero(self.fit.used_lines)

    def model_values(self, model: ReducedModel) -> ComplexArray:
        """FRFs of a reduced model at the measured points, on the lines and at the s of the measurement.

        Parameters
        ----------
        model : ReducedModel
            Nominal or updated.

        Returns
        -------
        (n_used, n_frfs) complex array
            SI; empty without a measurement.
        """
        frfs = self.frfs
        if frfs is None:
            return np.zeros((0, 0), complex)
        return compute_frfs(model, frfs.labels, frfs.s[self.used_lines()])

    def targets(self) -> list[Target]:
        """Targets of the update.

        Returns
        -------
        list of Target
            Poles first; empty without an update.
        """
        if self.updated is None or self.pairs is None:
            return []
        return target_rows(self.updated, self.pairs, self.labels)


def read_contents(results: Results) -> RunContents:
    """Read all results of a run.

    Parameters
    ----------
    results : Results
        The run.

    Returns
    -------
    RunContents
        What is there.

    Raises
    ------
    FileFormatError
        If a file is damaged.
    """
    return RunContents(
        manifest=results.manifest,
        estimate=results.estimate,
        fit=results.fit,
        reduced=results.reduced_model,
        pairs=results.pairs,
        updated=results.updated_model,
        prediction=results.prediction,
        state_space=results.state_space_arrays,
        diagnosis=results.diagnosis,
        levels=results.level_dependence,
        geometry=results.geometry,
        reference=results.reference,
        stale=results.stale,
    )
