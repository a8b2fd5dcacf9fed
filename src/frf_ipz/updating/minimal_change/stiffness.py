"""The stiffness phase of a minimal change: moduli of poles and zeros by stiffness (and mass).

Targets are the logarithms of the moduli of undamped roots: light damping hardly changes the modulus of a pole. The
small change by damping is subtracted from the targets.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.numerics.low_rank import PAIRS_AT_ONCE, LowRankMatrices
from frf_ipz.updating.minimal_change.modal_frame import is_negative
from frf_ipz.updating.parameters import ParameterBasis, PriorTerm
from frf_ipz.updating.target_noise import TargetNoise
from frf_ipz.updating.tracking import TargetRoots, TrackedRoots, nominal_roots, track

POLE_SLACK = 1e-7  # relative standard deviation of a true pole that a reduced model cannot express: it has its modes
ZERO_SLACK = 1e-5  # the same of a zero, which depends on the modes beyond as well


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StiffnessPhase:
    """Stiffness and mass, in mass-normalised modal coordinates of the nominal model.

    Parameters
    ----------
    eigenvalues : (r,) array
        Squared natural frequencies of the nominal model, (rad/s)^2: its stiffness; its mass is the unit matrix.
    basis : ParameterBasis
        In the coordinates of the model.
    target_roots : TargetRoots
        Poles and zeros that are targets.
    targets : (n,) array
        Logarithms of the moduli of measured poles and zeros, without the change by damping in the model.
    noise : TargetNoise
        Their covariance.
    by_stiffness, by_mass : LowRankMatrices
        The matrices of the parameters in modal coordinates.
    changes_mass : bool
        False where no parameter changes the mass: its derivatives are then not needed.
    """

    eigenvalues: FloatArray
    basis: ParameterBasis
    target_roots: TargetRoots
    targets: FloatArray
    noise: TargetNoise
    by_stiffness: LowRankMatrices
    by_mass: LowRankMatrices
    changes_mass: bool

    @property
    def terms(self) -> tuple[PriorTerm, ...]:
        """Prior of the parameters."""
        return self.basis.terms

    @property
    def slack(self) -> FloatArray:
        """Standard deviations of what no parameter explains, (n,)."""
        return np.where(self.target_roots.frf < 0, POLE_SLACK, ZERO_SLACK)

    def matrices(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mass and stiffness for some parameters.

        Parameters
        ----------
        theta : (..., p) array
            Parameters.

        Returns
        -------
        mass, stiffness : (..., r, r) array
            Matrices.
        """
        amounts = self.basis.amounts(theta)
        shape = (*theta.shape[:-1], *np.diag(self.eigenvalues).shape)
        mass, stiffness = np.zeros(shape), np.zeros(shape)
        self.by_mass.add_sums(mass, amounts)
        self.by_stiffness.add_sums(stiffness, amounts)
        mass += np.eye(len(self.eigenvalues))
        stiffness += np.diag(self.eigenvalues)
        return mass, stiffness

    def named_roots(self, theta: FloatArray, computed: ComplexArray) -> TrackedRoots:
        """Find the roots that the pairing named.

        Parameters
        ----------
        theta : (p,) array
            Parameters of the model that was paired.
        computed : (n,) complex array
            Its poles and zeros, rad/s.

        Returns
        -------
        TrackedRoots
            Roots at the start of the iteration.
        """
        return nominal_roots(self.target_roots, *self.matrices(theta), computed)

    def roots(self, theta: FloatArray, reference: TrackedRoots) -> TrackedRoots | None:
        """Give the squared roots that belong to the targets; see `Phase`.

        Parameters
        ----------
        theta : (p,) array
            Parameters.
        reference : TrackedRoots
            Roots of a model close to this one.

        Returns
        -------
        TrackedRoots or None
            None where the stiffness has more negative eigenvalues than the model's, or the mass is not positive.
        """
        mass, stiffness = self.matrices(theta)
        n_negative = np.count_nonzero(is_negative(np.asarray(np.linalg.eigvalsh(stiffness), float)))
        is_indefinite = n_negative > np.count_nonzero(is_negative(self.eigenvalues))
        if is_indefinite or (self.changes_mass and np.linalg.eigvalsh(mass)[0] <= 0):
            return None
        return track(self.target_roots, reference, mass, stiffness)

    def errors(self, tracked: TrackedRoots) -> FloatArray:
        """Give targets minus model.

        Parameters
        ----------
        tracked : TrackedRoots
            Squared roots of the model.

        Returns
        -------
        (n,) array
            Errors of the logarithms.
        """
        return np.asarray(self.targets - log_moduli(tracked, len(self.targets)))

    def slopes(self, theta: FloatArray, tracked: TrackedRoots) -> FloatArray:
        """Give the derivatives of the logarithms of the moduli.

        Parameters
        ----------
        theta : (p,) array
            Parameters.
        tracked : TrackedRoots
            Roots for these parameters.

        Returns
        -------
        (n, p) array
            Per unit of the parameters.
        """
        result = np.empty((len(self.targets), len(theta)))
        by_amount = self.basis.slopes(theta)
        for indices, roots in tracked.groups:
            left = roots.left_vectors * (0.5 / (roots.slope * roots.values))
            by_mass = left * -roots.values if self.changes_mass else left
            for first in range(0, len(indices), PAIRS_AT_ONCE):
                part = slice(first, first + PAIRS_AT_ONCE)
                change = self.by_stiffness.forms(left[:, part], roots.right_vectors[:, part])
                if self.changes_mass:
                    self.by_mass.add_forms(change, by_mass[:, part], roots.right_vectors[:, part])
                result[indices[part]] = change * by_amount
        return result

    def history_columns(self, theta: FloatArray) -> dict[str, float]:
        """Give the factor on the stiffness of every region, updated over nominal.

        Parameters
        ----------
        theta : (p,) array
            Parameters.

        Returns
        -------
        dict of str to float
            By name; empty for parameters without a location.
        """
        count = len(self.basis.regions)
        factors = 1 + self.basis.amounts(theta)[:count]
        return dict(zip(self.basis.names[:count], factors.tolist(), strict=True))

    def max_step_fraction(self, theta: FloatArray, proposed: FloatArray) -> float:
        """Allow the whole step.

        Parameters
        ----------
        theta, proposed : (p,) array
            Parameters before and after the step.

        Returns
        -------
        float
            1.
        """
        del theta, proposed
        return 1.0


def log_moduli(tracked: TrackedRoots, count: int) -> FloatArray:
    """Logarithms of the moduli of squared roots.

    Parameters
    ----------
    tracked : TrackedRoots
        Roots, squared.
    count : int
        Number of targets.

    Returns
    -------
    (count,) array
        Of the modulus in rad/s.
    """
    return np.asarray(0.5 * np.log(np.abs(tracked.values(count)) + np.finfo(float).tiny))
