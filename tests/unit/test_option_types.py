"""Options made in Python are checked as those of a file are."""

from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Annotated, get_args, get_origin, get_type_hints

import numpy as np
import pytest

import frf_ipz
from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.fe.model_file import model_kinds
from frf_ipz.fleet.fleet_file import FleetFile
from frf_ipz.ingest import campaign_file
from frf_ipz.pipeline.config import PipelineFile
from frf_ipz.toml_files import to_options

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


def lax_keys(hint, where):
    """Find keys in a type whose values pydantic would convert: texts to truth values, truth values to numbers."""
    if hint in {bool, int, float}:
        return [where]
    if is_dataclass(hint):
        inner = get_type_hints(hint, include_extras=True)
        return [key for item in fields(hint) for key in lax_keys(inner[item.name], f"{where}.{item.name}")]
    if get_origin(hint) is Annotated:
        base, *about = get_args(hint)
        is_strict = any(getattr(piece, "strict", False) for part in about for piece in getattr(part, "metadata", ()))
        return [] if is_strict else lax_keys(base, where)
    return [key for part in get_args(hint) for key in lax_keys(part, where)]


@pytest.mark.parametrize(
    "file", [campaign_file.CampaignFileKeys, PipelineFile, FleetFile, *(kind.FILE for kind in model_kinds().values())]
)
def test_no_key_of_a_file_takes_values_of_another_kind(file):
    assert not lax_keys(file, file.__name__)


@pytest.mark.parametrize(
    ("options", "key", "table"),
    [
        (frf_ipz.FitOptions, "delay", {}),
        (frf_ipz.UpdateOptions, "mass", {}),
        (frf_ipz.DiagnoseOptions, "apply", {}),
        (campaign_file.FrfKeys, "conjugated", {"file": "h.unv", "quantity": "accelerance"}),
    ],
)
@pytest.mark.parametrize("value", ["yes", "true", 1, 1.0])
def test_truth_values_are_true_or_false(options, key, table, value):
    with pytest.raises(FileFormatError, match=f"key '{key}'.*must be a valid boolean; given is"):
        to_options(table | {key: value}, options, Path("some.toml"))
    assert getattr(to_options(table | {key: True}, options, Path("some.toml")), key) is True


@pytest.mark.parametrize("value", [True, 1.0])
@pytest.mark.parametrize(
    ("options", "key", "table"),
    [
        (campaign_file.TestKeys, "time_column", {"kind": "hammer"}),
        (campaign_file.ChannelKeys, "column", {"role": "input", "quantity": "force"}),
    ],
)
def test_numbers_of_columns_are_whole_numbers(options, key, table, value):
    with pytest.raises(FileFormatError, match=f"key '{key}'.*given is {value}"):
        to_options(table | {key: value}, options, Path("some.toml"))
    assert getattr(to_options(table | {key: 2}, options, Path("some.toml")), key) == 2
