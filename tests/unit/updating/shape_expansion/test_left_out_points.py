"""How well a point follows from the others, where it is heard."""

import numpy as np
import pytest

from frf_ipz.updating.shape_expansion.left_out_points import median_error_db


def test_lines_where_nothing_is_heard_do_not_count():
    predicted = np.full((10, 2), 2.0 + 0j)
    measured = np.full((10, 2), 1.0 + 0j)
    measured[:, 1] = np.nan
    assert median_error_db(measured, predicted, is_level_known=True) == pytest.approx(20 * np.log10(2))
    assert np.isnan(median_error_db(measured[:, 1:], predicted[:, 1:], is_level_known=True))
