"""Real measurements by others: each point that is left out is predicted from the rest."""

import pytest

from frf_testbench.studies.left_out import predict_left_out, read_beam

TRIVIAL, UPDATED = "measured poles, nominal shapes", "updated"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("node", "bar_db", "in_band"),
    [
        (30, 1.6, 0.8),
        (50, 1.6, 0.8),
        (70, 1.6, 0.8),
    ],
)
def test_every_inner_sensor_of_a_steel_beam_is_predicted(recordings, node, bar_db, in_band):
    """Masses at its ends and actuators are found, and hidden things split its modes; the model knows neither."""
    table = predict_left_out(read_beam(recordings / "steel_beam_5x3"), node)
    updated = table.loc[UPDATED]
    assert updated["dB after the factor"] < min(bar_db, table.loc[TRIVIAL, "dB after the factor"] / 2)
    assert updated["in the band"] > in_band


@pytest.mark.slow
def test_a_struck_point_of_a_free_beam_is_predicted(recordings):
    """Without a factor: the file of the driving point is 15 % low, which must not spoil the others."""
    table = predict_left_out(read_beam(recordings / "freefree_beam"), 49)
    assert table.loc[UPDATED, "dB"] < 0.60
    assert table.loc[UPDATED, "dB after the factor"] < table.loc[TRIVIAL, "dB after the factor"] + 0.1
    assert table.loc[UPDATED, "in the band"] > 0.8
