"""What a run is assessed by: its results side by side, and the models' FRFs at the measured points."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.fe.response import compute_frfs
from frf_ipz.prediction.predict import band_of_magnitudes

if TYPE_CHECKING:
    from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
    from frf_ipz.diagnosis.result import Diagnosis
    from frf_ipz.frf import FrfSet
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.ingest.frf_estimate import Trace
    from frf_ipz.pairing.pairs import Pairs
    from frf_ipz.prediction.prediction import Prediction
    from frf_ipz.structure import ReducedModel, StructuralModel
    from frf_ipz.updating.updated_model import UpdatedModel


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
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
    is_corrected : bool
        What the diagnosis found is in the model that predicts.
    impacts : tuple of Trace
        Forces and responses of a hammer's impacts; empty for other tests.
    is_recorded : bool
        The FRFs were estimated from columns of recordings.
    test_file, model_file : str
        Where a mistake would stand.
    """

    frfs: FrfSet
    fit: ModalFit
    fe_model: StructuralModel
    pairs: Pairs
    updated_model: UpdatedModel
    prediction: Prediction
    reference: FrfSet | None = None
    diagnosis: Diagnosis | None = None
    is_corrected: bool = False
    impacts: tuple[Trace, ...] = ()
    is_recorded: bool = False
    test_file: str = "test.toml"
    model_file: str = "model.toml"

    @cached_property
    def lines(self) -> IntArray:
        """Lines that were fitted."""
        return np.flatnonzero(self.fit.used_lines)

    @cached_property
    def measured(self) -> ComplexArray:
        """(n_lines, n_frfs) measured FRFs on these lines, without the delay that was fitted."""
        late = np.exp(self.frfs.s[self.lines, None] * self.fit.model.delay_s)
        return np.asarray(self.frfs.values[self.lines] * late)

    @cached_property
    def noise(self) -> FloatArray:
        """(n_lines, n_frfs) standard deviation of the measured FRFs, of the complex value's modulus.

        Where the recordings do not tell, what the fit leaves over stands in for it.
        """
        stated = np.sqrt(self.frfs.variance[self.lines])
        left_over = np.abs(self.frfs.values[self.lines] - self.fit.model(self.frfs.s[self.lines]))
        known = np.isfinite(stated)
        return np.where(known, np.where(known, stated, 0.0), np.sqrt(np.mean(left_over**2, axis=0)))

    @cached_property
    def is_heard(self) -> np.ndarray:
        """(n_lines, n_frfs) bool array: where an FRF stands above its noise."""
        return np.abs(self.measured) > self.noise

    @property
    def is_relative(self) -> bool:
        """Tell whether the scale of the FRFs is unknown, so that gains are fitted."""
        return self.frfs.unknown_scale != "none"

    @cached_property
    def updated(self) -> ComplexArray:
        """(n_lines, n_frfs) FRFs of the updated model at the measured points, in the unit of the measurement."""
        return self._values(self.updated_model.model)

    @cached_property
    def nominal(self) -> ComplexArray:
        """(n_lines, n_frfs) FRFs of the model before updating at the measured points."""
        return self._values(self.updated_model.nominal)

    @cached_property
    def band(self) -> tuple[FloatArray, FloatArray]:
        """90 % band of the updated model's magnitudes at the measured points, two (n_lines, n_frfs) arrays."""
        s = np.asarray(2j * np.pi * self.frfs.frequency_hz[self.lines], np.complex128)
        return band_of_magnitudes(self.fit, self.updated_model, self.frfs.labels, s)

    def _values(self, model: ReducedModel) -> ComplexArray:
        values = compute_frfs(model, self.frfs.labels, self.frfs.s[self.lines])
        return values * self.updated_model.scale_of(model).gains(self.frfs.labels)
