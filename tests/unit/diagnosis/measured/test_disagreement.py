"""What records disagree by is nothing that a model could explain."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosed import labels
from frf_ipz.diagnosis.measured.data_split import DataSplit
from frf_ipz.diagnosis.measured.disagreement import measure_disagreement
from frf_ipz.diagnosis.measured.transfer_functions import TransferFunctions

N_POINTS, NOISE, TOLERANCE = 120, 2e-3, 1e-3


def functions_of(drawn, disturbance=0.0):
    """FRFs of size 1 with white noise; the second one is disturbed in the first sixth of the band."""
    noise = NOISE * (drawn.standard_normal((N_POINTS, 2)) + 1j * drawn.standard_normal((N_POINTS, 2))) / np.sqrt(2)
    values = 1.0 + noise
    values[: N_POINTS // 6, 1] += disturbance * NOISE
    return TransferFunctions(
        s=2j * np.pi * np.linspace(10.0, 100.0, N_POINTS),
        labels=labels(),
        values=values,
        size=np.ones((N_POINTS, 2)),
        covariance=np.repeat(NOISE**2 * np.eye(N_POINTS, dtype=complex)[None], 2, 0),
        shared_errors=(np.zeros((N_POINTS, 0), complex),),
        input_index=np.zeros(2, np.int64),
    )


@pytest.mark.parametrize(("held_out_kind", "least"), [("records", 10.0), ("lines", 1.0)])
def test_what_disturbs_one_frf_in_a_part_of_the_band_shows_there_only(held_out_kind, least):
    drawn = np.random.default_rng(3)
    sound = functions_of(drawn)
    split = DataSplit(
        coarse=sound, middle=sound, training=sound, held_out=functions_of(drawn, 6.0), survey=None,
        kind="hammer", held_out_kind=held_out_kind,
    )  # fmt: skip
    disagreement = measure_disagreement(split, TOLERANCE)
    assert disagreement[1, 0] >= least
    assert np.delete(disagreement.ravel(), 6).max() < 1.5
    assert (disagreement >= 1).all()
    calm = measure_disagreement(replace(split, held_out=functions_of(drawn)), TOLERANCE)
    assert calm.max() < 1.5
