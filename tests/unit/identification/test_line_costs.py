"""What is made of all lines without going through them for each number: the same numbers as by going through them."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.frf import FrfSet
from frf_ipz.identification.likelihood import sandwich
from frf_ipz.identification.likelihood.compression import column_gains, compress, model_columns, response
from frf_ipz.identification.likelihood.delay import find_delays
from frf_ipz.identification.likelihood.refinement import refine_poles
from frf_ipz.identification.likelihood.smooth_terms import smooth_terms_of_band
from frf_ipz.identification.measured_lines import measured_lines
from frf_ipz.identification.options import FitOptions
from frf_ipz.identification.search import goodness_of_fit
from frf_ipz.numerics import polyreference
from frf_ipz.numerics.partial_fractions import stacked, unstacked
from synthetic_frfs import accelerances, random_modes

SAME = 1e-6  # relative: normal equations lose the square of a condition of up to 1e5
DELAY_S = 2.3e-4


@pytest.fixture(scope="module", params=["one weight", "each its own"])
def fitted(request):
    """Lines, a fit of them, and its terms: with weights that all FRFs share, or with those of each."""
    modes = random_modes([45.0, 80.0, 83.0, 150.0], 0.006, n_outputs=3, n_inputs=1)
    frfs: FrfSet = accelerances(modes, np.arange(20.0, 200.0, 0.05))
    if request.param == "each its own":
        slopes = np.geomspace([1.0, 1.0, 30.0], [30.0, 1.0, 1.0], frfs.n_lines)
        frfs = replace(frfs, variance=frfs.variance * slopes)
    lines = measured_lines(frfs, FitOptions())
    terms = smooth_terms_of_band(lines.band_hz, lines.line_hz).first(3)
    data = lines.weighted()
    assert data.is_shared == (request.param == "one weight")
    return data, refine_poles(data, modes.poles, terms), terms


def variance_factors_by_qr(data, fit, terms):
    """Give the factors by an orthonormal basis over all lines, and the covariance of scores as a matrix."""
    n, poles = fit.system.n_linear, fit.poles
    misfit = stacked((data.receptance - response(fit.system, terms, data.s)) * data.weight)
    residues = fit.system.scaled_residues()
    scores = np.zeros((len(data.s), 2 * len(poles)))
    for frf in range(misfit.shape[1]):
        weight = data.profile if data.is_shared else data.weight[:, frf]
        columns = model_columns(data.s, poles, terms, real_modes=False, with_slopes=True) * np.tile(weight, 2)[:, None]
        basis = np.linalg.qr(columns[:, :n])[0]
        real, imag = np.split(columns[:, n:] - basis @ (basis.T @ columns[:, n:]), 2, axis=1)
        leverage = np.sum(basis**2, axis=1)
        of_frf = (misfit[:, frf] / np.sqrt(1 - np.minimum(leverage, sandwich.MAX_LEVERAGE)))[:, None]
        a, b = residues[frf].real, residues[frf].imag
        by_line = np.concatenate([real * a + imag * b, imag * a - real * b], axis=1) * of_frf
        scores += by_line[: len(scores)] + by_line[len(scores) :]
    inverse = np.linalg.inv(fit.information)
    variances = []
    for max_lag in sandwich.LAGS:
        total = scores.T @ scores
        for lag in range(1, max_lag + 1):
            product = scores[lag:].T @ scores[:-lag]
            total += (1 - lag / (max_lag + 1)) * (product + product.T)
        variances.append(np.diag(inverse @ total @ inverse))
    return np.max(variances, axis=0) / np.diag(inverse)


def test_variance_factors_need_no_orthonormal_basis_of_the_lines(fitted, monkeypatch):
    expected = variance_factors_by_qr(*fitted)

    def refuse(*_, **__):
        raise AssertionError("no QR over all lines: the fit has the factor")

    monkeypatch.setattr(np.linalg, "qr", refuse)
    np.testing.assert_allclose(sandwich.pole_variance_factors(*fitted), expected, rtol=SAME, atol=0)


def test_responses_are_the_columns_times_the_coefficients(fitted):
    data, fit, terms = fitted
    columns = model_columns(data.s, fit.poles, terms, real_modes=False)
    expected = unstacked(columns @ fit.system.coefficients().T)
    size = np.abs(expected).max()
    np.testing.assert_allclose(response(fit.system, terms, data.s) / size, expected / size, rtol=0, atol=1e-12)


def test_gains_of_groups_of_any_size(fitted):
    data, fit, terms = fitted
    groups = [[8, 12], [3], [2, 3, 4]]
    whole = compress(data, fit.poles, terms)
    gains = column_gains(whole, groups)
    for group, of_group in zip(groups, gains, strict=True):
        others = np.delete(np.arange(whole.n_linear), group)
        for frf, z in enumerate(whole.z[:, : whole.n_linear]):
            U = whole.U[frf if len(whole.U) > 1 else 0][: whole.n_linear, : whole.n_linear]
            left = np.linalg.lstsq(U[:, others], z, rcond=None)[1]
            np.testing.assert_allclose(of_group[frf], left.sum(), rtol=SAME, atol=SAME)


def test_one_search_for_missing_poles_an_assessment(fitted, monkeypatch):
    data, fit, terms = fitted
    asked = []

    def count(*args):
        asked.append(args)
        return find(*args)

    find = goodness_of_fit.find_candidates
    monkeypatch.setattr(goodness_of_fit, "find_candidates", count)
    without_one = refine_poles(data, fit.poles[:3], terms)
    goodness = goodness_of_fit.assess_fit(data, without_one, terms)
    assert len(asked) == 1  # what is dropped does not depend on what may be added
    as_it_is, over_level = goodness_of_fit.missing_poles(goodness)
    assert np.abs(as_it_is[0] - fit.poles[3]) < -2 * fit.poles[3].real
    assert over_level is goodness.candidates.poles


@pytest.mark.parametrize("fitted", ["one weight"], indirect=True)
def test_a_delay_comes_with_the_misfit_that_it_leaves(fitted):
    data, fit, terms = fitted
    late = replace(data, receptance=data.receptance * np.exp(-data.s[:, None] * DELAY_S))
    delays, misfit = find_delays(late.with_real_modes(), fit.poles, terms, np.zeros(3, np.int64))
    np.testing.assert_allclose(delays, DELAY_S, rtol=0, atol=5e-6)  # 0.1 % of the shortest period
    again = replace(late, receptance=late.receptance * np.exp(data.s[:, None] * delays), real_modes=True)
    np.testing.assert_allclose(misfit, np.sum(compress(again, fit.poles, terms).misfit), rtol=SAME, atol=0)


def test_normal_modes_share_what_was_made_of_the_lines(fitted):
    data, fit, terms = fitted
    compress(data, fit.poles, terms)
    assert data.with_real_modes().real_modes
    assert list(data.with_real_modes().sums.values()) == list(data.sums.values())


@pytest.mark.parametrize("angles", [(0.0, np.pi), (0.3, 5.9)])
def test_start_poles_go_through_the_lines_once(angles):
    theta = np.linspace(*angles, 20_000)
    theta = np.delete(theta, slice(4000, 9000))
    columns = np.random.default_rng(2).standard_normal((len(theta), 3, 2)).view(complex)[..., 0]
    few, carried = polyreference._carried_to_nodes(theta, columns, 60)
    assert len(few) < len(theta) / 10
    waves = np.exp(-1j * np.arange(-60, 61)[:, None] * theta)
    expected = waves @ columns
    size = np.sum(np.abs(columns))
    found = np.exp(-1j * np.arange(-60, 61)[:, None] * few) @ carried
    np.testing.assert_allclose(found / size, expected / size, rtol=0, atol=1e-14)
