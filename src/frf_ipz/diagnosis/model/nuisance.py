"""Nuisance parameters: what a nominal model may be wrong by within the stated tolerances, and its prior.

Small errors of mass and stiffness, wherever they are, act on the modes of the band as symmetric matrices: stiffness
``omega_i omega_j kappa_ij`` and mass ``mu_ij``. Their diagonals are the scatter of the frequencies, the rest that of
the shapes, and with it of the zeros. What modes lose scatters in the same way: damping ratios, and what damping couples
two modes by, ``2 (zeta_i omega_i zeta_j omega_j)^(1/2)`` times a number that is zero only where damping is proportional
to mass and stiffness everywhere. Positions and directions of sensors and excited points, and gains of channels come
beside. A tolerance is the half width of what can be, so that the standard deviation is the tolerance over the square
root of three. Nothing that is stated by a tolerance lies far outside of it: there the prior rises much faster than a
normal one. Shapes of modes, and all about modes beyond the band, are stated by no tolerance and keep a normal prior.

Near an excited point FRFs contain the local compliance around the contact, which depends on its size and which no mesh
represents well: the compliance of all modes beyond those with scatter is not known exactly.

Gains multiply the model's FRFs. As errors in proportion to the measured FRFs they would follow their noise, and bias
every fit to smaller FRFs by the product of their variance and the number of points.

[dAgostini1994] G. D'Agostini, On the use of the covariance matrix to fit correlated data, Nuclear Instruments and
Methods in Physics Research A 346 (1994) 306-311.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from itertools import accumulate
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import BoolArray, FloatArray, IntArray
from frf_ipz.diagnosis.model.layout import (
    AXES,
    list_turns,
    make_motion_row,
    make_shift_rows,
    make_turn_rows,
    measure_extents,
    shear_slope_at_force,
)
from frf_ipz.dofs import Dof
from frf_ipz.fe.beam_models import with_formulation
from frf_ipz.fe.eigen import damping_ratios, solve_basis
from frf_ipz.fe.kinds.beam import BeamFile

if TYPE_CHECKING:
    from frf_ipz.diagnosis.model.basis import Basis
    from frf_ipz.diagnosis.model.layout import Layout
    from frf_ipz.diagnosis.options import DiagnoseOptions
    from frf_ipz.dofs import AnyDof

UNIFORM_STD = 1 / np.sqrt(3.0)  # standard deviation of what is uniform between -1 and 1
OFF_DIAGONAL = 0.5  # stiffness, mass and damping between two modes, over those of one: fields average out
MASS_PART = 0.5  # tolerance of masses over that of stiffness
SUSPENSION_FREQUENCY = 0.02  # frequency of a free structure on its suspension, over its first elastic one
MODES_BEYOND = 2.0  # times the top of the band: modes with scatter of their own
LOWERED = 1.2  # times the top of the band: modes that shear would bring there
MAX_MODES = 16
LESS_CONVERGED = 20.0  # growth of a mode's error with its frequency over the top of the band: meshes suit the band
REDUCED = 80.0  # the same with the square: what is far beyond the band may be lost in a reduction
LOCAL_PART = 0.05  # of the compliance of all modes beyond those with scatter: what is not known
MAX_GAIN = 2.0  # logarithm: no step on the way to a fit goes farther
EDGE = 2.0  # standard deviations, a little more than a tolerance: beyond, its prior rises faster
STEEPNESS = 1.0  # per standard deviation: how much faster
MAX_BEYOND_EDGE = 4.0  # standard deviations beyond the edge: from there on no faster, or fits would not get back
TURNED = "turned to "  # before an axis: a direction that is not exact, beside a position that is not
UNSTATED_SPREAD = 0.5  # of a damping ratio that is not stated: on its suspension, or far beyond the band


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NuisanceValues:
    """Values of all nuisance parameters.

    Parameters
    ----------
    kappa, mu : (m, m) array
        Relative errors of stiffness and mass on the first modes, symmetric.
    damping : (m,) array
        Relative errors of damping ratios.
    coupling : (m, m) array
        What damping couples the first modes by, over the geometric mean of their own; symmetric, zero on the diagonal.
    suspension : (n_rigid,) array
        Squared frequencies of rigid-body modes, (rad/s)^2.
    output_shift, input_shift : (n, n_axes) array
        Distances of sensors and excited points from their nominal positions, m, and angles to their directions, rad.
    local : (n_frfs,) array
        Errors of the compliance that modes beyond those with scatter give to the FRFs, m/N.
    gains : (n_channels,) array
        Relative errors of the channels' gains, as logarithms.
    """

    kappa: FloatArray
    mu: FloatArray
    damping: FloatArray
    coupling: FloatArray
    suspension: FloatArray
    output_shift: FloatArray
    input_shift: FloatArray
    local: FloatArray
    gains: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class NuisanceBlocks:
    """Where each kind of nuisance parameter stands among all of them.

    Parameters
    ----------
    stiffness, mass : slice
        Upper triangles of kappa and mu, row by row.
    damping : slice
        Relative errors of damping ratios.
    coupling : slice
        What damping couples two modes by, of those pairs that it may couple.
    suspension : slice
        Squared frequencies of rigid-body modes.
    output_shifts, input_shifts : slice
        Distances of sensors and excited points from their nominal positions and angles to their directions; of each,
        along one axis after the other.
    local : slice
        Errors of the local compliance of the FRFs.
    gains : slice
        Errors of the channels' gains.
    """

    stiffness: slice
    mass: slice
    damping: slice
    coupling: slice
    suspension: slice
    output_shifts: slice
    input_shifts: slice
    local: slice
    gains: slice

    @classmethod
    def in_order(cls, **sizes: int) -> NuisanceBlocks:
        """Place blocks of some sizes one after the other."""
        ends = accumulate(sizes.values())
        return cls(**{name: slice(end - size, end) for (name, size), end in zip(sizes.items(), ends, strict=True)})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NuisancePrior:
    """Prior of the nuisance parameters, each in units of its standard deviation.

    Parameters
    ----------
    n_modes, n_rigid : int
        Modes with scatter, rigid-body modes among them.
    kappa_std, mu_std : (m, m) array
        Standard deviations.
    damping_std : (m,) array
        Of damping ratios, relative.
    coupling_std : (m, m) array
        Of what damping couples modes by, over the geometric mean of their own damping.
    suspension_std : float
        Of squared frequencies of rigid-body modes, (rad/s)^2.
    axes : tuple of str
        Along which positions are uncertain, and, after `TURNED`, towards which directions are.
    shift_std : (n_axes,) array
        m, and rad.
    n_outputs, n_inputs : int
        Sensor positions and excited points.
    local_std : (n_frfs,) array
        Of the compliance of modes beyond those with scatter, m/N, with the signs of the FRFs.
    n_channels : int
        Channels with gains.
    gain_std : float
        Of gains, relative.
    is_stated : (m,) bool array
        Modes whose frequency and damping a tolerance states: elastic ones of the band.
    """

    n_modes: int
    n_rigid: int
    kappa_std: FloatArray
    mu_std: FloatArray
    damping_std: FloatArray
    coupling_std: FloatArray
    suspension_std: float
    axes: tuple[str, ...]
    shift_std: FloatArray
    n_outputs: int
    n_inputs: int
    local_std: FloatArray
    n_channels: int
    gain_std: float
    is_stated: BoolArray

    @property
    def pairs(self) -> tuple[IntArray, IntArray]:
        """Rows and columns of the upper triangle of kappa and mu."""
        return _triangle(self.n_modes)

    @property
    def is_coupled(self) -> BoolArray:
        """Which of all pairs damping may couple, (n_pairs,) array."""
        return np.asarray(self.coupling_std[self.pairs] > 0)

    @property
    def blocks(self) -> NuisanceBlocks:
        """Where each kind of parameter stands."""
        n_axes = len(self.axes)
        shifts = n_axes * self.n_outputs, n_axes * self.n_inputs
        n_coupled = int(np.count_nonzero(self.is_coupled))
        return _place_blocks(self.n_modes, n_coupled, self.n_rigid, *shifts, len(self.local_std), self.n_channels)

    @property
    def size(self) -> int:
        """Number of all parameters."""
        return int(self.blocks.gains.stop)

    @property
    def frequency_indices(self) -> IntArray:
        """Where the relative errors of the squared frequencies, kappa_ii, stand among the parameters."""
        rows, columns = self.pairs
        return np.asarray(_indices(self.blocks.stiffness)[rows == columns], np.int64)

    @property
    def damping_indices(self) -> IntArray:
        """Where the relative errors of the damping ratios stand among the parameters."""
        return _indices(self.blocks.damping)

    @property
    def gain_indices(self) -> IntArray:
        """Where the gains stand among the parameters."""
        return _indices(self.blocks.gains)

    @property
    def is_bounded(self) -> BoolArray:
        """Which parameters a tolerance bounds, (size,) array: frequencies, damping, positions and gains."""
        (rows, columns), blocks, is_bounded = self.pairs, self.blocks, np.zeros(self.size, bool)
        is_bounded[blocks.stiffness] = is_bounded[blocks.mass] = (rows == columns) & self.is_stated[rows]
        is_bounded[blocks.damping] = self.is_stated
        is_bounded[blocks.output_shifts] = is_bounded[blocks.input_shifts] = is_bounded[blocks.gains] = True
        return is_bounded

    def scaled_by(self, part: float) -> NuisancePrior:
        """Give the same with a part of the tolerances of stiffness, mass and frequencies.

        Parameters
        ----------
        part : float
            Of each standard deviation of `kappa` and `mu`.

        Returns
        -------
        NuisancePrior
            With the same parameters.
        """
        return replace(self, kappa_std=part * self.kappa_std, mu_std=part * self.mu_std)

    def rescale(self, values: FloatArray, part: float) -> FloatArray:
        """Give the same state in the standard deviations of `scaled_by`.

        Parameters
        ----------
        values : (size,) array
            Parameters in standard deviations.
        part : float
            As for `scaled_by`.

        Returns
        -------
        (size,) array
            Parameters in the other standard deviations.
        """
        rescaled = values.copy()
        for fields in (self.blocks.stiffness, self.blocks.mass):
            rescaled[fields] /= part
        return rescaled

    def whiten(self, values: FloatArray, *, is_bounded: bool = True) -> tuple[FloatArray, FloatArray]:
        """Transform parameters so that the prior's cost is half their sum of squares.

        Parameters
        ----------
        values : (size,) array
            Parameters in standard deviations.
        is_bounded : bool
            False for a normal prior of all.

        Returns
        -------
        whitened_nuisance : (size,) array
            As the parameters, but beyond the edge of a tolerance larger and larger.
        slopes : (size,) array
            Derivatives of the whitened parameters by the parameters.
        """
        if not is_bounded:
            return values, np.ones_like(values)
        outside = np.where(self.is_bounded, np.maximum(np.abs(values) - EDGE, 0.0), 0.0)
        curved = np.minimum(outside, MAX_BEYOND_EDGE)
        added = STEEPNESS * curved * (2 * outside - curved)
        return values + np.sign(values) * added, 1 + 2 * STEEPNESS * curved

    def unpack(self, values: FloatArray) -> NuisanceValues:
        """Give physical values.

        Parameters
        ----------
        values : (size,) array
            Parameters in standard deviations.

        Returns
        -------
        NuisanceValues
            The values.
        """
        blocks, n_axes = self.blocks, len(self.axes)
        return NuisanceValues(
            kappa=self._symmetric(values[blocks.stiffness]) * self.kappa_std,
            mu=self._symmetric(values[blocks.mass]) * self.mu_std,
            damping=np.maximum(values[blocks.damping] * self.damping_std, -0.95),
            coupling=self._symmetric(values[blocks.coupling], self.is_coupled) * self.coupling_std,
            suspension=values[blocks.suspension] * self.suspension_std,
            output_shift=values[blocks.output_shifts].reshape(self.n_outputs, n_axes) * self.shift_std,
            input_shift=values[blocks.input_shifts].reshape(self.n_inputs, n_axes) * self.shift_std,
            local=self.local_std * values[blocks.local],
            gains=np.clip(values[blocks.gains] * self.gain_std, -MAX_GAIN, MAX_GAIN),
        )

    def _symmetric(self, triangle: FloatArray, used: BoolArray | slice = slice(None)) -> FloatArray:
        rows, columns = (ends[used] for ends in self.pairs)
        matrix = np.zeros((self.n_modes, self.n_modes))
        matrix[rows, columns] = matrix[columns, rows] = triangle
        return matrix


def _indices(block: slice) -> IntArray:
    return np.arange(block.start, block.stop, dtype=np.int64)


@cache
def _place_blocks(
    n_modes: int, n_coupled: int, n_rigid: int, n_output_shifts: int, n_input_shifts: int, n_frfs: int, n_channels: int
) -> NuisanceBlocks:
    n_pairs = n_modes * (n_modes + 1) // 2
    return NuisanceBlocks.in_order(
        stiffness=n_pairs,
        mass=n_pairs,
        damping=n_modes,
        coupling=n_coupled,
        suspension=n_rigid,
        output_shifts=n_output_shifts,
        input_shifts=n_input_shifts,
        local=n_frfs,
        gains=n_channels,
    )


@cache
def _triangle(size: int) -> tuple[IntArray, IntArray]:
    rows, columns = np.triu_indices(size)
    return rows.astype(np.int64), columns.astype(np.int64)


def make_nuisance_prior(basis: Basis, layout: Layout, options: DiagnoseOptions) -> NuisancePrior:
    """Turn tolerances into standard deviations.

    Parameters
    ----------
    basis : Basis
        Of the nominal model.
    layout : Layout
        Sensors and excited points.
    options : DiagnoseOptions
        Tolerances.

    Returns
    -------
    NuisancePrior
        The parameters.
    """
    frequencies = basis.modes.omega_rad_s
    n_modes = max(
        int(np.count_nonzero(frequencies <= MODES_BEYOND * basis.highest_rad_s)), 1, _count_lowered_modes(basis)
    )
    n_modes = min(n_modes, MAX_MODES, len(frequencies))
    n_rigid = min(basis.modes.n_rigid, n_modes)
    stiffness, mass = options.stiffness_tolerance * UNIFORM_STD, MASS_PART * options.stiffness_tolerance * UNIFORM_STD
    kappa, mu = np.full((n_modes, n_modes), OFF_DIAGONAL * stiffness), np.full((n_modes, n_modes), OFF_DIAGONAL * mass)
    np.fill_diagonal(kappa, np.hypot(stiffness, 2 * options.frequency_tolerance * UNIFORM_STD))
    np.fill_diagonal(mu, mass)
    beyond = np.maximum(frequencies[:n_modes] / basis.highest_rad_s - 1, 0.0)
    growth = 1 + LESS_CONVERGED * beyond + REDUCED * beyond**2
    kappa *= np.sqrt(np.outer(growth, growth))
    kappa[:n_rigid] = kappa[:, :n_rigid] = 0.0
    first = frequencies[n_rigid] if len(frequencies) > n_rigid else 0.0
    span = measure_extents(basis.model)
    directions = {dof.direction for dof in (*(dof for _, dof in layout.outputs), *layout.inputs)}
    axes = tuple(axis for axis in span if directions != {axis})
    shift_std = np.array([options.position_tolerance_m_per_m * span[axis] * UNIFORM_STD for axis in axes])
    turned = _list_turns(basis, layout)
    turn_std = np.full(len(turned), np.deg2rad(options.angle_tolerance_deg) * UNIFORM_STD)
    damping = _damping_std(options.damping_tolerance * UNIFORM_STD, growth, n_rigid)
    beyond_scatter = LOCAL_PART * _local_compliance(basis, layout, n_modes)
    return NuisancePrior(
        n_modes=n_modes,
        n_rigid=n_rigid,
        kappa_std=kappa,
        mu_std=mu,
        damping_std=damping,
        coupling_std=_coupling_std(basis, damping, options.stiffness_tolerance),
        suspension_std=(SUSPENSION_FREQUENCY * first) ** 2,
        axes=(*axes, *turned),
        shift_std=np.concatenate([shift_std, turn_std]),
        n_outputs=len(layout.outputs),
        n_inputs=len(layout.inputs),
        local_std=np.copysign(np.hypot(beyond_scatter, _corner_compliance(basis, layout, shift_std)), beyond_scatter),
        n_channels=len(layout.channels),
        gain_std=options.gain_tolerance * UNIFORM_STD,
        is_stated=(np.arange(n_modes) >= n_rigid) & (beyond == 0),
    )


def _list_turns(basis: Basis, layout: Layout) -> tuple[str, ...]:
    """List the directions towards which sensors or impacts may be turned."""
    towards = {other.direction for dof in layout.dofs for other in list_turns(basis.model, dof)}
    return tuple(TURNED + axis for axis in AXES if axis in towards)


def _count_lowered_modes(basis: Basis) -> int:
    """Count the modes that shear, where a thick beam was modelled without it, could bring into the band."""
    source = basis.model.source
    if not isinstance(source, BeamFile) or source.beam.formulation != "euler-bernoulli":
        return 0
    squares = solve_basis(with_formulation(basis.model, "timoshenko")).eigenvalues
    return int(np.count_nonzero(np.sqrt(squares) <= LOWERED * basis.highest_rad_s))


def _damping_std(stated: float, growth: FloatArray, n_rigid: int) -> FloatArray:
    """Relative standard deviations of damping ratios: stated ratios are measured within the band."""
    std = np.maximum(stated, np.minimum(stated * growth, UNSTATED_SPREAD))
    std[:n_rigid] = UNSTATED_SPREAD
    return std


def _coupling_std(basis: Basis, damping_std: FloatArray, least: float) -> FloatArray:
    """Give standard deviations of what damping couples modes by, over the geometric mean of their own.

    Where it changes a shape by less than a model's FRFs are exact to, modes lie so far apart that it is left out:
    ``2 (zeta_i omega_i zeta_j omega_j)^(1/2) (omega_i omega_j)^(1/2) / |omega_i^2 - omega_j^2|``, to first order
    [Hasselman1976]. T. K. Hasselman, Modal coupling in lightly damped structures, AIAA Journal 14 (1976) 1627-1628.
    """
    modes = basis.modes.first(len(damping_std))
    own = damping_ratios(basis.model, modes) * modes.eigenvalues
    relative = np.minimum(damping_std, UNSTATED_SPREAD)
    std = OFF_DIAGONAL * np.sqrt(np.outer(relative, relative))
    apart = np.abs(np.subtract.outer(modes.eigenvalues, modes.eigenvalues))
    np.fill_diagonal(std, 0.0)
    std[: modes.n_rigid] = std[:, : modes.n_rigid] = 0.0
    return np.where(2 * std * np.sqrt(np.outer(own, own)) < least * apart, 0.0, std)


def _local_compliance(basis: Basis, layout: Layout, n_modes: int) -> FloatArray:
    """Compliance of each FRF by all modes beyond those with scatter, m/N."""
    outputs = np.array([make_motion_row(basis.model, dof) for _, dof in layout.outputs]) @ basis.vectors
    inputs = np.array([make_motion_row(basis.model, dof) for dof in layout.inputs]) @ basis.vectors
    shift = basis.modes.shift
    whole = outputs @ np.linalg.solve(basis.stiffness + shift * np.eye(len(basis.stiffness)), inputs.T)
    scattered = (outputs[:, :n_modes] / (basis.modes.eigenvalues[:n_modes] + shift)) @ inputs[:, :n_modes].T
    return np.asarray((whole - scattered)[layout.output_index, layout.input_index])


def _corner_compliance(basis: Basis, layout: Layout, shift_std: FloatArray) -> FloatArray:
    """Give the compliance, m/N, by which an FRF may be off where sensor and force meet: it has a corner there."""
    apart = np.sqrt(2.0) * np.linalg.norm(shift_std)  # m, both being misplaced
    ends = zip(layout.output_index.tolist(), layout.input_index.tolist(), strict=True)
    meet = [_are_at_one_node(layout.outputs[output][1], layout.inputs[force]) for output, force in ends]
    slopes = np.array([shear_slope_at_force(basis.model, dof) for dof in layout.inputs])
    return np.asarray(np.where(meet, apart * slopes[layout.input_index], 0.0))


def _are_at_one_node(output: AnyDof, force: AnyDof) -> bool:
    return isinstance(output, Dof) and isinstance(force, Dof) and output.node == force.node


def make_all_shift_rows(basis: Basis, nuisance_prior: NuisancePrior, dofs: tuple[AnyDof, ...]) -> FloatArray:
    """Make the rows in the basis by which motions change with positions and directions.

    Parameters
    ----------
    basis : Basis
        Coordinates.
    nuisance_prior : NuisancePrior
        Says along which axes positions are uncertain, and towards which directions are.
    dofs : tuple of Dof
        Of sensors or excited points.

    Returns
    -------
    (n_dofs, n_axes, q) array
        1/m, and 1/rad.
    """
    rows = np.zeros((len(dofs), len(nuisance_prior.axes), basis.vectors.shape[1]))
    for index, dof in enumerate(dofs):
        turned = {TURNED + axis: row for axis, row in make_turn_rows(basis.model, dof).items()}
        for axis, row in {**make_shift_rows(basis.model, dof), **turned}.items():
            if axis in nuisance_prior.axes:
                weighted = np.flatnonzero(row)
                rows[index, nuisance_prior.axes.index(axis)] = row[weighted] @ basis.vectors[weighted]
    return rows
