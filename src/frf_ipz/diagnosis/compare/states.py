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

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> stiffness = 1e5 * np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    >>> dofs = ["1:x", "2:x", "3:x"]
    >>> masses = np.diag([2.0, 1.0, 1.0])
    >>> model = frf_ipz.StructuralModel.from_matrices(masses, stiffness, dofs=dofs, modal_damping=0.01)
    >>> heavier = frf_ipz.StructuralModel.from_matrices(
    ...     masses + np.diag([0.0, 0.0, 0.2]), stiffness, dofs=dofs, modal_damping=0.01
    ... )
    >>> lines = np.arange(5, 100.0, 0.5)
    >>> first, accelerance = frf_ipz.Dof(1, "x"), frf_ipz.FrfQuantity.ACCELERANCE
    >>> labels = [frf_ipz.FrfLabel(frf_ipz.parse_dof(dof), first, accelerance) for dof in dofs]
    >>> values = frf_ipz.compute_frfs(heavier, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=dofs, inputs=["1:x"], variance=np.full(values.shape, 2e-6)
    ... )
    >>> observed = frf_ipz.observe(frf_ipz.VibrationTest.from_frfs(frfs), frfs=frfs)
    >>> frf_ipz.MachineState(observed=observed, fe_model=model).observed.band_hz
    (5.0, 99.5)
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

    Examples
    --------
    >>> import frf_ipz
    >>> options = frf_ipz.CompareOptions(effects=("added_mass", "local_stiffness"))
    >>> options.model.stiffness_tolerance, options.scatter.stiffness_tolerance
    (0.05, 0.001)
    """

    model: DiagnoseOptions = field(default=ROUGH_MODEL)
    scatter: DiagnoseOptions = field(default_factory=DiagnoseOptions)
    effects: tuple[str, ...] = ()
