"""A linear force at one place: a stiffness times a function of frequency that has one number more."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from frf_ipz.diagnosis.catalogue.effect import Builder, Parameter, Place, Signature
from frf_ipz.diagnosis.catalogue.stiffness.viscoelastic_joint import SOFTEST, STIFFEST, ViscoelasticJoint, motion_at
from frf_ipz.diagnosis.physics.change import Attachment, Change

if TYPE_CHECKING:
    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.diagnosis.catalogue.model_context import ModelContext


class LocalForce(ViscoelasticJoint):
    """Against the motion of any place of a joint, k g(s / s_0), s_0 in the middle of the band."""

    tried: ClassVar[tuple[float, ...]]
    """Values of the second parameter that a wide search starts from."""
    rivals_several: ClassVar[bool] = False
    """Any two causes may imitate it, not only those with dynamics of their own."""

    @abstractmethod
    def second_parameter(self) -> Parameter:
        """Name and bounds of what g depends on."""

    @abstractmethod
    def per_stiffness(self, s: ComplexArray, second: float) -> ComplexArray:
        """Give g, (n_points,) complex array, at s over that in the middle of the band."""

    @abstractmethod
    def words(self, where: str, second: float) -> str:
        """Say what explains the measurement better than the catalogue."""

    def parameters(self, specimen: ModelContext, place: Place) -> tuple[Parameter, ...]:
        """Stiffness in the middle of the band, and the second one."""
        own = specimen.stiffness_against(motion_at(specimen, place))
        return (Parameter(name="stiffness_N_m", low=SOFTEST * own, high=STIFFEST * own), self.second_parameter())

    def build(self, specimen: ModelContext, place: Place) -> Builder:
        """Attach its dynamic stiffness; no matrices have it."""
        motion, middle = motion_at(specimen, place)[:, None], _middle(specimen)
        none = np.zeros((1, 1))

        def change(values: FloatArray) -> Change:
            stiffness, second = values
            attachment = Attachment(
                motions=motion,
                stiffness=lambda s: stiffness * self.per_stiffness(s / middle, float(second)),
                matrices=(none, none, none),
            )
            return Change(attachments=(attachment,))

        return change

    def sketch(self, specimen: ModelContext, place: Place) -> Signature:
        """Draw some values of the second parameter."""
        unit = specimen.contour / _middle(specimen)
        return Signature(
            motion=motion_at(specimen, place),
            shapes=np.array([self.per_stiffness(unit, second) for second in self.tried]),
            values=np.stack([np.ones(len(self.tried)), self.tried], 1),
        )


def where_of(specimen: ModelContext, place: Place) -> str:
    """Say in words where a force acts.

    Parameters
    ----------
    specimen : ModelContext
        What is tested.
    place : Place
        Of a joint.

    Returns
    -------
    str
        A node or a spring.
    """
    nodes = place.location.get("nodes")
    if isinstance(nodes, list):
        return specimen.where(int(nodes[0]))
    return f"spring {place.key[1]}"


def _middle(specimen: ModelContext) -> float:
    return float(2 * np.pi * np.sqrt(np.prod(specimen.band_hz)))
