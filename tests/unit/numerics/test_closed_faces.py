"""Faces that lines enclose."""

import numpy as np

from frf_ipz.numerics.closed_faces import faces_between_lines


def grid(columns, rows):
    """Lines and corners of a flat grid."""
    at = np.array([[x, y, 0.0] for y in range(rows) for x in range(columns)])
    across = [(k, k + 1) for k in range(len(at)) if (k + 1) % columns]
    along = [(k, k + columns) for k in range(len(at) - columns)]
    return across + along, at


def test_a_grid_has_one_face_a_cell():
    lines, at = grid(5, 4)
    faces = faces_between_lines(lines, at)
    assert len(faces) == 4 * 3
    assert all(len(set(face)) == 4 for face in faces)


def test_a_brick_has_six_faces_and_a_tetrahedron_four():
    at = np.array([[x, y, z] for x in (0.0, 1) for y in (0.0, 1) for z in (0.0, 1)])
    edges = [(a, b) for a in range(8) for b in range(a) if np.abs(at[a] - at[b]).sum() == 1]
    assert len(faces_between_lines(edges, at)) == 6
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    assert len(faces_between_lines([(a, b) for a in range(4) for b in range(a)], corners)) == 4


def test_a_row_of_lines_encloses_nothing():
    at = np.stack([np.arange(4.0), np.zeros(4), np.zeros(4)], 1)
    assert faces_between_lines([(0, 1), (1, 2), (2, 3)], at) == []
    assert faces_between_lines([(0, 1), (1, 2), (0, 2)], at) == []  # corners on one line
