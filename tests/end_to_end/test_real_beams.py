"""Real measurements by others: a sensor that is left out is predicted from the rest."""

import numpy as np

import frf_ipz
from real_beams import leave_out


def test_the_fourth_sensor_of_a_steel_beam_is_predicted(recordings):
    """The beam's ends are bent, which its model does not know: frequencies are a quarter off to begin with."""
    folder = recordings / "steel_beam_5x3"
    frfs = frf_ipz.estimate_frfs(frf_ipz.read_test(folder / "test.toml"), options=frf_ipz.IngestOptions()).frfs
    table = leave_out(frfs, frf_ipz.read_model(folder / "model.toml"), (20.0, 600.0), "output", 70)
    updated, trivial = table.loc["updated"], table.loc["measured poles, nominal shapes"]
    assert table.loc["nominal", "X_S"] < 0.05
    assert updated["X_S"] > 0.8
    assert updated["dB"] < trivial["dB"] - 1
    assert np.isfinite(updated["factor"])
