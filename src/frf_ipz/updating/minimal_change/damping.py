"""The smallest change of damping that brings the real parts of poles and zeros to their targets.

In mass-normalised modal coordinates the damping matrix is ``E^1/2 (C + O) E^1/2 + (1 + d) D``: E holds the modes' rates
``2 zeta omega``, each multiplied by a factor whose logarithm is a parameter (one more is common to all modes), C is the
nominal matrix scaled to a unit diagonal, O couples modes. Rates stay positive whatever the parameters, and damping of
a model is rarely known better than its order of magnitude, which is what the prior of the common factor says. D are the
dampers of a model that states damping ratios besides: they couple modes far more than modes' own damping does, and are
known better.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.rational import damping_ratio
from frf_ipz.updating.minimal_change.modal_frame import ModalFrame
from frf_ipz.updating.parameters import ParameterBasis, PriorTerm, unwhiten
from frf_ipz.updating.tracking import TargetRoots, TrackedRoots, nominal_roots, with_damping

COMMON_STD = 1.5  # of the logarithm of the factor common to all modes
MODE_STD = 0.3  # of the logarithm of each mode's own factor
DASHPOT_STD = 0.1  # of the part by which all dampers are stronger
COUPLING_STD = 0.1  # of a coupling, relative to the two modes' rates
LARGEST_STEP = 1.5  # of a logarithm in one iteration: the real part is not linear in it
SMALL_DAMPING = 0.2  # of the usual damping ratio: real parts below are not compared relative to themselves
SMALLEST_RATIO = 1e-5  # below it no damping ratio is taken as usual
SMALLEST_NOISE = 1e-4  # relative standard deviation of a real part: none is measured better
NO_DAMPING = 1e-3  # of the usual rate: a model with less states no damping for that mode
POLE_SLACK = 1e-3  # relative standard deviation of what no damping matrix explains of a pole's real part
ZERO_SLACK = 0.02  # the same of a zero, which depends on shapes too, and those are known no better
INDEFINITE = 1e-9  # part of the largest rate below which a negative eigenvalue is rounding


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DampingPhase:
    """Damping, in mass-normalised modal coordinates of the model with updated stiffness.

    Parameters
    ----------
    eigenvalues : (r,) array
        Squared natural frequencies, (rad/s)^2.
    rates : (r,) array
        Nominal ``2 zeta omega``, rad/s; 0 for rigid-body modes.
    shape : (r, r) array
        The nominal damping matrix scaled to a unit diagonal.
    dashpots : (r, r) array
        Damping that belongs to no mode.
    chosen : (q, r, r) array
        Damping matrices for one unit of parameters that a diagnosis has chosen; last that of the dashpots, if any.
    terms : tuple of PriorTerm
        Prior of all parameters: common, each mode's, couplings, chosen ones.
    undamped : TrackedRoots
        Squared roots of the same model without damping that belong to the targets.
    wanted : TargetRoots
        Which roots are targets.
    targets : (n,) array
        Measured real parts with their sign changed, rad/s.
    sizes : (n,) array
        What they are compared relative to, rad/s.
    noise : (n, n) array
        Covariance of the targets over their sizes.
    pairs : pair of (r (r - 1) / 2,) int arrays
        Rows and columns of the couplings.
    """

    eigenvalues: FloatArray
    rates: FloatArray
    shape: FloatArray
    dashpots: FloatArray
    chosen: FloatArray
    terms: tuple[PriorTerm, ...]
    undamped: TrackedRoots
    wanted: TargetRoots
    targets: FloatArray
    sizes: FloatArray
    noise: FloatArray
    pairs: tuple[IntArray, IntArray]

    @property
    def slack(self) -> FloatArray:
        """Standard deviations of what no parameter explains, (n,)."""
        return np.where(self.wanted.frf < 0, POLE_SLACK, ZERO_SLACK)

    def damping(self, theta: FloatArray) -> FloatArray:
        """Give the damping matrix for some parameters.

        Parameters
        ----------
        theta : (..., p) array
            Common logarithm, each mode's, couplings, chosen parameters.

        Returns
        -------
        (..., r, r) array
            Damping matrix.
        """
        chosen = theta[..., 1 + len(self.rates) + len(self.pairs[0]) :]
        return np.asarray(self._of_modes(theta) + self.dashpots + np.tensordot(chosen, self.chosen, 1))

    def _of_modes(self, theta: FloatArray) -> FloatArray:
        """Damping that belongs to modes, (..., r, r) array."""
        own = 1 + len(self.rates)
        row, column = self.pairs
        roots = np.sqrt(self._factors(theta))
        coupled = np.broadcast_to(self.shape, (*theta.shape[:-1], *self.shape.shape)).copy()
        couplings = theta[..., own : own + len(row)]
        coupled[..., row, column] += couplings
        coupled[..., column, row] += couplings
        return np.asarray(coupled * roots[..., :, None] * roots[..., None, :])

    def start(self) -> FloatArray:
        """Give whitened parameters to start from: the nominal damping times what the poles ask for on the whole."""
        whitened = np.zeros(sum(term.root.shape[1] for term in self.terms))
        poles = self.wanted.frf < 0
        nominal = self._roots(self.damping(np.zeros(self.terms[0].root.shape[0])))
        ratios = self.targets[poles] / -nominal.values(len(poles))[poles].real
        if np.any(ratios > 0):
            whitened[0] = np.log(np.median(ratios[ratios > 0])) / self.terms[0].std
        return whitened

    def initial_roots(self) -> TrackedRoots:
        """Give the roots of the model to start from."""
        stds = np.array([term.std for term in self.terms])
        return self._roots(self.damping(unwhiten(self.terms, stds, self.start())))

    def roots(self, theta: FloatArray, near: TrackedRoots | None = None) -> TrackedRoots | None:
        """Give the damped roots that belong to the targets; see `Phase`.

        Parameters
        ----------
        theta : (p,) array
            Parameters.
        near : TrackedRoots, optional
            Not needed: damping leaves shapes nearly as they are.

        Returns
        -------
        TrackedRoots or None
            rad/s; None where the damping matrix is indefinite.
        """
        del near
        damping = self.damping(theta)
        if np.linalg.eigvalsh(damping)[0] < -INDEFINITE * self.rates.max():
            return None
        return self._roots(damping)

    def _roots(self, damping: FloatArray) -> TrackedRoots:
        order = len(self.eigenvalues)
        return with_damping(self.wanted, self.undamped, np.eye(order), damping, np.diag(self.eigenvalues))

    def errors(self, tracked: TrackedRoots) -> FloatArray:
        """Give targets minus model.

        Parameters
        ----------
        tracked : TrackedRoots
            Damped roots of the model.

        Returns
        -------
        (n,) array
            Errors of the real parts over their sizes.
        """
        return np.asarray((self.targets + tracked.values(len(self.targets)).real) / self.sizes)

    def slopes(self, theta: FloatArray, tracked: TrackedRoots) -> FloatArray:
        """Give the derivatives of the real parts with their sign changed.

        Parameters
        ----------
        theta : (p,) array
            Parameters.
        tracked : TrackedRoots
            Roots for these parameters.

        Returns
        -------
        (n, p) array
            Over the sizes, per unit of the parameters.
        """
        row, column = self.pairs
        own = self._of_modes(theta)
        rates = self._factors(theta)
        couplings = np.sqrt(rates[row] * rates[column])
        result = np.zeros((len(self.targets), len(theta)))
        for places, roots in tracked.groups:
            # by each entry of the damping matrix: -s y x^T / slope; every parameter is a sum over entries
            weights = (roots.values / roots.slope)[:, None, None]
            entries = (weights * roots.left_vectors.T[:, :, None] * roots.right_vectors.T[:, None, :]).real
            by_mode = (entries * own).sum(axis=2) / 2 + (entries * own).sum(axis=1) / 2
            by_coupling = (entries[:, row, column] + entries[:, column, row]) * couplings
            by_chosen = np.tensordot(entries, self.chosen, ([1, 2], [1, 2]))
            result[places] = np.hstack([by_mode.sum(axis=1, keepdims=True), by_mode, by_coupling, by_chosen])
        return result / self.sizes[:, None]

    def _factors(self, theta: FloatArray) -> FloatArray:
        """Rates of the modes."""
        return np.asarray(self.rates * np.exp(theta[..., :1] + theta[..., 1 : 1 + len(self.rates)]))

    def shown(self, theta: FloatArray) -> dict[str, float]:
        """Give the factor on every mode's damping.

        Parameters
        ----------
        theta : (p,) array
            Parameters.

        Returns
        -------
        dict of str to float
            By mode.
        """
        factors = np.exp(theta[0] + theta[1 : 1 + len(self.rates)])
        return {f"damping of mode {mode}": float(factor) for mode, factor in enumerate(factors, 1)}

    def largest_part(self, theta: FloatArray, wanted: FloatArray) -> float:
        """Keep every logarithm within the largest step.

        Parameters
        ----------
        theta, wanted : (p,) array
            Where the step starts and ends.

        Returns
        -------
        float
            At most 1.
        """
        largest = float(np.abs((wanted - theta)[: 1 + len(self.rates)]).max())
        return min(1.0, LARGEST_STEP / max(largest, np.finfo(float).tiny))


def damping_phase(
    basis: ParameterBasis,
    inner: ModalFrame,
    wanted: TargetRoots,
    matrix: FloatArray,
    dashpots: FloatArray,
    values: ComplexArray,
    covariance: FloatArray,
    moduli: FloatArray,
) -> DampingPhase:
    """Set up the damping phase.

    Parameters
    ----------
    basis : ParameterBasis
        Parameters in the coordinates of the stiffness phase.
    inner : ModalFrame
        Modes of the model with updated stiffness, in the same coordinates.
    wanted : TargetRoots
        Which roots are targets, with rows in the inner coordinates.
    matrix : (r, r) array
        The nominal damping matrix in the inner coordinates.
    dashpots : (r, r) array
        The part of it that belongs to no mode; zero where there is none.
    values : (n,) complex array
        Measured poles and zeros, rad/s.
    covariance : (n, n) array
        Of their real parts, (rad/s)^2.
    moduli : (n,) array
        Moduli of the model's undamped roots that belong to the targets, rad/s.

    Returns
    -------
    DampingPhase
        Ready to iterate.
    """
    usual = max(float(np.median(damping_ratio(values))), SMALLEST_RATIO)
    omega = np.sqrt(inner.eigenvalues)
    matrix = matrix - dashpots
    nominal = np.diagonal(matrix)
    rates = np.where(nominal > NO_DAMPING * usual * omega, nominal, 2 * usual * omega)
    roots = np.sqrt(np.where(rates > 0, rates, 1.0))
    shape = matrix / roots[:, None] / roots
    np.fill_diagonal(shape, 1.0)
    chosen, terms = _chosen(basis, inner, dashpots)
    sizes = np.maximum(np.abs(values.real), SMALL_DAMPING * usual * np.abs(values))
    return DampingPhase(
        eigenvalues=inner.eigenvalues,
        rates=rates,
        shape=shape,
        dashpots=dashpots,
        chosen=chosen,
        terms=_make_terms(len(rates), len(chosen), terms),
        undamped=nominal_roots(wanted, np.eye(len(rates)), np.diag(inner.eigenvalues), moduli.astype(complex)),
        wanted=wanted,
        targets=-values.real,
        sizes=sizes,
        pairs=np.triu_indices(len(rates), 1),
        noise=covariance / np.outer(sizes, sizes) + SMALLEST_NOISE**2 * np.eye(len(values)),
    )


def _chosen(basis: ParameterBasis, inner: ModalFrame, dashpots: FloatArray) -> tuple[FloatArray, tuple[PriorTerm, ...]]:
    """Give damping matrices that a diagnosis has chosen and that of the dashpots, and the prior of their factors."""
    own = ~np.any(basis.stiffness, axis=(1, 2)) & ~np.any(basis.mass, axis=(1, 2)) & np.any(basis.damping, axis=(1, 2))
    matrices = [*inner.inside(basis.damping[own]), *([dashpots] if np.any(dashpots) else [])]
    places = np.eye(len(matrices))
    count = int(own.sum())
    terms = [replace(term, root=places[:, :count] @ term.root[own]) for term in basis.terms if np.any(term.root[own])]
    if len(matrices) > count:
        terms.append(
            PriorTerm(name="a factor on the dampers", root=places[:, count:], std=DASHPOT_STD, scale_uncertainty=0.0)
        )
    return np.reshape(matrices, (len(matrices), *dashpots.shape)), tuple(terms)


def _make_terms(order: int, extra: int, chosen: tuple[PriorTerm, ...]) -> tuple[PriorTerm, ...]:
    """Prior of all parameters, given that of the extra, chosen ones alone."""
    couplings = order * (order - 1) // 2
    own = 1 + order + couplings
    places = np.eye(own + extra)
    terms = [
        PriorTerm(name="a factor on the damping", root=places[:, :1], std=COMMON_STD, scale_uncertainty=0.0),
        PriorTerm(name="damping of each mode", root=places[:, 1 : 1 + order], std=MODE_STD, scale_uncertainty=0.7),
        PriorTerm(
            name="coupling of modes by damping",
            root=places[:, 1 + order : own],
            std=COUPLING_STD,
            scale_uncertainty=0.0,
        ),
    ]
    for term in chosen:
        root = np.vstack([np.zeros((own, term.root.shape[1])), term.root])
        terms.append(replace(term, root=root))
    return tuple(terms)
