"""A delay of one channel that the lines speak against is not taken off."""

import numpy as np

from frf_ipz.identification.fit import fit_modes
from frf_ipz.identification.search import find_modes
from synthetic_frfs import accelerances, random_modes

LATE_S = 0.2  # as long as the modes ring: no pole describes it


def test_keeps_fit_where_delay_leaves_more(monkeypatch):
    modes = random_modes(np.array([60.0, 95.0, 140.0]), 0.01, n_outputs=3, n_inputs=1)
    frfs = accelerances(modes, np.arange(30.0, 200.0, 0.25))
    before = fit_modes(frfs)
    monkeypatch.setattr(find_modes, "late_channels", lambda *_: np.array([LATE_S, 0.0, 0.0]))
    fit = fit_modes(frfs)
    assert fit.n_modes == before.n_modes
    assert not fit.misfit["delay_s"].any()
