"""A new user's notebook: from plain arrays to a state space at a point of interest, in a few lines of public names."""

import ast

import control
import numpy as np
import pytest

MOST_LINES = 15
NOTEBOOK = """
import frf_ipz

model = frf_ipz.StructuralModel.from_matrices(M, K, dofs=names, modal_damping=0.01)
frfs = frf_ipz.FrfSet.from_arrays(f, H, outputs=["12:+x", "5:+x"], inputs=["3:+x", "12:+x"], quantity="accelerance")

campaign = frf_ipz.Campaign(frfs, model, points=["8:+x"])
results = campaign.run()
system = results.state_space

print(results.summary())
"""
N, STEEL_N_M, MASS_KG = 12, 4e6, 0.5


def make_chain(stiffness, masses):
    """A chain of masses and springs whose left end is held: dense matrices."""
    K = np.zeros((N, N))
    for spring, k in enumerate(stiffness):
        K[spring, spring] += k
        if spring:
            K[spring - 1, spring - 1] += k
            K[spring - 1, spring] -= k
            K[spring, spring - 1] -= k
    return np.diag(masses), K


def accelerance(M, K, ratios, outputs, inputs, f):
    """FRFs of dense matrices by their modes, (n_lines, n_outputs, n_inputs); nodes count from 1."""
    root = np.diag(1 / np.sqrt(np.diag(M)))
    squares, vectors = np.linalg.eigh(root @ K @ root)
    shapes, omega, s = root @ vectors, np.sqrt(squares), 2j * np.pi * f[:, None]
    modal = s**2 / (s**2 + 2 * ratios * omega * s + omega**2)
    return np.einsum("or,fr,ir->foi", shapes[np.array(outputs) - 1], modal, shapes[np.array(inputs) - 1])


# Springs 8 % stiffer to the left and 5 % softer to the right, which no single cause explains: the search is long.
GRADED = np.linspace(1.08, 0.95, N), np.where(np.arange(N) == 6, 1.05, 1.0)
STIFFER = np.full(N, 1.06), np.ones(N)


@pytest.fixture(
    scope="module",
    params=[pytest.param(STIFFER, id="stiffer"), pytest.param(GRADED, id="graded", marks=pytest.mark.slow)],
)
def truth(request):
    """The real chain."""
    stiffness_ratios, mass_ratios = request.param
    M, K = make_chain(STEEL_N_M * stiffness_ratios, MASS_KG * mass_ratios)
    return M, K, np.full(N, 0.01)


@pytest.fixture(scope="module")
def nominal():
    return make_chain(np.full(N, STEEL_N_M), np.full(N, MASS_KG))


@pytest.fixture(scope="module")
def notebook(truth, nominal):
    """The names of the notebook after it was executed, on FRFs with a little noise."""
    f = np.arange(5.0, 400.0, 0.25)
    H = accelerance(*truth, [12, 5], [3, 12], f)
    random = np.random.default_rng(7)
    H = H + 1e-3 * np.median(np.abs(H)) * (random.normal(size=H.shape) + 1j * random.normal(size=H.shape))
    M, K = nominal
    names = {"M": M, "K": K, "f": f, "H": H, "names": [f"{node}:x" for node in range(1, N + 1)]}
    exec(compile(NOTEBOOK, "notebook", "exec"), names)
    return names


def test_the_notebook_is_short_and_imports_frf_ipz_only():
    assert len(NOTEBOOK.strip().splitlines()) <= MOST_LINES
    imports = [node for node in ast.walk(ast.parse(NOTEBOOK)) if isinstance(node, ast.Import | ast.ImportFrom)]
    assert [ast.unparse(node) for node in imports] == ["import frf_ipz"]
    attributes = [node for node in ast.walk(ast.parse(NOTEBOOK)) if isinstance(node, ast.Attribute)]
    assert not [node.attr for node in attributes if node.attr.startswith("_")]


def test_the_state_space_is_one_of_python_control_with_names(notebook):
    system = notebook["system"]
    assert isinstance(system, control.StateSpace)
    assert system.input_labels == ["3:+x", "12:+x"]
    assert system.output_labels == ["12:+x", "5:+x", "8:+x"]


def test_its_frfs_at_the_point_of_interest_are_those_of_the_real_structure(notebook, truth, nominal):
    system, f = notebook["system"], np.arange(6.0, 390.0, 1.0)
    row = system.output_labels.index("8:+x")
    predicted = np.array([system(2j * np.pi * hertz)[row] for hertz in f])
    real = accelerance(*truth, [8], [3, 12], f)[:, 0]
    untouched = accelerance(*nominal, np.full(N, 0.01), [8], [3, 12], f)[:, 0]
    error, error_before = (np.median(np.abs(values / real - 1), axis=0) for values in (predicted, untouched))
    assert np.all(error < 0.03)
    assert np.all(error < error_before / 3)
