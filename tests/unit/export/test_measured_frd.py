"""Measured FRFs reach python-control as they were measured."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from chains import label
from frf_ipz.errors import InputError
from frf_ipz.export.frequency_response_data import to_frd
from frf_ipz.frf import FrfSet

LABELS = (label(2, 1), label(-4, 1), label(2, 3))


def frfs():
    rng = np.random.default_rng(0)
    values = rng.standard_normal((5, 3)) + 1j * rng.standard_normal((5, 3))
    nothing = np.full(values.shape, np.nan)
    return FrfSet(
        frequency_hz=np.arange(1.0, 6.0),
        values=values,
        labels=LABELS,
        variance=nothing,
        coherence=nothing,
        averages=np.zeros(3, int),
    )


def test_rows_are_sensors_columns_excited_dofs_and_unmeasured_pairs_nan():
    measured = frfs()
    data = to_frd(measured)
    assert data.output_labels == ["2:+x", "4:-x"]
    assert data.input_labels == ["1:+x", "3:+x"]
    assert np.array_equal(data.frdata[0, 0], measured.values[:, 0])
    assert np.array_equal(data.frdata[1, 0], measured.values[:, 1])
    assert np.array_equal(data.frdata[0, 1], measured.values[:, 2])
    assert np.isnan(data.frdata[1, 1]).all()
    assert_allclose(data.omega, 2 * np.pi * measured.frequency_hz, rtol=1e-15)


def test_an_exponential_window_is_refused():
    with pytest.raises(InputError, match="exponential window"):
        to_frd(replace(frfs(), window_decay_1_s=3.0))
