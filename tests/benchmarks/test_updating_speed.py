"""CPU time of updating: one minimal change, and one published iteration against its bare LAPACK calls and plain NumPy.

Run with ``pytest tests/benchmarks --benchmark-only -s``; numbers are CPU seconds of one thread.
"""

import time

import numpy as np
from scipy import linalg
from scipy.linalg import lapack

from frf_ipz.updating.ipz.step import PublishedStep, StepSettings
from frf_ipz.updating.options import UpdateOptions
from frf_ipz.updating.parameters import make_structural_basis
from frf_ipz.updating.update import update_model
from frf_testbench.updating.paper_cases import build_section_4
from frf_testbench.updating.study import make_update_case

UPDATE_MS = 50.0  # one minimal-change update of a reduced model of order 12
LAPACK_RATIO = 4.0  # a published iteration over its two bare dgeev calls of order 12
ROUNDS = 2000


def cpu_us(work, rounds=ROUNDS):
    """Best of five: CPU microseconds of one call."""
    times = []
    for _ in range(5):
        start = time.process_time()
        for _ in range(rounds):
            work()
        times.append((time.process_time() - start) / rounds * 1e6)
    return min(times)


def order_12():
    return next(case for case in map(make_update_case, range(100)) if len(case.reduced_model.dofs) == 12)


def test_minimal_change(benchmark):
    case = order_12()
    basis = make_structural_basis(case.structure.nominal_model, case.reduced_model)
    update = {
        "with its ensemble of 200": lambda: update_model(case.fit, case.reduced_model, pairs=case.pairs, basis=basis),
        "alone": lambda: update_model(
            case.fit, case.reduced_model, pairs=case.pairs, options=UpdateOptions(ensemble=0), basis=basis
        ),
    }
    found = {name: cpu_us(work, 5) / 1e3 for name, work in update.items()}
    print("\n" + ", ".join(f"{name} {ms:.1f} ms" for name, ms in found.items()) + f" (at most {UPDATE_MS} ms)")
    benchmark.extra_info.update(found)
    benchmark.pedantic(update["alone"], rounds=3)
    assert found["with its ensemble of 200"] < UPDATE_MS


def test_published_iteration(benchmark, timings):
    case = build_section_4()
    model, label = case.reduced_model, case.fit.labels[0]
    step = PublishedStep(
        model.mass,
        model.damping,
        model.stiffness,
        sensor=model.dofs.index(label.output_dof),
        actuator=model.dofs.index(label.input_dof),
        targets=case.targets,
        computed=np.array([pair.computed_value for pair in case.pairs.targets]),
        n_poles=4,
        settings=StepSettings(alpha=0.1, beta=0.3, cross_sensitivities=True, damping=False),
    )
    matrix = model.stiffness

    def iteration():
        step.evaluate(matrix)
        step.step()

    state = state_matrix(model)
    bare = cpu_us(lambda: [lapack.dgeev(state), lapack.dgeev(state)])
    plain = cpu_us(lambda: plain_numpy(case), 200)
    ours = cpu_us(iteration)
    print(
        f"\nan iteration {ours:.0f} us; its two dgeev calls {bare:.0f} us: {ours / bare:.2f} (at most {LAPACK_RATIO})"
    )
    print(f"the same in plain NumPy {plain:.0f} us: {plain / ours:.1f} times as long")
    timings.add("an iteration of ipz", "its two calls of dgeev alone", bare / ours, 1 / LAPACK_RATIO)
    benchmark.extra_info.update(ours_us=ours, dgeev_us=bare, numpy_us=plain)
    benchmark.pedantic(iteration, rounds=100)
    assert ours < LAPACK_RATIO * bare


def state_matrix(model):
    """First-order matrix, 12 x 12: the substructure's is 10 x 10."""
    order = len(model.mass)
    inverse = np.linalg.inv(model.mass)
    rest = [-inverse @ model.stiffness, -inverse @ model.damping]
    return np.block([[np.zeros((order, order)), np.eye(order)], rest])


def plain_numpy(case):
    """One iteration as one would write it down: two eigenvalue problems with left vectors, one least-squares step."""
    model, label = case.reduced_model, case.fit.labels[0]
    everything = list(range(len(model.dofs)))
    keep_rows = [k for k in everything if model.dofs[k] != label.input_dof]
    keep_columns = [k for k in everything if model.dofs[k] != label.output_dof]
    blocks = []
    for rows, columns, count in ((everything, everything, 4), (keep_rows, keep_columns, 3)):
        mass, damping, stiffness = (
            each[np.ix_(rows, columns)] for each in (model.mass, model.damping, model.stiffness)
        )
        order = len(mass)
        first = np.block([[stiffness, np.zeros((order, order))], [np.zeros((order, order)), np.eye(order)]])
        second = np.block([[-damping, -mass], [np.eye(order), np.zeros((order, order))]])
        values, left, right = linalg.eig(first, second, left=True)
        upper = np.argsort(np.where(values.imag > 5 * np.abs(values.real), values.imag, np.inf))[:count]
        eigenvalues, vectors = np.linalg.eig(stiffness)
        duals = np.linalg.inv(vectors)
        chosen = np.argsort(eigenvalues.real)[:count]
        blocks.append(
            (values[upper], left[:order, upper].conj(), right[:order, upper], vectors[:, chosen], duals[chosen])
        )
    sensitivity = np.zeros((7, 7), complex)
    for row, (values, left, right, _, _) in enumerate(blocks):
        for column, (_, _, _, vectors, duals) in enumerate(blocks):
            size = min(len(left), len(vectors))
            part = (vectors[:size].T @ left[:size]) * (duals[:, :size] @ right[:size])
            sensitivity[4 * row : 4 * row + len(values), 4 * column : 4 * column + vectors.shape[1]] = part.T
    error = case.targets - np.concatenate([values for values, *_ in blocks])
    stacked = np.vstack([sensitivity.real, sensitivity.imag])
    return np.linalg.lstsq(stacked.T @ stacked + 0.01 * np.eye(7), stacked.T @ np.r_[error.real, error.imag])[0]
