"""FRFs as long CSV: ``frequency_hz, output_dof, input_dof, real, imag`` and, if known, ``coherence``, ``variance``."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import complex_array
from frf_ipz.dofs import AnyDof, parse_label
from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.ingest.formats.frf_file import FrfContents, FrfSource, MeasuredFrf, note_at_rest, undefined_at_rest
from frf_ipz.ingest.formats.text_layout import TextLayout, sniff
from frf_ipz.ingest.formats.text_table import column_index, not_a_number, read_blocks, require_once
from frf_ipz.late_imports import import_late
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    import pyarrow as pa

    from frf_ipz.arrays import FloatArray
else:
    pa = import_late("pyarrow")

NUMBERS = ("frequency_hz", "real", "imag")
LABELS = ("output_dof", "input_dof")
OPTIONAL = ("coherence", "variance")


class _LongCsv:
    rank = 20

    def holds(self, source: FrfSource, head: bytes) -> bool:
        return not source.columns and b"frequency_hz" in head[:1000]

    def read(self, source: FrfSource) -> tuple[MeasuredFrf, ...]:
        layout = sniff(source.path)
        if not layout.header:
            expected = ",".join((*NUMBERS, *LABELS))
            raise FileFormatError(source.path, f"has no line that names its columns; expected are {expected}")
        names = layout.header[-1]
        table = _read_table(layout, names)
        groups: dict[tuple[str, str], list[int]] = {}
        for row, pair in enumerate(zip(*(table[name].to_pylist() for name in LABELS), strict=True)):
            groups.setdefault(pair, []).append(row)
        dofs = {text: _parse_dof(layout, text) for pair in groups for text in pair}
        values = {name: table[name].to_numpy() for name in table.column_names if name not in LABELS}
        for (output, input_), rows in groups.items():
            require_once(layout, "frequency_hz", values["frequency_hz"][rows], rows, f"{output} / {input_}")
        frfs = [
            _make_frf(source, dofs[output], dofs[input_], {name: array[rows] for name, array in values.items()})
            for (output, input_), rows in groups.items()
        ]
        return (replace(frfs[0], notes=(*frfs[0].notes, *_note_unused(layout, names))), *frfs[1:]) if frfs else ()

    def look(self, source: FrfSource) -> FrfContents:
        frfs = self.read(source)
        return FrfContents(n_outputs=len(frfs), n_inputs=1, ends=tuple((frf.output_dof, frf.input_dof) for frf in frfs))


FORMAT = _LongCsv()


def _read_table(layout: TextLayout, names: tuple[str, ...]) -> pa.Table:
    if len(names) != layout.n_columns:
        problem = f"has {counted(layout.n_columns, 'value')} where the header has {counted(len(names), 'column')}"
        raise FileFormatError(layout.path, problem, where=f"line {layout.n_before + 1}")
    numeric = [*NUMBERS, *(name for name in OPTIONAL if name in names)]
    columns = {column_index(layout, names, name): name for name in (*numeric, *LABELS)}
    types = {index: pa.string() if name in LABELS else pa.float64() for index, name in columns.items()}
    batches = list(read_blocks(layout, names, types))
    table = pa.Table.from_batches(batches).rename_columns(list(columns.values()))
    required = [index for index, name in columns.items() if name in NUMBERS]
    numbers = np.column_stack([table[name].to_numpy() for name in NUMBERS])
    is_bad = ~np.isfinite(numbers).all(axis=1) & (numbers[:, 0] != 0.0)
    if is_bad.any():
        raise not_a_number(layout, names, required, int(np.argmax(is_bad)))
    return table


def _note_unused(layout: TextLayout, names: tuple[str, ...]) -> tuple[str, ...]:
    """Say which columns are not read: a coherence of another name is none."""
    unused = [name for name in names if name and name not in (*NUMBERS, *LABELS, *OPTIONAL)]
    if not unused:
        return ()
    known = " and ".join(OPTIONAL)
    return (
        f"{layout.path.name}: not read: {counted(len(unused), 'column')} {', '.join(unused)}; beside the FRF, "
        f"{known} are, by these names",
    )


def _parse_dof(layout: TextLayout, text: str) -> AnyDof:
    try:
        return parse_label(text)
    except InputError as error:
        raise FileFormatError(layout.path, str(error), where="column 'output_dof' or 'input_dof'") from None


def _make_frf(source: FrfSource, output_dof: AnyDof, input_dof: AnyDof, columns: dict[str, FloatArray]) -> MeasuredFrf:
    left_out = undefined_at_rest({name: columns[name] for name in NUMBERS})
    columns = {name: values[~left_out] for name, values in columns.items()}
    order = np.argsort(columns["frequency_hz"], kind="stable")
    return MeasuredFrf(
        source=source,
        output_dof=output_dof,
        input_dof=input_dof,
        frequency_hz=columns["frequency_hz"][order],
        values=complex_array(columns["real"][order], columns["imag"][order]),
        coherence=columns["coherence"][order] if "coherence" in columns else None,
        variance=columns["variance"][order] if "variance" in columns else None,
        notes=note_at_rest(source, output_dof, input_dof, left_out),
    )
