"""Poles that the final weights do not ask for go, and those that the user has pinned stay."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.identification.fit import fit_modes
from frf_ipz.identification.likelihood.refinement import refine_poles
from frf_ipz.identification.options import FitOptions, PinnedPole
from frf_ipz.identification.search import find_modes
from synthetic_frfs import accelerances, count, random_modes

LINES_HZ = np.arange(256, 2560) * 0.078125  # 20 to 200 Hz
TRUE_HZ = np.array([42.7, 136.8])
FALSE_HZ = 90.0
SEED = 3


@pytest.fixture
def truth():
    return random_modes(TRUE_HZ, 0.01, n_outputs=3, n_inputs=1, seed=SEED)


@pytest.fixture
def frfs(truth):
    """Make FRFs whose noise differs over the lines, so that the search has other weights than the last fit."""
    even = accelerances(truth, LINES_HZ, noise=1e-3, seed=SEED)
    slope = np.exp(np.outer(np.linspace(-1, 1, len(LINES_HZ)), [2.0, 0.0, -2.0]))
    clean = accelerances(truth, LINES_HZ, noise=0.0, seed=SEED)
    return replace(even, values=clean.values + (even.values - clean.values) * slope, variance=even.variance * slope**2)


@pytest.fixture
def _search_believes_a_false_mode(monkeypatch):
    select = find_modes.select_modes

    def select_one_more(data, poles, terms, options, **known):
        selected = select(data, poles, terms, options, **known)
        false = 2 * np.pi * FALSE_HZ * complex(-0.01, 1.0)
        fit = refine_poles(data, np.append(selected.fit.poles, false), terms, iterations=0)
        return replace(selected, fit=replace(fit, has_converged=False))

    monkeypatch.setattr(find_modes, "select_modes", select_one_more)


@pytest.mark.usefixtures("_search_believes_a_false_mode")
def test_mode_that_the_final_weights_do_not_ask_for_is_dropped_and_said(frfs, truth):
    fit = fit_modes(frfs)
    assert count(fit.model.poles[: fit.n_modes], truth.poles, frequency=0.01) == (2, 0, 0)
    assert (fit.modes["significance"] > 1).all()
    dropped = fit.decisions[fit.decisions["action"] == "dropped"]
    assert dropped["reason"].str.contains("BIC").any()


@pytest.mark.usefixtures("_search_believes_a_false_mode")
def test_pinned_mode_stays_whatever_the_lines_say(frfs):
    options = FitOptions(pin_hz=(PinnedPole(hz=FALSE_HZ),))
    assert fit_modes(frfs, options=options).n_modes == len(TRUE_HZ) + 1
