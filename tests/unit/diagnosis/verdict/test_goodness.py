"""The shortfall of a fit is its worst figure."""

from types import SimpleNamespace

import numpy as np
import pytest

from frf_ipz.diagnosis.verdict.goodness import Goodness, Limits, _find_common, required_log_bayes_factor


@pytest.mark.parametrize(
    "worst", ["misfit", "nuisance_chi2", "common_subband", "largest_deviation", "frequency_deviation"]
)
def test_the_shortfall_names_the_figure_that_is_farthest_over_its_limit(worst):
    limits = Limits(misfit=1.0, subband=1.0)
    figures = {
        "misfit": 1.5,
        "nuisance_chi2": 15.0,
        "common_subband": 1.5,
        "largest_deviation": 4.0,
        "frequency_deviation": 3.0,
    }
    figures[worst] *= 10
    goodness = Goodness(**figures, worst_subband=20.0, limits=limits, nuisance_chi2_limit=10.0)
    assert not goodness.is_good
    words = {
        "misfit": "leaves 3.87 times the expected misfit",
        "nuisance_chi2": "tolerances",
        "common_subband": "part of the band",
        "largest_deviation": "a damping ratio or a gain that is 23 times its tolerance",
        "frequency_deviation": "a natural frequency that is 17 times",
    }
    assert words[worst] in goodness.shortfall
    assert (worst == "common_subband") == ("part of the band" in goodness.shortfall)


@pytest.mark.parametrize(("misfit", "subband", "times"), [(0.5, 0.6, 1.0), (0.5, 2.0, 2.0), (3.0, 2.0, 1.0)])
def test_beside_a_model_with_underestimated_errors_an_effect_must_explain_more(misfit, subband, times):
    """Unless the model does not explain: then that it leaves much is no fault of its errors."""
    limits = Limits(misfit=1.0, subband=4.0)
    goodness = Goodness(
        misfit=misfit,
        nuisance_chi2=0.0,
        worst_subband=subband,
        common_subband=subband,
        largest_deviation=0.0,
        frequency_deviation=0.0,
        limits=limits,
        nuisance_chi2_limit=45.0,
    )
    assert goodness.error_underestimation == times
    log_odds = np.log(20 * 20) if goodness.is_good else np.log(20)
    needed = required_log_bayes_factor(SimpleNamespace(effects=("added_mass",)), goodness)
    assert needed == pytest.approx(times * limits.subband * log_odds)


def test_a_part_of_the_band_counts_where_a_channel_or_a_point_has_it_in_common():
    """Three sensors and three struck points: one FRF is off, or all of a sensor are."""
    layout = SimpleNamespace(output_index=np.tile(np.arange(3), 3), input_index=np.repeat(np.arange(3), 3))
    subbands = np.full((9, 6), 0.5)
    subbands[4, 2] = 6.5
    assert _find_common(layout, subbands) == pytest.approx(2.5)
    subbands[layout.output_index == 1, 2] = 6.5
    assert _find_common(layout, subbands) == pytest.approx(6.5)
