"""Places are exact, within one node or element, or wrong."""

import pytest

from frf_testbench.proof.locations import Layout, compare_locations, read_layout

BEAM = Layout(ends={"left": 1, "right": 41})
FRAME = Layout(springs={"k1": (0, 1), "k2": (1, 2), "k3": (2, 3), "k4": (0, 3)})
# rows of three nodes, 0.1 m apart, the rows 0.3 m apart; numbers with gaps
PLATE = Layout(positions={10 * j + i: (0.1 * i, 0.3 * j, 0.0) for j in range(3) for i in range(3)})


@pytest.mark.parametrize(
    ("layout", "truth", "said", "expected"),
    [
        (BEAM, {"nodes": [12]}, {"nodes": [12]}, "exact"),
        (BEAM, {"nodes": [12]}, {"nodes": [13]}, "near"),
        (BEAM, {"nodes": [12]}, {"nodes": [14]}, "wrong"),
        (BEAM, {"nodes": [12]}, {}, "wrong"),
        (BEAM, {"nodes": [12]}, {"nodes": [12, 13]}, "wrong"),
        (BEAM, {"nodes": [3, 9]}, {"nodes": [9, 3]}, "exact"),
        (BEAM, {"nodes": [3, 9]}, {"nodes": [8, 3]}, "near"),
        (BEAM, {"nodes": [3, 9]}, {"nodes": [4, 3]}, "wrong"),
        (BEAM, {"elements": [5, 7]}, {"elements": [5, 7]}, "exact"),
        (BEAM, {"elements": [5, 7]}, {"elements": [4, 8]}, "near"),
        (BEAM, {"elements": [5, 7]}, {"elements": [5, 9]}, "wrong"),
        (FRAME, {"springs": ["k2"]}, {"springs": ["k3"]}, "near"),
        (FRAME, {"springs": ["k1"]}, {"springs": ["k4"]}, "wrong"),  # they meet at the ground only
        (FRAME, {"nodes": [1]}, {"nodes": [2]}, "near"),
        (FRAME, {"nodes": [1]}, {"nodes": [3]}, "wrong"),
        (FRAME, {"springs": ["k2"]}, {"nodes": [2]}, "wrong"),
        (PLATE, {"nodes": [10]}, {"nodes": [11]}, "near"),
        (PLATE, {"nodes": [2]}, {"nodes": [10]}, "wrong"),  # numbers in a row are no neighbours
        (PLATE, {"nodes": [11]}, {"nodes": [1]}, "wrong"),  # the next row is thrice as far as the next node
        (PLATE, {"nodes": [11]}, {"nodes": [999]}, "wrong"),
        (BEAM, {"channels": ["acc_1"]}, {"channels": ["acc_1"]}, "exact"),
        (BEAM, {"channels": ["acc_1"]}, {"channels": ["acc_2"]}, "wrong"),
        (BEAM, {"channels": ["acc_1"], "nodes": [8]}, {"channels": ["acc_1"], "nodes": [9]}, "near"),
        (BEAM, {"channels": ["acc_1"], "nodes": [8]}, {"channels": ["acc_2"], "nodes": [8]}, "wrong"),
        (BEAM, {"groups": ["rail"]}, {"groups": ["rail"]}, "exact"),
        (BEAM, {"groups": ["rail"]}, {"groups": ["tie"]}, "wrong"),
        (BEAM, {}, {}, None),
    ],
)
def test_a_place_is_compared(layout, truth, said, expected):
    assert compare_locations(truth, said, layout) == expected


@pytest.mark.parametrize("truth", [{"end": "right", "nodes": [41]}, {"end": "right"}])
@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ({"end": "right"}, "exact"),
        ({"end": "right", "nodes": [41]}, "exact"),
        ({"nodes": [41]}, "exact"),
        ({"nodes": [40]}, "near"),
        ({"nodes": [1]}, "wrong"),
        ({"end": "left"}, "wrong"),
        ({"end": "left", "nodes": [41]}, "wrong"),
        ({}, "wrong"),
    ],
)
def test_an_end_may_be_named_by_its_side_or_its_node(truth, said, expected):
    assert compare_locations(truth, said, BEAM) == expected


def test_the_layout_is_read_from_the_model(tmp_path):
    text = '[model]\nkind = "lumped"\n[[lumped.mass]]\nnode = 1\nmass_kg = 1.0\n'
    text += '[[lumped.spring]]\nid = "k1"\nnodes = [0, 1]\nstiffness_N_m = 1.0\n'
    (tmp_path / "model.toml").write_text(text, encoding="utf-8")
    assert read_layout(tmp_path).springs == {"k1": (0, 1)}
    (tmp_path / "model.toml").write_text("[beam]\nelements = 40\n", encoding="utf-8")
    assert read_layout(tmp_path) == BEAM
    (tmp_path / "model.toml").write_text('[matrices]\ndofs = "dofs.csv"\n', encoding="utf-8")
    (tmp_path / "dofs.csv").write_text("node,direction,x_m,y_m,z_m\n7,z,0.5,0.25,0\n9,z,1,0,0\n", encoding="utf-8")
    assert read_layout(tmp_path).positions == {7: (0.5, 0.25, 0.0), 9: (1.0, 0.0, 0.0)}
