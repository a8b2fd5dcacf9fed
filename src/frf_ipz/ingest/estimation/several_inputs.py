"""FRFs of records with several forces at once: H1 of correlated inputs, by inverting their spectral matrix.

With the sums over sub-records ``S_ff = sum F F'`` and ``S_xf = sum X F'``, the FRFs are ``S_xf / S_ff``
(eq. 7.39 of [Bendat2010]). What they leave of a response, ``sum |X|^2 - H S_ff H'``, over the segments less the inputs
is its noise; times the diagonal of the inverse of S_ff it is the variance of each FRF, which grows as the forces become
alike. Where they are one force on two channels, nothing tells the FRFs apart, and they are refused.

[Bendat2010]: J. S. Bendat, A. G. Piersol, Random Data, 4th ed., Wiley 2010 (doi:10.1002/9781118032428).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import InputError
from frf_ipz.frf import FrfLabel, FrfSet
from frf_ipz.ingest.campaign import setup_labels
from frf_ipz.ingest.estimation.record_table import empty_record_table
from frf_ipz.ingest.frf_estimate import FrfEstimate
from frf_ipz.ingest.recording_files import UNIFORM, RecordingFiles
from frf_ipz.ingest.signals.transients import transform_subrecords
from frf_ipz.ingest.signals.windows import count_independent_segments, cut_segments
from frf_ipz.ingest.survey.checks import find_record_faults
from frf_ipz.ingest.survey.selection import check_names, is_named, record_name
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.ingest.campaign import TestSetup, VibrationTest
    from frf_ipz.ingest.options import IngestOptions
    from frf_ipz.progress import Progress
else:
    pd = import_late("pandas")

SEGMENTS_OF_INPUT = 10  # independent ones: the noise is then known to a fifth, and the spectral matrix well
SHORTEST_SEGMENT = 32  # samples
SAME_FORCE = 0.5  # of the lines that are excited: where forces cannot be told apart on more of them, on none for sure


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SeveralInputFrfs:
    """FRFs of several inputs and what is known of them.

    Parameters
    ----------
    values : (n_lines, n_outputs, n_inputs) complex array
        H1; 0 on lines without a force.
    variance : (n_lines, n_outputs, n_inputs) array
        E of the squared modulus of the error; NaN on lines where the forces cannot be told apart.
    ordinary : (n_lines, n_outputs, n_inputs) array
        Coherence of each response with each force alone.
    multiple : (n_lines, n_outputs) array
        Share of each response's power that all forces together explain.
    of_inputs : (n_lines, n_inputs, n_inputs) array
        Coherence of the forces with each other.
    is_resolved : (n_lines,) bool array
        The forces can be told apart.
    """

    values: ComplexArray
    variance: FloatArray
    ordinary: FloatArray
    multiple: FloatArray
    of_inputs: FloatArray
    is_resolved: np.ndarray


def estimate_several_inputs(forces: ComplexArray, responses: ComplexArray, independent: float) -> SeveralInputFrfs:
    """Estimate FRFs from spectra of segments.

    Parameters
    ----------
    forces : (n_segments, n_inputs, n_lines) complex array
        Spectra of the forces.
    responses : (n_segments, n_outputs, n_lines) complex array
        Spectra of the responses.
    independent : float
        How many independent segments they are worth.

    Returns
    -------
    SeveralInputFrfs
        FRFs with variance and coherences.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> forces = rng.standard_normal((40, 2, 9, 2)).view(complex)[..., 0]
    >>> responses = 3 * forces[:, :1] - 1j * forces[:, 1:]
    >>> estimate_several_inputs(forces, responses, 40.0).values[4].real.round(9) + 0.0
    array([[3., 0.]])
    """
    F, X = forces.transpose(2, 1, 0), responses.transpose(2, 1, 0)
    n_inputs = F.shape[1]
    S_ff = F @ F.conj().transpose(0, 2, 1)
    S_xf = X @ F.conj().transpose(0, 2, 1)
    power = np.sum(np.abs(X) ** 2, axis=2)
    force_power = np.einsum("kii->ki", S_ff).real
    tiny = np.finfo(float).tiny
    scale = np.sqrt(np.maximum(force_power, tiny))
    alike = S_ff / (scale[:, :, None] * scale[:, None, :])
    smallest = np.linalg.eigvalsh(alike)[:, 0]
    is_excited = (force_power > np.finfo(float).eps ** 2 * force_power.max(axis=0)).all(axis=1)
    # eigenvalues of a matrix of rank one, from so many segments, are no larger than the errors of its elements
    is_resolved = is_excited & (smallest > n_inputs * np.finfo(float).eps * len(forces))
    inverse = np.zeros_like(S_ff)
    inverse[is_resolved] = np.linalg.inv(alike[is_resolved])
    inverse = inverse / (scale[:, :, None] * scale[:, None, :])
    H = S_xf @ inverse
    explained = np.einsum("koi,koi->ko", H, S_xf.conj()).real
    left_over = np.maximum(power - explained, 0.0)
    noise = left_over / max(independent - n_inputs, np.finfo(float).eps)
    variance = noise[:, :, None] * np.einsum("kii->ki", inverse).real[:, None, :]
    with np.errstate(divide="ignore", invalid="ignore"):  # a line may hold nothing
        ordinary = np.abs(S_xf) ** 2 / (power[:, :, None] * force_power[:, None, :])
        multiple = np.where(is_resolved[:, None], 1 - left_over / power, np.nan)
    return SeveralInputFrfs(
        values=np.asarray(H),
        variance=np.where(is_resolved[:, None, None], variance, np.nan),
        ordinary=ordinary,
        multiple=multiple,
        of_inputs=np.abs(alike) ** 2,
        is_resolved=is_resolved,
    )


def estimate_random_several(files: RecordingFiles, options: IngestOptions, progress: Progress) -> FrfEstimate:
    """Estimate the FRFs of a test whose records have several forces at once.

    Parameters
    ----------
    files : RecordingFiles
        Of a test of kind ``random``, with several input channels.
    options : IngestOptions
        `segment_s` chooses the length of the segments.
    progress : Progress
        Called with the share of the work that is done.

    Returns
    -------
    FrfEstimate
        FRFs with the multiple coherence of each response, and the table of all coherences.

    Raises
    ------
    InputError
        If a record cannot be used, there are too few segments, or the forces cannot be told apart.
    """
    test = files.test
    if options.estimator != "H1":
        raise InputError(f"{test.path}: [ingest] estimator = '{options.estimator}' knows one force; several need 'H1'")
    names = [channel.column for channel in test.input_channels]
    frfs: dict[FrfLabel, tuple[np.ndarray, ...]] = {}
    tables, notes = [], []
    all_names = [record_name(test, path, 1, 1) for _, path in test.recordings]
    check_names(all_names, options)
    warnings: list[str] = []
    signals = {setup: _read(files, setup, options, warnings) for setup in test.setups}
    step_s = _common_step([step for records in signals.values() for step, _ in records], test)
    length = _segment_length(test, [[part for _, part in records] for records in signals.values()], step_s, options)
    kind, how = ("sub-records", "transients at both ends removed (local rational method)")
    if options.segment_s is not None:
        kind, how = "segments", "under Hann windows, overlapping by half (as asked for)"
    lines_hz = np.arange(length // 2 + 1) / (length * step_s)
    for place, (setup, records) in enumerate(signals.items()):
        progress(place / len(signals), "averaging segments")
        forces, responses, independent = _transform([part for _, part in records], len(names), length, options)
        estimate = estimate_several_inputs(forces, responses, independent)
        _refuse_one_force(test, estimate, names)
        labels = setup_labels(test.channels, setup)
        columns = np.indices(estimate.values.shape[1:]).reshape(2, -1).T.tolist()
        for label, (output, force) in zip(labels, columns, strict=True):
            column = (
                estimate.values[:, output, force],
                estimate.variance[:, output, force],
                estimate.multiple[:, output],
            )
            frfs.setdefault(label, (*column, np.array(len(forces))))
            tables.append(_coherence_rows(lines_hz, label, estimate, output, force))
        notes.append(_describe_forces(estimate, names, len(forces), independent))
    measured = tuple(label for label in test.labels if label in frfs)
    values, variance, multiple, counts = zip(*(frfs[label] for label in measured), strict=True)
    return FrfEstimate(
        frfs=FrfSet(
            frequency_hz=lines_hz,
            values=np.column_stack(values),
            labels=measured,
            variance=np.column_stack(variance),
            coherence=np.column_stack(multiple),
            averages=np.array(counts, np.int64),
            unknown_scale=test.unknown_scale,
        ),
        records=empty_record_table(),
        choices=(*files.notes, f"{kind} of {length * step_s:.4g} s, {how}", *dict.fromkeys(notes)),
        warnings=tuple(warnings),
        coherences=pd.concat(tables, ignore_index=True),
    )


def _read(
    files: RecordingFiles, setup: TestSetup, options: IngestOptions, warnings: list[str]
) -> list[tuple[float, FloatArray]]:
    """Read step and signals of each good record of a set-up, (n_channels, n_samples), without their means.

    A record with a fault is left out beside good ones, unless the user keeps it; where all are bad, all are used. What
    is done is added to `warnings`.
    """
    good, bad, texts = [], [], []
    for path in setup.files:
        name = record_name(files.test, path, 1, 1)
        if is_named(name, options.drop):
            continue
        table = np.concatenate(list(files.blocks(setup, path)))
        signals = table[:, 1:].T
        step_s = float(table[-1, 0] - table[0, 0]) / (len(table) - 1)
        record = (step_s, signals - signals.mean(axis=1, keepdims=True))
        faults = () if is_named(name, options.keep) else find_record_faults(files.test, step_s, signals)
        if faults:
            bad.append(record)
            texts.append((name, "; ".join(faults)))
        else:
            good.append(record)
    if not good and not bad:
        raise InputError(f"[ingest] drop leaves no record at {', '.join(map(str, setup.input_dofs))}; keep one")
    if good:
        warnings += [f"{name} is left out: {text}" for name, text in texts]
    else:
        warnings += [f"{name} is used although it is bad ({text}): there is no better record" for name, text in texts]
    return good or bad


def _transform(
    records: list[FloatArray], n_inputs: int, length: int, options: IngestOptions
) -> tuple[ComplexArray, ComplexArray, float]:
    """Transform the parts of the records of a set-up: forces, responses, and how many independent ones they are."""
    if options.segment_s is not None:
        spectra = np.array([np.fft.rfft(part) for record in records for part in cut_segments(record, length)])
        independent = sum(count_independent_segments(_count(record, length)) for record in records)
        return spectra[:, :n_inputs], spectra[:, n_inputs:], independent
    parts = [part for record in records for part in transform_subrecords(record[:n_inputs], record[n_inputs:], length)]
    return np.array([force for force, _ in parts]), np.array([motion for _, motion in parts]), float(len(parts))


def _common_step(steps: Sequence[float], test: VibrationTest) -> float:
    if max(steps) - min(steps) > UNIFORM * min(steps):
        raise InputError(
            f"{test.path}: records have steps from {min(steps):.6g} to {max(steps):.6g} s; FRFs of several forces need "
            "one rate for all: resample, or leave the others out"
        )
    return float(np.mean(steps))


def _count(record: FloatArray, length: int) -> int:
    return max((int(record.shape[1]) - length) // max(length // 2, 1) + 1, 0)


def _segment_length(test: VibrationTest, records: list[list[FloatArray]], step_s: float, options: IngestOptions) -> int:
    """Choose the longest sub-records of which each set-up has enough, or take those that the user asks for."""
    n_inputs = len(test.input_channels)
    needed = SEGMENTS_OF_INPUT * n_inputs

    def worth(length: int) -> float:
        return min(sum(count_independent_segments(_count(record, length)) for record in parts) for parts in records)

    def subrecords(length: int) -> int:
        return min(sum(int(record.shape[1]) // length for record in parts) for parts in records)

    if options.segment_s is not None:
        length = round(options.segment_s / step_s)
        if length < SHORTEST_SEGMENT or worth(length) <= n_inputs + 1:
            raise InputError(
                f"{test.path}: [ingest] segment_s = {options.segment_s:g} gives {worth(max(length, 1)):.3g} "
                f"independent segments of {length} samples; {n_inputs} forces need more than {n_inputs + 1}, of "
                f"{SHORTEST_SEGMENT} samples at least"
            )
        return int(length)
    length = max(record.shape[1] for parts in records for record in parts)
    while length >= SHORTEST_SEGMENT and subrecords(length) < needed:
        length = int(length / np.sqrt(2.0))
    if length < SHORTEST_SEGMENT:
        raise InputError(f"{test.path}: records are too short for the {needed} parts that {n_inputs} forces need")
    return length


def _refuse_one_force(test: VibrationTest, estimate: SeveralInputFrfs, names: Sequence[str]) -> None:
    """Refuse forces that are one and the same, up to a filter."""
    if np.mean(estimate.is_resolved) >= SAME_FORCE:
        return
    medians = np.median(np.nan_to_num(estimate.of_inputs), axis=0) - np.eye(len(names))
    first, second = (int(place) for place in np.unravel_index(np.argmax(medians), medians.shape))
    raise InputError(
        f"{test.path}: the forces '{names[first]}' and '{names[second]}' are fully correlated (coherence "
        f"{medians[first, second]:.6f}, median): their FRFs cannot be told apart; drive the shakers by independent "
        "signals, or one after the other"
    )


def _coherence_rows(
    lines_hz: FloatArray, label: FrfLabel, estimate: SeveralInputFrfs, output: int, force: int
) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "frequency_hz": lines_hz,
            "output_dof": str(label.output_dof),
            "input_dof": str(label.input_dof),
            "ordinary_coherence": estimate.ordinary[:, output, force],
            "multiple_coherence": estimate.multiple[:, output],
        }
    )


def _describe_forces(estimate: SeveralInputFrfs, names: Sequence[str], count: int, independent: float) -> str:
    pairs = [
        f"{names[first]} and {names[second]} {np.nanmedian(estimate.of_inputs[:, first, second]):.2g}"
        for second in range(len(names))
        for first in range(second)
    ]
    return f"{count} parts, worth {independent:.3g} independent ones; coherence of the forces: {', '.join(pairs)}"
