"""The covariance that is never formed gives what the formed one would."""

import numpy as np
import pytest
from scipy import sparse

from frf_ipz.identification.root_covariance import RootCovariance, pair_blocks

EXACT = 1e-13  # rounding of a sum of five products


@pytest.fixture(name="forms")
def both_forms():
    rng = np.random.default_rng(3)
    common = rng.standard_normal((8, 5))
    parts = [rng.standard_normal((4, 6)) for _ in range(2)]
    blocks = sparse.block_diag([part @ part.T for part in parts], format="csr")
    return RootCovariance(common=common, blocks=blocks), common @ common.T + blocks.toarray()


@pytest.mark.parametrize(
    "key",
    [
        np.ix_([1, 4, 2], [0, 7]),
        (slice(2, 6), slice(None)),
        (slice(None), 3),
        (5, slice(1, 4)),
        (2, 3),
        (-1, -1),
        np.ix_([], [1]),
    ],
    ids=["ix", "slices", "column", "row", "number", "negative", "empty"],
)
def test_indexing(forms, key):
    covariance, dense = forms
    key = tuple(np.asarray(part, int) if isinstance(part, np.ndarray) else part for part in key)
    assert np.shape(covariance[key]) == dense[key].shape
    np.testing.assert_allclose(covariance[key], dense[key], rtol=EXACT, atol=EXACT)


def test_diagonal_blocks_and_array(forms):
    covariance, dense = forms
    assert covariance.shape == dense.shape
    np.testing.assert_allclose(covariance.diagonal(), np.diagonal(dense), rtol=EXACT)
    np.testing.assert_allclose(np.diagonal(covariance), np.diagonal(dense), rtol=EXACT)
    np.testing.assert_allclose(pair_blocks(covariance), pair_blocks(dense), rtol=EXACT, atol=EXACT)
    np.testing.assert_allclose(pair_blocks(dense)[1], dense[2:4, 2:4], rtol=EXACT)
