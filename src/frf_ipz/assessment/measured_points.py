"""Models beside the FRFs that were measured: what every comparison of the two starts from."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.numerics.noise_floor import above_noise

if TYPE_CHECKING:
    from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
    from frf_ipz.frf import FrfSet
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.updating.updated_model import UpdatedModel


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredPoints:
    """Measured FRFs, and those of the model before and after updating, on the lines of the fit.

    Parameters
    ----------
    frfs : FrfSet
        As measured.
    fit : ModalFit
        The fitted model.
    updated_model : UpdatedModel
        The updated model, with the nominal one.
    """

    frfs: FrfSet
    fit: ModalFit
    updated_model: UpdatedModel

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
        return above_noise(np.abs(self.measured), self.noise)

    @property
    def is_relative(self) -> bool:
        """Tell whether the scale of the FRFs is unknown, so that gains are fitted."""
        return self.frfs.unknown_scale != "none"

    @cached_property
    def updated(self) -> ComplexArray:
        """(n_lines, n_frfs) FRFs of the updated model at the measured points, in the unit of the measurement."""
        return self.updated_model.compute_frfs(self.frfs.labels, self.frfs.s[self.lines])

    @cached_property
    def nominal(self) -> ComplexArray:
        """(n_lines, n_frfs) FRFs of the model before updating at the measured points."""
        return self.updated_model.compute_frfs(self.frfs.labels, self.frfs.s[self.lines], nominal=True)

    @property
    def band_text(self) -> str:
        """The band that was compared, in words."""
        hertz = self.frfs.frequency_hz[self.lines]
        return f"{hertz[0]:.4g} to {hertz[-1]:.4g} Hz" if len(hertz) else "no line"

    def decibels(self, values: ComplexArray) -> FloatArray:
        """Compare magnitudes with the measured ones.

        Parameters
        ----------
        values : (n_lines, n_frfs) complex array
            Of a model.

        Returns
        -------
        (n_lines, n_frfs) array
            Moduli of the differences, dB; NaN where an FRF does not stand above its noise.
        """
        with np.errstate(divide="ignore", invalid="ignore"):  # an FRF may be 0
            difference = np.abs(20 * np.log10(np.abs(values) / np.abs(self.measured)))
        return np.where(self.is_heard, difference, np.nan)
