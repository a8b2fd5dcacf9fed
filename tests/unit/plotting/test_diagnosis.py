"""Numbers of a diagnosis as its pictures and its table write them."""

import pytest

from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.result import Finding
from frf_ipz.plotting.diagnosis import evidence_text, probability_text


def finding(probability, gain):
    return Finding(
        effect="added_mass",
        location=Location.at_node(3),
        parameters={},
        probability=probability,
        log_evidence_gain=gain,
        statement="A mass sits at node 3.",
    )


@pytest.mark.parametrize(
    ("probability", "text"), [(1.0, "above 0.999"), (0.842, "= 0.84"), (0.0123, "= 0.012"), (1e-12, "below 0.001")]
)
def test_a_probability_is_written_as_in_the_statement(probability, text):
    assert probability_text(finding(probability, 50.0)) == text
    assert text.removeprefix("= ") in finding(probability, 50.0).confidence


def test_what_is_worse_than_without_has_no_probability():
    assert probability_text(finding(1.0, -3.0)) == "–"


@pytest.mark.parametrize(("gain", "text"), [(2309.839839685112, "2310"), (7.4, "7"), (-3.2, "-3")])
def test_evidence_has_no_decimals(gain, text):
    assert evidence_text(finding(1.0, gain)) == text
