from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.diagnosis.nonlinear.linearity import WIDTH, assess_linearity

HALF_BAND = WIDTH / 2  # lines


def test_blows_on_a_linear_chain_agree(strike):
    found = assess_linearity(strike())
    assert not found.is_nonlinear
    assert found.score > 0  # something was compared


@pytest.mark.parametrize(
    "law",
    [lambda w, _: 2e10 * w**3, lambda _, v: 1.5 * np.tanh(v / 1e-3)],
    ids=["cubic", "friction"],
)
def test_blows_on_a_nonlinear_chain_do_not(strike, law):
    assert assess_linearity(strike(law)).is_nonlinear


def test_groups_of_lines_keep_out_of_what_is_left_out(strike):
    low, high = 30.0, 40.0
    found = assess_linearity(replace(strike(), exclude_hz=((low, high),)))
    spacing = 0.25 * HALF_BAND  # of lines, 4 s of record
    assert len(found.frequency_hz) > 4
    assert np.all((found.frequency_hz + spacing < low) | (found.frequency_hz - spacing > high))
    assert not found.is_nonlinear
