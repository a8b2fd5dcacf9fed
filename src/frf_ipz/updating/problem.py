"""Input of every updating method: matrices, targets with their covariance, and parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np
from scipy import sparse

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.identification.root_covariance import RootCovariance, pair_blocks
from frf_ipz.pairing.poles import probability_of_modes
from frf_ipz.updating.parameters import ParameterBasis
from frf_ipz.updating.tracking import TargetRoots, nearest_roots

if TYPE_CHECKING:
    from frf_ipz.frf import FrfLabel
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.pairing.pairs import Pairs
    from frf_ipz.structure import ReducedModel


class PairAgain(Protocol):
    """Pairs with models that have been updated; see `pairing_again`."""

    @property
    def pairs(self) -> Pairs:
        """Pairs with the nominal model."""

    def with_model(
        self, problem: UpdateProblem, model: ReducedModel, pairs: Pairs, values: ComplexArray
    ) -> tuple[Pairs, UpdateProblem] | None:
        """Pair with an updated model; None where all measured poles keep their counterparts."""

    def deviation_db(self, model: ReducedModel) -> float:
        """Tell how far a model is from the measured FRFs."""

    def named_before(self, again: Pairs, nominal: ReducedModel, values: ComplexArray) -> Pairs:
        """Name pairs with an updated model by the roots of the model before."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class UpdateProblem:
    """A reduced model, and the poles and zeros that it has to meet.

    Parameters
    ----------
    model : ReducedModel
        The nominal model.
    labels : tuple of FrfLabel
        The measured FRFs.
    values, computed : (n,) complex array
        Measured and nominal poles and zeros, imaginary part >= 0, rad/s; poles first.
    covariance : (2 n, 2 n) array, or RootCovariance
        Of the real and the imaginary part of each measured one in turn, (rad/s)^2.
    frf : (n,) int array
        Which FRF a zero belongs to; -1 for poles.
    names : tuple of str
        Each target in words.
    basis : ParameterBasis, optional
        Parameters chosen by a diagnosis, or those of the FE model's parts; None for the method's own generic ones.
    pair_again : PairAgain, optional
        Pairs with a model that has been updated; None where the pairs are to stand.
    n_without_counterpart : int
        Measured poles that the model has none for.
    """

    model: ReducedModel
    labels: tuple[FrfLabel, ...]
    values: ComplexArray
    computed: ComplexArray
    covariance: FloatArray | RootCovariance
    frf: IntArray
    names: tuple[str, ...]
    basis: ParameterBasis | None = None
    pair_again: PairAgain | None = None
    n_without_counterpart: int = 0

    @property
    def frfs(self) -> tuple[int, ...]:
        """The FRFs that have zeros among the targets."""
        return tuple(int(number) for number in np.unique(self.frf[self.frf >= 0]))

    @property
    def at_ports(self) -> FloatArray:
        """Rows of all that was measured and excited, (2 n_frfs, r)."""
        rows = [row for number in range(len(self.labels)) for row in self.rows(number)]
        return np.array(rows).reshape(-1, len(self.model.mass))

    def rows(self, frf: int) -> tuple[FloatArray, FloatArray]:
        """Output and input row of an FRF, each (r,).

        Parameters
        ----------
        frf : int
            Its number.

        Returns
        -------
        tuple of (r,) arrays
            Motion of the sensor's and of the excited DOF for unit motions of the retained ones.
        """
        label = self.labels[frf]
        return self.model.row(label.output_dof), self.model.row(label.input_dof)

    def nearest_roots(self, model: ReducedModel, reference: ComplexArray) -> ComplexArray:
        """Find the poles and zeros of a model nearest to given ones.

        Parameters
        ----------
        model : ReducedModel
            The model, changed or not.
        reference : (n,) complex array
            One value for each target, rad/s.

        Returns
        -------
        (n,) complex array
            The model's, one to one, imaginary part > 0, rad/s.
        """
        targets = TargetRoots(frf=self.frf, rows={number: self.rows(number) for number in self.frfs})
        return nearest_roots(targets, reference, model.mass, model.damping, model.stiffness)


def make_problem(model: ReducedModel, fit: ModalFit, pairs: Pairs, basis: ParameterBasis | None) -> UpdateProblem:
    """Collect the targets of an update.

    Parameters
    ----------
    model : ReducedModel
        The nominal model.
    fit : ModalFit
        Poles and zeros as measured, with their covariance.
    pairs : Pairs
        Measured poles and zeros with their counterparts.
    basis : ParameterBasis, optional
        Parameters to use.

    Returns
    -------
    UpdateProblem
        The paired poles and zeros, in the order of `Pairs.targets`.
    """
    targets = pairs.targets
    indices = np.array([pair.measured + (fit.n_modes if pair.kind == "zero" else 0) for pair in targets], int)
    parts = (2 * indices[:, None] + np.arange(2)).ravel()
    return UpdateProblem(
        model=model,
        labels=fit.labels,
        values=np.array([pair.measured_value for pair in targets], complex),
        computed=np.array([pair.computed_value for pair in targets], complex),
        covariance=_as_often_as_found(_selected(fit.covariance, parts), indices, probability_of_modes(fit)),
        frf=np.array([pair.frf for pair in targets], int),
        names=tuple(_name(pair.kind, pair.frf, pair.measured_value, fit) for pair in targets),
        basis=basis,
        n_without_counterpart=pairs.count("pole").missing,
    )


def _selected(covariance: FloatArray | RootCovariance, parts: IntArray) -> FloatArray | RootCovariance:
    return covariance.select(parts) if isinstance(covariance, RootCovariance) else covariance[np.ix_(parts, parts)]


def _as_often_as_found(
    covariance: FloatArray | RootCovariance, indices: IntArray, probability: FloatArray
) -> FloatArray | RootCovariance:
    """Let a mode that is found again with probability p tell p times as much: its own variance is divided by p."""
    is_pole = indices < len(probability)
    share = np.ones(len(indices))
    share[is_pole] = np.maximum(probability[indices[is_pole]], np.finfo(float).eps)
    added = (1 / share - 1)[:, None, None] * pair_blocks(covariance)
    if not added.any():
        return covariance
    blocks = sparse.block_diag(tuple(added), format="csr")
    if isinstance(covariance, RootCovariance):
        return replace(covariance, blocks=sparse.csr_array(covariance.blocks + blocks))
    return np.asarray(covariance + blocks.toarray())


def _name(kind: str, frf: int, value: complex, fit: ModalFit) -> str:
    where = f" of {fit.labels[frf]}" if kind == "zero" else ""
    return f"{kind} at {abs(value) / (2 * np.pi):.6g} Hz{where}"
