"""Meshes and wire frames: files made by other programs' libraries are read, and their surface found."""

import sys
from pathlib import Path

import numpy as np
import pytest
import pyuff
from numpy.testing import assert_allclose

from frf_ipz.errors import FileFormatError
from frf_ipz.meshes.formats.abaqus_deck import shape_of
from frf_ipz.meshes.formats.universal import holds_geometry
from frf_ipz.meshes.outer_faces import outer_faces
from frf_ipz.meshes.registry import read_mesh

CUBES = np.array([(x, y, z) for z in range(2) for y in range(2) for x in range(3)], float)  # two in a row
BRICKS = [(1, 2, 5, 4, 7, 8, 11, 10), (2, 3, 6, 5, 8, 9, 12, 11)]


def characteristic(mesh):
    """2 for a closed surface without holes, by Euler."""
    return len(mesh.nodes) - len(mesh.lines) + len(mesh.faces)


def require_two_cubes(mesh, unit_m=1.0):
    assert sorted(mesh.positions) == list(range(1, 13))
    drawn = mesh.drawn()
    assert len(drawn.faces) == 10
    assert characteristic(drawn) == 2
    assert_allclose(drawn.coordinates_m, unit_m * CUBES[drawn.nodes - 1])


def write_universal(path, sets):
    pyuff.UFF(str(path)).write_sets(sets, "overwrite")


NODES_15 = {"type": 15, "node_nums": [1, 2, 3, 4], "def_cs": [0] * 4, "disp_cs": [0] * 4, "color": [1] * 4,
            "x": [0.0, 1.0, 1.0, -0.5], "y": [0.0, 0.0, 1.0, 1.0], "z": [0.0, 0.0, 0.0, -1e-12]}  # fmt: skip
TRACE = {"type": 82, "trace_num": 1, "n_nodes": 6, "color": 1, "id": "frame", "nodes": np.array([1, 2, 3, 0, 3, 4])}


def test_nodes_and_trace_lines_of_an_analyser(tmp_path):
    write_universal(tmp_path / "a.unv", [NODES_15, TRACE])
    mesh = read_mesh(tmp_path / "a.unv")
    assert mesh.positions[4] == (-0.5, 1.0, -1e-12)
    assert mesh.drawn().lines.tolist() == [[1, 2], [2, 3], [3, 4]]
    assert not len(mesh.drawn().faces)
    assert holds_geometry(tmp_path / "a.unv")


def test_columns_that_touch(tmp_path):
    row = "".join(f"{number:10d}" for number in (1, 0, 0, 1)) + "-1.000000E+00-2.000000E+00-3.000000E+00"
    (tmp_path / "a.unv").write_text("\n".join(["    -1", "    15", row, "    -1"]))
    assert read_mesh(tmp_path / "a.unv").positions == {1: (-1.0, -2.0, -3.0)}


def universal_bricks(path, descriptor, elements):
    """Data sets 164 in mm, 2411, and 2412 written by hand, since pyuff writes elements of one kind only."""
    si = {"type": 164, "units_code": 5, "units_description": "mm", "temp_mode": 2, "length": 1000.0, "force": 1000.0,
          "temp": 1.0, "temp_offset": 273.15}  # fmt: skip
    x, y, z = 1000 * CUBES.T
    numbers = np.arange(1, 13)
    nodes = {"type": 2411, "grid_global": np.column_stack([numbers, x, y, z]), "node_nums": numbers, "x": x, "y": y}
    nodes |= {"z": z, "def_cs": 0 * numbers, "disp_cs": 0 * numbers, "color": 0 * numbers}
    write_universal(path, [si, nodes])
    lines = ["    -1", "  2412"]
    for number, corners in enumerate(elements, start=1):
        lines.append("".join(f"{value:10d}" for value in (number, descriptor, 1, 1, 7, len(corners))))
        lines += ["".join(f"{node:10d}" for node in corners[first : first + 8]) for first in range(0, len(corners), 8)]
    path.write_text(path.read_text() + "\n".join([*lines, "    -1"]) + "\n")


def test_elements_of_a_universal_file_in_mm(tmp_path):
    universal_bricks(tmp_path / "a.unv", 115, BRICKS)
    mesh = read_mesh(tmp_path / "a.unv")
    assert mesh.unit_m == 1e-3
    require_two_cubes(mesh)


def test_parabolic_elements_have_nodes_between_corners(tmp_path):
    around = [[1, 99, 2, 99, 5, 99, 4, 99, 99, 99, 99, 99, 7, 99, 8, 99, 11, 99, 10, 99]]
    universal_bricks(tmp_path / "a.unv", 116, around)
    faces = read_mesh(tmp_path / "a.unv").drawn().faces
    assert set(faces.ravel().tolist()) == set(BRICKS[0])


@pytest.mark.parametrize("faulty", ["1  2  x", "1  0  0  1  0.0"])
def test_a_damaged_universal_file_names_its_line(tmp_path, faulty):
    (tmp_path / "a.unv").write_text("\n".join(["    -1", "    15", faulty, "    -1"]))
    with pytest.raises(FileFormatError, match=r"a\.unv, line 3"):
        read_mesh(tmp_path / "a.unv")


def test_a_deck_of_abaqus(tmp_path):
    nodes = "".join(f"{number}, {x}, {y}, {z}\n" for number, (x, y, z) in enumerate(CUBES.tolist(), start=1))
    rows = "".join(f"{k}, {', '.join(map(str, b[:5]))},\n {', '.join(map(str, b[5:]))}\n" for k, b in enumerate(BRICKS))
    (tmp_path / "a.inp").write_text(f"*NODE, NSET=all\n{nodes}** bricks\n*Element, type=C3D8R\n{rows}*STEP\n")
    require_two_cubes(read_mesh(tmp_path / "a.inp"))


@pytest.mark.parametrize(
    ("kind", "shape"),
    [("S8R", "quadrilateral"), ("C3D10", "tetrahedron"), ("STRI65", "triangle"), ("B32", "line"), ("SPRING1", "")],
)
def test_shapes_of_abaqus(kind, shape):
    assert shape_of(kind) == shape


def test_a_deck_of_nastran(tmp_path):
    grids = [f"GRID,{number},,{x},{y},{z}" for number, (x, y, z) in enumerate(CUBES.tolist()[:6], start=1)]
    grids += [f"{'GRID':8}{n:8}{'':8}{x:8}{y:8}{z:8}" for n, (x, y, z) in enumerate(CUBES.tolist()[6:11], start=7)]
    x, y, z = CUBES[11].tolist()
    grids += [f"{'GRID*':8}{12:16}{'':16}{x:16}{y:16}", f"{'*':8}{z:16}"]
    first, second = BRICKS
    bricks = ["CHEXA,1,1," + ",".join(map(str, first[:6])), "," + ",".join(map(str, first[6:]))]
    bricks += [f"{'CHEXA':8}{2:8}{1:8}" + "".join(f"{node:8}" for node in second[:6]) + "+2"]
    bricks += [f"{'+2':8}" + "".join(f"{node:8}" for node in second[6:])]
    (tmp_path / "a.bdf").write_text("\n".join(["$ two cubes", *grids, *bricks, "ENDDATA"]))
    require_two_cubes(read_mesh(tmp_path / "a.bdf"))


@pytest.mark.parametrize("name", ["a.vtu", "a.vtk", "a.msh", "a.mesh"])
def test_meshes_of_other_programs(tmp_path, name):
    meshio = pytest.importorskip("meshio")
    meshio.write_points_cells(tmp_path / name, CUBES, [("hexahedron", np.array(BRICKS) - 1)])
    require_two_cubes(read_mesh(tmp_path / name))


def test_an_archive_of_ansys():
    examples = pytest.importorskip("mapdl_archive.examples")
    for name, n_faces in ((examples.hexarchivefile, 88), (examples.tetarchivefile, 1392)):
        drawn = read_mesh(Path(name)).drawn()
        assert len(drawn.faces) == n_faces
        assert characteristic(drawn) == 2


@pytest.mark.parametrize(("name", "library"), [("a.vtu", "meshio"), ("a.cdb", "mapdl_archive")])
def test_a_missing_library_is_named_with_its_extra(tmp_path, monkeypatch, name, library):
    monkeypatch.setitem(sys.modules, library, None)
    (tmp_path / name).write_text("something")
    with pytest.raises(FileFormatError, match=r"frf_ipz\[mesh\]"):
        read_mesh(tmp_path / name)


@pytest.mark.parametrize("name", ["a.vtu", "a.vtk", "a.msh", "a.cdb"])
def test_damaged_files_are_one_line(tmp_path, name, capsys):
    pytest.importorskip("meshio")
    pytest.importorskip("mapdl_archive")
    (tmp_path / name).write_text("$MeshFormat\n4.1 0 8\n<VTKFile>\nEBLOCK,19,SOLID,1,1\n")
    with pytest.raises(FileFormatError, match=name) as error:
        read_mesh(tmp_path / name)
    assert "\n" not in str(error.value)
    assert not any(capsys.readouterr())


def test_a_damaged_archive_of_ansys_ends_its_reader_only(tmp_path):
    """Its library writes beyond its memory where an element has more nodes than its row says."""
    examples = pytest.importorskip("mapdl_archive.examples")
    data = bytearray(Path(examples.hexarchivefile).read_bytes())
    for place in range(len(data) // 2, len(data) // 2 + 4000, 97):
        data[place : place + 1] = b"99999999"
    (tmp_path / "a.cdb").write_bytes(data)
    with pytest.raises(FileFormatError, match=r"a\.cdb"):
        read_mesh(tmp_path / "a.cdb")


def test_a_collapsed_brick_has_the_faces_of_a_wedge():
    faces = outer_faces([("hexahedron", (1, 2, 3, 3, 4, 5, 6, 6))])
    assert sorted(len(set(face)) for face in faces.tolist()) == [3, 3, 4, 4, 4]


def test_a_collapsed_quadrilateral_is_a_triangle_whose_last_corner_stands_there_twice():
    corners = [(1, 1, 2, 3), (4, 5, 6, 4), (7, 8, 8, 9), (7, 7, 8, 8)]
    faces = outer_faces([("quadrilateral", nodes) for nodes in corners])
    assert faces.tolist() == [[2, 3, 1, 1], [5, 6, 4, 4], [9, 7, 8, 8]]


def test_positions_are_read_in_the_unit_of_their_names(tmp_path):
    path = tmp_path / "nodes.csv"
    path.write_text("node,x_mm,y_mm,z_mm\n1,20,0,0\n", encoding="utf-8")
    stored = read_mesh(path)
    assert (stored.unit_m, list(stored.positions.values())) == (1e-3, [(20.0, 0.0, 0.0)])
