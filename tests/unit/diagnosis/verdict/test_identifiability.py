"""The evidence of an effect that no scatter explains."""

from types import SimpleNamespace

import numpy as np
import pytest

from frf_ipz.diagnosis.verdict import identifiability as detectable


@pytest.mark.parametrize("size", [1.0, 1e9])
def test_what_scatter_explains_is_no_evidence_however_much_it_changes(monkeypatch, size):
    """Two of the three columns are alike to the last bits; only a part of 2 lies across all of them."""
    rng = np.random.default_rng(0)
    basis = np.linalg.qr(rng.standard_normal((40, 4)))[0]
    columns = size * np.stack([basis[:, 0], basis[:, 0] * (1 + 1e-15), basis[:, 1]], 1)
    white = 3 * basis[:, 0] + basis[:, 1] + 2 * basis[:, 2]
    monkeypatch.setattr(detectable, "nuisance_jacobian", lambda *_: columns)
    answer = SimpleNamespace(values=np.zeros((40, 1)))
    data = SimpleNamespace(
        measured=SimpleNamespace(s=None),
        slopes=lambda _, changes: white[:, None] if changes.ndim == 3 else changes,
    )
    hypothesis = SimpleNamespace(respond=lambda *_: answer)
    problem = SimpleNamespace(data=data, nuisance_prior=SimpleNamespace(size=3), context=SimpleNamespace(layout=None))
    null = SimpleNamespace(hypothesis=hypothesis, values=None)
    evidence = detectable._make_evidence(problem, null)(hypothesis, None)
    remaining = np.linalg.lstsq(np.vstack([columns, np.eye(3)]), np.concatenate([white, np.zeros(3)]), rcond=1e-15)
    expected = 0.5 * float(np.sum((white - columns @ remaining[0]) ** 2) + np.sum(remaining[0] ** 2))
    assert evidence == pytest.approx(expected, rel=1e-6)
    assert evidence > 2.0 - 1e-6
