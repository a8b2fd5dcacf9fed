"""What the owner of a structure cannot know about it, within the tolerances that they state.

Small errors of mass and stiffness, wherever they are, act on the modes of the band as symmetric matrices: stiffness
``omega_i omega_j kappa_ij`` and mass ``mu_ij``. Their diagonals are the scatter of the frequencies, the rest that of
the shapes, and with it of the zeros. Damping ratios of modes, places of sensors and blows, and gains of channels come
beside. A tolerance is the half width of what can be, so that the standard deviation is the tolerance over the square
root of three.

Gains multiply the model's FRFs. As errors in proportion to the measured FRFs they would follow their noise, and pull
every fit to smaller FRFs by the product of their variance and the number of points.

[dAgostini1994] G. D'Agostini, On the use of the covariance matrix to fit correlated data, Nuclear Instruments and
Methods in Physics Research A 346 (1994) 306-311.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.diagnosis.physics.layout import extents, shift_rows

if TYPE_CHECKING:
    from frf_ipz.diagnosis.options import DiagnoseOptions
    from frf_ipz.diagnosis.physics.basis import Basis
    from frf_ipz.diagnosis.physics.layout import Layout
    from frf_ipz.dofs import Dof

UNIFORM = 1 / np.sqrt(3.0)  # standard deviation of what is uniform between -1 and 1
ACROSS = 0.5  # kappa and mu between two modes, over those of one: fields average out
MASS_PART = 0.5  # tolerance of masses over that of stiffness
CORDS = 0.02  # frequency of a free structure in its cords, over its first elastic one
MODES_BEYOND = 2.0  # times the top of the band: modes with scatter of their own
MOST_MODES = 16
LESS_CONVERGED = 20.0  # growth of a mode's error with its frequency over the top of the band: meshes suit the band
MOST_GAIN = 2.0  # logarithm: no step on the way to a fit goes farther
SUSPENSION_SPREAD = 0.5  # relative standard deviation of the damping of rigid-body modes in their cords


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Unknowns:
    """Values of all that cannot be known.

    Parameters
    ----------
    kappa, mu : (m, m) array
        Relative errors of stiffness and mass on the first modes, symmetric.
    damping : (m,) array
        Relative errors of damping ratios.
    cords : (n_rigid,) array
        Squared frequencies of rigid-body modes, (rad/s)^2.
    output_shift, input_shift : (n, n_axes) array
        How far sensors and blows are from their places, m.
    gains : (n_channels,) array
        Relative errors of the channels' gains, as logarithms.
    """

    kappa: FloatArray
    mu: FloatArray
    damping: FloatArray
    cords: FloatArray
    output_shift: FloatArray
    input_shift: FloatArray
    gains: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Nuisance:
    """Parameters of what cannot be known, each in units of its standard deviation.

    Parameters
    ----------
    n_modes, n_rigid : int
        Modes with scatter, rigid-body modes among them.
    kappa_std, mu_std : (m, m) array
        Standard deviations.
    damping_std : (m,) array
        Of damping ratios, relative.
    cords_std : float
        Of squared frequencies of rigid-body modes, (rad/s)^2.
    axes : tuple of str
        Along which places are uncertain.
    shift_std : (n_axes,) array
        m.
    n_outputs, n_inputs : int
        Sensor positions and blows.
    n_channels : int
        Channels with gains.
    gain_std : float
        Of gains, relative.
    """

    n_modes: int
    n_rigid: int
    kappa_std: FloatArray
    mu_std: FloatArray
    damping_std: FloatArray
    cords_std: float
    axes: tuple[str, ...]
    shift_std: FloatArray
    n_outputs: int
    n_inputs: int
    n_channels: int
    gain_std: float

    @property
    def pairs(self) -> tuple[IntArray, IntArray]:
        """Rows and columns of the upper triangle of kappa and mu."""
        rows, columns = np.triu_indices(self.n_modes)
        return rows.astype(np.int64), columns.astype(np.int64)

    @property
    def sizes(self) -> tuple[int, ...]:
        """Numbers of parameters: kappa, mu, damping, cords, sensor shifts, blow shifts, gains."""
        n_pairs = self.n_modes * (self.n_modes + 1) // 2
        shifts = len(self.axes)
        return (
            *(n_pairs, n_pairs, self.n_modes, self.n_rigid),
            *(shifts * self.n_outputs, shifts * self.n_inputs, self.n_channels),
        )

    @property
    def size(self) -> int:
        """Number of all parameters."""
        return sum(self.sizes)

    @property
    def frequency_places(self) -> IntArray:
        """Where the relative errors of the squared frequencies, kappa_ii, stand among the parameters."""
        rows, columns = self.pairs
        return np.flatnonzero(rows == columns).astype(np.int64)

    @property
    def damping_places(self) -> IntArray:
        """Where the relative errors of the damping ratios stand among the parameters."""
        return np.arange(self.n_modes) + 2 * self.sizes[0]

    @property
    def gain_places(self) -> IntArray:
        """Where the gains stand among the parameters."""
        return np.arange(self.size - self.n_channels, self.size)

    def unpack(self, values: FloatArray) -> Unknowns:
        """Give physical values.

        Parameters
        ----------
        values : (size,) array
            Parameters in standard deviations.

        Returns
        -------
        Unknowns
            The values.
        """
        parts = np.split(values, np.cumsum(self.sizes)[:-1])
        return Unknowns(
            kappa=self._symmetric(parts[0]) * self.kappa_std,
            mu=self._symmetric(parts[1]) * self.mu_std,
            damping=np.maximum(parts[2] * self.damping_std, -0.95),
            cords=parts[3] * self.cords_std,
            output_shift=parts[4].reshape(self.n_outputs, len(self.axes)) * self.shift_std,
            input_shift=parts[5].reshape(self.n_inputs, len(self.axes)) * self.shift_std,
            gains=np.clip(parts[6] * self.gain_std, -MOST_GAIN, MOST_GAIN),
        )

    def _symmetric(self, triangle: FloatArray) -> FloatArray:
        matrix = np.zeros((self.n_modes, self.n_modes))
        matrix[self.pairs] = triangle
        return matrix + np.triu(matrix, 1).T


def make_nuisance(basis: Basis, layout: Layout, options: DiagnoseOptions) -> Nuisance:
    """Turn tolerances into standard deviations.

    Parameters
    ----------
    basis : Basis
        Of the nominal model.
    layout : Layout
        Sensors and blows.
    options : DiagnoseOptions
        Tolerances.

    Returns
    -------
    Nuisance
        The parameters.
    """
    frequencies = np.sqrt(basis.modes.eigenvalues)
    n_modes = int(np.clip(np.count_nonzero(frequencies <= MODES_BEYOND * basis.highest_rad_s), 1, MOST_MODES))
    n_modes = min(n_modes, len(frequencies))
    n_rigid = min(basis.modes.n_rigid, n_modes)
    stiffness, mass = options.stiffness_tolerance * UNIFORM, MASS_PART * options.stiffness_tolerance * UNIFORM
    kappa, mu = np.full((n_modes, n_modes), ACROSS * stiffness), np.full((n_modes, n_modes), ACROSS * mass)
    np.fill_diagonal(kappa, np.hypot(stiffness, 2 * options.frequency_tolerance * UNIFORM))
    np.fill_diagonal(mu, mass)
    growth = 1 + LESS_CONVERGED * np.maximum(frequencies[:n_modes] / basis.highest_rad_s - 1, 0.0)
    kappa *= np.sqrt(np.outer(growth, growth))
    kappa[:n_rigid] = kappa[:, :n_rigid] = 0.0
    first = frequencies[n_rigid] if len(frequencies) > n_rigid else 0.0
    span = extents(basis.model)
    directions = {dof.direction for dof in (*(dof for _, dof in layout.outputs), *layout.inputs)}
    axes = tuple(axis for axis in span if directions != {axis})
    return Nuisance(
        n_modes=n_modes,
        n_rigid=n_rigid,
        kappa_std=kappa,
        mu_std=mu,
        damping_std=np.where(np.arange(n_modes) < n_rigid, SUSPENSION_SPREAD, options.damping_tolerance * UNIFORM),
        cords_std=(CORDS * first) ** 2,
        axes=axes,
        shift_std=np.array([options.position_tolerance_m_per_m * span[axis] * UNIFORM for axis in axes]),
        n_outputs=len(layout.outputs),
        n_inputs=len(layout.inputs),
        n_channels=len(layout.channels),
        gain_std=options.gain_tolerance * UNIFORM,
    )


def all_shift_rows(basis: Basis, nuisance: Nuisance, dofs: tuple[Dof, ...]) -> FloatArray:
    """Rows in the basis by which motions change with places.

    Parameters
    ----------
    basis : Basis
        Coordinates.
    nuisance : Nuisance
        Says along which axes places are uncertain.
    dofs : tuple of Dof
        Of sensors or blows.

    Returns
    -------
    (n_dofs, n_axes, q) array
        1/m.
    """
    rows = np.zeros((len(dofs), len(nuisance.axes), basis.vectors.shape[1]))
    for index, dof in enumerate(dofs):
        for axis, row in shift_rows(basis.model, dof).items():
            if axis in nuisance.axes:
                rows[index, nuisance.axes.index(axis)] = row @ basis.vectors
    return rows
