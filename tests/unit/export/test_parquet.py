"""Parquet tables carry unit and meaning of every column."""

import json

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from frf_ipz.dofs import Dof
from frf_ipz.export.parquet import Column, make_table, repeated, write_table
from frf_ipz.export.run_tables import frame_table, frf_table
from frf_ipz.frf import FrfLabel, FrfSet
from frf_ipz.quantities import FrfQuantity

CONTRACT = ["frequency_hz", "output_dof", "input_dof", "quantity", "real", "imag", "coherence", "variance", "averages"]


def frfs():
    labels = tuple(FrfLabel(Dof(node, "z", -1), Dof(5, "z"), FrfQuantity.ACCELERANCE) for node in (1, 2))
    return FrfSet(
        frequency_hz=np.array([1.0, 2.0, 3.0]),
        values=np.array([[1 + 1j, 2], [3, 4], [5, 6 - 1j]]),
        labels=labels,
        variance=np.full((3, 2), np.nan),
        coherence=np.array([[1.0, np.nan]] * 3),
        averages=np.array([4, 1]),
    )


def test_the_frf_table_is_that_of_the_contract(tmp_path):
    write_table(frf_table(frfs()), tmp_path / "frf.parquet")
    table = pd.read_parquet(tmp_path / "frf.parquet")
    assert list(table.columns) == CONTRACT
    row = table[(table.output_dof == "2:-z") & (table.frequency_hz == 3.0)].iloc[0]
    assert (row.real, row.imag, row.averages, row.quantity, row.input_dof) == (6.0, -1.0, 1, "accelerance", "5:+z")


def test_late_frfs_stay_as_measured_and_say_their_delay():
    table = frf_table(frfs(), [0.0, 1.5e-3])
    assert table["real"].to_pylist()[3:] == [2.0, 4.0, 6.0]
    assert json.loads(table.schema.metadata[b"delay_s"]) == {"2:-z / 5:+z": 1.5e-3}
    assert frf_table(frfs()).schema.metadata[b"delay_s"] == b"{}"


def test_unknown_values_are_null_not_nan():
    table = frf_table(frfs())
    assert table["variance"].null_count == 6
    assert table["coherence"].null_count == 3


def test_every_column_has_a_unit_and_a_meaning(tmp_path):
    write_table(frf_table(frfs()), tmp_path / "frf.parquet")
    schema = pq.read_schema(tmp_path / "frf.parquet")
    assert schema.field("frequency_hz").metadata[b"unit"] == b"Hz"
    assert all(schema.field(name).metadata[b"meaning"] for name in CONTRACT)


def test_columns_of_a_frame_are_those_declared():
    declared = [
        Column("order", "int", "1", "model order"),
        Column("std: *", "float", "1", "expected size"),
        Column("name", "text", "", "name"),
        Column("taken", "flag", "", "taken"),
        Column("absent", "float", "1", "not in this frame"),
    ]
    frame = pd.DataFrame({"order": [1], "std: mass": [2.5], "name": ["a"], "taken": [True]})
    table = frame_table(frame, declared)
    assert table.column_names == ["order", "std: mass", "name", "taken"]
    assert [str(field.type) for field in table.schema] == ["int64", "double", "string", "bool"]
    assert table.schema.field("std: mass").metadata == {b"unit": b"1", b"meaning": b"expected size"}
    with pytest.raises(KeyError, match="'hz' is not declared"):
        frame_table(frame.assign(hz=1.0), declared)


def test_values_without_a_column_are_refused():
    columns = [Column("number", "int", "", "n")]
    with pytest.raises(KeyError, match="'text' is not declared"):
        make_table(columns, {"number": [1], "text": ["a"]})


def test_a_frame_without_rows_has_the_kinds_of_its_columns():
    table = frame_table(pd.DataFrame([], columns=["number", "text"]), [Column("*", "int", "", "n")])
    assert [str(field.type) for field in table.schema] == ["int64", "int64"]


def test_none_is_null_in_every_kind():
    columns = [Column("number", "int", "", "n"), Column("text", "text", "", "t"), Column("ratio", "float", "1", "r")]
    table = make_table(columns, {"number": [1, None], "text": ["a", None], "ratio": [np.nan, 1.0]})
    assert [table[name].null_count for name in ("number", "text", "ratio")] == [1, 1, 1]


def test_repeated_texts_stand_in_order():
    assert repeated(["b", "a"], 2).to_pylist() == ["b", "b", "a", "a"]
