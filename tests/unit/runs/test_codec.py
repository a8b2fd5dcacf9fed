"""Results survive the trip through a file to the last bit, and nothing else comes out of a file."""

import dataclasses
import json

import numpy as np
import pandas as pd
import pytest
from scipy import sparse

from frf_ipz.dofs import Dof
from frf_ipz.errors import FileFormatError
from frf_ipz.frf import FrfLabel
from frf_ipz.pairing.pairs import Pair, Pairs, PairVerdict
from frf_ipz.quantities import FrfQuantity
from frf_ipz.rational import ZeroSet
from frf_ipz.runs.codec import RESULTS, load_result, save_result
from frf_ipz.runs.stage_file import StageFile, read_stage_file, write_stage_file
from synthetic_run import synthetic_folder


def round_trip(value, tmp_path):
    save_result(value, tmp_path / "value.result")
    return load_result(tmp_path / "value.result")


@pytest.mark.parametrize(
    "value",
    [
        None,
        True,
        3,
        0.1,
        float("inf"),
        "text",
        "\U0001f528",
        1 + 2j,
        (1, ("a", None)),
        {"a": 1, 2: (3,)},
        np.float64(2),
    ],
    ids=ascii,
)
def test_plain_values_come_back_equal(value, tmp_path):
    assert round_trip(value, tmp_path) == value


@pytest.mark.parametrize("order", ["C", "F"])
def test_arrays_keep_every_bit_their_type_and_their_order(tmp_path, order):
    values = np.array([np.nan, -0.0, np.inf, 1e-320])
    table = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], order=order)
    back = round_trip({"real": values, "complex": np.array([1j]), "flag": values > 0, "table": table}, tmp_path)
    assert back["real"].tobytes() == values.tobytes()
    assert back["complex"].dtype == complex
    assert back["flag"].dtype == bool
    np.testing.assert_array_equal(back["table"], table)
    assert back["table"].strides == table.strides


def pairs():
    pair = Pair(
        kind="pole",
        frf=-1,
        measured=0,
        computed=1,
        measured_value=-1 + 100j,
        computed_value=-1 + 101j,
        distance=float("nan"),
        verdict=PairVerdict.AMBIGUOUS,
        reason="two are as near",
    )
    label = FrfLabel(Dof(3, "rz", -1), Dof(1, "x"), FrfQuantity.MOBILITY)
    return Pairs(rows=(pair,), labels=(label,), warnings=("look",))


def test_our_dataclasses_come_back_as_themselves(tmp_path):
    back = round_trip(pairs(), tmp_path)
    assert isinstance(back, Pairs)
    assert repr(back) == repr(pairs())


def test_every_result_of_a_run_comes_back_equal(tmp_path):
    results = synthetic_folder(diagnosed=True).results
    results["model"] = results["model"].geometry
    assert results.keys() <= RESULTS.keys()
    for stage, result in results.items():
        save_result(result, tmp_path / "stage.result", key=stage)
        assert_equal(load_result(tmp_path / "stage.result", stage=stage, key=stage), result)


def assert_equal(back, value):
    assert type(back) is type(value) or np.isscalar(value) or isinstance(value, tuple | list)
    if dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            assert_equal(getattr(back, field.name), getattr(value, field.name))
    elif isinstance(value, pd.DataFrame):
        pd.testing.assert_frame_equal(back, value, check_column_type=False, check_index_type=False)
    elif isinstance(value, tuple | list):
        for item, other in zip(back, value, strict=True):
            assert_equal(item, other)
    elif sparse.issparse(value):
        assert (back != value).nnz == 0
    else:
        np.testing.assert_equal(back, value)


def test_frames_and_sparse_matrices_come_back(tmp_path):
    frame = pd.DataFrame({"order": [1, 2], "hz": [1.5, np.nan], "name": ["a", None], "taken": [True, False]})
    pd.testing.assert_frame_equal(round_trip(frame, tmp_path), frame)
    empty = pd.DataFrame({"order": np.array([], int)})
    pd.testing.assert_frame_equal(round_trip(empty, tmp_path), empty)
    matrix = sparse.csr_array(np.diag([1.0, 0.0, 3.0]))
    assert (round_trip(matrix, tmp_path) != matrix).nnz == 0


@pytest.mark.parametrize(
    "value",
    [object(), FrfQuantity.MOBILITY, ZeroSet, np.array([object()]), np.array(["text"]), len],
    ids=["object", "enum", "class", "objects", "texts", "function"],
)
def test_what_is_no_plain_value_is_not_written(tmp_path, value):
    with pytest.raises(TypeError, match="a stage's result holds"):
        save_result(value, tmp_path / "value.result")


def test_what_an_annotation_does_not_say_is_not_written(tmp_path):
    with pytest.raises(TypeError, match="list in the place of a str"):
        save_result(dataclasses.replace(pairs(), warnings=(["look"],)), tmp_path / "value.result")


@pytest.mark.parametrize(
    "name",
    [
        "subprocess:Popen",
        "builtins:eval",
        "frf_ipz.diagnosis.catalogue.finder:classes_in",
        "frf_ipz.runs.codec:import_module",
        "frf_ipz.identification.modal_fit:ModalFit.__init__",
        "frf_ipz.options:FitOptions",
        ["frf_ipz.pairing.pairs:Pairs"],
        None,
    ],
    ids=str,
)
def test_a_type_that_is_not_in_the_list_is_not_built(tmp_path, name):
    path = tmp_path / "evil.result"
    write_stage_file(StageFile(key="", tree=[name, {"fields": {"args": "true"}}], arrays=[]), path)
    with pytest.raises(FileFormatError, match="damaged"):
        load_result(path)


def test_pairs_of_thousands_of_frfs_are_kept(tmp_path):
    """2100 FRFs have 44 000 zeros: as many values outside of arrays would be too many to be read again."""
    (row,), label = pairs().rows, pairs().labels[0]
    rows = tuple(dataclasses.replace(row, frf=frf, distance=float(frf)) for frf in range(50_000))
    kept = dataclasses.replace(pairs(), rows=rows, labels=(label,) * 2100)
    assert round_trip_of(kept, tmp_path).rows == rows


def round_trip_of(result, tmp_path):
    save_result(result, tmp_path / "value.result")
    return load_result(tmp_path / "value.result", stage="pair")


def tampered(tmp_path, change):
    """The pairs in a file whose tree has been changed, and which is otherwise whole."""
    path = tmp_path / "pairs.result"
    save_result(pairs(), path)
    content = read_stage_file(path)
    tree = json.loads(json.dumps(content.tree))
    change(tree)
    write_stage_file(dataclasses.replace(content, tree=tree), path)
    return path


def columns(tree, name="rows"):
    return tree[1]["fields"][name]["columns"]


ROW = {"fields": "not these"}


@pytest.mark.parametrize(
    "change",
    [
        lambda tree: tree[1]["fields"].pop("rows"),
        lambda tree: tree[1]["fields"].update(extra=1),
        lambda tree: tree[1]["fields"].update(rows=ROW),
        lambda tree: tree[1]["fields"].update(rows=[ROW]),
        lambda tree: tree[1]["fields"].update(warnings="look"),
        lambda tree: tree[1]["fields"].update(warnings=[1]),
        lambda tree: columns(tree).update(verdict=[["__class__"], columns(tree)["verdict"][1]]),
        lambda tree: columns(tree).update(verdict=[[], columns(tree)["verdict"][1]]),
        lambda tree: columns(tree).update(frf=True),
        lambda tree: columns(tree).update(frf=[2.5]),
        lambda tree: columns(tree).update(frf=columns(tree)["distance"], distance=columns(tree)["frf"]),
        lambda tree: columns(tree).update(measured_value=[1.0, 2.0]),
        lambda tree: columns(tree).pop("reason"),
        lambda tree: tree[1]["fields"]["rows"].update(rows=2),
        lambda tree: columns(tree, "labels")["output_dof"][0]["fields"].update(direction={"array": 0}),
        lambda tree: tree.append(1),
    ],
    ids=range(16),
)
def test_a_field_that_is_not_what_its_annotation_says_is_damage(tmp_path, change):
    assert load_result(tampered(tmp_path, lambda _: None), stage="pair").rows
    with pytest.raises(FileFormatError, match=r"damaged or from another version .* run again") as caught:
        load_result(tampered(tmp_path, change))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("tree", "arrays"),
    [
        ({"array": 1}, [np.zeros(2)]),
        ([{"array": 0}, {"array": 0}], [np.zeros(2)]),
        ({"csr": [{"array": 0}, {"array": 1}, {"array": 2}], "shape": [2, 2]}, [np.ones(2), [0, 9**9], [0, 1, 2]]),
        ({"csr": [{"array": 0}, {"array": 1}, {"array": 2}], "shape": [2, 2]}, [np.ones(2), [0, 1], [0, 1, 9**9]]),
        ({"csr": [{"array": 0}, {"array": 1}, {"array": 2}], "shape": [2, 2]}, [np.ones(2), [0, 1], [0, 9**9, 0]]),
        ({"csr": [{"array": 0}, {"array": 1}, {"array": 2}], "shape": [1, 2**40]}, [np.ones(1), [0], [0, 1]]),
        ({"frame": [["a", {"array": 0}]], "rows": 3}, [np.zeros(2)]),
        ({"frame": [["a", {"array": 0}]], "rows": 2}, [np.zeros((2, 2))]),
        ({"frame": [], "rows": 10**18}, []),
        ({"unknown": 1}, []),
        ({}, []),
    ],
    ids=[
        *("no array", "one twice", "indices", "pointers", "pointers that end at none", "not square"),
        *("rows", "axes", "no columns", "tag", "nothing"),
    ],
)
def test_arrays_and_tables_that_do_not_fit_are_damage(tmp_path, tree, arrays):
    path = tmp_path / "evil.result"
    write_stage_file(StageFile(key="", tree=["", tree], arrays=[np.asarray(array) for array in arrays]), path)
    with pytest.raises(FileFormatError, match="damaged"):
        load_result(path)


def test_a_result_of_another_stage_or_key_is_refused(tmp_path):
    path = tmp_path / "pair.result"
    save_result(pairs(), path, key="a")
    assert load_result(path, stage="pair", key="a").rows
    with pytest.raises(FileFormatError, match="it holds frf_ipz"):
        load_result(path, stage="fit")
    with pytest.raises(FileFormatError, match="belongs to another run"):
        load_result(path, stage="pair", key="b")
