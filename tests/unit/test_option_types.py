"""Options made in Python are checked as those of a file are."""

import numpy as np
import pytest

import frf_ipz
from frf_ipz.errors import InputError

WRONG = [
    (frf_ipz.FitOptions, "max_order", -1),
    (frf_ipz.FitOptions, "band_hz", (10.0, "high")),
    (frf_ipz.IngestOptions, "exponential_window_s", -1.0),
    (frf_ipz.IngestOptions, "force_window_s", float("inf")),
    (frf_ipz.ReduceOptions, "modes", 0),
    (frf_ipz.UpdateOptions, "delta", -1.0),
    (frf_ipz.PredictOptions, "points", 5),
    (frf_ipz.ExportOptions, "sample_time_s", float("nan")),
    (frf_ipz.ExportOptions, "outputs", "metres"),
    (frf_ipz.DiagnoseOptions, "seed", True),
]


@pytest.mark.parametrize(("options", "key", "value"), WRONG, ids=lambda value: getattr(value, "__name__", str(value)))
def test_a_wrong_value_is_refused_by_the_name_of_its_option(options, key, value):
    with pytest.raises(InputError, match=rf"{options.__name__}\.{key}.*: .*given is"):
        options(**{key: value})


def test_numbers_of_numpy_are_numbers():
    assert frf_ipz.ReduceOptions(modes=np.int64(4)).modes == 4
    assert frf_ipz.IngestOptions(force_window_s=np.float32(0.5)).force_window_s == 0.5


def test_a_list_is_as_good_as_a_tuple():
    assert frf_ipz.FitOptions(band_hz=[10.0, 700.0]).band_hz == (10.0, 700.0)


def test_a_stop_of_zero_lets_the_published_method_go_on():
    options = frf_ipz.UpdateOptions(method="ipz", delta=0.0, delta_damping=0.0)
    assert (options.delta, options.delta_damping) == (0.0, 0.0)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -1.0, 1e300, "text", [], {}, True])
@pytest.mark.parametrize(
    ("options", "key"),
    [
        (frf_ipz.IngestOptions, "exponential_window_s"),
        (frf_ipz.IngestOptions, "segment_s"),
        (frf_ipz.UpdateOptions, "alpha"),
        (frf_ipz.UpdateOptions, "ensemble"),
        (frf_ipz.ExportOptions, "sample_time_s"),
        (frf_ipz.DiagnoseOptions, "gain_tolerance"),
        (frf_ipz.ReduceOptions, "modes"),
        (frf_ipz.FitOptions, "max_order"),
    ],
)
def test_no_number_is_without_bounds(options, key, value):
    with pytest.raises(InputError, match=rf"{options.__name__}\.{key}.*: .*given is"):
        options(**{key: value})


def test_counts_end_before_memory_does():
    with pytest.raises(InputError, match=r"UpdateOptions\.ensemble.*1000000"):
        frf_ipz.UpdateOptions(ensemble=10**15)
