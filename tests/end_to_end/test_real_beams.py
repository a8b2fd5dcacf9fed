"""Real measurements by others: a sensor that is left out is predicted from the rest."""

import numpy as np

from frf_testbench.studies.left_out import predict_left_out, read_beam


def test_the_fourth_sensor_of_a_steel_beam_is_predicted(recordings):
    """The beam's ends are bent, which its model does not know: frequencies are a quarter off to begin with."""
    table = predict_left_out(read_beam(recordings / "steel_beam_5x3"), 70)
    updated, trivial = table.loc["updated"], table.loc["measured poles, nominal shapes"]
    assert table.loc["nominal", "X_S"] < 0.05
    assert updated["X_S"] > 0.8
    assert updated["dB"] < trivial["dB"] - 1
    assert np.isfinite(updated["factor"])
