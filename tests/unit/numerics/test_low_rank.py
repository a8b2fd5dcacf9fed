"""Bilinear forms of matrices of low rank, against the matrices."""

import numpy as np
import pytest

from frf_ipz.numerics.low_rank import factorise, of_entries

ORDER = 9


@pytest.fixture
def symmetric():
    rng = np.random.default_rng(0)
    roots = [rng.standard_normal((ORDER, rank)) for rank in (1, 2, 5, ORDER)]
    pair = np.zeros((ORDER, ORDER))
    pair[1, 4] = pair[4, 1] = 3.0
    return np.array([np.zeros((ORDER, ORDER)), *(root @ root.T for root in roots), pair])


@pytest.mark.parametrize("imaginary", [0.0, 1.0])
def test_forms_are_those_of_the_matrices(symmetric, imaginary):
    rng = np.random.default_rng(1)
    left, right = (
        rng.standard_normal((ORDER, 20)) + 1j * imaginary * rng.standard_normal((ORDER, 20)) for _ in range(2)
    )
    expected = np.einsum("in,pij,jn->np", left, symmetric, right)
    assert np.abs(factorise(symmetric).forms(left, right) - expected.real).max() < 1e-9 * np.abs(expected).max()


def test_forms_of_real_pairs_beside_complex_ones(symmetric):
    rng = np.random.default_rng(2)
    left, right = rng.standard_normal((2, ORDER, 6)) + 1j * rng.standard_normal((2, ORDER, 6))
    left.imag[:, ::2] = right.imag[:, 1] = 0.0
    expected = np.einsum("in,pij,jn->np", left, symmetric, right).real
    for chosen in (symmetric, symmetric[[1, 5, 2]], symmetric[[4, 0, 3]]):
        of_chosen = np.einsum("in,pij,jn->np", left, chosen, right).real
        assert np.abs(factorise(chosen).forms(left, right) - of_chosen).max() < 1e-9 * np.abs(expected).max()


def test_a_pair_of_modes_is_one_entry(symmetric):
    found = factorise(symmetric[-1:])
    assert (found.rows.tolist(), found.columns.tolist(), found.entries.tolist()) == ([1], [4], [3.0])
    assert found.vectors.shape == (ORDER, 0)


def test_an_entry_of_the_diagonal_counts_once():
    assert factorise(np.diag([0.0, 2.0])[None]).forms(np.ones((2, 1)), np.ones((2, 1))).tolist() == [[2.0]]
    assert of_entries(np.array([1]), np.array([1])).forms(np.ones((2, 1)), np.ones((2, 1))).tolist() == [[1.0]]


def test_forms_are_added_to_what_is_there(symmetric):
    forms, some = factorise(symmetric), np.ones((ORDER, 3))
    total = forms.forms(some, some)
    forms.add_forms(total, some, -some)
    assert np.abs(total).max() < 1e-12


def test_sums_are_those_of_the_matrices(symmetric):
    """Also of two matrices with their entry at one place, in other coordinates, and for many amounts at once."""
    rng = np.random.default_rng(3)
    stack = np.concatenate([symmetric, 2.0 * symmetric[-1:], np.diag(np.eye(ORDER)[2])[None]])
    amounts = rng.standard_normal((4, len(stack)))
    for turn in (None, rng.standard_normal((ORDER, ORDER))):
        turned = stack if turn is None else turn.T @ stack @ turn
        total = np.ones((4, ORDER, ORDER))
        factorise(stack, turn).add_sums(total, amounts)
        expected = 1.0 + np.tensordot(amounts, turned, 1)
        assert np.abs(total - expected).max() < 1e-9 * np.abs(expected).max()
        alone = np.zeros((ORDER, ORDER))
        factorise(stack, turn).add_sums(alone, amounts[0])
        assert np.abs(alone + 1.0 - expected[0]).max() < 1e-9 * np.abs(expected).max()


def test_no_matrices_have_no_forms():
    assert factorise(np.zeros((2, 3, 3))).forms(np.eye(3), np.eye(3)).tolist() == [[0.0, 0.0]] * 3
    assert factorise(np.zeros((0, 3, 3))).forms(np.eye(3), np.eye(3)).shape == (3, 0)
