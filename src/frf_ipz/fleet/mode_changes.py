"""What changed between two tests of a structure: which modes have moved, and by how much against their deviations.

Modes of the two runs are matched as those of the machines of a fleet are: by their counterpart in the FE model where
both runs have the same one, and by frequency and shape. A mode has moved where that is no chance: not by the noise of
both tests, nor by what differs from test to test with nothing changed.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from frf_ipz.arguments import require_type
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.display import Concise
from frf_ipz.errors import InputError
from frf_ipz.fleet.machine_record import describe_results
from frf_ipz.fleet.mode_matching import match_roots
from frf_ipz.fleet.outliers import FALSE_ALARMS
from frf_ipz.identification.options import Stability
from frf_ipz.late_imports import import_late
from frf_ipz.modes import modal_assurance
from frf_ipz.plotting.wording import NOTHING, number, with_error
from frf_ipz.runs.results import Results
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    import pandas as pd

    from frf_ipz.fleet.machine_record import Roots
else:
    pd = import_late("pandas")

FREQUENCY_SCATTER = DiagnoseOptions().frequency_tolerance  # within which a diagnosis takes frequencies for equal
DAMPING_SCATTER = Stability().damping  # within which a stabilisation diagram takes damping ratios for equal
SAME_SHAPE = 0.9  # modal assurance from which two shapes are usually taken for one
NONE = float("nan")


class ModeOutcome(StrEnum):
    """What became of a mode.

    Examples
    --------
    >>> import frf_ipz
    >>> frf_ipz.ModeOutcome("only after") is frf_ipz.ModeOutcome.NEW
    True
    """

    MOVED = "moved"
    DAMPING = "damping only"
    SAME = "as before"
    NEW = "only after"
    GONE = "only before"


@dataclass(frozen=True, slots=True, kw_only=True)
class ModeChange:
    """One mode in two tests; NaN in the test that does not have it.

    Parameters
    ----------
    before_hz, before_hz_std, after_hz, after_hz_std : float
        Natural frequencies with their standard deviations, Hz.
    before_damping, before_damping_std, after_damping, after_damping_std : float
        Damping ratios, likewise.
    frequency_sigma, damping_sigma : float
        Changes in standard deviations: of both measurements, and from test to test.
    mac : float
        Modal assurance of the two shapes; NaN where fewer than two DOFs were measured in both tests.
    outcome : ModeOutcome
        What became of it.

    Examples
    --------
    >>> mode = ModeChange(before_hz=100.0, before_hz_std=0.1, after_hz=98.0, after_hz_std=0.1)
    >>> round(mode.change, 3), round(mode.change_std, 4), mode.outcome.value
    (-0.02, 0.0014, 'as before')
    """

    before_hz: float = NONE
    before_hz_std: float = NONE
    after_hz: float = NONE
    after_hz_std: float = NONE
    before_damping: float = NONE
    before_damping_std: float = NONE
    after_damping: float = NONE
    after_damping_std: float = NONE
    frequency_sigma: float = NONE
    damping_sigma: float = NONE
    mac: float = NONE
    outcome: ModeOutcome = ModeOutcome.SAME

    @property
    def change(self) -> float:
        """Of the frequency, over that before."""
        return self.after_hz / self.before_hz - 1

    @property
    def change_std(self) -> float:
        """Its standard deviation by the noise of both tests."""
        return float(np.hypot(self.before_hz_std / self.before_hz, self.after_hz_std / self.after_hz))

    @property
    def damping_change(self) -> float:
        """Of the damping ratio, over that before."""
        return self.after_damping / self.before_damping - 1

    @property
    def damping_change_std(self) -> float:
        """Its standard deviation by the noise of both tests."""
        before, after = self.before_damping_std / self.before_damping, self.after_damping_std / self.after_damping
        return float(np.hypot(before, after))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class RunComparison(Concise):
    """Two tests of a structure, mode by mode.

    Parameters
    ----------
    modes : tuple of ModeChange
        By ascending frequency.
    scale_is_known : bool
        Of both measurements.
    frequency_scatter, damping_scatter : float
        Relative, what differs from test to test with nothing changed.

    Examples
    --------
    >>> moved = ModeChange(before_hz=100.0, before_hz_std=0.1, after_hz=98.0, after_hz_std=0.1, outcome="moved")
    >>> RunComparison(modes=(moved,), scale_is_known=True, frequency_scatter=0.001, damping_scatter=0.05).statement
    'The mode at 100 Hz has moved by -2.0 %: the structure is softer or heavier.'
    """

    modes: tuple[ModeChange, ...]
    scale_is_known: bool
    frequency_scatter: float
    damping_scatter: float

    def of(self, *outcomes: ModeOutcome) -> list[ModeChange]:
        """Give the modes of which something became.

        Parameters
        ----------
        *outcomes : ModeOutcome
            What.

        Returns
        -------
        list of ModeChange
            By ascending frequency.
        """
        return [mode for mode in self.modes if mode.outcome in outcomes]

    @property
    def common(self) -> list[ModeChange]:
        """The modes that both tests have."""
        return self.of(ModeOutcome.MOVED, ModeOutcome.DAMPING, ModeOutcome.SAME)

    @property
    def statement(self) -> str:
        """What changed, in a sentence."""
        moved = self.of(ModeOutcome.MOVED)
        if not self.common:
            return "The two tests have no mode in common."
        if not moved:
            return f"No frequency of {counted(len(self.common), 'mode')} has moved beyond its deviations."
        changes = [100 * mode.change for mode in moved]
        by = " to ".join(dict.fromkeys(f"{change:+.2g} %" for change in (min(changes), max(changes))))
        if len(self.common) == 1:
            return f"The mode at {number(moved[0].before_hz)} Hz has moved by {changes[0]:+.1f} %: {self.direction}."
        verb = "has" if len(moved) == 1 else "have"
        return f"{len(moved)} of {counted(len(self.common), 'mode')} {verb} moved, by {by}: {self.direction}."

    @property
    def direction(self) -> str:
        """What the modes that have moved say of the structure; empty where none has."""
        changes = [mode.change for mode in self.of(ModeOutcome.MOVED)]
        if not changes:
            return ""
        if max(changes) < 0:
            return "the structure is softer or heavier"
        if min(changes) > 0:
            return "the structure is stiffer or lighter"
        return "parts of the structure are softer or heavier, others stiffer or lighter"

    @property
    def additions(self) -> tuple[str, ...]:
        """What there is to add, in sentences."""
        texts = []
        damped = [mode for mode in self.common if abs(mode.damping_sigma) > self.limit_sigma]
        if damped:
            changes = [100 * mode.damping_change for mode in damped]
            by = " to ".join(dict.fromkeys(f"{change:+.2g} %" for change in (min(changes), max(changes))))
            texts.append(f"Damping has changed in {counted(len(damped), 'mode')}, by {by} of its value.")
        for outcome, test in ((ModeOutcome.GONE, "before"), (ModeOutcome.NEW, "after")):
            alone = [mode.before_hz if outcome is ModeOutcome.GONE else mode.after_hz for mode in self.of(outcome)]
            if alone:
                texts.append(f"Found in the test {test} only: {', '.join(map(number, alone))} Hz.")
        if self.of(ModeOutcome.MOVED):
            whether = "Frequencies alone do not tell stiffness from mass"
            if self.scale_is_known:
                texts.append(f"{whether}: frf_ipz.compare_states does, with the FE model and the FRFs of both tests.")
            else:
                texts.append(f"{whether}, and the amplitudes of FRFs do not either where their scale is unknown.")
        return tuple(texts)

    @property
    def limit_sigma(self) -> float:
        """Standard deviations beyond which a change is no chance: one in twenty comparisons of equals has one."""
        return float(special.ndtri(1 - FALSE_ALARMS / (4 * max(len(self.common), 1))))

    def summary(self) -> str:
        """Give the result as text, one mode a line."""
        lines = [self.statement, *self.additions, "", "before, Hz   after, Hz        change, %  deviations"]
        for mode in self.modes:
            change = with_error(100 * mode.change, 100 * mode.change_std, 3)
            sigma = f"{mode.frequency_sigma:.1f}" if mode in self.common else NOTHING
            hertz = f"{number(mode.before_hz, 6):>10}{number(mode.after_hz, 6):>12}"
            lines.append(f"{hertz}{change:>17}{sigma:>12}  {mode.outcome.value}")
        return "\n".join(lines)

    def to_frame(self) -> pd.DataFrame:
        """Give the modes as a table.

        Returns
        -------
        DataFrame
            One row a mode, with the fields of `ModeChange`.
        """
        names = [field.name for field in fields(ModeChange)]
        return pd.DataFrame([{name: getattr(mode, name) for name in names} for mode in self.modes], columns=names)


def compare_runs(
    before: Results,
    after: Results,
    *,
    frequency_scatter: float = FREQUENCY_SCATTER,
    damping_scatter: float = DAMPING_SCATTER,
) -> RunComparison:
    """Say which modes have moved from one test of a structure to another.

    Parameters
    ----------
    before, after : Results
        Of two runs, each with a fit.
    frequency_scatter, damping_scatter : float
        Relative standard deviations of frequencies and of damping ratios from test to test with nothing changed:
        temperature, suspension, another person with the hammer.

    Returns
    -------
    RunComparison
        Mode by mode.

    Raises
    ------
    InputError
        If a run has no fit, or a scatter is not 0 or more.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> lines, tip = np.arange(5, 400.0, 0.5), frf_ipz.Dof(11, "z")
    >>> label = frf_ipz.FrfLabel(tip, tip, frf_ipz.FrfQuantity.ACCELERANCE)
    >>> def run(modulus_Pa):
    ...     beam = frf_ipz.make_beam(
    ...         length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=modulus_Pa, density_kg_m3=2700,
    ...         elements=10, left="clamped", modal_ratio=0.01,
    ...     )
    ...     values = frf_ipz.compute_frfs(beam, [label], 2j * np.pi * lines)[:, :, None]
    ...     frfs = frf_ipz.FrfSet.from_arrays(
    ...         lines, values, outputs=[tip], inputs=[tip], variance=np.full(values.shape, 1e-4)
    ...     )
    ...     return frf_ipz.Campaign(frfs).run()
    >>> frf_ipz.compare_runs(run(70e9), run(67e9)).statement
    '3 of 3 modes have moved, by -2.2 %: the structure is softer or heavier.'
    """
    require_type("before", before, Results)
    require_type("after", after, Results)
    for name, value in (("frequency_scatter", frequency_scatter), ("damping_scatter", damping_scatter)):
        if isinstance(value, bool) or not isinstance(value, float | int) or not 0 <= value < np.inf:
            raise InputError(f"{name} is {value!r}; it is a relative deviation, 0 or more")
    poles = _poles_of_both(before, after)
    scatter = frequency_scatter, damping_scatter
    comparison = RunComparison(
        modes=tuple(_mode_change(poles, places, scatter) for places in _matched_places(poles)),
        scale_is_known=all(run.frfs is not None and run.frfs.unknown_scale == "none" for run in (before, after)),
        frequency_scatter=float(frequency_scatter),
        damping_scatter=float(damping_scatter),
    )
    limit = comparison.limit_sigma
    return replace(comparison, modes=tuple(_with_outcome(mode, limit) for mode in comparison.modes))


def _poles_of_both(before: Results, after: Results) -> list[Roots]:
    records = [describe_results(name, run) for name, run in (("before", before), ("after", after))]
    found = []
    for record, run in zip(records, (before, after), strict=True):
        if record.poles is None:
            raise InputError(f"the run '{run.name}' ({run.path or 'in memory'}) has no fit; run: frf-ipz fit")
        found.append(record.poles)
    if records[0].reduction and records[0].reduction == records[1].reduction:
        return found
    return [replace(poles, counterpart=np.full(poles.count, -1)) for poles in found]  # numbers of unlike models


def _matched_places(poles: list[Roots]) -> list[tuple[int, int]]:
    """Give the places of each mode in both tests, -1 where a test does not have it.

    A mode may move further than one of a model may be off. So of two modes that each stand alone in their test between
    the same neighbours, with one shape, the one is taken for the other.
    """
    here, there = ({int(mode): place for place, mode in enumerate(of_test)} for of_test in match_roots(poles))
    found = [(here.get(mode, -1), there.get(mode, -1)) for mode in sorted(here.keys() | there.keys())]
    joined: list[tuple[int, int]] = []
    for count, places in enumerate(found):
        earlier = joined[-1] if joined else (0, 0)
        both = max(earlier[0], places[0]), max(earlier[1], places[1])
        is_alone = {earlier.index(-1), places.index(-1)} == {0, 1} if -1 in earlier and -1 in places else False
        next_one = found[count + 1] if count + 1 < len(found) else (0, 0)
        before_it = joined[-2] if len(joined) > 1 else (0, 0)
        if is_alone and min(*next_one, *before_it) >= 0 and _assurance(poles, both) > SAME_SHAPE:
            joined[-1] = both
        else:
            joined.append(places)
    return joined


def _mode_change(poles: list[Roots], places: tuple[int, int], scatter: tuple[float, float]) -> ModeChange:
    """Put a mode of both tests side by side; -1 is the place of one that a test does not have."""
    before, after = (_root(roots, place) for roots, place in zip(poles, places, strict=True))
    mode = ModeChange(
        before_hz=before[0],
        before_hz_std=before[1],
        after_hz=after[0],
        after_hz_std=after[1],
        before_damping=before[2],
        before_damping_std=before[3],
        after_damping=after[2],
        after_damping_std=after[3],
        mac=_assurance(poles, places) if min(places) >= 0 else NONE,
    )
    return replace(
        mode,
        frequency_sigma=_sigma(mode.change, mode.change_std, scatter[0]),
        damping_sigma=_sigma(mode.damping_change, mode.damping_change_std, scatter[1]),
    )


def _root(roots: Roots, place: int) -> tuple[float, ...]:
    """Frequency and damping ratio, each with its standard deviation; NaN where there is no such mode."""
    columns = (roots.frequency_hz, roots.frequency_std_hz, roots.damping_ratio, roots.damping_ratio_std)
    return tuple(float(column[place]) if place >= 0 else NONE for column in columns)


def _sigma(change: float, std: float, scatter: float) -> float:
    """Give a change in standard deviations; noise that is not known counts as none."""
    return change / max(float(np.hypot(np.nan_to_num(std), scatter)), np.finfo(float).tiny)


def _assurance(poles: list[Roots], places: tuple[int, int]) -> float:
    common = [dof for dof in poles[0].dofs if dof in poles[1].dofs]
    if len(common) < 2:  # any two shapes are alike at one DOF
        return NONE
    shapes = [
        roots.shapes[[roots.dofs.index(dof) for dof in common]][:, [place]]
        for roots, place in zip(poles, places, strict=True)
    ]
    return float(modal_assurance(*shapes)[0, 0])


def _with_outcome(mode: ModeChange, limit: float) -> ModeChange:
    outcome = ModeOutcome.SAME
    if np.isnan(mode.before_hz):
        outcome = ModeOutcome.NEW
    elif np.isnan(mode.after_hz):
        outcome = ModeOutcome.GONE
    elif abs(mode.frequency_sigma) > limit:
        outcome = ModeOutcome.MOVED
    elif abs(mode.damping_sigma) > limit:
        outcome = ModeOutcome.DAMPING
    return replace(mode, outcome=outcome)
