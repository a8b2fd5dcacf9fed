"""Two-node beam elements with the static deflection of a Timoshenko beam as shape, and Euler-Bernoulli as its limit.

The deflection w is a cubic and the rotation of the cross-section a quadratic polynomial that satisfy equilibrium
without load along the element, so the stiffness is exact and nothing locks, however slender the beam [Davis1972]. All
depends on the shear parameter Phi = 12 E I / (kappa G A L^2), which is 0 for Euler-Bernoulli. The mass matrix is
consistent with w and, for Timoshenko, with the rotation, with a correction of order h^2 for what these shapes lack: the
frequencies of uniform and stepped beams converge with the fourth power of the element length h, with shear as without.

Element DOFs are ``w, ry`` of the left and of the right node. ry is the rotation about y, so that dw/dx = -ry without
shear.

[Davis1972] R. Davis, R. D. Henshell, G. B. Warburton, A Timoshenko beam element, Journal of Sound and Vibration 22 (4),
1972, 475-487, doi:10.1016/0022-460X(72)90457-9.
[Cowper1966] G. R. Cowper, The shear coefficient in Timoshenko's beam theory, Journal of Applied Mechanics 33 (2), 1966,
335-340, doi:10.1115/1.3625046.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frf_ipz.arrays import FloatArray

SIGNS = np.array([1.0, -1.0, 1.0, -1.0])  # from the slope-like rotation theta = -ry of textbooks to ry


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BeamElements:
    """Properties of the elements of a beam, one number an element.

    Parameters
    ----------
    length : (n,) array
        m.
    bending_stiffness : (n,) array
        E I, N m^2.
    shear_parameter : (n,) array
        Phi = 12 E I / (kappa G A L^2); 0 for Euler-Bernoulli.
    mass_per_length : (n,) array
        rho A, kg/m.
    rotary_inertia_per_length : (n,) array
        rho I, kg m; 0 for Euler-Bernoulli.
    """

    length: FloatArray
    bending_stiffness: FloatArray
    shear_parameter: FloatArray
    mass_per_length: FloatArray
    rotary_inertia_per_length: FloatArray


def shear_coefficient(poisson_ratio: float) -> float:
    """Shear coefficient of a rectangle, 10 (1 + nu) / (12 + 11 nu) [Cowper1966].

    Parameters
    ----------
    poisson_ratio : float
        nu.

    Returns
    -------
    float
        kappa, about 0.85.
    """
    return 10.0 * (1.0 + poisson_ratio) / (12.0 + 11.0 * poisson_ratio)


def deflection_polynomials(length: FloatArray, shear_parameter: FloatArray) -> FloatArray:
    """Deflection w for unit motions of the element's DOFs.

    Parameters
    ----------
    length, shear_parameter : (n,) array
        As in `BeamElements`.

    Returns
    -------
    (n, 4, 4) array
        Coefficients of 1, xi, xi^2, xi^3 (last axis), xi = x / L, for each DOF (axis before), m/m and m/rad.
    """
    phi, zero, unit = shear_parameter, np.zeros_like(length), np.ones_like(length)
    rows = [
        [1 + phi, -phi, -3 * unit, 2 * unit],
        [zero, length * (1 + phi / 2), -length * (2 + phi / 2), length],
        [zero, phi, 3 * unit, -2 * unit],
        [zero, -length * phi / 2, -length * (1 - phi / 2), length],
    ]
    return _per_element(rows, phi)


def rotation_polynomials(length: FloatArray, shear_parameter: FloatArray) -> FloatArray:
    """Rotation theta = -ry of the cross-section for unit motions of the element's DOFs.

    Parameters
    ----------
    length, shear_parameter : (n,) array
        As in `BeamElements`.

    Returns
    -------
    (n, 4, 3) array
        Coefficients of 1, xi, xi^2 (last axis), for each DOF, rad/m and rad/rad.
    """
    phi, zero, slope = shear_parameter, np.zeros_like(length), 6 / length
    rows = [
        [zero, -slope, slope],
        [1 + phi, -(4 + phi), 3 + zero],
        [zero, slope, -slope],
        [zero, -(2 - phi), 3 + zero],
    ]
    return _per_element(rows, phi)


def stiffness_matrices(elements: BeamElements) -> FloatArray:
    """Bending and shear stiffness.

    Parameters
    ----------
    elements : BeamElements
        The elements.

    Returns
    -------
    (n, 4, 4) array
        N/m and its rotational counterparts.
    """
    length, phi = elements.length, elements.shear_parameter
    twelve, six = np.full_like(length, 12.0), 6 * length
    same_end, other_end = (4 + phi) * length**2, (2 - phi) * length**2
    rows = [
        [twelve, six, -twelve, six],
        [six, same_end, -six, other_end],
        [-twelve, -six, twelve, -six],
        [six, other_end, -six, same_end],
    ]
    scale = elements.bending_stiffness / (length**3 * (1 + phi))
    return np.moveaxis(np.array(rows), -1, 0) * np.outer(SIGNS, SIGNS) * scale[:, None, None]


def mass_matrices(elements: BeamElements) -> FloatArray:
    """Mass of deflection and rotation, with the second-order effect of inertia on the static shapes.

    Inertia within an element of length h bends its ends' static shapes by a bubble that z = omega^2 drives. To leading
    order its work is h^2 / 12 times the integral of (z rho A w)^2 / (kappa G A) plus that of
    (z rho I theta)^2 Phi / (E I (1 + Phi)). The mode's own balance, z rho A w = -V' and z rho I theta = -(M' + V), and
    integration by parts over the beam turn one z of each into strains: w' gamma, and theta'^2 and theta gamma. The
    terms at the ends vanish at clamped, pinned, sliding and free ends; at point masses and springs an error of second
    order remains, as in modal masses. Without shear nothing is added.

    The matrices are positive definite for isotropic materials, of which E / (kappa G) is 3.5 at most.

    Parameters
    ----------
    elements : BeamElements
        The elements.

    Returns
    -------
    (n, 4, 4) array
        kg and its rotational counterparts.
    """
    deflection = deflection_polynomials(elements.length, elements.shear_parameter)
    rotation = rotation_polynomials(elements.length, elements.shear_parameter)
    mass, inertia = elements.mass_per_length * elements.length, elements.rotary_inertia_per_length * elements.length
    phi = elements.shear_parameter
    rise = deflection[..., 1:].sum(-1)  # h times the mean of w'
    turn = elements.length[:, None] * (rotation / np.arange(1.0, rotation.shape[-1] + 1)).sum(-1)
    sheared = rise - turn  # h gamma, which is constant
    bent = _integral(rotation[..., 1:] * np.arange(1.0, rotation.shape[-1]))
    correction = phi[:, None, None] / 12 * bent - _symmetric(turn, sheared) / elements.length[:, None, None] ** 2
    translational = _integral(deflection) + _symmetric(rise, sheared) / 12
    rotary = _integral(rotation) + correction / (1 + phi)[:, None, None]
    return mass[:, None, None] * translational + inertia[:, None, None] * rotary


def geometric_stiffness_matrices(elements: BeamElements) -> FloatArray:
    """Stiffness that an axial tension of 1 N adds: the integral of w' w' over the element.

    Parameters
    ----------
    elements : BeamElements
        The elements.

    Returns
    -------
    (n, 4, 4) array
        N/m per N of tension, and its rotational counterparts.
    """
    deflection = deflection_polynomials(elements.length, elements.shear_parameter)
    slope = deflection[..., 1:] * np.array([1.0, 2.0, 3.0])
    return np.asarray(_integral(slope) / elements.length[:, None, None])


def _per_element(rows: list[list[FloatArray]], phi: FloatArray) -> FloatArray:
    return np.asarray(np.moveaxis(np.array(rows), -1, 0) * SIGNS[:, None] / (1 + phi)[:, None, None])


def _integral(polynomials: FloatArray) -> FloatArray:
    """Integral over xi from 0 to 1 of all products of two DOFs' polynomials."""
    power = np.arange(polynomials.shape[-1])
    moments = 1.0 / (power[:, None] + power[None, :] + 1.0)
    product = polynomials @ moments @ np.swapaxes(polynomials, -1, -2)
    return np.asarray((product + np.swapaxes(product, -1, -2)) / 2)  # symmetric to the last bit


def _symmetric(first: FloatArray, second: FloatArray) -> FloatArray:
    """(n, 4, 4) mean of the products of two values of all DOFs, (n, 4), in both orders."""
    product = first[:, :, None] * second[:, None, :]
    return np.asarray((product + np.swapaxes(product, 1, 2)) / 2)
