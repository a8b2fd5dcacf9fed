"""Labels of degrees of freedom."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from frf_ipz.dofs import DIRECTIONS, Dof, parse_dof
from frf_ipz.errors import InputError

DOFS = st.builds(Dof, st.integers(0, 10**6), st.sampled_from(DIRECTIONS), st.sampled_from([1, -1]))


@given(DOFS)
def test_a_label_reads_back_as_the_same_dof(dof):
    assert parse_dof(str(dof)) == dof


@pytest.mark.parametrize(
    ("text", "node", "direction", "sign"),
    [("18:+z", 18, "z", 1), ("20:-z", 20, "z", -1), ("7:rz", 7, "rz", 1), (" 3:x ", 3, "x", 1), ("0:-ry", 0, "ry", -1)],
)
def test_the_forms_of_the_contract(text, node, direction, sign):
    assert parse_dof(text) == Dof(node, direction, sign)


@pytest.mark.parametrize("text", ["", "z", "18", "18:w", "18:++z", "-3:z", "18.5:z", "18:+z 3", "18;z"])
def test_other_texts_are_refused_with_an_example(text):
    with pytest.raises(InputError, match="expected NODE:SIGN DIRECTION"):
        parse_dof(text)


def test_the_unsigned_dof_is_the_models():
    assert parse_dof("4:-x").unsigned == Dof(4, "x")
    assert parse_dof("4:-x").name == "4:x"
