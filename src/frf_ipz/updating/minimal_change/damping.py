"""The smallest change of damping that brings the real parts of poles and zeros to their targets.

In mass-normalised modal coordinates the damping matrix is ``E^1/2 (C + O) E^1/2 + (1 + d) D``: E holds the modes' rates
``2 zeta omega``, each multiplied by a factor whose logarithm is a parameter (one more is common to all modes), C is the
nominal matrix scaled to a unit diagonal, O couples modes. Rates stay positive whatever the parameters, and the prior
of the common factor states that the damping of a model is rarely known better than its order of magnitude. D are the
dampers of a model that states damping ratios too: they couple modes far more than modal damping does, and are known
better.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.numerics.low_rank import PAIRS_AT_ONCE, factorise, of_entries
from frf_ipz.rational import damping_ratio
from frf_ipz.updating.minimal_change.modal_frame import ModalFrame
from frf_ipz.updating.parameters import ParameterBasis, PriorTerm, unwhiten
from frf_ipz.updating.target_noise import TargetNoise
from frf_ipz.updating.tracking import TargetRoots, TrackedRoots, nominal_roots, with_damping

COMMON_STD = 1.5  # of the logarithm of the factor common to all modes
MODE_STD = 0.3  # of the logarithm of the factor of each mode
WIDEST = float(np.exp(1.0))  # of a mode's rate, more than three standard deviations of its logarithm
DASHPOT_STD = 0.1  # of the relative change of all dampers
COUPLING_STD = 0.1  # of a coupling, relative to the two modes' rates
LARGEST_STEP = 1.5  # of a logarithm in one iteration: the real part is not linear in it
SMALL_DAMPING = 0.2  # of the typical damping ratio: errors of smaller real parts are relative to this
SMALLEST_RATIO = 1e-5  # lower bound of the typical damping ratio
SMALLEST_NOISE = 1e-4  # relative standard deviation of a real part: none is measured better
NO_DAMPING = 1e-3  # of the typical rate: a model with less states no damping for that mode
POLE_SLACK = 1e-3  # relative standard deviation of a pole's real part that no damping matrix explains
ZERO_SLACK = 0.02  # the same of a zero, which depends on mode shapes too, and these are not known better
MOST_COUPLED_MODES = 48  # the lowest: as many as may change each other's stiffness; higher ones lie far above the band
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
    extra : (q, r, r) array
        Damping matrices for one unit of parameters from a diagnosis; last that of the dashpots, if any.
    terms : tuple of PriorTerm
        Prior of all parameters: common, each mode's, couplings, extra ones.
    undamped : TrackedRoots
        Squared roots of the same model without damping that belong to the targets.
    target_roots : TargetRoots
        Poles and zeros that are targets.
    targets : (n,) array
        Measured real parts with their sign changed, rad/s.
    sizes : (n,) array
        Sizes to which errors are relative, rad/s.
    noise : TargetNoise
        Covariance of the targets over their sizes, and of what shapes, not damping, make of the real parts.
    pairs : pair of (n_couplings,) int arrays
        Rows and columns of the couplings.
    """

    eigenvalues: FloatArray
    rates: FloatArray
    shape: FloatArray
    dashpots: FloatArray
    extra: FloatArray
    terms: tuple[PriorTerm, ...]
    undamped: TrackedRoots
    target_roots: TargetRoots
    targets: FloatArray
    sizes: FloatArray
    noise: TargetNoise
    pairs: tuple[IntArray, IntArray]

    @property
    def slack(self) -> FloatArray:
        """Standard deviations of what no parameter explains, (n,)."""
        return np.where(self.target_roots.frf < 0, POLE_SLACK, ZERO_SLACK)

    def damping(self, theta: FloatArray) -> FloatArray:
        """Give the damping matrix for some parameters.

        Parameters
        ----------
        theta : (..., p) array
            Common logarithm, each mode's, couplings, extra parameters.

        Returns
        -------
        (..., r, r) array
            Damping matrix.
        """
        amounts = theta[..., 1 + len(self.rates) + len(self.pairs[0]) :]
        return np.asarray(self._modal_damping(theta) + self.dashpots + np.tensordot(amounts, self.extra, 1))

    def _modal_damping(self, theta: FloatArray) -> FloatArray:
        """Damping that belongs to modes, (..., r, r) array."""
        first = 1 + len(self.rates)
        row, column = self.pairs
        roots = np.sqrt(self._mode_rates(theta))
        coupled = np.broadcast_to(self.shape, (*theta.shape[:-1], *self.shape.shape)).copy()
        couplings = theta[..., first : first + len(row)]
        coupled[..., row, column] += couplings
        coupled[..., column, row] += couplings
        return np.asarray(coupled * roots[..., :, None] * roots[..., None, :])

    def start(self) -> FloatArray:
        """Give whitened parameters to start from: the nominal damping times the typical factor of the poles."""
        whitened = np.zeros(sum(term.root.shape[1] for term in self.terms))
        poles = self.target_roots.frf < 0
        nominal = self._roots(self.damping(np.zeros(self.terms[0].root.shape[0])))
        ratios = self.targets[poles] / -nominal.values(len(poles))[poles].real
        if np.any(ratios > 0):
            whitened[0] = np.log(np.median(ratios[ratios > 0])) / self.terms[0].std
        return whitened

    def initial_roots(self) -> TrackedRoots:
        """Give the roots of the model to start from."""
        stds = np.array([term.std for term in self.terms])
        return self._roots(self.damping(unwhiten(self.terms, stds, self.start())))

    def roots(self, theta: FloatArray, reference: TrackedRoots | None = None) -> TrackedRoots | None:
        """Give the damped roots that belong to the targets; see `Phase`.

        Parameters
        ----------
        theta : (p,) array
            Parameters.
        reference : TrackedRoots, optional
            Not needed: damping hardly changes shapes.

        Returns
        -------
        TrackedRoots or None
            rad/s; None where the damping matrix is indefinite.
        """
        del reference
        damping = self.damping(theta)
        if np.linalg.eigvalsh(damping)[0] < -INDEFINITE * self.rates.max():
            return None
        return self._roots(damping)

    def _roots(self, damping: FloatArray) -> TrackedRoots:
        order = len(self.eigenvalues)
        return with_damping(self.target_roots, self.undamped, np.eye(order), damping, np.diag(self.eigenvalues))

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
        modal_damping = self._modal_damping(theta)
        rates = self._mode_rates(theta)
        couplings = np.sqrt(rates[row] * rates[column])
        result = np.empty((len(self.targets), len(theta)))
        extra, by_coupling = factorise(self.extra), of_entries(row, column)
        ends = np.cumsum([1, len(rates), len(row)])
        for indices, roots in tracked.groups:
            # by each entry of the damping matrix: -s y x^T / slope; every parameter is a sum over entries
            x, y = roots.right_vectors, roots.left_vectors * (roots.values / roots.slope)
            by_mode = (y * (modal_damping @ x) + x * (modal_damping @ y)).real.T / 2
            for first in range(0, len(indices), PAIRS_AT_ONCE):
                part = slice(first, first + PAIRS_AT_ONCE)
                rows = np.empty((len(indices[part]), len(theta)))
                rows[:, :1] = by_mode[part].sum(axis=1, keepdims=True)
                rows[:, 1 : ends[1]] = by_mode[part]
                rows[:, ends[1] : ends[2]] = by_coupling.forms(y[:, part], x[:, part]) * couplings
                rows[:, ends[2] :] = extra.forms(y[:, part], x[:, part])
                result[indices[part]] = rows / self.sizes[indices[part], None]
        return result

    def beyond_damping(self) -> FloatArray:
        """Give how far zeros lie beyond what damping can make of them, whatever the rate of each mode.

        Where two zeros nearly meet, damping and shapes part them, and their real parts are large and of both signs.
        What modes with up to `WIDEST` of their rates make, or of those of their measured poles, is between the sums of
        their negative and of their positive shares.

        Returns
        -------
        (n,) array
            Relative to the sizes; 0 within, and of poles.
        """
        start = unwhiten(self.terms, np.array([term.std for term in self.terms]), self.start())
        roots = self.initial_roots()
        slopes, measured = self.slopes(start, roots), self.targets / self.sizes
        computed = measured - self.errors(roots)
        of_modes, poles = slopes[:, 1 : 1 + len(self.rates)], self.target_roots.poles
        shares = np.column_stack([of_modes, computed - of_modes.sum(axis=1)])  # last that of dampers
        if len(poles):
            modes = np.argmax(np.abs(roots.groups[0][1].right_vectors), axis=0)
            shares[:, modes] *= np.maximum(measured[poles] / computed[poles], 1.0)
        spread = np.zeros(len(slopes))
        for term in self.terms[2:]:
            spread += term.std**2 * np.sum(term.by_whitened(slopes) ** 2, axis=1)
        least = WIDEST * (np.minimum(shares, 0.0).sum(axis=1) - np.sqrt(spread))
        most = WIDEST * (np.maximum(shares, 0.0).sum(axis=1) + np.sqrt(spread))
        beyond = np.maximum(np.maximum(least - measured, measured - most), 0.0)
        return np.where(self.target_roots.frf < 0, 0.0, beyond)

    def _mode_rates(self, theta: FloatArray) -> FloatArray:
        """Rates of the modes."""
        return np.asarray(self.rates * np.exp(theta[..., :1] + theta[..., 1 : 1 + len(self.rates)]))

    def history_columns(self, theta: FloatArray) -> dict[str, float]:
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

    def max_step_fraction(self, theta: FloatArray, proposed: FloatArray) -> float:
        """Limit every logarithm to the largest step.

        Parameters
        ----------
        theta, proposed : (p,) array
            Parameters before and after the step.

        Returns
        -------
        float
            At most 1.
        """
        largest = float(np.abs((proposed - theta)[: 1 + len(self.rates)]).max())
        return min(1.0, LARGEST_STEP / max(largest, np.finfo(float).tiny))


def damping_phase(
    basis: ParameterBasis,
    turn: FloatArray,
    inner: ModalFrame,
    target_roots: TargetRoots,
    matrix: FloatArray,
    dashpots: FloatArray,
    values: ComplexArray,
    noise: TargetNoise,
    undamped: ComplexArray,
) -> DampingPhase:
    """Set up the damping phase.

    Parameters
    ----------
    basis : ParameterBasis
        Parameters in the coordinates of the model.
    turn : (r, r) array
        Motion of these for unit motions of the inner ones.
    inner : ModalFrame
        Modes of the model with updated stiffness, in the coordinates of the stiffness phase.
    target_roots : TargetRoots
        Poles and zeros that are targets, with rows in the inner coordinates.
    matrix : (r, r) array
        The nominal damping matrix in the inner coordinates.
    dashpots : (r, r) array
        The part of it that belongs to no mode; zero where there is none.
    values : (n,) complex array
        Measured poles and zeros, rad/s.
    noise : TargetNoise
        Covariance of their real parts, (rad/s)^2.
    undamped : (n,) complex array
        The model's undamped roots that belong to the targets, rad/s.

    Returns
    -------
    DampingPhase
        Ready to iterate.
    """
    typical_ratio = max(float(np.median(damping_ratio(values))), SMALLEST_RATIO)
    omega = np.sqrt(np.maximum(inner.eigenvalues, 0.0))
    matrix = matrix - dashpots
    nominal = np.diagonal(matrix)
    rates = np.where(nominal > NO_DAMPING * typical_ratio * omega, nominal, 2 * typical_ratio * omega)
    roots = np.sqrt(np.where(rates > 0, rates, 1.0))
    shape = matrix / roots[:, None] / roots
    np.fill_diagonal(shape, 1.0)
    extra, terms = _extra_parameters(basis, turn, dashpots)
    sizes = np.maximum(np.abs(values.real), SMALL_DAMPING * typical_ratio * np.abs(values))
    target_undamped = nominal_roots(target_roots, np.eye(len(rates)), np.diag(inner.eigenvalues), undamped)
    from_shapes = _real_parts(target_undamped, len(values)) / sizes
    pairs = np.triu_indices(min(len(rates), MOST_COUPLED_MODES), 1)
    phase = DampingPhase(
        eigenvalues=inner.eigenvalues,
        rates=rates,
        shape=shape,
        dashpots=dashpots,
        extra=extra,
        terms=_prior_terms(len(rates), len(pairs[0]), len(extra), terms),
        undamped=target_undamped,
        target_roots=target_roots,
        targets=-values.real,
        sizes=sizes,
        pairs=pairs,
        noise=noise.over(sizes).plus(SMALLEST_NOISE**2 + from_shapes**2),
    )
    return replace(phase, noise=phase.noise.plus(phase.beyond_damping() ** 2))


def _real_parts(undamped: TrackedRoots, count: int) -> FloatArray:
    """Real parts, rad/s, that zeros have without damping: of shapes, they say nothing of damping and are not known."""
    return np.asarray(np.abs(np.sqrt(-undamped.values(count)).real))


def _extra_parameters(
    basis: ParameterBasis, turn: FloatArray, dashpots: FloatArray
) -> tuple[FloatArray, tuple[PriorTerm, ...]]:
    """Damping matrices of a diagnosis and that of the dashpots, with the prior of their factors."""
    is_damping = (
        ~np.any(basis.stiffness, axis=(1, 2)) & ~np.any(basis.mass, axis=(1, 2)) & np.any(basis.damping, axis=(1, 2))
    )
    matrices = [*(turn.T @ basis.damping[is_damping] @ turn), *([dashpots] if np.any(dashpots) else [])]
    unit = np.eye(len(matrices))
    count = int(is_damping.sum())
    terms = [
        replace(term, root=unit[:, :count] @ term.root[is_damping])
        for term in basis.terms
        if np.any(term.root[is_damping])
    ]
    if len(matrices) > count:
        terms.append(
            PriorTerm(name="a factor on the dampers", root=unit[:, count:], std=DASHPOT_STD, scale_uncertainty=0.0)
        )
    return np.reshape(matrices, (len(matrices), *dashpots.shape)), tuple(terms)


def _prior_terms(order: int, couplings: int, n_extra: int, extra: tuple[PriorTerm, ...]) -> tuple[PriorTerm, ...]:
    """Prior of all parameters, from that of the extra ones."""
    n_modal = 1 + order + couplings
    unit = np.eye(n_modal + n_extra)
    terms = [
        PriorTerm(name="a factor on the damping", root=unit[:, :1], std=COMMON_STD, scale_uncertainty=0.0),
        PriorTerm(name="damping of each mode", root=unit[:, 1 : 1 + order], std=MODE_STD, scale_uncertainty=0.7),
        PriorTerm(
            name="coupling of modes by damping",
            root=unit[:, 1 + order : n_modal],
            std=COUPLING_STD,
            scale_uncertainty=0.0,
        ),
    ]
    for term in extra:
        root = np.vstack([np.zeros((n_modal, term.root.shape[1])), term.root])
        terms.append(replace(term, root=root))
    return tuple(terms)
