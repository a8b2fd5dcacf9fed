"""FRFs in files of arrays: as `modalfrf` returns them, structures of `frd`, `idfrd` and Testlab, or under any names.

Which array holds the FRFs and which the frequencies follows from ``variables`` of the test, else from names and shapes:
the axis that is as long as the frequencies counts the lines, and the others count outputs, then inputs.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import complex_array
from frf_ipz.dofs import AnyDof, Dof, parse_dof
from frf_ipz.errors import FileFormatError, InputError, QuantityError, did_you_mean
from frf_ipz.ingest.formats.column_words import ANGULAR
from frf_ipz.ingest.formats.decibels import DECIBELS, join_polar
from frf_ipz.ingest.formats.file_arrays import FileArrays, describe, last_part
from frf_ipz.ingest.formats.frf_file import FrfContents, FrfSource, MeasuredFrf, note_at_rest, undefined_at_rest
from frf_ipz.ingest.formats.recording_arrays import RATE
from frf_ipz.ingest.formats.registry import find_array_format
from frf_ipz.ingest.formats.testlab_arrays import points_of, testlab_blocks
from frf_ipz.ingest.formats.text_layout import read_head
from frf_ipz.ingest.units import frequency_factor

if TYPE_CHECKING:
    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.ingest.formats.file_arrays import NumericArray

FREQUENCIES = {"frequency_hz": 1.0, "frequency_rad_s": 1.0 / (2.0 * np.pi)}
PARTS = ("frf", "real", "imag", "magnitude", DECIBELS, "phase_deg", "phase_rad")
GRID = ("frequency_step_hz", "frequency_start_hz")
ROUNDED = 1e-6  # beyond 1, of a coherence computed in single precision
SAMPLE_RATE = "sample_rate_hz"  # the lines go from 0 Hz to half of it
KNOWN = (*FREQUENCIES, *GRID, SAMPLE_RATE, *PARTS, "coherence", "variance")
FREQUENCY = re.compile(r"(f|ff|freq\w*|frf?_?freq\w*|frequenz\w*|hz|f_?(vec|axis|hz)\w*|x)", re.IGNORECASE)
COHERENCE = re.compile(r"(coh|gamma2?|cxy)\w*", re.IGNORECASE)
OUTPUTS = re.compile(r"(output|response|out)_?(dofs?|names?|points?|channels?)", re.IGNORECASE)
INPUTS = re.compile(r"(input|reference|excitation|in|ref)_?(dofs?|names?|points?|channels?)", re.IGNORECASE)
FRF_NAME = re.compile(r"h(?![a-z])|frf|tf|accelerance|mobility|receptance|responsedata", re.IGNORECASE)
STEP = re.compile(r"d_?f|delta_?f|(f|freq\w*)_?(step|res\w*)", re.IGNORECASE)
START = re.compile(r"(f|freq\w*)_?(start|min|low|0)", re.IGNORECASE)
END = re.compile(r"(f|freq\w*)_?(end|stop|max|high)", re.IGNORECASE)
RESPONSE_DATA = "ResponseData"  # of frd and idfrd
FEWEST_LINES = 2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrfBlock:
    """FRFs on common lines.

    Parameters
    ----------
    name : str
        Of the array.
    frequency_hz : (n_lines,) array
        Hz.
    values : (n_lines, n_outputs, n_inputs) complex array
        In `unit`.
    ends : sequence of pairs of Dof, optional
        What each FRF connects, row by row, as far as the file says so.
    coherence, variance : (n_lines, n_outputs, n_inputs) array, optional
        Where the file has them.
    unit : str
        What the file says; may be empty.
    is_level : bool
        The values were levels in decibels, relative to that unit.
    about : str
        How it was found.
    """

    name: str
    frequency_hz: FloatArray
    values: ComplexArray
    ends: Sequence[tuple[AnyDof, AnyDof]] | None = None
    coherence: FloatArray | None = None
    variance: FloatArray | None = None
    unit: str = ""
    is_level: bool = False
    about: str = ""


class _ArrayFrfs:
    """FRFs by name or shape."""

    rank = 4

    def holds(self, source: FrfSource, head: bytes) -> bool:
        return not source.columns and find_array_format(head) is not None

    def read(self, source: FrfSource) -> tuple[MeasuredFrf, ...]:
        blocks = find_frfs(source)
        if len(blocks) > 1 and any(block.ends is None for block in blocks):
            names = ", ".join(f"'{block.name}' ({describe(block.values)})" for block in blocks)
            problem = f"holds several arrays that may be FRFs: {names}"
            way_out = f'say which, as in variables = {{ frf = "{blocks[0].name}" }} of its [[frf]]'
            raise FileFormatError(source.path, f"{problem}; {way_out}")
        return tuple(frf for block in blocks for frf in _measured(source, block))

    def look(self, source: FrfSource) -> FrfContents:
        blocks = find_frfs(source)
        block = blocks[0]
        return FrfContents(
            arrays=tuple(block.name for block in blocks) if len(blocks) > 1 else (),
            n_outputs=block.values.shape[1],
            n_inputs=block.values.shape[2],
            ends=tuple(block.ends or ()),
            unit=block.unit,
            about=block.about,
        )


FORMAT = _ArrayFrfs()


def _own_frequencies(values: ComplexArray) -> FloatArray | None:
    """Give the first of two columns where it holds the frequencies of the other, as SignalCalc saves a function."""
    if values.ndim != 2 or values.shape[1] != 2 or len(values) < FEWEST_LINES or np.any(values[:, 0].imag):
        return None
    frequency_hz = np.asarray(values[:, 0].real)
    return frequency_hz if frequency_hz[0] >= 0.0 and (np.diff(frequency_hz) > 0.0).all() else None


def find_frfs(source: FrfSource) -> tuple[FrfBlock, ...]:
    """Find the FRFs among the arrays of a file.

    Parameters
    ----------
    source : FrfSource
        The file as the test describes it.

    Returns
    -------
    tuple of FrfBlock
        At least one.

    Raises
    ------
    FileFormatError
        If nothing can be FRFs, or what `variables` names does not fit.
    """
    array_format = find_array_format(read_head(source.path))
    if array_format is None:
        raise FileFormatError(source.path, "is no file of arrays")
    arrays = array_format.read(source.path)
    variables = dict(source.variables)
    for key in variables:
        if key not in KNOWN:
            problem = f"'variables' of its [[frf]] has the key '{key}'; {did_you_mean(key, KNOWN)}"
            raise FileFormatError(source.path, problem)
    if set(variables) & set(PARTS):
        return (_named_block(arrays, variables),)
    blocks = [*_testlab_blocks(arrays), *_response_data(arrays)] or _blocks_by_shape(arrays, variables)
    named = [block for block in blocks if FRF_NAME.match(last_part(block.name))]
    blocks = named or blocks
    if not blocks:
        problem = "holds no complex array with a vector of as many frequencies"
        way_out = 'name them, as in variables = { frequency_hz = "f", frf = "H" } of its [[frf]]'
        raise FileFormatError(source.path, f"{problem}; {way_out}. It holds {arrays.listing()}")
    return tuple(blocks)


def _named_block(arrays: FileArrays, variables: Mapping[str, str]) -> FrfBlock:
    given = {key: arrays.select(name) for key, name in variables.items()}
    values = _complex_values(arrays, given)
    name = next(variables[key] for key in PARTS if key in variables)
    axes = [key for key in given if key in FREQUENCIES]
    is_grid = GRID[0] in given or SAMPLE_RATE in given
    own, about = None if axes or is_grid else _own_frequencies(values), ""
    if own is not None:
        frequency_hz, values = own, values[:, 1:]
        about = f"the frequencies of '{name}' are in its first column"
    elif axes:
        frequency_hz = _vector(arrays, variables[axes[0]], given[axes[0]]) * FREQUENCIES[axes[0]]
    elif GRID[0] in given:
        step_hz, start_hz = (_number(arrays, variables.get(key, key), given.get(key, np.zeros(1))) for key in GRID)
        frequency_hz = start_hz + step_hz * np.arange(max(values.shape))
    elif SAMPLE_RATE in given:
        rate_hz = _number(arrays, variables[SAMPLE_RATE], given[SAMPLE_RATE])
        frequency_hz = np.linspace(0.0, 0.5 * rate_hz, max(values.shape))
    else:
        found = _find_frequencies(arrays, values.shape, {})
        if found is None:
            problem = f"'{name}' is {describe(values)}, and no vector of frequencies is as long"
            raise FileFormatError(arrays.path, f'{problem}; name it: variables = {{ frequency_hz = "..." }}')
        frequency_hz, about = found[1], f"the frequencies of '{name}' are in '{found[0]}'"
    shaped = _lines_first(arrays, name, values, len(frequency_hz))
    others = {
        key: np.real(_lines_first(arrays, variables[key], given[key], len(frequency_hz)))
        for key in ("coherence", "variance")
        if key in given
    }
    return FrfBlock(
        name=name,
        frequency_hz=frequency_hz,
        values=shaped,
        ends=_ends_beside(arrays, name, shaped.shape[1:]),
        coherence=others.get("coherence"),
        variance=others.get("variance"),
        unit=_unit_beside(arrays, name),
        is_level=DECIBELS in given,
        about=about,
    )


def _complex_values(arrays: FileArrays, given: Mapping[str, NumericArray]) -> ComplexArray:
    if "frf" in given:
        joined = _joined_columns(given["frf"])
        return np.asarray(given["frf"], np.complex128) if joined is None else joined
    parts = set(given) & set(PARTS)
    magnitudes, phases = parts & {"magnitude", DECIBELS}, parts & {"phase_deg", "phase_rad"}
    shapes = {given[key].shape for key in parts}
    if len(shapes) != 1 or not (parts == {"real", "imag"} or (len(magnitudes) == 1 and len(phases) == 1)):
        problem = f"'variables' names {', '.join(sorted(parts))}; needed is frf, or real and imag, or a magnitude and a"
        raise FileFormatError(arrays.path, f"{problem} phase, of one shape")
    if parts == {"real", "imag"}:
        return complex_array(given["real"], given["imag"])
    return join_polar(arrays.path, given, key="variables")


def _vector(arrays: FileArrays, name: str, values: NumericArray) -> FloatArray:
    flat = np.squeeze(values)
    if flat.ndim != 1 or np.iscomplexobj(flat):
        raise FileFormatError(arrays.path, f"'{name}' is {describe(values)}; the frequencies are one real vector")
    return np.asarray(flat, np.float64)


def _number(arrays: FileArrays, name: str, values: NumericArray) -> float:
    if values.size != 1 or np.iscomplexobj(values):
        raise FileFormatError(arrays.path, f"'{name}' is {describe(values)}; the start and step are one number each")
    return float(values.ravel()[0])


def _lines_first(
    arrays: FileArrays, name: str, values: NumericArray, n_lines: int, *, last: bool = False
) -> NumericArray:
    """Bring an array to [line, output, input]: the axis that is as long as the frequencies counts the lines."""
    axes = [axis for axis, size in enumerate(values.shape) if size == n_lines]
    if not axes or values.ndim > 3:
        problem = f"'{name}' is {describe(values)}, and there are {n_lines} frequencies: no axis fits"
        raise FileFormatError(arrays.path, f"{problem}; name others under 'variables'")
    moved = np.moveaxis(values, axes[-1] if last else axes[0], 0)
    shape = moved.shape[1:]
    if len(shape) == 2 or not shape:
        return np.asarray(moved.reshape(n_lines, *(shape or (1, 1))))
    return np.asarray(moved.reshape(n_lines, shape[0], 1))


def _testlab_blocks(arrays: FileArrays) -> list[FrfBlock]:
    blocks = []
    for block in testlab_blocks(arrays):
        if not np.iscomplexobj(block.values):
            continue
        ends = [points_of(name) for name in block.names]
        known = [(pair[0], pair[1]) for pair in ends if len(pair) == 2]
        blocks.append(
            FrfBlock(
                name=block.name,
                frequency_hz=block.x,
                values=np.asarray(block.values[:, :, None], np.complex128),
                ends=known if len(known) == block.values.shape[1] else None,
                unit=block.units[0] if block.units and len(set(block.units)) == 1 else "",
                about=f"FRFs of Testlab in '{block.name}'",
            )
        )
    return blocks


def _response_data(arrays: FileArrays) -> list[FrfBlock]:
    """Read structures made from `frd` and `idfrd` objects: [output, input, line], frequencies in their unit."""
    blocks = []
    for key, values in arrays.arrays.items():
        way = key.removesuffix(RESPONSE_DATA)
        frequency = arrays.arrays.get(f"{way}Frequency")
        if way == key or frequency is None:
            continue
        unit = "".join(arrays.texts.get(f"{way}FrequencyUnit", ("rad/s",))).replace("TimeUnit", "s")
        try:
            factor = frequency_factor(unit)
        except QuantityError as error:
            raise FileFormatError(arrays.path, str(error), where=f"'{way}FrequencyUnit'") from None
        frequency_hz = np.asarray(frequency, np.float64).ravel() * factor
        shaped = _lines_first(arrays, key, np.atleast_3d(np.asarray(values)), len(frequency_hz), last=True)
        units = [arrays.texts.get(f"{way}{end}Unit", ()) for end in ("Output", "Input")]
        same = all(len(set(texts)) == 1 and texts[0].strip() for texts in units)
        blocks.append(
            FrfBlock(
                name=key,
                frequency_hz=frequency_hz,
                values=np.asarray(shaped, np.complex128),
                ends=_ends_beside(arrays, key, shaped.shape[1:]),
                unit=f"({units[0][0]})/({units[1][0]})" if same else "",
                about=f"FRFs in '{key}' ({describe(values)}), frequencies in {unit}",
            )
        )
    return blocks


def _blocks_by_shape(arrays: FileArrays, variables: Mapping[str, str]) -> list[FrfBlock]:
    blocks = []
    for name, whole in _complex_arrays(arrays):
        values, own = whole, None if set(variables) & set(FREQUENCIES) else _own_frequencies(whole)
        if own is not None:
            about = f"FRF in '{name}' ({describe(values)}), its frequencies in the first column"
            blocks.append(FrfBlock(name=name, frequency_hz=own, values=values[:, 1:, None], about=about))
            continue
        found = _find_frequencies(arrays, values.shape, variables)
        if found is None or values.ndim > 3:
            continue
        frequency_name, frequency_hz = found
        shaped = _lines_first(arrays, name, values, len(frequency_hz))
        coherences = [
            (other, np.real(_lines_first(arrays, other, array, len(frequency_hz))))
            for other, array in arrays.arrays.items()
            if COHERENCE.match(last_part(other)) and array.shape == values.shape and not np.iscomplexobj(array)
        ]
        about = f"FRFs in '{name}' ({describe(values)}), frequencies in '{frequency_name}'"
        coherence = coherences[0][1] if len(coherences) == 1 else None
        about += f", coherence in '{coherences[0][0]}'" if len(coherences) == 1 else ""
        if coherence is None and _alternates(shaped):
            shaped, coherence = shaped[:, ::2], np.real(shaped[:, 1::2])
            about += ", each followed by its coherence"
        blocks.append(
            FrfBlock(
                name=name,
                frequency_hz=frequency_hz,
                values=shaped,
                ends=_ends_beside(arrays, name, shaped.shape[1:]),
                coherence=coherence,
                unit=_unit_beside(arrays, name),
                about=about,
            )
        )
    return blocks


def _alternates(values: NumericArray) -> bool:
    """Tell whether every second column is real and from 0 to 1, a coherence, as Cambridge's data logger saves them."""
    n_columns = values.shape[1]
    if n_columns % 2 or values.shape[2] != 1:
        return False
    frfs, others = values[:, ::2], values[:, 1::2]
    is_share = not np.any(others.imag) and bool(((others.real >= 0.0) & (others.real <= 1.0 + ROUNDED)).all())
    return is_share and bool(np.any(frfs.imag, axis=0).all())


def _complex_arrays(arrays: FileArrays) -> list[tuple[str, ComplexArray]]:
    """Give complex arrays, and pairs of real ones that are called the real and the imaginary part."""
    found = [
        (name, np.asarray(array, np.complex128))
        for name, array in arrays.arrays.items()
        if np.iscomplexobj(array) and array.size > 1
    ]
    for name, array in arrays.arrays.items():
        match = re.fullmatch(r"(.*?)(real|re)", name, re.IGNORECASE)
        other = None if match is None else arrays.find(match[1] + {"real": "imag", "re": "im"}[match[2].lower()])
        if match and other and array.shape == arrays.arrays[other].shape and array.size > 1:
            found.append((name, complex_array(array, arrays.arrays[other])))
    return found or _columns_of_parts(arrays)


def _columns_of_parts(arrays: FileArrays) -> list[tuple[str, ComplexArray]]:
    named = {name: array for name, array in arrays.arrays.items() if FRF_NAME.match(last_part(name))}
    joined = {name: _joined_columns(array) for name, array in named.items()}
    return [(name, values) for name, values in joined.items() if values is not None]


def _joined_columns(array: NumericArray) -> ComplexArray | None:
    """Join two real columns, real and imaginary part; None where they are others, or frequencies and a value."""
    if array.ndim != 2 or array.shape[1] != 2 or len(array) < FEWEST_LINES or np.iscomplexobj(array):
        return None
    return None if (np.diff(array[:, 0]) > 0).all() else complex_array(array[:, 0], array[:, 1])


def _find_frequencies(
    arrays: FileArrays, shape: tuple[int, ...], variables: Mapping[str, str]
) -> tuple[str, FloatArray] | None:
    """Find the frequencies of an array: as named, else by a name, else the only vector that ascends and fits."""
    for key in set(variables) & set(FREQUENCIES):
        return variables[key], _vector(arrays, variables[key], arrays.select(variables[key])) * FREQUENCIES[key]
    vectors = {}
    for name, array in arrays.arrays.items():
        flat = np.squeeze(array)
        fits = flat.ndim == 1 and len(flat) in shape and len(flat) >= FEWEST_LINES and not np.iscomplexobj(flat)
        if fits and _ascends(flat):
            vectors[name] = np.asarray(flat, np.float64)
    for pattern, factor in ((FREQUENCY, 1.0), (ANGULAR, FREQUENCIES["frequency_rad_s"])):
        for name, vector in vectors.items():
            if pattern.fullmatch(last_part(name)):
                return name, vector * factor
    if len(vectors) == 1:
        return next(iter(vectors.items()))
    return _lines_of_transform(arrays, shape) or _lines_by_step(arrays, shape)


def _ascends(vector: NumericArray) -> bool:
    """Tell whether frequencies ascend: from 0 or above, or over both sides, in the order of a transform too."""
    ordered = np.fft.fftshift(vector) if vector[0] == 0 and vector[-1] < 0 else vector
    is_two_sided = bool(ordered[0] < 0 < ordered[-1] <= -ordered[0])
    return bool((np.diff(ordered) > 0).all()) and (bool(ordered[0] >= 0) or is_two_sided)


def _lines_of_transform(arrays: FileArrays, shape: tuple[int, ...]) -> tuple[str, FloatArray] | None:
    """Make the lines of a whole transform, from 0 Hz to half the sampling rate, where numbers beside it say so."""
    n_lines = max(shape, default=0)
    singles = {name: float(array.ravel()[0].real) for name, array in arrays.arrays.items() if array.size == 1}
    if not any(number == 2 * (n_lines - 1) for number in singles.values()):  # of samples
        return None
    for name, number in singles.items():
        is_rate = RATE.fullmatch(last_part(name)) or FREQUENCY.fullmatch(last_part(name))
        if is_rate and 1.0 < number < np.inf:
            return f"{name} ({number:g} samples a second)", np.linspace(0.0, 0.5 * number, n_lines)
    return None


def _lines_by_step(arrays: FileArrays, shape: tuple[int, ...]) -> tuple[str, FloatArray] | None:
    """Make lines from a step, and a first and a last frequency where they are there, as in ``f_start:df:f_end``."""
    step, start, end = (_number_called(arrays, key) for key in (STEP, START, END))
    if step is None or not 0.0 < step[1] < np.inf:
        return None
    n_lines, first_hz = max(shape, default=0), 0.0 if start is None else start[1]
    if end is not None and n_lines != 1 + int(np.floor((end[1] - first_hz) / step[1] * (1 + ROUNDED))):
        return None
    lines_hz = np.asarray(first_hz + step[1] * np.arange(n_lines), np.float64)
    return f"{step[0]} ({step[1]:g} Hz from line to line, from {first_hz:g} Hz on)", lines_hz


def _number_called(arrays: FileArrays, key: re.Pattern[str]) -> tuple[str, float] | None:
    """Find a single number by its name."""
    for name, array in arrays.arrays.items():
        if array.size == 1 and key.fullmatch(last_part(name)):
            return name, float(array.ravel()[0].real)
    return None


def _ends_beside(arrays: FileArrays, name: str, shape: tuple[int, ...]) -> list[tuple[AnyDof, AnyDof]] | None:
    """Read what FRFs connect from lists of DOFs in the same place."""
    way = name[: -len(last_part(name))]
    lists = []
    for pattern in (OUTPUTS, INPUTS):
        texts = [
            said for key, said in arrays.texts.items() if key.startswith(way) and pattern.fullmatch(last_part(key))
        ]
        dofs = [_parse_all(said) for said in texts]
        lists.append(next((found for found in dofs if found), None))
    outputs, inputs = lists
    if outputs is None or inputs is None:
        return None
    return _pairs(outputs, inputs, shape)


def _pairs(
    outputs: Sequence[AnyDof], inputs: Sequence[AnyDof], shape: tuple[int, ...]
) -> list[tuple[AnyDof, AnyDof]] | None:
    """Match DOFs with the axes of FRFs, output by output; or FRF by FRF where there is one axis for both."""
    n_outputs, n_inputs = shape
    if (len(outputs), len(inputs)) == (n_outputs, n_inputs):
        return [(output, input_) for output in outputs for input_ in inputs]
    if n_inputs == 1 and len(outputs) == len(inputs) == n_outputs:
        return list(zip(outputs, inputs, strict=True))
    if n_inputs == 1 and len(outputs) == 1 and len(inputs) == n_outputs:  # one sensor, several impacts
        return [(outputs[0], input_) for input_ in inputs]
    if n_inputs == 1 and len(outputs) * len(inputs) == n_outputs:
        return [(output, input_) for output in outputs for input_ in inputs]
    return None


def _parse_all(texts: Sequence[str]) -> list[Dof] | None:
    try:
        return [parse_dof(text) for text in texts] or None
    except InputError:
        return None


def _unit_beside(arrays: FileArrays, name: str) -> str:
    way = name[: -len(last_part(name))]
    for key in (f"{name}@unit", f"{name}@units", f"{name}.unit", f"{way}unit", f"{way}units", f"{name}_unit"):
        if len(arrays.texts.get(key, ())) == 1:
            return arrays.texts[key][0].strip()
    return ""


def _example(count: int) -> str:
    return '"1:+z"' if count == 1 else f'["1:+z", {"..., " * (count > 2)}"{count}:+z"]'


def _measured(source: FrfSource, block: FrfBlock) -> list[MeasuredFrf]:
    shape = block.values.shape[1:]
    ends = _pairs(source.output_dofs, source.input_dofs, shape) if source.output_dofs else block.ends
    if ends is None:
        n_outputs, n_inputs = shape
        problem = f"holds FRFs in '{block.name}', {n_outputs} outputs x {n_inputs} inputs on {len(block.values)} lines"
        example = f"output_dof = {_example(n_outputs)}, input_dof = {_example(n_inputs)}"
        given = f"; given are {len(source.output_dofs)} and {len(source.input_dofs)}" if source.output_dofs else ""
        raise FileFormatError(source.path, f"{problem}; say what they connect in its [[frf]]: {example}{given}")
    frfs = []
    values = block.values.reshape(len(block.values), -1)
    coherence, variance = (
        None if array is None else array.reshape(len(array), -1) for array in (block.coherence, block.variance)
    )
    for number, (output_dof, input_dof) in enumerate(ends):
        one = values[:, number]
        columns = {"frequency_hz": block.frequency_hz, "real": one.real, "imag": one.imag}
        left_out = undefined_at_rest(columns)
        used = ~left_out
        is_bad = used & ~np.isfinite(one)
        if is_bad.any():
            problem = f"the FRF {output_dof} / {input_dof} is not finite at {block.frequency_hz[is_bad][0]:g} Hz"
            raise FileFormatError(source.path, f"{problem}; correct the file")
        order = np.flatnonzero(used)[np.argsort(block.frequency_hz[used], kind="stable")]
        frfs.append(
            MeasuredFrf(
                source=source,
                output_dof=output_dof,
                input_dof=input_dof,
                frequency_hz=block.frequency_hz[order],
                values=one[order],
                unit=block.unit,
                is_level=block.is_level,
                coherence=None if coherence is None else coherence[order, number],
                variance=None if variance is None else variance[order, number],
                notes=(
                    *((f"{source.path.name}: {block.about}",) if block.about and not number else ()),
                    *note_at_rest(source, output_dof, input_dof, left_out),
                ),
            )
        )
    return frfs
