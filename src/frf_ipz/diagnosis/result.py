"""What a diagnosis says: verdict, findings with their certainty, and the figures and curves that prove it."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.location import Location
from frf_ipz.display import Concise, Drawn, Tabulated
from frf_ipz.dofs import Dof
from frf_ipz.frf import FrfLabel
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    import pandas as pd
else:
    pd = import_late("pandas")


class DiagnosisVerdict(StrEnum):
    """What a diagnosis concludes; each is its text.

    Examples
    --------
    >>> import frf_ipz
    >>> frf_ipz.DiagnosisVerdict.EXPLAINED == "explained"
    True
    """

    CONSISTENT = "consistent"
    """Nothing is missing beyond noise and tolerances."""
    EXPLAINED = "explained"
    """What was found explains the measurement."""
    UNEXPLAINED = "unexplained"
    """Something is missing that nothing known explains."""

    def __repr__(self) -> str:
        return repr(self.value)


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A number with its uncertainty.

    Parameters
    ----------
    value, std : float
        Most probable value and standard deviation, in the unit that the parameter's name ends with.
    low, high : float
        Ends of the 95 % interval; not symmetric for parameters that are known to a factor.

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
    >>> options = frf_ipz.DiagnoseOptions(effects=("added_mass",))
    >>> diagnosis = frf_ipz.diagnose(frfs, model, options=options)
    >>> mass = diagnosis.findings[0].parameters["mass_kg"]
    >>> mass.low < 0.2 < mass.high
    True
    """

    value: float
    std: float
    low: float
    high: float

    def in_words(self, unit: str = "", scale: float = 1.0, *, less: float = 0.0) -> str:
        """Write the number with its 95 % interval, to the digits that the latter supports.

        Parameters
        ----------
        unit : str
            Stands behind the number.
        scale : float
            From the unit of the parameter to that one; may be negative.
        less : float
            Taken off before, in the unit of the parameter.

        Returns
        -------
        str
            The number alone where the interval is not known.

        Examples
        --------
        >>> import frf_ipz
        >>> frf_ipz.Estimate(value=0.001515, std=6.3e-05, low=0.001397, high=0.001644).in_words("g", 1e3)
        '1.52 g (95 %: 1.40 to 1.64)'
        >>> frf_ipz.Estimate(value=0.624, std=0.014, low=0.598, high=0.652).in_words("%", -100, less=1)
        '38 % (95 %: 35 to 40)'
        >>> frf_ipz.Estimate(value=481.0, std=1400.0, low=1.6, high=144480.0).in_words("N/m")
        '500 N/m (95 %: 0 to 1.4e5)'
        """
        value, *ends = (scale * (number - less) for number in (self.value, self.low, self.high))
        low, high = sorted(ends)
        behind = f" {unit}" if unit else ""
        if not (math.isfinite(low) and math.isfinite(high) and high > low):
            return f"{_rounded(value, _last_digit(value, 0.0))}{behind}"
        last = _last_digit(value, (high - low) / (2 * NORMAL_95))
        own = min(last, _last_digit(value, abs(value)))  # less is known of it than its first digit: that is written
        return f"{_rounded(value, own)}{behind} (95 %: {_rounded(low, last)} to {_rounded(high, last)})"


NORMAL_95 = 1.96  # standard deviations
LISTED_PROBABILITY = 0.95  # probability that the listed locations hold
MAX_LOCATIONS = 12  # that are listed
NOT_DETECTABLE = "how small an effect of each kind would show"
MOST_DIGITS = 6  # of a number whose deviation is tiny
FEWEST_DIGITS = 4  # of a number whose deviation is not known


def _last_digit(value: float, std: float) -> int:
    """Give the power of ten of the last digit that is worth writing."""
    size = math.floor(math.log10(abs(value))) if value else 0
    if not std > 0:
        return size - FEWEST_DIGITS + 1
    return max(math.floor(math.log10(std)), size - MOST_DIGITS + 1)


def _rounded(value: float, last: int) -> str:
    rounded = round(value, -last) + 0.0  # no negative zero
    if rounded and not 1e-3 <= abs(rounded) < 1e5:
        size = math.floor(math.log10(abs(rounded)))
        mantissa, exponent = f"{rounded:.{max(size - last, 0)}e}".split("e")
        return f"{mantissa}e{int(exponent)}"
    return f"{rounded:.{max(-last, 0)}f}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """An effect at its location.

    Parameters
    ----------
    effect : str
        Name in the catalogue.
    location : Location
        As a mapping: what applies of ``nodes``, ``elements``, ``springs``, ``channels``, ``end``, ``groups``.
    parameters : mapping of str to Estimate or str
        By their names in the contract.
    probability : float
        Of this effect, at any location, among all that were tried.
    log_evidence_gain : float
        Log Bayes factor (natural) over the explanation without this effect.
    statement : str
        A sentence for the user.
    location_set : tuple of Location
        All locations that hold 95 % of the effect's probability, the most probable first.
    is_significant : bool
        False where it was detected and lies within the user's tolerances.
    values : tuple of float
        Values of the parameters as the effect itself knows them, in its own order.

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
    >>> options = frf_ipz.DiagnoseOptions(effects=("added_mass",))
    >>> diagnosis = frf_ipz.diagnose(frfs, model, options=options)
    >>> finding = diagnosis.findings[0]
    >>> finding.effect, dict(finding.location), finding.is_significant
    ('added_mass', {'nodes': [3]}, True)
    """

    effect: str
    location: Location = field(default_factory=Location)
    parameters: Mapping[str, Estimate | str] = field(default_factory=dict)
    probability: float = 1.0
    log_evidence_gain: float = 0.0
    statement: str = ""
    location_set: tuple[Location, ...] = ()
    is_significant: bool = True
    values: tuple[float, ...] = ()

    @property
    def confidence(self) -> str:
        """Its probability in words."""
        return confidence(self.probability)


NEARLY_SURE = 0.99  # from here on two digits would write 1
SURE = 0.999  # a probability above is written as being above; below its complement, as being below


def confidence(probability: float) -> str:
    """Write a probability as people read it.

    Parameters
    ----------
    probability : float
        From 0 to 1.

    Returns
    -------
    str
        No row of nines, and none of zeros.

    Examples
    --------
    >>> confidence(0.99999), confidence(0.9961), confidence(0.842), confidence(1e-12)
    ('probability above 0.999', 'probability 0.996', 'probability 0.84', 'probability below 0.001')
    """
    if probability > SURE:
        return f"probability above {SURE}"
    if probability < 1 - SURE:
        return f"probability below {1 - SURE:.3f}"
    return f"probability {probability:.{2 if probability < NEARLY_SURE else 3}g}"


def with_confidence(statement: str, probability: float) -> str:
    """Add to a statement how probable it is.

    Parameters
    ----------
    statement : str
        A sentence.
    probability : float
        From 0 to 1.

    Returns
    -------
    str
        A sentence.

    Examples
    --------
    >>> with_confidence("A mass sits at node 3.", 0.97)
    'A mass sits at node 3 (probability 0.97).'
    """
    return f"{statement.removesuffix('.')} ({confidence(probability)})."


def as_appearance(statement: str) -> str:
    """Turn a statement into what it only looks like, where something remains that nothing explains.

    Parameters
    ----------
    statement : str
        Of a finding.

    Returns
    -------
    str
        A sentence.

    Examples
    --------
    >>> as_appearance("A mass sits at node 3 (probability 0.97).")
    'A part of it looks like this, and need not be: a mass sits at node 3 (probability 0.97 among what was tried).'
    """
    relative = PROBABILITY.sub(r"(\1 among what was tried)", statement)  # what was not tried may be likelier
    return f"{APPEARANCE}{relative[:1].lower()}{relative[1:]}"


PROBABILITY = re.compile(r"\((probability [^()]*)\)")
APPEARANCE = "A part of it looks like this, and need not be: "


def describe_location_set(locations: Sequence[Location]) -> str:
    """Name the locations between which a test cannot decide.

    Parameters
    ----------
    locations : sequence of Location
        The most probable first.

    Returns
    -------
    str
        A sentence with a space before it; empty for a single location.
    """
    if len(locations) < 2:
        return ""
    kinds: dict[str, list[tuple[object, ...]]] = {}
    for location in locations:
        distinct = [
            item for item in location.items() if any(alternative.get(item[0]) != item[1] for alternative in locations)
        ]
        for kind, value in distinct[:1]:
            kinds.setdefault(kind, []).append(tuple(value) if isinstance(value, list) else (value,))
    words = " or ".join(f"{kind} {_list_values(kind, parts)}" for kind, parts in kinds.items())
    return f" The test locates it no closer than {words}."


def _list_values(kind: str, parts: list[tuple[object, ...]]) -> str:
    """List single numbers as runs, segments of elements from first to last, others as they are."""
    numbers = sorted(number for (number, *further) in parts if isinstance(number, int) and not further)
    if len(numbers) == len(parts):
        breaks = [i for i in range(len(numbers)) if i == 0 or numbers[i] > numbers[i - 1] + 1]
        runs = [numbers[a:b] for a, b in zip(breaks, [*breaks[1:], None], strict=True)]
        return ", ".join(f"{run[0]}" if len(run) == 1 else f"{run[0]} to {run[-1]}" for run in runs)
    joined = " to " if kind == "elements" else " and "
    return ", ".join(joined.join(str(part) for part in dict.fromkeys(location)) for location in parts)


@dataclass(frozen=True, slots=True, kw_only=True)
class DataCheck:
    """A check of the measurement that needs no model.

    Parameters
    ----------
    name : str
        ``homogeneity``, ``reciprocity`` or ``coherence``.
    value : float
        Mean squared difference over its expected square; NaN where it could not be checked.
    limit : float
        What it stays below where nothing is wrong.
    statement : str
        A sentence for the user.

    Examples
    --------
    >>> import frf_ipz
    >>> check = frf_ipz.DataCheck(name="reciprocity", value=1.3, limit=4.0, statement="Exchanged FRFs agree.")
    >>> check.passed
    True
    """

    name: str
    value: float
    limit: float
    statement: str

    @property
    def passed(self) -> bool:
        """True where nothing is wrong, or nothing could be checked."""
        return not self.value > self.limit


@dataclass(frozen=True, slots=True, kw_only=True)
class Misfit:
    """How far a model is from a measurement.

    Parameters
    ----------
    training, held_out : float
        Norm of measured minus model over the norm of measured, on what was fitted and on what was not.
    training_noise, held_out_noise : float
        The same norms over what noise and tolerances make one expect.

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
    >>> options = frf_ipz.DiagnoseOptions(effects=("added_mass",))
    >>> diagnosis = frf_ipz.diagnose(frfs, model, options=options)
    >>> diagnosis.after.training < diagnosis.before.training
    True
    """

    training: float
    held_out: float
    training_noise: float
    held_out_noise: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Ambiguity:
    """Explanations that these data cannot tell apart.

    Parameters
    ----------
    effects : tuple of str
        Names, the most probable first.
    log_bayes_factor : float
        Log Bayes factor of the first over the last.
    resolve_by : str
        The sensor or excitation that would distinguish them.

    Examples
    --------
    >>> import frf_ipz
    >>> ambiguity = frf_ipz.Ambiguity(
    ...     effects=("added_mass", "local_stiffness"), log_bayes_factor=1.2, resolve_by="A sensor at node 7 would."
    ... )
    >>> ambiguity.statement
    'These data cannot tell apart: added mass and local stiffness. A sensor at node 7 would.'
    """

    effects: tuple[str, ...]
    log_bayes_factor: float
    resolve_by: str

    @property
    def statement(self) -> str:
        """What cannot be distinguished and what would do so, in a sentence or two."""
        *first, last = (effect.replace("_", " ") for effect in self.effects)
        return f"These data cannot tell apart: {', '.join(first)} and {last}. {self.resolve_by}".strip()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Curves(Concise):
    """FRFs beside the imaginary axis, to be drawn.

    Parameters
    ----------
    s : (n_points,) complex array
        rad/s.
    labels : tuple of FrfLabel
        One an FRF.
    measured, nominal, updated, explained : (n_points, n_frfs) complex array
        As measured; of the model as it is, with what its tolerances allow, and with the findings.
    expected : (n_points, n_frfs) array
        Standard deviation of noise and of what no parameter of the model stands for.

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
    >>> options = frf_ipz.DiagnoseOptions(effects=("added_mass",))
    >>> diagnosis = frf_ipz.diagnose(frfs, model, options=options)
    >>> curves = diagnosis.curves
    >>> curves.measured.shape == curves.explained.shape == (len(curves.s), len(curves.labels))
    True
    """

    s: ComplexArray
    labels: tuple[FrfLabel, ...]
    measured: ComplexArray
    nominal: ComplexArray
    updated: ComplexArray
    explained: ComplexArray
    expected: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class LinearisedLaw(Concise):
    """A force law as a spring and a damper, about the amplitudes of the test.

    Parameters
    ----------
    ends : tuple of Dof
        Where it acts: against the ground at one DOF, or between two.
    stiffness, damping : float
        About the motion in all records together, N/m and N s/m.
    motion_rms_m : (n_records,) array
        Root mean square motion there in each record, ascending.
    stiffness_by_record, damping_by_record : (n_records,) array
        About the motion in that record alone, N/m and N s/m.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> law = frf_ipz.LinearisedLaw(
    ...     ends=(frf_ipz.Dof(3, "x"),), stiffness=1e4, damping=2.0, motion_rms_m=np.array([1e-4, 3e-4]),
    ...     stiffness_by_record=np.array([8e3, 1.2e4]), damping_by_record=np.array([2.0, 2.0]),
    ... )
    >>> law.statement.split(';')[0].split(', ')[1]
    'a spring of 1e+04 N/m and a damper of 2 N s/m stand for it in a linear model'
    """

    ends: tuple[Dof, ...]
    stiffness: float
    damping: float
    motion_rms_m: FloatArray
    stiffness_by_record: FloatArray
    damping_by_record: FloatArray

    @property
    def statement(self) -> str:
        """For which motions a linear model may stand for the law."""
        low, high = (
            f"{self.stiffness_by_record[end]:.3g} N/m and {self.damping_by_record[end]:.3g} N s/m" for end in (0, -1)
        )
        return (
            f"At the level of this test, a spring of {self.stiffness:.3g} N/m and a damper of {self.damping:.3g} N s/m "
            f"stand for it in a linear model; with the level they go from {low} (weakest record, "
            f"{self.motion_rms_m[0]:.3g} m rms) to {high} (strongest, {self.motion_rms_m[-1]:.3g} m rms)."
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class LawInTime(Concise):
    """A force law at its location in time, to be drawn.

    Parameters
    ----------
    motion_m, velocity_m_s, force_N : (n_times,) array
        Of its location in the record that moves it most, as far as the law was fitted to it, and of the law there.
    record : str
        Whose response is given; empty where all records start in motion, which is not simulated.
    is_held_out : bool
        True if that record was held out of the fit.
    channel, response, unit : str
        Which sensor, the one in which the law shows most, and what it measures: ``acceleration`` in ``m/s^2``, say.
    time_s : (n_samples,) array
        s from the start.
    measured, without, simulated : (n_samples,) array
        As measured, and of the fitted model without the law and with it, SI.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> motion = np.array([-1e-3, 0.0, 1e-3])
    >>> law = frf_ipz.LawInTime(motion_m=motion, velocity_m_s=np.zeros(3), force_N=1e10 * motion**3)
    >>> ax = frf_ipz.plotting.plot_law(law)
    >>> ax.get_ylabel()
    'Force of the law, N'
    """

    motion_m: FloatArray
    velocity_m_s: FloatArray
    force_N: FloatArray  # noqa: N815  a unit
    record: str = ""
    is_held_out: bool = False
    channel: str = ""
    response: str = ""
    unit: str = ""
    time_s: FloatArray = field(default_factory=lambda: np.zeros(0))
    measured: FloatArray = field(default_factory=lambda: np.zeros(0))
    without: FloatArray = field(default_factory=lambda: np.zeros(0))
    simulated: FloatArray = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Diagnosis(Tabulated, Drawn):
    """What is missing from a nominal model, if anything.

    Parameters
    ----------
    verdict : DiagnosisVerdict
        ``consistent``, ``explained`` or ``unexplained``.
    findings : tuple of Finding
        What is missing, the best supported first; with ``unexplained``, the part that is explained.
    alternatives : tuple of Finding
        Other explanations, the most probable first.
    mismatch_hz : (n,) array
        Frequencies at which the nominal model disagrees with the measurement, Hz.
    mismatch_where : str
        Which FRFs, bands and DOFs disagree, and by how much.
    mismatch_location : Location
        Where it sits: of the first finding, or where one unknown dynamic stiffness explains most of it; may be empty.
    mismatch : DataFrame
        One row an FRF and band: ``frf``, ``low_hz``, ``high_hz``, ``before``, ``after``: rms misfit over what noise and
        tolerances explain.
    before, updated, after : Misfit
        Of the model as it is, with what its tolerances allow, and with the findings.
    held_out_kind : str
        What was held out of the fit: ``records`` or ``lines``.
    ambiguity : tuple of Ambiguity
        What cannot be distinguished.
    data_checks : tuple of DataCheck
        Checks of the measurement alone.
    detectability : mapping of str to mapping
        Smallest detectable size of each effect, by parameter, where it shows best.
    statement : str
        The verdict in a few sentences.
    unexplained_part : str
        What nothing explains, in words without a full stop; empty if nothing remains.
    curves : Curves, optional
        FRFs to draw.
    numbers : mapping of str to float
        What the verdict rests on: log Bayes factor, misfits, nuisance chi2, number of hypotheses.
    warnings : tuple of str
        What the user has to know.
    linearised_law : LinearisedLaw, optional
        The force law among the findings, for linear models.
    law_in_time : LawInTime, optional
        The same in time, to be drawn.
    statements : tuple of str
        What was measured and is nothing missing: damping of single modes.
    not_searched : str
        What was not looked at because the time was over, in words; empty for a complete search.

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
    >>> options = frf_ipz.DiagnoseOptions(effects=("added_mass",))
    >>> diagnosis = frf_ipz.diagnose(frfs, model, options=options)
    >>> diagnosis
    Diagnosis: explained, added_mass
    >>> [(finding.effect, dict(finding.location)) for finding in diagnosis.findings]
    [('added_mass', {'nodes': [3]})]
    """

    verdict: DiagnosisVerdict
    findings: tuple[Finding, ...]
    alternatives: tuple[Finding, ...]
    mismatch_hz: FloatArray
    mismatch_where: str
    mismatch: pd.DataFrame
    before: Misfit
    updated: Misfit
    after: Misfit
    held_out_kind: str
    mismatch_location: Location = field(default_factory=Location)
    ambiguity: tuple[Ambiguity, ...] = ()
    data_checks: tuple[DataCheck, ...] = ()
    detectability: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    statement: str = ""
    unexplained_part: str = ""
    curves: Curves | None = None
    numbers: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    linearised_law: LinearisedLaw | None = None
    law_in_time: LawInTime | None = None
    statements: tuple[str, ...] = ()
    not_searched: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "verdict", DiagnosisVerdict(self.verdict))  # its text is taken too

    @property
    def is_complete(self) -> bool:
        """False where the time did not suffice for the whole search."""
        return not self.not_searched

    @property
    def has_seen_all(self) -> bool:
        """False where the time did not suffice to look at every cause."""
        return self.not_searched in {"", NOT_DETECTABLE}

    @property
    def is_explained(self) -> bool:
        """True where nothing remains that the findings and the measured damping do not explain."""
        is_damping_only = bool(self.statements) and not self.unexplained_part
        return self.verdict != DiagnosisVerdict.UNEXPLAINED or is_damping_only

    def __repr__(self) -> str:
        effects = ", ".join(finding.effect for finding in self.findings) or "no finding"
        return f"Diagnosis: {self.verdict}, {effects}"

    def to_json(self) -> dict[str, Any]:
        """Give the content of ``diagnosis.json``.

        Returns
        -------
        dict
            Plain values.
        """
        return {
            "verdict": self.verdict.value,
            "statement": self.statement,
            "statements": list(self.statements),
            "complete": self.is_complete,
            "not_searched": self.not_searched,
            "findings": [_finding_to_json(finding) for finding in self.findings],
            "alternatives": [_finding_to_json(finding) for finding in self.alternatives],
            "mismatch": {
                "frequency_hz": [round(float(value), 6) for value in self.mismatch_hz],
                "where": self.mismatch_where,
                "location": dict(self.mismatch_location),
            },
            "fit": {
                "before": _misfit_to_json(self.before),
                "updated_without_findings": _misfit_to_json(self.updated),
                "after": _misfit_to_json(self.after),
                "held_out_is": self.held_out_kind,
            },
            "ambiguity": [
                {
                    "effects": list(ambiguity.effects),
                    "log_bayes_factor": _plain_number(ambiguity.log_bayes_factor),
                    "resolve_by": ambiguity.resolve_by,
                }
                for ambiguity in self.ambiguity
            ],
            "data_checks": [
                {
                    "name": check.name,
                    "value": _plain_number(check.value),
                    "limit": _plain_number(check.limit),
                    "passed": check.passed,
                    "statement": check.statement,
                }
                for check in self.data_checks
            ],
            "detectability": {name: _plain_values(sizes) for name, sizes in self.detectability.items()},
            "numbers": _plain_values(self.numbers),
            "warnings": list(self.warnings),
            **({} if self.linearised_law is None else {"linear_model": _law_to_json(self.linearised_law)}),
        }


# Every key of diagnosis.json, as `Diagnosis.to_json` gives it: [] is each entry of a list, * a name of the catalogue.
_FINDING_KEYS = {
    "effect": "name in the catalogue",
    "location": "what applies of `nodes`, `elements`, `springs`, `channels`, `end`, `groups`",
    "parameters.*": "a text (`kind`), else the four figures that follow",
    "parameters.*.value": "most probable value, in the unit at the end of the parameter's name",
    "parameters.*.std": "standard deviation",
    "parameters.*.ci95": "ends of the 95 % interval",
    "probability": "probability of this effect, at any location, among all that were tried",
    "log_evidence_gain": "natural log Bayes factor over the explanation without this effect",
    "statement": "a sentence",
    "location_set": "all locations that hold 95 % of the effect's probability, the most probable first",
    "significant": "false where it was detected and lies within the tolerances",
}
_MISFIT_KEYS = {
    "training": "norm of measured minus model over the norm of measured, on what the model was fitted to",
    "held_out": "the same on what was held out of the fit",
    "training_over_noise": "the same norms over what noise and tolerances make one expect",
    "held_out_over_noise": "the same on what was held out of the fit",
}
JSON_KEYS = {
    "verdict": "`consistent`, `explained` or `unexplained`",
    "statement": "the verdict in a few sentences",
    "statements": "what was measured and is nothing missing: damping of single modes",
    "complete": "false where the time did not suffice for the whole search",
    "not_searched": "what was not looked at because the time was over; empty for a complete search",
    **{f"findings[].{name}": text for name, text in _FINDING_KEYS.items()},
    "alternatives[]": "other explanations, the most probable first, each with the keys of a finding",
    "mismatch.frequency_hz": "frequencies at which the nominal model disagrees with the measurement, Hz",
    "mismatch.where": "which FRFs, bands and DOFs disagree, and by how much",
    "mismatch.location": "where it sits, with the keys of a finding's location; may be empty",
    **{f"fit.before.{name}": f"model as it is: {text}" for name, text in _MISFIT_KEYS.items()},
    "fit.updated_without_findings": "the same four figures of the model with what its tolerances allow",
    "fit.after": "the same four figures of the model with the findings",
    "fit.held_out_is": "what was held out of the fit: `records` or `lines`",
    "ambiguity[].effects": "effects that these data do not tell apart, the most probable first",
    "ambiguity[].log_bayes_factor": "natural log Bayes factor of the first over the last",
    "ambiguity[].resolve_by": "the sensor or excitation that would distinguish them",
    "data_checks[].name": "`homogeneity`, `reciprocity` or `coherence`",
    "data_checks[].value": "mean squared difference over its expected square; null where it could not be checked",
    "data_checks[].limit": "what the value stays below where nothing is wrong",
    "data_checks[].passed": "true where nothing is wrong, or nothing could be checked",
    "data_checks[].statement": "a sentence",
    "detectability.*": "smallest detectable size of each effect where it shows best, by parameter",
    "numbers.log_bayes_factor": "natural log Bayes factor of the best explanation over nothing missing",
    "numbers.hypotheses": "number of explanations that were tried",
    "numbers.null_misfit": "mean square of the misfit over noise of the model as its tolerances allow",
    "numbers.null_nuisance_chi2": "how far that model uses its tolerances: chi squared of the nuisance parameters",
    "numbers.null_worst_subband": "largest mean square of that misfit in one subband of one FRF",
    "numbers.misfit": "the same as null_misfit, of the model with the best explanation",
    "numbers.nuisance_chi2": "the same as null_nuisance_chi2, of the model with the best explanation",
    "numbers.worst_subband": "the same as null_worst_subband, of the model with the best explanation",
    "warnings": "what the user has to know",
    "linear_model.between": "DOFs between which the force law acts; one DOF: against the ground",
    "linear_model.stiffness_N_m": "spring that stands for the law at the level of the test; only with a force law",
    "linear_model.damping_Ns_m": "damper that stands for the law at the level of the test",
    "linear_model.motion_rms_m": "root mean square motion there in each record, ascending",
    "linear_model.stiffness_at_N_m": "that spring in each of these records alone",
    "linear_model.damping_at_Ns_m": "that damper in each of these records alone",
}


def _finding_to_json(finding: Finding) -> dict[str, Any]:
    return {
        "effect": finding.effect,
        "location": dict(finding.location),
        "parameters": {name: _parameter_to_json(value) for name, value in finding.parameters.items()},
        "probability": _plain_number(finding.probability),
        "log_evidence_gain": _plain_number(finding.log_evidence_gain),
        "statement": finding.statement,
        "location_set": [dict(location) for location in finding.location_set],
        "significant": finding.is_significant,
    }


def _law_to_json(law: LinearisedLaw) -> dict[str, Any]:
    return {
        "between": [dof.name for dof in law.ends],
        "stiffness_N_m": _plain_number(law.stiffness),
        "damping_Ns_m": _plain_number(law.damping),
        "motion_rms_m": [_plain_number(value) for value in law.motion_rms_m],
        "stiffness_at_N_m": [_plain_number(value) for value in law.stiffness_by_record],
        "damping_at_Ns_m": [_plain_number(value) for value in law.damping_by_record],
    }


def _parameter_to_json(value: Estimate | str) -> Any:  # noqa: ANN401 - a text, or numbers by name
    if isinstance(value, str):
        return value
    return {
        "value": _plain_number(value.value),
        "std": _plain_number(value.std),
        "ci95": [_plain_number(value.low), _plain_number(value.high)],
    }


def _misfit_to_json(misfit: Misfit) -> dict[str, float | None]:
    return {
        "training": _plain_number(misfit.training),
        "held_out": _plain_number(misfit.held_out),
        "training_over_noise": _plain_number(misfit.training_noise),
        "held_out_over_noise": _plain_number(misfit.held_out_noise),
    }


def _plain_values(values: Mapping[str, float]) -> dict[str, float | None]:
    return {name: _plain_number(value) for name, value in values.items()}


def _plain_number(value: float) -> float | None:
    """JSON knows no NaN and no infinity."""
    number = float(value)
    return number if abs(number) < float("inf") else None
