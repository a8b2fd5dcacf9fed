"""Which segments laws are fitted to."""

from types import SimpleNamespace

import pytest

from frf_ipz.diagnosis.nonlinear.fitting.problem import FINE, LawFitData


def data(mean_misfit, max_samples=float("inf"), *, kind="hammer"):
    """Data whose problems hold the requested length; a linear model leaves a misfit."""

    def make_problem(duration_s, floor, *, loudest):
        n_samples = min(round(duration_s), max_samples)
        return SimpleNamespace(
            mean_misfit=mean_misfit, floor=floor, loudest=loudest, segments=SimpleNamespace(n_samples=n_samples)
        )

    return SimpleNamespace(
        make_problem=make_problem, training=SimpleNamespace(band_hz=(0.1, 1.0), kind=kind, records=())
    )


def lengths(problems):
    return [problem.segments.n_samples for problem in problems]


@pytest.mark.parametrize(
    ("mean_misfit", "max_samples", "expected"),
    [(30.0, 1e9, [80, 320]), (0.8, 1e9, [320, 640]), (0.8, 330, [80, 320])],
)
def test_segments_are_longer_where_the_misfit_of_a_linear_model_is_small(mean_misfit, max_samples, expected):
    assert lengths(LawFitData._choose_lengths(data(mean_misfit, max_samples))) == expected


def test_a_record_that_starts_linear_has_a_segment_where_it_is_loudest():
    short, long = LawFitData._choose_lengths(data(0.3, kind="random"))
    assert short.loudest
    assert long.loudest
    assert lengths((short, long)) == [320, 640]
    assert long.floor < FINE
