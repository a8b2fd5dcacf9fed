"""What an effect does: to mass and stiffness, to supports, to damping, to the measuring chain."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray

if TYPE_CHECKING:
    from frf_ipz.structure import Matrix, StructuralModel

Transfer = Callable[[ComplexArray], ComplexArray]
"""A function of s: (n_points,) complex array, rad/s, to (n_points,) complex array."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Attachment:
    """A dynamic stiffness on motions of the structure.

    Parameters
    ----------
    motions : (n_all, r) array
        Each column is a motion: weights of all DOFs of the model.
    stiffness : callable
        Dynamic stiffness against each of the motions, N/m or N m/rad.
    matrices : tuple of (1 + n, 1 + n) arrays, optional
        The same as mass, damping and stiffness between one motion and n motions of its own: what brings it into a model
        that has matrices only. Without them it cannot be brought there.
    """

    motions: FloatArray
    stiffness: Transfer
    matrices: tuple[FloatArray, FloatArray, FloatArray] | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Change:
    """Everything that an effect changes; what is left out stays.

    Parameters
    ----------
    model : StructuralModel, optional
        Another model in the place of the nominal one, with the same DOFs.
    mass, stiffness : (n_all, n_all) sparse array, optional
        What is added to the matrices of all DOFs.
    released : tuple of int
        Held DOFs (rows of all) that may move; `stiffness` says what holds them.
    floating : bool
        A free structure stays free: what is added hangs as softly as the structure, whose rigid-body modes stay.
    attachments : tuple of Attachment
        What has dynamics of its own. Modal damping is that of the structure without them.
    modal_ratio : float, optional
        Damping ratio of all modes, instead of the model's.
    added_ratio : float
        Damping ratio of all modes besides their own.
    loss_factor : float
        Of the whole stiffness: K (1 + i eta), besides the modal damping.
    reference_rad_s : float
        Where the stiffness is the model's: it rises with frequency, as causality asks of a constant loss factor. 0 for
        the same at all frequencies.
    keeps_modes : bool
        The stiffness of each mode is the model's at the mode's own frequency instead, and rises from there.
    channels : mapping of str to Transfer
        What a channel shows over what it should show.
    moved : mapping of str to int
        Output channels, and the node where the sensor really is.
    """

    model: StructuralModel | None = None
    mass: Matrix | None = None
    stiffness: Matrix | None = None
    released: tuple[int, ...] = ()
    floating: bool = False
    attachments: tuple[Attachment, ...] = ()
    modal_ratio: float | None = None
    added_ratio: float = 0.0
    loss_factor: float = 0.0
    reference_rad_s: float = 0.0
    keeps_modes: bool = False
    channels: Mapping[str, Transfer] = field(default_factory=dict)
    moved: Mapping[str, int] = field(default_factory=dict)

    def __add__(self, other: Change) -> Change:
        """Put two effects together."""
        return Change(
            model=self.model if other.model is None else other.model,
            mass=_sum(self.mass, other.mass),
            stiffness=_sum(self.stiffness, other.stiffness),
            released=tuple(dict.fromkeys((*self.released, *other.released))),
            floating=self.floating or other.floating,
            attachments=(*self.attachments, *other.attachments),
            modal_ratio=self.modal_ratio if other.modal_ratio is None else other.modal_ratio,
            added_ratio=self.added_ratio + other.added_ratio,
            loss_factor=self.loss_factor + other.loss_factor,
            reference_rad_s=self.reference_rad_s or other.reference_rad_s,
            keeps_modes=self.keeps_modes or other.keeps_modes,
            channels=_product(self.channels, other.channels),
            moved={**self.moved, **other.moved},
        )


def _sum(first: Matrix | None, second: Matrix | None) -> Matrix | None:
    if first is None or second is None:
        return first if second is None else second
    return first + second


def _product(first: Mapping[str, Transfer], second: Mapping[str, Transfer]) -> dict[str, Transfer]:
    both = {**first, **second}
    for name in first.keys() & second.keys():
        both[name] = _both(first[name], second[name])
    return both


def _both(first: Transfer, second: Transfer) -> Transfer:
    return lambda s: np.asarray(first(s) * second(s))


NOTHING = Change()
