"""What a run is assessed by: its results side by side."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.assessment.deviations import measured_deviation, point_deviation
from frf_ipz.assessment.measured_points import MeasuredPoints
from frf_ipz.ingest.estimation.record_table import empty_record_table
from frf_ipz.prediction.predict import band_of_magnitudes

if TYPE_CHECKING:
    import pandas as pd

    from frf_ipz.arrays import FloatArray
    from frf_ipz.assessment.deviations import FrfDeviation
    from frf_ipz.diagnosis.result import Diagnosis
    from frf_ipz.frf import FrfSet
    from frf_ipz.ingest.frf_estimate import Trace
    from frf_ipz.pairing.pairs import Pairs
    from frf_ipz.prediction.prediction import Prediction
    from frf_ipz.structure import StructuralModel


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence(MeasuredPoints):
    """The results of a run that its assessment rests on.

    Parameters
    ----------
    frfs : FrfSet
        As measured.
    fit : ModalFit
        The fitted model.
    fe_model : StructuralModel
        As the user handed it in.
    pairs : Pairs
        Who belongs to whom.
    updated_model : UpdatedModel
        The updated model, with the nominal one.
    prediction : Prediction
        FRFs at the points of interest.
    reference : FrfSet, optional
        Measured FRFs at points of interest that were kept aside.
    diagnosis : Diagnosis, optional
        What the FE model left out; None where it was not looked for.
    with_causes : Prediction, optional
        Of a model that has what the diagnosis found.
    explained_model : StructuralModel, optional
        The FE model with what the diagnosis found, where that explains the measurement.
    is_corrected : bool
        What the diagnosis found is in the model that predicts.
    impacts : tuple of Trace
        Forces and responses of a hammer's impacts; empty for other tests.
    records : DataFrame
        Impacts and records, as `FrfEstimate` has them; empty where FRFs were estimated elsewhere.
    is_recorded : bool
        The FRFs were estimated from columns of recordings.
    test_file, model_file : str
        Where a mistake would stand.
    """

    fe_model: StructuralModel
    pairs: Pairs
    prediction: Prediction
    reference: FrfSet | None = None
    diagnosis: Diagnosis | None = None
    with_causes: Prediction | None = None
    explained_model: StructuralModel | None = None
    is_corrected: bool = False
    impacts: tuple[Trace, ...] = ()
    records: pd.DataFrame = field(default_factory=empty_record_table)
    is_recorded: bool = False
    test_file: str = "test.toml"
    model_file: str = "model.toml"

    @property
    def has_targets(self) -> bool:
        """The update had a measured pole or zero with a counterpart to go by."""
        return bool(len(self.updated_model.after))

    @cached_property
    def deviation(self) -> FrfDeviation | None:
        """How far the models are from the measured FRFs; None where nothing stands above the noise."""
        return measured_deviation(self) if self.frfs.n_frfs else None

    @cached_property
    def point_deviation(self) -> FrfDeviation | None:
        """The same at the points of interest; None where nothing was measured there."""
        return point_deviation(self.prediction, frfs=self.frfs, reference=self.reference, with_causes=self.with_causes)

    @cached_property
    def band(self) -> tuple[FloatArray, FloatArray]:
        """90 % band of the updated model's magnitudes at the measured points, two (n_lines, n_frfs) arrays."""
        s = np.asarray(2j * np.pi * self.frfs.frequency_hz[self.lines], np.complex128)
        return band_of_magnitudes(self.fit, self.updated_model, labels=self.frfs.labels, s=s)
