"""What is worst about a fit is what is said about it."""

import pytest

from frf_ipz.diagnosis.verdict.goodness import Goodness, Limits


@pytest.mark.parametrize("worst", ["misfit", "pull", "worst_piece", "farthest", "detuned"])
def test_the_complaint_names_the_figure_that_is_farthest_over_its_limit(worst):
    limits = Limits(misfit=1.0, piece=1.0)
    figures = {"misfit": 1.5, "pull": 15.0, "worst_piece": 1.5, "farthest": 4.0, "detuned": 3.0}
    figures[worst] *= 10
    found = Goodness(**figures, limits=limits, most_pull=10.0)
    assert not found.is_good
    words = {
        "misfit": "leaves 3.87 times the expected misfit",
        "pull": "tolerances",
        "worst_piece": "part of the band",
        "farthest": "a damping ratio or a gain that is 23 times its tolerance",
        "detuned": "a natural frequency that is 17 times",
    }
    assert words[worst] in found.complaint
    assert (worst == "worst_piece") == ("part of the band" in found.complaint)


@pytest.mark.parametrize(("misfit", "piece", "times"), [(0.5, 0.6, 1.0), (0.5, 2.0, 2.0), (3.0, 2.0, 1.0)])
def test_beside_a_model_whose_errors_are_underrated_somewhere_a_cause_must_explain_more(misfit, piece, times):
    """Unless the model does not explain: then that it leaves much is no fault of its errors."""
    limits = Limits(misfit=1.0, piece=4.0)
    found = Goodness(
        misfit=misfit, pull=0.0, worst_piece=piece, farthest=0.0, detuned=0.0, limits=limits, most_pull=45.0
    )
    assert found.times_underrated == times
    assert found.needed_nats == times * limits.found_nats
