"""Loss within the material: a loss factor of the whole stiffness.

K (1 + i eta) is what the loss factor means, but it is not causal: a constant loss
factor makes the stiffness rise with frequency (Kjartansson 1979), from the model's in the middle of the band, or for
each mode from the model's at its own frequency. Many simulations put eta / 2 to the damping ratio of each mode instead:
the same at resonances. All four are tried.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray
from frf_ipz.diagnosis.catalogue.effect import Builder, Effect, Parameter
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.model.change import Change

if TYPE_CHECKING:
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.result import Estimate

BOUNDS = 1e-5, 1.0
CAUSAL, KEEPING_MODES, OF_MODES = "causal", "causal, mode by mode", "of modes"
LESS_LIKELY = -3.0  # log prior: less than distinguishes explanations, more than priors of two numbers differ by
START_VALUES = np.geomspace(2e-4, 0.5, 16)


class StructuralDamping(Effect):
    """K (1 + i eta) besides the modal damping."""

    name = "structural_damping"

    def locations(self, context: ModelContext) -> Sequence[Location]:
        """Everywhere, in four forms."""
        del context
        return [Location(form=form) for form in ("", CAUSAL, KEEPING_MODES, OF_MODES)]

    def parameters(self, context: ModelContext, location: Location) -> tuple[Parameter, ...]:
        """Loss factor."""
        del context, location
        return (Parameter(name="loss_factor", low=BOUNDS[0], high=BOUNDS[1]),)

    def build(self, context: ModelContext, location: Location) -> Builder:
        """Give it to the stiffness, or half of it to the ratio of each mode."""
        if location.form == OF_MODES:
            return lambda values: Change(added_ratio=float(values[0]) / 2)
        if location.form == KEEPING_MODES:
            return lambda values: Change(loss_factor=float(values[0]), keeps_modes=True)
        middle = 2 * np.pi * float(np.sqrt(context.band_hz[0] * context.band_hz[1])) if location.form else 0.0
        return lambda values: Change(loss_factor=float(values[0]), reference_rad_s=middle)

    def start_values(self, context: ModelContext, location: Location) -> FloatArray:
        """From little to much."""
        del context, location
        return START_VALUES[:, None]

    def log_prior(self, context: ModelContext, location: Location, values: FloatArray) -> float:
        """Half a loss factor for each mode is what another level of damping looks like, and says less plainly."""
        del context, values
        return LESS_LIKELY if location.form == OF_MODES else 0.0

    def statement(self, context: ModelContext, location: Location, values: Mapping[str, Estimate]) -> str:
        """Say how much."""
        del context, location
        loss = values["loss_factor"]
        return f"The material has a loss factor of {loss.in_words()}, of all stiffness and besides the model's damping."
