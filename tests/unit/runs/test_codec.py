"""Results survive the trip through a file to the last bit."""

import json

import numpy as np
import pandas as pd
import pytest
from scipy import sparse

from frf_ipz.dofs import Dof
from frf_ipz.errors import FileFormatError
from frf_ipz.pairing.pairs import Pair, Pairs, PairVerdict
from frf_ipz.quantities import FrfQuantity
from frf_ipz.rational import ZeroSet
from frf_ipz.runs.codec import load_result, save_result


def round_trip(value, tmp_path):
    save_result(value, tmp_path / "result.npz")
    return load_result(tmp_path / "result.npz")


@pytest.mark.parametrize(
    "value",
    [None, True, 3, 0.1, "text", 1 + 2j, FrfQuantity.MOBILITY, Dof(3, "rz", -1), (1, ("a", None)), {"a": 1, 2: (3,)}],
    ids=repr,
)
def test_plain_values_come_back_equal(value, tmp_path):
    assert round_trip(value, tmp_path) == value


def test_arrays_keep_every_bit_and_their_type(tmp_path):
    values = np.array([np.nan, -0.0, np.inf, 1e-320])
    back = round_trip({"real": values, "complex": np.array([1j]), "flag": values > 0}, tmp_path)
    assert back["real"].tobytes() == values.tobytes()
    assert back["complex"].dtype == complex
    assert back["flag"].dtype == bool


def test_our_dataclasses_come_back_as_themselves(tmp_path):
    pair = Pair(
        kind="pole",
        frf=-1,
        measured=0,
        computed=1,
        measured_value=-1 + 100j,
        computed_value=-1 + 101j,
        distance=0.01,
        verdict=PairVerdict.AMBIGUOUS,
        reason="two are as near",
    )
    pairs = Pairs(rows=(pair,), warnings=("look",))
    assert round_trip(pairs, tmp_path) == pairs
    zeros = ZeroSet(
        values=np.array([1j]), frf=np.array([2]), kind=("real",), identifiable=np.array([False]), reason=("beyond",)
    )
    back = round_trip(zeros, tmp_path)
    assert isinstance(back, ZeroSet)
    assert back.values[0] == 1j
    assert back.kind == ("real",)


def test_frames_and_sparse_matrices_come_back(tmp_path):
    frame = pd.DataFrame({"order": [1, 2], "hz": [1.5, np.nan], "name": ["a", None], "taken": [True, False]})
    pd.testing.assert_frame_equal(round_trip(frame, tmp_path), frame)
    empty = pd.DataFrame({"order": np.array([], int)})
    pd.testing.assert_frame_equal(round_trip(empty, tmp_path), empty)
    matrix = sparse.csr_array(np.diag([1.0, 0.0, 3.0]))
    assert (round_trip(matrix, tmp_path) != matrix).nnz == 0


def test_types_of_others_are_neither_written_nor_built(tmp_path):
    with pytest.raises(TypeError, match="object"):
        save_result(object(), tmp_path / "result.npz")
    tree = {"type": "subprocess:Popen", "fields": {"args": "true"}}
    np.savez(tmp_path / "evil.npz", tree=np.array(json.dumps(tree)))
    with pytest.raises(FileFormatError, match="no type of this package"):
        load_result(tmp_path / "evil.npz")


def test_a_damaged_file_is_said_to_be_damaged(tmp_path):
    path = tmp_path / "result.npz"
    save_result(np.arange(1000.0), path)
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(FileFormatError, match="damaged"):
        load_result(path)
