"""A force at one place that no effect of the catalogue describes: it rises with some power of frequency.

Springs, dampers and masses are the powers 0, 1 and 2; materials that relax over many time constants lie between
[Bagley1983]. What imitates such a force in the catalogue explains less than the power law itself.

[Bagley1983] R. L. Bagley, P. J. Torvik, A theoretical basis for the application of fractional calculus to
viscoelasticity, Journal of Rheology 27 (1983) 201-210.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.diagnosis.catalogue.effect import Builder, Parameter, Place, Sketch
from frf_ipz.diagnosis.catalogue.stiffness.viscoelastic_joint import SOFTEST, STIFFEST, ViscoelasticJoint, motion_at
from frf_ipz.diagnosis.judging.verdict import LIMITS
from frf_ipz.diagnosis.physics.change import Attachment, Change
from frf_ipz.diagnosis.search.climb import climb_all
from frf_ipz.diagnosis.search.far.starts import bring_closer, refine_far
from frf_ipz.diagnosis.search.far.wide import wide_search
from frf_ipz.diagnosis.search.search import ranked

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.diagnosis.catalogue.specimen import Specimen
    from frf_ipz.diagnosis.judging.decision import Decision
    from frf_ipz.diagnosis.search.bench import Bench
    from frf_ipz.diagnosis.search.far.sketches import Start
    from frf_ipz.diagnosis.search.far.starts import Supposed
    from frf_ipz.diagnosis.search.fit import Fit

ORDERS = 0.05, 1.95
TRIED = (0.25, 0.5, 0.75, 1.5)
FITTED = 5  # places with large errors
FAR_BEHIND = 300.0  # nats, with large errors: such a force is not fitted exactly


class PowerLaw(ViscoelasticJoint):
    """k (s / s_0)^order between a place and the ground, s_0 in the middle of the band."""

    name = "power_law"

    def parameters(self, specimen: Specimen, place: Place) -> tuple[Parameter, ...]:
        """Stiffness in the middle of the band, and order."""
        own = specimen.stiffness_against(motion_at(specimen, place))
        return (
            Parameter(name="stiffness_N_m", low=SOFTEST * own, high=STIFFEST * own),
            Parameter(name="order", low=ORDERS[0], high=ORDERS[1], is_log=False),
        )

    def build(self, specimen: Specimen, place: Place) -> Builder:
        """Attach its dynamic stiffness; no matrices have it."""
        motion, middle = motion_at(specimen, place)[:, None], _middle(specimen)
        none = np.zeros((1, 1))

        def change(values: FloatArray) -> Change:
            stiffness, order = values
            attachment = Attachment(
                motions=motion, stiffness=lambda s: stiffness * _power(s, middle, order), matrices=(none, none, none)
            )
            return Change(attachments=(attachment,))

        return change

    def sketch(self, specimen: Specimen, place: Place) -> Sketch:
        """Draw some orders."""
        middle = _middle(specimen)
        return Sketch(
            motion=motion_at(specimen, place),
            shapes=np.array([_power(specimen.contour, middle, order) for order in TRIED]),
            values=np.stack([np.ones(len(TRIED)), TRIED], 1),
        )


def find_another(bench: Bench, found: Decision) -> Fit | None:
    """Look for one force that explains more than what was found, or as much as several causes.

    Parameters
    ----------
    bench : Bench
        Data and model.
    found : Decision
        With one cause or more.

    Returns
    -------
    Fit or None
        Of a power law; None where what was found explains as much, or has no dynamics of its own.
    """
    causes = found.final.hypothesis.causes
    if not causes or not all(cause.effect.has_dynamics for cause in causes):
        return None
    only = replace(bench, effects={PowerLaw.name: PowerLaw()})
    refined = refine_far(only, found.null, wide_search(only, found.null))
    early = [only.fit_early((*known, start.cause), start.values) for known, start in _closer(only, refined)]
    best = min(early, key=lambda fit: fit.cost)
    if best.cost > only.fit_early(causes, found.final.values).cost + FAR_BEHIND:
        return None
    exact = only.fit_from(best)
    fits = {exact.hypothesis.causes[-1].key: exact}
    climb_all(only, found.null, fits)
    best = ranked(only, fits.values())[0]
    needed = LIMITS[bench.kind].beside_nats if len(causes) == 1 else 0.0
    return best if best.log_evidence > found.final.log_evidence + needed else None


def describe_another(fit: Fit) -> str:
    """Say what explains more than the catalogue.

    Parameters
    ----------
    fit : Fit
        Of a power law.

    Returns
    -------
    str
        In words that follow "Something is missing that nothing in the catalogue explains: ".
    """
    specimen, location = fit.hypothesis.specimen, fit.hypothesis.causes[-1].place.location
    nodes, springs = location.get("nodes"), location.get("springs")
    where = specimen.where(int(nodes[0])) if isinstance(nodes, list) else f"spring {springs}"
    return (
        f"a force at {where} that grows with the power {fit.values[-1]:.2g} of frequency explains the measurement "
        "better than springs, dampers and masses do"
    )


def _closer(bench: Bench, refined: Sequence[Start]) -> list[Supposed]:
    return bring_closer(bench, [((), start) for start in refined[:FITTED]])


def _middle(specimen: Specimen) -> float:
    return float(2 * np.pi * np.sqrt(np.prod(specimen.band_hz)))


def _power(s: ComplexArray, middle: float, order: float) -> ComplexArray:
    return np.asarray((s / middle) ** order)
