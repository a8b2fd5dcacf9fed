"""Natural frequencies of straight beams by transfer matrices: exact, without elements.

Along a uniform segment the state (deflection w, rotation psi, moment, shear force) obeys a linear differential
equation, so it is carried on by a matrix exponential; masses and springs at a point add a jump. Both
theories are the same equation, Euler-Bernoulli with no shear flexibility and no rotary inertia.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

STEPS_PER_DECADE = 300  # of the search for changes of sign: steps of 0.8 %, frequencies lie far wider apart
KNOWN = {"clamped": (0, 1), "pinned": (0, 2), "sliding": (1, 3), "free": (2, 3)}  # states that are 0 at an end


@dataclass(frozen=True, kw_only=True)
class BeamSegment:
    """A uniform part of a beam, and the masses and springs at its right end."""

    length: float
    bending_stiffness: float
    mass_per_length: float
    shear_stiffness: float = np.inf
    rotary_inertia_per_length: float = 0.0
    tension: float = 0.0
    end_mass: float = 0.0
    end_rotary_inertia: float = 0.0
    end_spring: float = 0.0
    end_rotational_spring: float = 0.0

    def transfer(self, omega):
        # the shear force is kappa G A (w' - psi) + N w', so that w' = (force + kappa G A psi) / (kappa G A + N)
        by_force = 1 / (self.shear_stiffness + self.tension)
        by_rotation = 1 / (1 + self.tension / self.shear_stiffness)
        rotary = self.rotary_inertia_per_length * omega**2
        field = np.array(
            [
                [0, by_rotation, 0, by_force],
                [0, 0, 1 / self.bending_stiffness, 0],
                [0, self.tension * by_rotation - rotary, 0, self.tension * by_force - 1],
                [-self.mass_per_length * omega**2, 0, 0, 0],
            ]
        )
        jump = np.eye(4)
        jump[2, 1] = self.end_rotational_spring - self.end_rotary_inertia * omega**2
        jump[3, 0] = self.end_spring - self.end_mass * omega**2
        return jump @ expm(field * self.length)


def rectangle(length, width, thickness, youngs_modulus, density, poisson_ratio=None, **tension_and_end):
    """A segment of rectangular section; with Poisson's ratio by Timoshenko's theory."""
    area, inertia = width * thickness, width * thickness**3 / 12
    shear = {}
    if poisson_ratio is not None:
        coefficient = 10 * (1 + poisson_ratio) / (12 + 11 * poisson_ratio)
        shear_modulus = youngs_modulus / (2 + 2 * poisson_ratio)
        shear = {
            "shear_stiffness": coefficient * shear_modulus * area,
            "rotary_inertia_per_length": density * inertia,
        }
    return BeamSegment(
        length=length,
        bending_stiffness=youngs_modulus * inertia,
        mass_per_length=density * area,
        **shear,
        **tension_and_end,
    )


def exact_frequencies_hz(segments, left, right, count, lowest_hz, highest_hz):
    """The first frequencies above lowest_hz of a chain of segments."""
    unknown = [state for state in range(4) if state not in KNOWN[left]]
    scale = np.diag([1.0, segments[0].length, 1.0, segments[0].length])

    def determinant(hz):
        matrix = np.eye(4)
        for segment in segments:
            matrix = segment.transfer(2 * np.pi * hz) @ matrix
        block = (scale @ matrix @ scale)[np.ix_(KNOWN[right], unknown)]
        return np.linalg.det(block / np.linalg.norm(block, axis=1, keepdims=True))

    grid = np.geomspace(lowest_hz, highest_hz, int(STEPS_PER_DECADE * np.log10(highest_hz / lowest_hz)))
    values = np.array([determinant(hz) for hz in grid])
    frequencies_hz = []
    for index in np.flatnonzero(values[:-1] * values[1:] < 0)[:count]:
        frequencies_hz.append(brentq(determinant, grid[index], grid[index + 1], xtol=1e-12, rtol=1e-13))
    assert len(frequencies_hz) == count, "search in a wider band"
    return np.array(frequencies_hz)
