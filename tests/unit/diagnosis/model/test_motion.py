"""Motions by index are those of all DOFs."""

import numpy as np
from numpy.testing import assert_array_equal

from frf_ipz.diagnosis.model.motion import Motion, make_unit_stiffness, stack_motions

N_ALL = 5
FIRST, SECOND = Motion(rows=(3,), weights=(1.0,)), Motion(rows=(0,), weights=(-2.0,))


def test_a_motion_of_all_dofs_and_the_same_by_index_are_one():
    dense = np.array([0.0, -2.0, 0.0, 1.0, 0.0])
    motion = Motion.of(dense)
    assert motion == Motion(rows=(1, 3), weights=(-2.0, 1.0)) == Motion.of(motion)
    assert_array_equal(motion.dense(N_ALL), dense)


def test_motions_side_by_side_are_columns():
    motions = [FIRST, FIRST - SECOND]
    assert_array_equal(
        stack_motions(motions, N_ALL).toarray(), np.stack([motion.dense(N_ALL) for motion in motions], 1)
    )


def test_a_spring_acts_against_its_motion():
    motion = (FIRST - SECOND).dense(N_ALL)
    assert_array_equal(make_unit_stiffness(FIRST - SECOND, N_ALL).toarray(), np.outer(motion, motion))
