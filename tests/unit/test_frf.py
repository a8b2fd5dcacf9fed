"""Sets of measured FRFs."""

import numpy as np
import pytest

from frf_ipz.dofs import Dof, parse_dof
from frf_ipz.errors import InputError, ShapeError
from frf_ipz.frf import FrfLabel, FrfSet
from frf_ipz.quantities import FrfQuantity, frf_quantity_of

FREQUENCY = np.arange(1.0, 6.0)
PAIRS = [(1, 8), (2, 8), (1, 9)]  # node 2 was not measured for the excitation at node 9


def frf_set(**changes):
    values = np.arange(15.0).reshape(5, 3) + 1j
    labels = tuple(
        FrfLabel(Dof(output, "z", -1), Dof(struck, "z"), FrfQuantity.ACCELERANCE) for output, struck in PAIRS
    )
    fields = {
        "frequency_hz": FREQUENCY,
        "values": values,
        "labels": labels,
        "variance": np.full((5, 3), np.nan),
        "coherence": np.ones((5, 3)),
        "averages": np.array([3, 3, 4]),
    }
    return FrfSet(**{**fields, **changes})


def test_arrays_cannot_be_written_to():
    with pytest.raises(ValueError, match="read-only"):
        frf_set().values[0, 0] = 0


@pytest.mark.parametrize("name", ["values", "variance", "coherence", "averages"])
def test_shapes_that_disagree_are_refused(name):
    with pytest.raises(ShapeError, match=name):
        frf_set(**{name: np.zeros((4, 3))})


def test_values_that_are_not_finite_are_refused_with_their_index():
    values = np.zeros((5, 3), complex)
    values[2, 1] = np.nan
    with pytest.raises(ShapeError, match=r"\(2, 1\)"):
        frf_set(values=values)


def test_the_matrix_has_holes_where_nothing_was_measured():
    frfs = frf_set()
    matrix, measured = frfs.matrix()
    assert [dof.node for dof in frfs.output_dofs] == [1, 2]
    assert [dof.node for dof in frfs.input_dofs] == [8, 9]
    assert measured.tolist() == [[True, True], [True, False]]
    np.testing.assert_array_equal(matrix[:, 0, 1], frfs.values[:, 2])
    assert not matrix[:, 1, 1].any()


def test_lines_and_frfs_can_be_selected():
    frfs = frf_set().select_lines(FREQUENCY > 2).select_frfs([2, 0])
    assert frfs.n_lines == 3
    assert [label.input_dof.node for label in frfs.labels] == [9, 8]
    assert frfs.averages.tolist() == [4, 3]
    np.testing.assert_array_equal(frfs.values, frf_set().values[2:, [2, 0]])


def test_a_band_includes_its_ends_and_leaves_out_what_is_excluded():
    assert frf_set().in_band((2, 5), [(2.5, 3.5)]).tolist() == [False, True, False, True, True]


def test_a_band_outside_the_data_is_refused_with_what_there_is():
    with pytest.raises(InputError, match="1 to 5 Hz"):
        frf_set().in_band((10, 20))


def test_the_windows_rate_is_the_real_part_of_s():
    np.testing.assert_allclose(frf_set(window_decay_1_s=3.0).s, 3 + 2j * np.pi * FREQUENCY, rtol=1e-15, atol=0)


def test_labels_know_sign_and_unit():
    label = frf_set().labels[0]
    assert label.sign == -1
    assert label.unit == "m/s^2/N"
    assert FrfQuantity.RECEPTANCE.unit("rx", "ry") == "rad/(N m)"
    assert [frf_quantity_of(name).power for name in ("displacement", "velocity", "acceleration")] == [0, 1, 2]


def test_a_label_takes_the_names_of_dofs_and_quantities():
    label = FrfLabel("20:-z", "18:+z", "mobility")
    assert label == FrfLabel(parse_dof("20:-z"), parse_dof("18:+z"), FrfQuantity.MOBILITY)
    with pytest.raises(InputError, match="20:zz"):
        FrfLabel("20:zz", "18:+z", "mobility")


@pytest.mark.parametrize(("band_hz", "is_named"), [((2000, 4000), True), ((8000, 9000), False), ((0.1, 0.2), False)])
def test_a_band_a_thousand_times_too_high_is_taken_for_time_in_ms(band_hz, is_named):
    with pytest.raises(InputError) as raised:
        frf_set().in_band(band_hz)
    assert ("time of the recordings is in ms" in str(raised.value)) == is_named
