"""A force at one location that no effect of the catalogue describes, where it explains more than what was found.

Each kind is a stiffness times a function of frequency that has one number more.

[Bagley1983] R. L. Bagley, P. J. Torvik, A theoretical basis for the application of fractional calculus to
viscoelasticity, Journal of Rheology 27 (1983) 201-210.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar, cast

import numpy as np

from frf_ipz.diagnosis.catalogue.effect import Builder, Parameter, Signature
from frf_ipz.diagnosis.catalogue.effects.viscoelastic_joint import SOFTEST, STIFFEST, ViscoelasticJoint, motion_at
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.model.change import Attachment, Change
from frf_ipz.diagnosis.search.component_search import rank_fits
from frf_ipz.diagnosis.search.global_scan import scan_globally
from frf_ipz.diagnosis.search.neighbourhood_search import search_neighbourhoods
from frf_ipz.diagnosis.search.rivals import MAX_BEHIND_COMPLETE
from frf_ipz.diagnosis.search.robust_refinement import refine_halfway, refine_starts
from frf_ipz.diagnosis.verdict.goodness import LIMITS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext
    from frf_ipz.diagnosis.evidence.fit import Fit
    from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem
    from frf_ipz.diagnosis.search.robust_refinement import Start, StartBeside
    from frf_ipz.diagnosis.verdict.decision import Decision

ORDERS = 0.05, 1.95
LOSSES = 1e-3, 30.0  # in the middle of the band; with more it is a damper
N_ROUGH = 5  # locations that are fitted with inflated errors


class LocalForce(ViscoelasticJoint):
    """Against the motion of any location of a joint, k g(s / s_0), s_0 in the middle of the band."""

    start_seconds: ClassVar[tuple[float, ...]]
    """Values of the second parameter that a global scan starts from."""
    rivals_several: ClassVar[bool] = False
    """Any two components may imitate it, not only those with dynamics of their own."""

    @abstractmethod
    def second_parameter(self) -> Parameter:
        """Name and bounds of what g depends on."""

    @abstractmethod
    def per_stiffness(self, s: ComplexArray, second: float) -> ComplexArray:
        """Give g, (n_points,) complex array, at s over that in the middle of the band."""

    @abstractmethod
    def describe(self, where: str, second: float) -> str:
        """Say what explains the measurement better than the catalogue."""

    def parameters(self, context: ModelContext, location: Location) -> tuple[Parameter, ...]:
        """Stiffness in the middle of the band, and the second one."""
        scale = context.stiffness_against(motion_at(context, location))
        return (Parameter(name="stiffness_N_m", low=SOFTEST * scale, high=STIFFEST * scale), self.second_parameter())

    def build(self, context: ModelContext, location: Location) -> Builder:
        """Attach its dynamic stiffness; no matrices have it."""
        motion, middle = motion_at(context, location).dense(len(context.model.all_dofs))[:, None], _middle(context)
        zero = np.zeros((1, 1))

        def change(values: FloatArray) -> Change:
            stiffness, second = values
            attachment = Attachment(
                motions=motion,
                stiffness=lambda s: stiffness * self.per_stiffness(s / middle, float(second)),
                matrices=(zero, zero, zero),
            )
            return Change(attachments=(attachment,))

        return change

    def signature(self, context: ModelContext, location: Location) -> Signature:
        """Take some values of the second parameter."""
        unit = context.contour / _middle(context)
        return Signature(
            motion=motion_at(context, location),
            shapes=np.array([self.per_stiffness(unit, second) for second in self.start_seconds]),
            values=np.stack([np.ones(len(self.start_seconds)), self.start_seconds], 1),
        )


def describe_location(context: ModelContext, location: Location) -> str:
    """Say in words where a force acts.

    Parameters
    ----------
    context : ModelContext
        Model, layout and tolerances.
    location : Location
        Of a joint.

    Returns
    -------
    str
        A node or a spring.
    """
    return f"spring {location.springs[0]}" if location.springs else context.describe_node(location.node)


def _middle(context: ModelContext) -> float:
    return float(2 * np.pi * np.sqrt(np.prod(context.band_hz)))


class PowerLaw(LocalForce):
    """k (s / s_0)^order between a location and the ground: a force that rises with some power of frequency.

    Springs, dampers and masses are the powers 0, 1 and 2; materials that relax over many time constants lie between
    [Bagley1983]. What imitates such a force in the catalogue explains less than the power law itself.
    """

    name = "power_law"
    start_seconds = (0.25, 0.5, 0.75, 1.5)

    def second_parameter(self) -> Parameter:
        """Order."""
        return Parameter(name="order", low=ORDERS[0], high=ORDERS[1], is_log=False)

    def per_stiffness(self, s: ComplexArray, second: float) -> ComplexArray:
        """Take a power."""
        return np.asarray(s**second)

    def describe(self, where: str, second: float) -> str:
        """Say which power."""
        return (
            f"a force at {where} that grows with the power {second:.2g} of frequency explains the measurement "
            "better than springs, dampers and masses do"
        )


class NegativeSpring(LocalForce):
    """k (-1 + loss s / s_0) between a location and the ground: a negative stiffness with losses.

    Magnets, buckled springs, control that is late: a late force -k exp(-s tau) is -k + k tau s as long as the delay tau
    is short, takes stiffness away and damps.
    """

    name = "negative_spring"
    start_seconds = (0.01, 0.1, 1.0, 5.0)
    rivals_several = True

    def second_parameter(self) -> Parameter:
        """Loss in the middle of the band."""
        return Parameter(name="loss", low=LOSSES[0], high=LOSSES[1])

    def per_stiffness(self, s: ComplexArray, second: float) -> ComplexArray:
        """Sum a negative spring and a damper."""
        return np.asarray(second * s - 1)

    def describe(self, where: str, second: float) -> str:
        """Say how lossy."""
        return (
            f"a force at {where} that takes stiffness away, with a loss factor of {second:.2g} in the middle of the "
            "band, explains the measurement better than the effects of the catalogue do"
        )


KINDS: tuple[LocalForce, ...] = (PowerLaw(), NegativeSpring())


def find_unnamed_force(problem: InferenceProblem, decision: Decision) -> Fit | None:
    """Search for one force that explains more than what was found, or as much as several components.

    Parameters
    ----------
    problem : InferenceProblem
        Data and model.
    decision : Decision
        With one component or more.

    Returns
    -------
    Fit or None
        Of a force; None where what was found explains as much, or is one component that has no dynamics of its own.
    """
    components = decision.final.hypothesis.components
    are_dynamic = bool(components) and all(component.effect.has_dynamics for component in components)
    kinds = [kind for kind in KINDS if are_dynamic or (kind.rivals_several and len(components) > 1)]
    if not kinds:
        return None
    cost_limit = problem.fit_roughly(components, decision.final.values).cost + MAX_BEHIND_COMPLETE
    fits = [fit for kind in kinds if (fit := _fit_best_location(problem, decision.null, kind, cost_limit)) is not None]
    required = LIMITS[problem.kind].decisive_log_bayes_factor if len(components) == 1 else 0.0
    required_log_evidence = decision.final.log_evidence + required
    return max(
        (fit for fit in fits if fit.log_evidence > required_log_evidence),
        key=lambda fit: fit.log_evidence,
        default=None,
    )


def _fit_best_location(problem: InferenceProblem, null: Fit, kind: LocalForce, cost_limit: float) -> Fit | None:
    """Fit a kind of force at its best location; None where its cost with inflated errors exceeds a limit."""
    force_problem = replace(problem, effects={kind.name: kind})
    refined = refine_starts(force_problem, null, scan_globally(force_problem, null))
    rough_fits = [
        force_problem.fit_roughly((*known, start.component), start.values)
        for known, start in _refine_halfway(force_problem, refined)
    ]
    best = min(rough_fits, key=lambda fit: fit.cost)
    if best.cost > cost_limit:
        return None
    exact = force_problem.fit_exactly(best)
    fits = {exact.hypothesis.components[-1].key: exact}
    search_neighbourhoods(force_problem, null, fits)
    return rank_fits(force_problem, fits.values())[0]


def describe_unnamed_force(fit: Fit) -> str:
    """Say what explains more than the catalogue.

    Parameters
    ----------
    fit : Fit
        Of a force.

    Returns
    -------
    str
        In words that follow "Something is missing that nothing in the catalogue explains: ".
    """
    (component,) = fit.hypothesis.components
    kind = cast("LocalForce", component.effect)
    return kind.describe(describe_location(fit.hypothesis.context, component.location), float(fit.values[-1]))


def _refine_halfway(problem: InferenceProblem, refined: Sequence[Start]) -> list[StartBeside]:
    return refine_halfway(problem, [((), start) for start in refined[:N_ROUGH]])
