"""CPU time of the eigensolve against SciPy's own shift-invert, on thin plates of bricks.

Run with ``pytest tests/benchmarks --benchmark-only -s``; numbers are CPU seconds of one thread.
"""

import time

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse import linalg as sparse_linalg

from brick_plate import plate_matrices
from frf_ipz.dofs import Dof
from frf_ipz.fe.eigen import solve_basis
from frf_ipz.fe.reduction.options import ReduceOptions
from frf_ipz.fe.reduction.reduce import reduce_to_dofs
from frf_ipz.structure import Geometry, StructuralModel

ELEMENT_M, THICKNESS_M, LAYERS = 5e-3, 6e-3, 3
MODES = 36  # 6 of them of the rigid body
SHARE = 0.25  # of the CPU time of eigsh(sigma=) that the default may take at 1e5 DOFs
PLATES = {"1.5e4": (30, 40), "1e5": (80, 110)}


def plate(across, along):
    stiffness, mass, corners = plate_matrices(
        (across, along, LAYERS), (across * ELEMENT_M, along * ELEMENT_M, THICKNESS_M)
    )
    dofs = tuple(Dof(node + 1, axis) for node in range(len(corners)) for axis in "xyz")
    order = len(dofs)
    return StructuralModel(
        name="plate",
        kind="matrices",
        all_dofs=dofs,
        fixed=np.zeros(order, bool),
        mass_all=mass,
        stiffness_all=stiffness,
        damping_all=sparse.csr_array((order, order)),
        modal_damping=np.array([0.01]),
        geometry=Geometry(
            nodes=np.arange(1, len(corners) + 1), coordinates_m=corners, lines=np.zeros((0, 2), np.int64)
        ),
    )


def cpu_seconds(work):
    start = time.process_time()
    result = work()
    return time.process_time() - start, result


@pytest.mark.parametrize("size", PLATES)
def test_eigensolve(benchmark, size):
    model = plate(*PLATES[size])
    basis = benchmark.pedantic(lambda: solve_basis(model, n_modes=MODES), rounds=1)
    assert basis.n_rigid == 6


def test_default_against_plain_eigsh(benchmark, timings):
    model = plate(*PLATES["1e5"])
    ours, basis = cpu_seconds(lambda: solve_basis(model, n_modes=MODES))
    shift = -((2 * np.pi * 20.0) ** 2)
    plain, (values, _) = cpu_seconds(
        lambda: sparse_linalg.eigsh(model.stiffness, MODES, M=model.mass, sigma=shift, which="LM")
    )
    frequency = np.sqrt(np.sort(values)[basis.n_rigid :]) / (2 * np.pi)
    np.testing.assert_allclose(basis.natural_frequency_hz[basis.n_rigid :], frequency, rtol=1e-4)
    timings.add("eigenmodes", f"{MODES} of a plate of 1e5 DOFs, eigsh of SciPy", plain / ours, 1 / SHARE)
    benchmark.extra_info.update(ours_cpu_s=ours, eigsh_cpu_s=plain, share=ours / plain)
    print(f"\nours {ours:.1f} s, eigsh {plain:.1f} s of CPU: {ours / plain:.2f} (at most {SHARE})")
    benchmark.pedantic(lambda: None, rounds=1)
    assert ours <= SHARE * plain


def test_reduction_of_a_plate(benchmark):
    model = plate(*PLATES["1.5e4"])
    ends = {"actuators": [Dof(1, "z")], "sensors": [Dof(31, "z"), Dof(700, "z")], "points": [Dof(900, "z")]}
    found = benchmark.pedantic(
        lambda: reduce_to_dofs(model, options=ReduceOptions(), band_hz=(100.0, 3000.0), **ends), rounds=1
    )
    assert len(found.dofs) > 10
