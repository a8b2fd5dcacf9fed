"""What is worst about a fit is what is said about it."""

import pytest

from frf_ipz.diagnosis.judging.verdict import Goodness, Limits


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
