"""Beams whose model misses something, for bands and pairing: local modes, cords, a lump, its mass, its density.

Own inputs, drawn from a seed: what is drawn here was not looked at when a constant was chosen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

import frf_ipz
from fe_models import structural_model
from frf_ipz.dofs import Dof

LENGTH_M, WIDTH_M, THICKNESS_M, YOUNGS_MODULUS_PA, DENSITY_KG_M3 = 0.5, 0.025, 0.006, 70e9, 2700.0
N_ELEMENTS = 20
DAMPING_RATIO = 0.005
NOISE = 2e-3  # of the root mean square of an FRF


def beam_matrices(n_elements=N_ELEMENTS):
    """Stiffness and mass of a free Euler-Bernoulli beam, z and ry of every node in turn."""
    size, edge = 2 * (n_elements + 1), LENGTH_M / n_elements
    flexural = YOUNGS_MODULUS_PA * WIDTH_M * THICKNESS_M**3 / 12
    line_mass = DENSITY_KG_M3 * WIDTH_M * THICKNESS_M
    a = edge
    rigid = [[12, -6 * a, -12, -6 * a], [0, 4 * a**2, 6 * a, 2 * a**2], [0, 0, 12, 6 * a], [0, 0, 0, 4 * a**2]]
    heavy = [[156, -22 * a, 54, 13 * a], [0, 4 * a**2, -13 * a, -3 * a**2], [0, 0, 156, 22 * a], [0, 0, 0, 4 * a**2]]
    stiffness, mass = (
        factor * (np.triu(upper) + np.triu(upper, 1).T)
        for factor, upper in ((flexural / a**3, rigid), (line_mass * a / 420, heavy))
    )
    K, M = np.zeros((size, size)), np.zeros((size, size))
    for element in range(n_elements):
        rows = slice(2 * element, 2 * element + 4)
        K[rows, rows] += stiffness
        M[rows, rows] += mass
    return K, M


def beam_dofs(n_elements=N_ELEMENTS):
    return [Dof(node, direction) for node in range(1, n_elements + 2) for direction in ("z", "ry")]


def as_model(stiffness, mass, dofs, *, clamped=False):
    """A structure given by matrices alone; `clamped` holds the first node."""
    kept = slice(2, None) if clamped else slice(None)
    return structural_model(
        sparse.csr_array(mass[kept, kept]),
        sparse.csr_array(stiffness[kept, kept]),
        tuple(dofs[kept]),
        modal_damping=(DAMPING_RATIO,),
    )


@dataclass(frozen=True, kw_only=True)
class Hidden:
    """A model, the machine that it stands for, and where it is measured."""

    model: object
    machine: object
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    point: str
    band_hz: tuple[float, float]


def draw_local_modes(seed):
    """Resonators of little mass crowd the band; the machine's beam is stiffer, and they are not."""
    rng = np.random.default_rng(seed)
    K, M = beam_matrices()
    factor = rng.uniform(1.03, 1.08)
    count = int(rng.integers(30, 41))
    hertz = np.linspace(60.0, rng.uniform(850.0, 950.0), count)  # as of one part that repeats, a little longer each
    nodes = rng.integers(2, N_ELEMENTS + 2, count)
    order = len(K) + count
    masses = rng.uniform(0.05e-3, 0.2e-3, count) * DENSITY_KG_M3 * WIDTH_M * THICKNESS_M * LENGTH_M
    stiffness, mass = np.zeros((order, order)), np.zeros((order, order))
    mass[: len(K), : len(K)] = M
    mass[range(len(K), order), range(len(K), order)] = masses
    for place, (node, spring) in enumerate(zip(nodes, masses * (2 * np.pi * hertz) ** 2, strict=True)):
        ends = np.array([2 * (node - 1), len(K) + place])
        stiffness[np.ix_(ends, ends)] += spring * np.array([[1.0, -1.0], [-1.0, 1.0]])
    dofs = [*beam_dofs(), *(Dof(5000 + place, "z") for place in range(count))]
    beam = np.zeros_like(stiffness)
    beam[: len(K), : len(K)] = K
    free = rng.choice(np.arange(6, N_ELEMENTS + 2), 4, replace=False)
    return Hidden(
        model=as_model(stiffness + beam, mass, dofs, clamped=True),
        machine=as_model(stiffness + factor * beam, mass, dofs, clamped=True),
        outputs=tuple(f"{node}:+z" for node in free[:2]),
        inputs=(f"{free[2]}:+z",),
        point=f"{free[3]}:+z",
        band_hz=(10.0, 950.0),
    )


def draw_cords(seed):
    """The model is free; the machine hangs in cords, and its lowest modes are those of a rigid body in them."""
    rng = np.random.default_rng(seed)
    K, M = beam_matrices()
    held, total = K.copy(), DENSITY_KG_M3 * WIDTH_M * THICKNESS_M * LENGTH_M
    for node in (rng.integers(2, 8), rng.integers(14, N_ELEMENTS)):
        held[2 * node - 2, 2 * node - 2] += total / 2 * (2 * np.pi * rng.uniform(4.0, 12.0)) ** 2
    return _measured(rng, K, M, rng.uniform(0.95, 1.05) * held, M, band_hz=(2.0, 800.0))


def draw_lump(seed):
    """The machine carries something on a spring, with a mode of its own in the band."""
    rng = np.random.default_rng(seed)
    K, M = beam_matrices()
    total = DENSITY_KG_M3 * WIDTH_M * THICKNESS_M * LENGTH_M
    order, node = len(K), int(rng.integers(4, N_ELEMENTS + 2))
    lump, hertz = rng.uniform(0.02, 0.1) * total, rng.uniform(80.0, 500.0)
    stiffness, mass = np.zeros((order + 1, order + 1)), np.zeros((order + 1, order + 1))
    stiffness[:order, :order], mass[:order, :order] = rng.uniform(0.97, 1.03) * K, M
    mass[order, order] = lump
    ends = np.array([2 * (node - 1), order])
    stiffness[np.ix_(ends, ends)] += lump * (2 * np.pi * hertz) ** 2 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return _measured(
        rng, K, M, stiffness, mass, band_hz=(5.0, 800.0), clamped=True, machine_dofs=[*beam_dofs(), Dof(9000, "z")]
    )


def draw_mass(seed):
    """The machine is heavier or lighter than its model, in some elements more than in others."""
    rng = np.random.default_rng(seed)
    K, M = beam_matrices()
    factor = np.exp(rng.uniform(np.log(1.1), np.log(1.4)) * rng.choice([-1.0, 1.0]))
    part = M.copy()
    split = 2 * int(rng.integers(6, 16))
    part[split:, split:] *= rng.uniform(0.95, 1.05)
    return _measured(rng, K, M, rng.uniform(0.95, 1.05) * K, factor * part, band_hz=(5.0, 800.0), clamped=True)


def draw_region(seed):
    """A part of the machine is denser or lighter than its model, everywhere else it is right but for its modulus."""
    rng = np.random.default_rng(seed)
    K, M = beam_matrices()
    first = 2 * int(rng.integers(8, 14))
    density = np.where(np.arange(len(M)) >= first, rng.choice([0.98, 1.02]) + rng.uniform(-0.01, 0.01), 1.0)
    real_mass = M * np.sqrt(np.outer(density, density))
    return _measured(rng, K, M, rng.uniform(0.98, 1.02) * K, real_mass, band_hz=(5.0, 800.0), clamped=True)


def _measured(rng, stiffness, mass, real_stiffness, real_mass, *, band_hz, clamped=False, machine_dofs=None):
    nodes = rng.choice(np.arange(4, N_ELEMENTS + 2), 6, replace=False)
    return Hidden(
        model=as_model(stiffness, mass, beam_dofs(), clamped=clamped),
        machine=as_model(real_stiffness, real_mass, machine_dofs or beam_dofs(), clamped=clamped),
        outputs=tuple(f"{node}:+z" for node in nodes[:3]),
        inputs=tuple(f"{node}:+z" for node in nodes[3:5]),
        point=f"{nodes[5]}:+z",
        band_hz=band_hz,
    )


DRAWS = {
    "local modes": draw_local_modes,
    "cords": draw_cords,
    "lump": draw_lump,
    "mass": draw_mass,
    "region": draw_region,
}


class HiddenRun:
    """A machine, measured, fitted, updated and predicted at a point that nobody measured."""

    def __init__(self, kind, seed, *, expand=True):
        self.hidden = hidden = DRAWS[kind](seed)
        rng = np.random.default_rng([seed, 1])
        low, high = hidden.band_hz
        lines = np.arange(low, high, 0.25 if low < 5 else 0.5)
        shape = (len(lines), len(hidden.outputs), len(hidden.inputs))
        labels = [
            frf_ipz.FrfLabel(output, source, "accelerance") for output in hidden.outputs for source in hidden.inputs
        ]
        exact = frf_ipz.compute_frfs(hidden.machine, labels, 2j * np.pi * lines)
        std = NOISE * np.sqrt(np.mean(np.abs(exact) ** 2, axis=0))
        noise = std / np.sqrt(2) * (rng.normal(size=exact.shape) + 1j * rng.normal(size=exact.shape))
        frfs = frf_ipz.FrfSet.from_arrays(
            lines,
            (exact + noise).reshape(shape),
            outputs=hidden.outputs,
            inputs=hidden.inputs,
            variance=np.broadcast_to(std**2, exact.shape).reshape(shape),
        )
        self.frfs, self.fit = frfs, frf_ipz.fit_modes(frfs)
        self.reduced = frf_ipz.reduce_model(self.fit, hidden.model, points=[hidden.point])
        self.pairs = frf_ipz.pair_roots(self.fit, self.reduced)
        self.updated = frf_ipz.update_model(
            self.fit,
            self.reduced,
            pairs=self.pairs,
            fe_model=hidden.model,
            options=frf_ipz.UpdateOptions(expand=expand),
        )
        self.prediction = frf_ipz.predict_frfs(self.fit, self.updated, points=[hidden.point])
        s = 2j * np.pi * self.prediction.frequency_hz
        self.truth = np.abs(frf_ipz.compute_frfs(hidden.machine, self.prediction.labels, s))

    @property
    def share_inside(self):
        """Share of the lines at the point that the band holds."""
        low, high = self.prediction.magnitude_low, self.prediction.magnitude_high
        return float(np.mean((self.truth >= low) & (self.truth <= high)))

    def error_db(self, values):
        """Median error at the point."""
        return float(np.median(np.abs(20 * np.log10(np.abs(values) / self.truth))))
