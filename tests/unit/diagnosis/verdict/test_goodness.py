"""The shortfall of a fit is its worst figure."""

import pytest

from frf_ipz.diagnosis.verdict.goodness import Goodness, Limits


@pytest.mark.parametrize(
    "worst", ["misfit", "nuisance_chi2", "worst_subband", "largest_deviation", "frequency_deviation"]
)
def test_the_shortfall_names_the_figure_that_is_farthest_over_its_limit(worst):
    limits = Limits(misfit=1.0, subband=1.0)
    figures = {
        "misfit": 1.5,
        "nuisance_chi2": 15.0,
        "worst_subband": 1.5,
        "largest_deviation": 4.0,
        "frequency_deviation": 3.0,
    }
    figures[worst] *= 10
    goodness = Goodness(**figures, limits=limits, nuisance_chi2_limit=10.0)
    assert not goodness.is_good
    words = {
        "misfit": "leaves 3.87 times the expected misfit",
        "nuisance_chi2": "tolerances",
        "worst_subband": "part of the band",
        "largest_deviation": "a damping ratio or a gain that is 23 times its tolerance",
        "frequency_deviation": "a natural frequency that is 17 times",
    }
    assert words[worst] in goodness.shortfall
    assert (worst == "worst_subband") == ("part of the band" in goodness.shortfall)


@pytest.mark.parametrize(("misfit", "subband", "times"), [(0.5, 0.6, 1.0), (0.5, 2.0, 2.0), (3.0, 2.0, 1.0)])
def test_beside_a_model_with_underestimated_errors_an_effect_must_explain_more(misfit, subband, times):
    """Unless the model does not explain: then that it leaves much is no fault of its errors."""
    limits = Limits(misfit=1.0, subband=4.0)
    goodness = Goodness(
        misfit=misfit,
        nuisance_chi2=0.0,
        worst_subband=subband,
        largest_deviation=0.0,
        frequency_deviation=0.0,
        limits=limits,
        nuisance_chi2_limit=45.0,
    )
    assert goodness.error_underestimation == times
    assert goodness.required_log_bayes_factor == times * limits.first_log_bayes_factor
