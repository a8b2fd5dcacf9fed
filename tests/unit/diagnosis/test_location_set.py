"""How a finding lists the locations between which a test cannot decide."""

import pytest

from diagnosed import beam, labels, measured, observed
from frf_ipz.diagnosis.diagnose import diagnose
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.diagnosis.result import describe_location_set
from frf_ipz.fe.changes import with_point_masses

ADDED_KG = 2e-3


@pytest.mark.parametrize(
    ("locations", "words"),
    [
        ([Location.at_node(7)], ""),
        ([Location.at_node(node) for node in (7, 5, 6, 12)], "nodes 5 to 7, 12"),
        ([Location(nodes=(44, 64)), Location(nodes=(45, 63))], "nodes 44 and 64, 45 and 63"),
        ([Location(elements=(36, 43)), Location(elements=(39, 39))], "elements 36 to 43, 39"),
        ([Location(channels=("a",), nodes=(node,)) for node in (15, 13)], "nodes 13, 15"),
        ([Location(end="right"), Location.at_node(3), Location.at_node(2)], "end right or nodes 2 to 3"),
    ],
)
def test_locations_that_a_test_cannot_distinguish_are_listed(locations, words):
    assert describe_location_set(locations) == (f" The test locates it no closer than {words}." if words else "")


def test_a_finding_says_how_closely_it_is_located(tmp_path):
    """A beam clamped at both ends and measured in its middle has no left and right."""
    nominal = beam(tmp_path, elements=24, right="clamped")
    frfs = measured(with_point_masses(nominal, {6: ADDED_KG}), labels(outputs=("13:+z",), inputs=("13:+z",)))
    diagnosis = diagnose(observed(frfs), nominal, options=DiagnoseOptions(effects=("added_mass",)))
    (finding,) = diagnosis.findings
    assert {6, 20} <= {location.node for location in finding.location_set}
    assert finding.statement.endswith(describe_location_set(finding.location_set))
    assert "no closer than nodes" in diagnosis.statement
