"""Mass-normalised modal coordinates of the nominal model, in which the changes of any model are of one size."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import BoolArray, FloatArray
from frf_ipz.numerics.pencils import separate_equal_modes, undamped_poles

if TYPE_CHECKING:
    from frf_ipz.structure import ReducedModel

INDEFINITE = 1e-9  # part of the largest eigenvalue below which a negative one is rounding


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModalFrame:
    """Modes of a model as coordinates.

    Parameters
    ----------
    eigenvalues : (r,) array
        Squared natural frequencies, (rad/s)^2; negative ones only where the model has a negative stiffness.
    shapes : (r, r) array
        Mass-normalised modes at the model's own coordinates.
    inverse : (r, r) array
        Its inverse.
    """

    eigenvalues: FloatArray
    shapes: FloatArray
    inverse: FloatArray

    def to_modal(self, matrix: FloatArray) -> FloatArray:
        """Transform matrices of the model into modal ones.

        Parameters
        ----------
        matrix : (..., r, r) array
            In the model's coordinates.

        Returns
        -------
        (..., r, r) array
            In modal coordinates.
        """
        return np.asarray(self.shapes.T @ matrix @ self.shapes)

    def from_modal(self, matrix: FloatArray) -> FloatArray:
        """Transform symmetric modal matrices into those of the model.

        Parameters
        ----------
        matrix : (..., r, r) array
            In modal coordinates.

        Returns
        -------
        (..., r, r) array
            In the model's coordinates, symmetric to the last bit.
        """
        result = self.inverse.T @ matrix @ self.inverse
        return np.asarray((result + np.swapaxes(result, -1, -2)) / 2)


def modal_frame(mass: FloatArray, stiffness: FloatArray) -> ModalFrame:
    """Compute the frame of a symmetric model.

    Parameters
    ----------
    mass, stiffness : (r, r) array
        Its matrices.

    Returns
    -------
    ModalFrame
        Modes by ascending frequency.
    """
    poles = undamped_poles(mass, stiffness)
    shapes, values = poles.right_vectors.real, poles.values.real
    is_rounding = (values < 0) & ~is_negative(values)
    return ModalFrame(eigenvalues=np.where(is_rounding, 0.0, values), shapes=shapes, inverse=shapes.T @ mass)


def is_negative(eigenvalues: FloatArray) -> BoolArray:
    """Tell eigenvalues of a negative stiffness from those of rigid-body modes, which rounding makes negative.

    Parameters
    ----------
    eigenvalues : (..., r) array
        Of a stiffness.

    Returns
    -------
    (..., r) bool array
        True for negative ones beyond rounding.
    """
    return np.asarray(eigenvalues < -INDEFINITE * np.abs(eigenvalues).max(axis=-1, keepdims=True))


def frame_of(model: ReducedModel, at_ports: FloatArray) -> ModalFrame:
    """Compute the frame of a reduced model.

    Of modes of one frequency a pole that was measured is the one that moves the ports; how it changes with the matrices
    follows from the shape that does.

    Parameters
    ----------
    model : ReducedModel
        The model.
    at_ports : (n_ports, r) array
        Motion of what was excited and measured for unit motions of the retained DOFs.

    Returns
    -------
    ModalFrame
        Its modes, those of one frequency turned to the ports.
    """
    frame = modal_frame(model.mass, model.stiffness)
    eigenvalues, turn = separate_equal_modes(frame.eigenvalues, at_ports @ frame.shapes)
    return ModalFrame(eigenvalues=eigenvalues, shapes=frame.shapes @ turn, inverse=turn.T @ frame.inverse)
