"""Labels of degrees of freedom."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

import frf_ipz
from frf_ipz.dofs import DIRECTIONS, Dof, as_dof, as_dofs, parse_dof, parse_label
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


@pytest.mark.parametrize("dof", ["0:+z", "00:z", "0:-rx", Dof(0, "z")])
def test_nothing_moves_and_nothing_acts_at_the_ground(dof):
    takes = [as_dof, lambda dof: as_dofs(["1:+z", dof]), lambda dof: frf_ipz.FrfLabel("1:+z", dof, "mobility")]
    for take in [*takes, parse_label] if isinstance(dof, str) else takes:
        with pytest.raises(InputError, match=r"is at node 0, which is the ground; name the node"):
            take(dof)
    with pytest.raises(InputError, match=r"is at node 0, which is the ground"):
        frf_ipz.FrfSet.from_arrays([1.0, 2.0], [[[1.0]], [[2.0]]], outputs=[dof], inputs=["1:+z"])


def test_a_port_may_be_held_against_the_ground():
    assert frf_ipz.Port("gap", {"3:z": 1.0, "0:z": -1.0}).weights[Dof(0, "z")] == -1.0
