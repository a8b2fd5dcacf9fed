"""Ports: sums of DOFs and points between nodes, in FRFs of the whole and of the reduced model, and what is refused."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import frf_ipz
from brick_plate import plate_matrices
from clamped_beam import BEAM
from fe_models import BEAM_TEXT, LUMPED_TEXT
from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.fe.mesh_points import interpolate_motion

EXACT = 1e-9  # of the largest FRF: the same numbers along two ways
S = 2j * np.pi * np.linspace(7.0, 900.0, 40)
SIDES_M = (0.3, 0.2, 0.02)
TILT = frf_ipz.Port("tilt", {"21:z": 2.0, "11:z": -2.0}, "rad")
PAIR = frf_ipz.Port("force pair", {"9:z": 1.0, "5:z": -1.0})


def receptances(model, pairs):
    labels = [frf_ipz.FrfLabel(output, force, "receptance") for output, force in pairs]
    return frf_ipz.compute_frfs(model, labels, S)


@pytest.fixture
def beam():
    return frf_ipz.make_beam(**BEAM).with_ports([TILT, PAIR])


@pytest.fixture(scope="module")
def plate():
    stiffness, mass, places = plate_matrices((3, 2, 1), SIDES_M)
    dofs = [f"{node + 1}:{axis}" for node in range(len(places)) for axis in "xyz"]
    return frf_ipz.StructuralModel.from_matrices(mass, stiffness, dofs=dofs, coordinates=places, modal_damping=0.01)


@pytest.mark.parametrize("reduced", [False, True])
def test_the_frf_of_ports_is_the_sum_of_those_of_their_dofs(beam, reduced):
    model = beam
    if reduced:
        frfs = frf_ipz.FrfSet.from_arrays(
            S.imag / 2 / np.pi, np.ones((40, 1, 1)), outputs=[TILT], inputs=["force pair"]
        )
        model = frf_ipz.reduce_model(frfs, beam, points=["21:z"])
        assert {str(dof) for dof in model.dofs} >= {"tilt", "force pair"}
    parts = receptances(beam, [(end, force) for end in ("21:z", "11:z") for force in ("9:z", "5:z")])
    expected = 2.0 * (parts[:, 0] - parts[:, 1] - parts[:, 2] + parts[:, 3])
    values = receptances(model, [("tilt", "force pair"), ("-tilt", "force pair")])
    exactness = 2e-3 if reduced else EXACT  # antiresonances of a reduced model in its band are right to 0.1 %
    assert_allclose(values[:, 0], expected, rtol=0, atol=exactness * np.abs(expected).max())
    assert_allclose(values[:, 1], -values[:, 0], rtol=EXACT)


def test_a_port_at_one_dof_is_that_dof(beam):
    same = beam.with_ports([frf_ipz.Port("tip", {"21:z": 1.0})])
    assert_allclose(*receptances(same, [("tip", "9:z"), ("21:+z", "9:+z")]).T, rtol=EXACT)


def test_units_follow_the_port(beam):
    del beam
    assert frf_ipz.FrfLabel(TILT, PAIR, "accelerance").unit == "rad/s^2/N"
    assert frf_ipz.FrfLabel("5:z", TILT, "receptance").unit == "m/(N m)"


@pytest.mark.parametrize("point", [(0.13, 0.07, 0.004), (0.1, 0.1, 0.0), (0.3, 0.2, 0.02)])
@pytest.mark.parametrize("direction", ["x", "z", "rx", "ry", "rz", (0.6, 0.0, 0.8)])
def test_motion_as_a_rigid_body_is_exact(plate, point, direction):
    """A translation and a turn about each axis move every point of a solid as they should."""
    axes = {"x": (1.0, 0.0, 0.0), "z": (0.0, 0.0, 1.0)}
    along = axes.get(direction, direction)
    port = frf_ipz.Port("probe", interpolate_motion(plate, point, along), "m")
    row = plate.with_ports([port]).rows(["probe"]).toarray()[0]
    places = plate.geometry.coordinates_m
    for axis in range(3):
        turn = np.cross(np.eye(3)[axis], places).ravel()
        shift = np.tile(np.eye(3)[axis], len(places))
        if isinstance(along, str):
            expected = (0.0, float(along == ("rx", "ry", "rz")[axis]))
        else:
            expected = (along[axis], np.cross(np.eye(3)[axis], point) @ along)
        assert_allclose((row @ shift, row @ turn), expected, rtol=0, atol=1e-9 * max(1.0, np.abs(row).max()))


def test_a_point_of_a_beam_moves_as_its_element_does():
    coarse = frf_ipz.make_beam(**{**BEAM, "elements": 10})
    port = frf_ipz.Port("probe", interpolate_motion(coarse, (0.475, 0.0, 0.0), (0.0, 0.0, -1.0)))
    values = receptances(coarse.with_ports([port]), [("probe", "5:z")])[:, 0]
    fine = receptances(frf_ipz.make_beam(**BEAM), [("20:-z", "9:z")])[:, 0]
    assert_allclose(values, fine, rtol=0, atol=2e-3 * np.abs(fine).max())  # resonances of ten elements are 1e-5 off


PORT = '[[port]]\nname = "probe"\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (PORT + 'dofs = { "91:z" = 1.0 }\nunit = "m"', r"\[\[port\]\] 'probe': the port 'probe': .* no node 91"),
        (PORT + 'dofs = { "9:x" = 1.0 }\nunit = "m"', "node 9 .* has no DOF 'x'; it has z, ry"),
        (PORT + 'dofs = { "1:z" = 1.0 }\nunit = "m"', "does not move: its DOFs are held"),
        (PORT + 'dofs = { "9:z" = 0.0 }\nunit = "m"', "no weight other than 0"),
        (PORT + 'dofs = { "9:z" = 1.0, "9:-z" = 1.0 }\nunit = "m"', "names the DOF 9:z twice"),
        (PORT + 'dofs = { "9:z" = nan }\nunit = "m"', "port.*finite"),
        (PORT + 'dofs = { "9" = 1.0 }\nunit = "m"', "'9' is no DOF label"),
        (PORT + 'dofs = { "9:z" = 1.0 }', "needs a unit beside dofs"),
        (PORT + 'dofs = { "9:z" = 1.0 }\nunit = "mrad"', "'m' or 'rad'"),
        (PORT + 'dofs = { "9:z" = 1.0 }\nunit = "m"\npoint_m = [0.1, 0.0, 0.0]', "needs either dofs or point_m"),
        (PORT + "point_m = [0.1, 0.0, 0.0]", "needs point_m and direction together"),
        (PORT + 'point_m = [0.1, 0.0, 0.0]\ndirection = "u"', "'u' is no direction"),
        (
            PORT + 'point_m = [0.1, 0.0, 0.0]\ndirection = "ry"\nunit = "m"',
            "unit is 'm', but a motion along ry is in rad",
        ),
        (PORT + 'point_m = [0.6, 0.0, 0.0]\ndirection = "z"', r"\[0.6, 0, 0\] m is outside the mesh .* node is 21"),
        (PORT + 'point_m = [0.1, 0.0, 0.01]\ndirection = "z"', "lies 0.01 m beside the line of nodes"),
        (PORT + 'point_m = [0.1, 0.0, 0.0]\ndirection = "x"', "has no DOF 'x'"),
        (PORT + 'point_m = [0.1, 0.0, 0.0]\ndirection = "rx"', "do not determine a rotation rx"),
        ('[[port]]\nname = "9:z"\ndofs = { "9:z" = 1.0 }\nunit = "m"', "'9:z' is no name of a port; it has no ':'"),
        ('[[port]]\nname = "-tilt"\ndofs = { "9:z" = 1.0 }\nunit = "m"', "is no name of a port"),
        (2 * (PORT + 'dofs = { "9:z" = 1.0 }\nunit = "m"\n'), "two ports are called 'probe'"),
        (PORT + 'weights = { "9:z" = 1.0 }', "weights"),
    ],
)
def test_what_does_not_fit_is_refused_with_its_place(tmp_path, text, message):
    path = tmp_path / "model.toml"
    path.write_text(BEAM_TEXT + text)
    with pytest.raises(FileFormatError, match=message) as error:
        frf_ipz.read_model(path)
    assert str(path) in str(error.value)


def test_masses_in_a_row_have_no_points(tmp_path):
    path = tmp_path / "model.toml"
    path.write_text(LUMPED_TEXT + PORT + 'point_m = [0.5, 0.0, 0.0]\ndirection = "x"')
    with pytest.raises(FileFormatError, match="nodes of this model have no positions"):
        frf_ipz.read_model(path)


def test_ports_of_a_file_are_ports_of_its_model(tmp_path):
    path = tmp_path / "model.toml"
    path.write_text(BEAM_TEXT + PORT + 'dofs = { "21:-z" = 12.5, "0:z" = 12.5, "1:z" = 3.0 }\nunit = "rad"')
    model = frf_ipz.read_model(path)
    row = model.rows(["-probe"])
    assert [(model.dofs[place].name, value) for place, value in zip(row.indices, row.data, strict=True)] == [
        ("21:z", 12.5)
    ]


def test_a_gap_is_no_mesh():
    """Two bars side by side: a point between them belongs to neither."""
    stiffness = np.kron(np.eye(2), [[2.0, -1.0], [-1.0, 2.0]])
    places = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]])
    dofs = [f"{node}:z" for node in range(1, 5)]
    model = frf_ipz.StructuralModel.from_matrices(np.eye(4), stiffness, dofs=dofs, coordinates=places)
    assert interpolate_motion(model, (0.5, 0.0, 0.0), (0.0, 0.0, 1.0)) == {
        frf_ipz.Dof(1, "z"): 0.5,
        frf_ipz.Dof(2, "z"): 0.5,
    }
    with pytest.raises(InputError, match=r"lies in a gap, since nothing joins nodes \d and \d"):
        interpolate_motion(model, (0.4, 0.45, 0.0), (0.0, 0.0, 1.0))
