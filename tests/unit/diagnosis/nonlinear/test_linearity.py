import numpy as np
import pytest

from frf_ipz.diagnosis.nonlinear.linearity import assess_linearity


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
