"""Compares states of a machine: the corrected model of the states before is the nominal one of the state after."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arguments import require_each, require_type
from frf_ipz.diagnosis.compare import mass_loss
from frf_ipz.diagnosis.compare.learnt_nuisance import estimate_change_error, learn, predict_unchanged_model
from frf_ipz.diagnosis.compare.states import CompareOptions, MachineState
from frf_ipz.diagnosis.compare.unexplained_change import discount_unexplained
from frf_ipz.diagnosis.diagnose import diagnose
from frf_ipz.diagnosis.measured.data_split import split_data
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.diagnosis.result import Diagnosis, DiagnosisVerdict
from frf_ipz.display import Concise
from frf_ipz.errors import InputError
from frf_ipz.numerics.one_thread import on_one_thread
from frf_ipz.progress import silent

if TYPE_CHECKING:
    from frf_ipz.diagnosis.compare.learnt_nuisance import LearntNuisance
    from frf_ipz.diagnosis.result import Finding
    from frf_ipz.progress import Progress

MASS_LOSS = f"{Path(mass_loss.__file__)}:MassLoss"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Comparison(Concise):
    """What changed.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of the state after against what the states before lead one to expect.
    expected : MachineState
        The state after as it was judged: its model if nothing had changed, and the measurement without known gains,
        with what the model cannot follow as noise.
    scatter : DiagnoseOptions
        Tolerances within which nothing has changed: those stated, or what the states before show beyond them.

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
    >>> before = frf_ipz.MachineState(observed=observed, fe_model=model)
    >>> frf_ipz.compare_states(before, before).is_changed
    False
    """

    diagnosis: Diagnosis
    expected: MachineState
    scatter: DiagnoseOptions

    @property
    def is_changed(self) -> bool:
        """True where more differs than from test to test."""
        return self.diagnosis.verdict != DiagnosisVerdict.CONSISTENT

    @property
    def changes(self) -> tuple[Finding, ...]:
        """What changed, the heaviest first; empty where nothing did, or nothing that has a name."""
        return self.diagnosis.findings

    @property
    def statement(self) -> str:
        """The result in a few sentences."""
        if not self.is_changed:
            return "Nothing has changed beyond what differs from test to test."
        return self.diagnosis.statement


@on_one_thread
def compare_states(
    before: MachineState | Sequence[MachineState],
    after: MachineState,
    *,
    options: CompareOptions | None = None,
    progress: Progress = silent,
) -> Comparison:
    """Find out what changed between two states of a machine, by how much and where, or that nothing did.

    The model need not be right: what it is wrong by is learnt from the states before. Three and more of them also
    show what differs from test to test. What the user knows to be different in the state after goes into its model.

    Parameters
    ----------
    before : MachineState or sequence of MachineState
        The machine as it should be, once or repeatedly.
    after : MachineState
        The machine to be judged, measured with the same channels over the same band.
    options : CompareOptions, optional
        What the model may be wrong by, and what differs from test to test at least.
    progress : Progress
        Receives the progress.

    Returns
    -------
    Comparison
        What changed.

    Raises
    ------
    InputError
        If states do not show the same channels and modes, or a model lacks a DOF that was measured.

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
    >>> test = frf_ipz.VibrationTest.from_frfs(frfs)
    >>> before = frf_ipz.MachineState(observed=frf_ipz.observe(test, frfs=frfs), fe_model=model)
    >>> frf_ipz.compare_states(before, before).statement
    'Nothing has changed beyond what differs from test to test.'
    """
    require_type("after", after, MachineState)
    require_type("options", options, CompareOptions, optional=True)
    chosen = options or CompareOptions()
    require_each("before", [before] if isinstance(before, MachineState) else before, MachineState)
    states = [before] if isinstance(before, MachineState) else list(before)
    if not states:
        raise InputError("before holds no state; give at least one that the state after is compared with")
    progress(0.0, "learning from the states before")
    return judge(learn(states, chosen), after, chosen, progress=progress)


def judge(
    learnt: LearntNuisance, after: MachineState, options: CompareOptions, *, progress: Progress = silent
) -> Comparison:
    """Judge a state by what was learnt from the states before: for many states after the same ones.

    Parameters
    ----------
    learnt : LearntNuisance
        From `learn`.
    after : MachineState
        The machine to be judged.
    options : CompareOptions
        As for `learn`.
    progress : Progress
        Receives the progress.

    Returns
    -------
    Comparison
        What changed.
    """
    observed = discount_unexplained(after.observed, learnt.gains, learnt.unexplained_part)
    source = split_data(observed)
    nominal = replace(after, observed=observed)
    expected = predict_unchanged_model(nominal, learnt, options, source)
    error = estimate_change_error(replace(nominal, fe_model=expected), source, learnt, options)
    scatter = replace(
        learnt.scatter,
        stiffness_tolerance=float(np.hypot(learnt.scatter.stiffness_tolerance, error)),
        frequency_tolerance=float(np.hypot(learnt.scatter.frequency_tolerance, error)),
        effects=options.effects,
        extra_effects=(MASS_LOSS,),
    )
    diagnosis = diagnose(observed, expected, options=scatter, progress=progress)
    return Comparison(diagnosis=diagnosis, expected=replace(nominal, fe_model=expected), scatter=scatter)
