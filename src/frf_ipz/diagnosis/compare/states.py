"""States of a machine, and what may differ from one test to the next although nothing has changed."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.display import Concise

if TYPE_CHECKING:
    from frf_ipz.diagnosis.observations import Observations
    from frf_ipz.structure import StructuralModel

ROUGH_MODEL = DiagnoseOptions(
    stiffness_tolerance=0.05,
    frequency_tolerance=0.05,
    damping_tolerance=0.7,
    gain_tolerance=0.1,
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class MachineState(Concise):
    """A state of a machine: what was measured in it, and what is known of it.

    Parameters
    ----------
    observed : Observations
        Records or FRFs, from `observe`.
    fe_model : StructuralModel
        The FE model, with damping, and with everything that is known to be different in this state.
    """

    observed: Observations
    fe_model: StructuralModel


@dataclass(frozen=True, slots=True, kw_only=True)
class CompareOptions:
    """How two states are compared.

    Parameters
    ----------
    model : DiagnoseOptions
        What the model may be wrong by in every state: this is learnt from the states before, and then allowed for.
    scatter : DiagnoseOptions
        What differs from test to test with nothing changed; what repeated states before show beyond that is added.
    effects : tuple of str
        Search for these changes only, besides `mass_loss`; for all effects of the catalogue where it is empty.
    """

    model: DiagnoseOptions = field(default=ROUGH_MODEL)
    scatter: DiagnoseOptions = field(default_factory=DiagnoseOptions)
    effects: tuple[str, ...] = ()
