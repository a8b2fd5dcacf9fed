"""What a user has to know before they trust a diagnosis."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosed import beam, measured, observed
from frf_ipz.diagnosis.measured.data_split import split_data
from frf_ipz.diagnosis.verdict.data_checks import list_warnings, run_data_checks


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    return split_data(observed(measured(beam(tmp_path_factory.mktemp("beam")))))


def test_a_good_measurement_has_no_warnings(source):
    assert list_warnings(source, run_data_checks(source, None)) == ()


def test_frfs_that_are_too_faint_are_named(source):
    training = replace(source.training, values=source.training.values * np.array([1.0, 1e-3]))
    (warning,) = list_warnings(replace(source, training=training), run_data_checks(source, None))
    assert warning.startswith(f"FRF {training.labels[1]} stays below 1 % of the largest at the same input")


def test_a_failed_check_is_a_warning(source):
    gates = run_data_checks(source, None)
    failed = replace(gates[-1], value=2 * gates[-1].limit, statement="It drowns in noise.")
    assert list_warnings(source, (*gates[:-1], failed)) == ("It drowns in noise.",)


@pytest.mark.parametrize(("dropped", "is_late"), [(0, False), (76, True)])
def test_records_that_begin_within_the_ringing_of_an_impact_are_named(strike, dropped, is_late):
    """The impact comes after 80 samples; the filter of the force rings as if it had no end."""
    records = []
    for record in strike().records:
        force = record.force.copy()
        force[70:80] += 1e-3 * record.level * (-1.0) ** np.arange(10)
        records.append(replace(record, force=force[dropped:], responses=record.responses[:, dropped:]))
    source = split_data(replace(strike(), records=tuple(records)))
    warnings = [text for text in list_warnings(source, run_data_checks(source, None)) if "ringing" in text]
    assert len(warnings) == is_late
    assert all(text.startswith("impact 100 N, ") for text in warnings)
