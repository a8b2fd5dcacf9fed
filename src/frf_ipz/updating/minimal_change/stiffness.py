"""The stiffness phase of a minimal change: moduli of poles and zeros by stiffness (and mass).

What is compared are the logarithms of the moduli of undamped roots: the modulus of a pole is what light damping leaves
alone. What damping adds to the moduli all the same is taken off the targets.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.numerics.pencils import undamped_sensitivity
from frf_ipz.updating.parameters import ParameterBasis, PriorTerm
from frf_ipz.updating.tracking import TargetRoots, TrackedRoots, nominal_roots, track

POLE_SLACK = 1e-7  # relative standard deviation of what a reduced model cannot express of a real pole: it has its modes
ZERO_SLACK = 1e-5  # the same of a zero, which the modes left out move as well
INDEFINITE = 1e-9  # part of the largest eigenvalue below which a negative one is rounding


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StiffnessPhase:
    """Stiffness and mass, in mass-normalised modal coordinates of the nominal model.

    Parameters
    ----------
    eigenvalues : (r,) array
        Squared natural frequencies of the nominal model, (rad/s)^2: its stiffness; its mass is the unit matrix.
    basis : ParameterBasis
        In the same coordinates.
    wanted : TargetRoots
        Which roots are targets.
    targets : (n,) array
        Logarithms of the moduli of measured poles and zeros, less what damping adds to them in the model.
    noise : (n, n) array
        Their covariance.
    changes_mass : bool
        False where no parameter moves the mass: then its derivatives need not be worked out.
    """

    eigenvalues: FloatArray
    basis: ParameterBasis
    wanted: TargetRoots
    targets: FloatArray
    noise: FloatArray
    changes_mass: bool

    @property
    def terms(self) -> tuple[PriorTerm, ...]:
        """Prior of the parameters."""
        return self.basis.terms

    @property
    def slack(self) -> FloatArray:
        """Standard deviations of what no parameter explains, (n,)."""
        return np.where(self.wanted.frf < 0, POLE_SLACK, ZERO_SLACK)

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
        mass = np.broadcast_to(np.eye(len(self.eigenvalues)), (*theta.shape[:-1], *self.basis.mass.shape[1:]))
        if self.changes_mass:
            mass = mass + np.tensordot(amounts, self.basis.mass, 1)
        return mass, np.diag(self.eigenvalues) + np.tensordot(amounts, self.basis.stiffness, 1)

    def nominal_roots(self, computed: ComplexArray) -> TrackedRoots:
        """Find the nominal roots that the pairing named.

        Parameters
        ----------
        computed : (n,) complex array
            The nominal model's poles and zeros, rad/s.

        Returns
        -------
        TrackedRoots
            Where the iteration starts.
        """
        return nominal_roots(self.wanted, *self.matrices(np.zeros(len(self.basis.names))), computed)

    def roots(self, theta: FloatArray, near: TrackedRoots) -> TrackedRoots | None:
        """Give the squared roots that belong to the targets; see `Phase`.

        Parameters
        ----------
        theta : (p,) array
            Parameters.
        near : TrackedRoots
            Those of a model close by.

        Returns
        -------
        TrackedRoots or None
            None where the stiffness is indefinite or the mass not positive.
        """
        mass, stiffness = self.matrices(theta)
        values = np.linalg.eigvalsh(stiffness)
        if values[0] < -INDEFINITE * values[-1] or (self.changes_mass and np.linalg.eigvalsh(mass)[0] <= 0):
            return None
        return track(self.wanted, near, mass, stiffness)

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
        result = np.zeros((len(self.targets), len(theta)))
        for places, roots in tracked.groups:
            moved = undamped_sensitivity(roots, self.basis.stiffness, self.basis.mass if self.changes_mass else None)
            result[places] = 0.5 * (moved / roots.values[:, None]).real
        return result * self.basis.slopes(theta)

    def shown(self, theta: FloatArray) -> dict[str, float]:
        """Give the factor on the stiffness of every region, real over nominal.

        Parameters
        ----------
        theta : (p,) array
            Parameters.

        Returns
        -------
        dict of str to float
            By name; empty for parameters that belong to no place.
        """
        count = len(self.basis.regions)
        factors = 1 + self.basis.amounts(theta)[:count]
        return dict(zip(self.basis.names[:count], factors.tolist(), strict=True))

    def largest_part(self, theta: FloatArray, wanted: FloatArray) -> float:
        """Allow the whole step.

        Parameters
        ----------
        theta, wanted : (p,) array
            Where the step starts and ends.

        Returns
        -------
        float
            1.
        """
        del theta, wanted
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
