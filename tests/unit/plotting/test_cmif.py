"""The complex mode indicator function: what it is computed from, and what is marked."""

import numpy as np
import pytest

from frf_ipz.dofs import Dof
from frf_ipz.frf import FrfLabel, FrfSet
from frf_ipz.plotting.cmif import describe_cmif
from frf_ipz.plotting.picture import Labels, Line, VerticalLines
from frf_ipz.quantities import FrfQuantity
from frf_ipz.runs.picture_data import mode_indicator
from synthetic_run import synthetic_folder

HERTZ = np.arange(50.0, 150.0, 0.25)
S = 2j * np.pi * HERTZ
SHAPES = np.array([[1.0, 1.0, 0.4], [1.0, -1.0, 0.2]])  # two modes at nearly one frequency
POLES = 2 * np.pi * np.array([99.9, 100.1]) * (1j - 0.01)
DOFS = [Dof(1, "z"), Dof(2, "z"), Dof(3, "z")]


def two_modes(pairs, quantity=FrfQuantity.RECEPTANCE):
    """FRFs of two modes that share a peak, between pairs of DOFs; one quantity, or one for each."""
    quantities = quantity if isinstance(quantity, list) else [quantity] * len(pairs)
    labels = tuple(FrfLabel(DOFS[i], DOFS[j], kind) for (i, j), kind in zip(pairs, quantities, strict=True))
    columns = []
    for (i, j), kind in zip(pairs, quantities, strict=True):
        terms = [
            shape[i] * shape[j] / (S**2 - 2 * pole.real * S + abs(pole) ** 2)
            for shape, pole in zip(SHAPES, POLES, strict=True)
        ]
        columns.append(sum(terms) * S**kind.power)
    values = np.stack(columns, 1)
    return FrfSet(
        frequency_hz=HERTZ,
        labels=labels,
        values=values,
        variance=np.full(values.shape, np.nan),
        coherence=np.full(values.shape, np.nan),
        averages=np.zeros(len(labels), int),
    )


FULL = [(i, j) for i in range(3) for j in range(2)]


def test_two_modes_in_one_peak_show_as_two_curves_that_peak_there():
    values = mode_indicator(two_modes(FULL)).values
    assert values.shape == (len(HERTZ), 2)
    peaks = HERTZ[values.argmax(axis=0)]
    np.testing.assert_allclose(peaks, 100.0, rtol=0.005)
    assert values[:, 1].max() > 0.3 * values[:, 0].max()


def test_singular_values_hold_all_of_the_matrix():
    frfs = two_modes(FULL)
    squares = (np.abs(frfs.values) ** 2).sum(axis=1)
    np.testing.assert_allclose((mode_indicator(frfs).values ** 2).sum(axis=1), squares, rtol=1e-12)


def test_an_entry_that_was_not_measured_makes_no_second_peak():
    indicator = mode_indicator(two_modes([(0, 0), (1, 1), (2, 1)]))
    assert indicator.values.shape[1] == 1
    assert (len(indicator.outputs), len(indicator.inputs)) == (2, 1)


def test_quantities_are_turned_into_that_of_the_first():
    mixed = [FrfQuantity.ACCELERANCE, *[FrfQuantity.RECEPTANCE] * 5]
    indicator = mode_indicator(two_modes(FULL, mixed))
    expected = mode_indicator(two_modes(FULL, FrfQuantity.ACCELERANCE))
    np.testing.assert_allclose(indicator.values, expected.values, rtol=1e-9)
    assert indicator.title == "Accelerance, m/s^2/N"


@pytest.fixture(scope="module")
def described():
    results = synthetic_folder().results
    return results["fit"], describe_cmif(mode_indicator(results["ingest"].frfs), results["fit"])


def test_the_modes_of_the_fit_are_marked_and_numbered(described):
    fit, picture = described
    (marks,) = [layer for layer in picture.layers if isinstance(layer, VerticalLines)]
    np.testing.assert_array_equal(marks.x, fit.model.natural_frequency_hz[: fit.n_modes])
    (numbers,) = [layer for layer in picture.layers if isinstance(layer, Labels)]
    assert numbers.texts[0].startswith("1")
    assert any(isinstance(layer, Line) for layer in picture.layers)
