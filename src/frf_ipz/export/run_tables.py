"""The tables of a run: the columns of each file of the contract, with unit and meaning.

`FILES` is what a run may write: a column that is not declared there is refused. The reference of the files is written
from it too.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray
from frf_ipz.export.parquet import Column, declared_column, make_table, repeated
from frf_ipz.identification.results.shapes import driving_points, mode_shapes
from frf_ipz.identification.root_covariance import pair_blocks
from frf_ipz.modes import modal_assurance
from frf_ipz.rational import damping_ratio, natural_frequency_hz

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd
    import pyarrow as pa

    from frf_ipz.frf import FrfLabel, FrfSet
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.ingest.frf_estimate import FrfEstimate
    from frf_ipz.pairing.pairs import Pairs
    from frf_ipz.prediction.prediction import Prediction
    from frf_ipz.updating.updated_model import UpdatedModel

RECORD = (
    Column("record", "text", "", "file relative to the test; #2 for the second record in it"),
    Column("input_dof", "text", "", "excited DOF, with the sign of the test"),
    Column("peak_force_N", "float", "N", "extreme value of the force, with its sign"),
    Column("pulse_s", "float", "s", "length of the pulse at half of its height; null for a shaker"),
    Column("used", "flag", "", "true where it enters the FRFs"),
    Column("weight", "float", "1", "its share of the energy of the force among the records of its set-up"),
    Column("marks", "text", "", "what is wrong with it, the reasons for leaving it out first"),
    Column("second_pulse_ratio", "float", "1", "height of a second pulse over the first; 0 where there is none"),
    Column("remaining_amplitude", "float", "1", "share of its amplitude that the slowest mode still has at the end"),
    Column("slowest_mode_hz", "float", "Hz", "frequency of that mode"),
    Column("snr_db", "float", "dB", "power of the response over its noise, median of the channels; null if unknown"),
    Column("force_noise_N", "float", "N", "standard deviation of the force outside of its pulse; null for a shaker"),
    Column("force_band_hz", "float", "Hz", "up to where the force's spectrum stays within 20 dB of its largest value"),
    Column("step_s", "float", "s", "time step of the file"),
    Column("samples", "int", "1", "number of samples"),
    Column("trigger_s", "float", "s", "time from its start at which the force sets in"),
    Column("unlike_others", "flag", "", "all its responses contradict the other impacts, and no fault explains it"),
)
FREQUENCY = Column("frequency_hz", "float", "Hz", "frequency line")
LABEL = (
    Column("output_dof", "text", "", "sensor, with the sign of the test"),
    Column("input_dof", "text", "", "excited DOF, with the sign of the test"),
    Column("quantity", "text", "", "accelerance, mobility or receptance"),
)
VALUE = (
    Column("real", "float", "SI of the quantity per N", "real part"),
    Column("imag", "float", "SI of the quantity per N", "imaginary part"),
)
FRF = (
    FREQUENCY,
    *LABEL,
    *VALUE,
    Column("coherence", "float", "1", "ordinary coherence; null for one record"),
    Column(
        "variance", "float", "SI squared", "E of the squared modulus of the error, half in each part; null if unknown"
    ),
    Column("averages", "int", "1", "records or segments averaged"),
)
COHERENCE = (
    FREQUENCY,
    *LABEL[:2],
    Column("ordinary_coherence", "float", "1", "coherence of the response with this force alone"),
    Column("multiple_coherence", "float", "1", "share of the response's power that all forces together explain"),
)
ROOT = (
    Column("frequency_hz", "float", "Hz", "undamped natural frequency |s| / 2 pi"),
    Column("damping_ratio", "float", "1", "-Re s / |s|"),
    Column("real_rad_s", "float", "rad/s", "real part"),
    Column("imag_rad_s", "float", "rad/s", "imaginary part, >= 0"),
    Column("frequency_std_hz", "float", "Hz", "standard deviation of the frequency"),
    Column("damping_ratio_std", "float", "1", "standard deviation of the damping ratio"),
    Column("real_std_rad_s", "float", "rad/s", "standard deviation of the real part"),
    Column("imag_std_rad_s", "float", "rad/s", "standard deviation of the imaginary part"),
)
FOUND_AGAIN = Column("found_again", "float", "1", "probability that the mode is found again with half as many lines")
POLE = (Column("pole_id", "int", "", "number of the pole, by ascending frequency"), *ROOT, FOUND_AGAIN)
ZERO = (
    Column("zero_id", "int", "", "number of the zero"),
    *LABEL,
    Column("kind", "text", "", "complex, real or quadruple"),
    Column("identifiable", "flag", "", "false where the data do not determine the number"),
    Column("reason", "text", "", "why it is not identifiable"),
    *ROOT,
)
PAIR = (
    Column("kind", "text", "", "pole or zero"),
    *LABEL[:2],
    Column("measured_id", "int", "", "pole_id or zero_id; null if missing in the measurement"),
    Column("verdict", "text", "", "paired, missing in the model, missing in the measurement or ambiguous"),
    Column("reason", "text", "", "why"),
    Column("distance", "float", "1", "cost that the assignment minimised"),
    Column("measured_hz", "float", "Hz", "measured frequency"),
    Column("before_hz", "float", "Hz", "frequency in the model before updating"),
    Column("after_hz", "float", "Hz", "frequency in the model after updating"),
    Column("measured_damping_ratio", "float", "1", "measured damping ratio"),
    Column("before_damping_ratio", "float", "1", "damping ratio in the model before updating"),
    Column("after_damping_ratio", "float", "1", "damping ratio in the model after updating"),
)
PREDICTION = (
    FREQUENCY,
    *LABEL,
    *VALUE,
    Column("magnitude_low", "float", "SI of the quantity per N", "lower end of the 90 % band of the magnitude"),
    Column("magnitude_high", "float", "SI of the quantity per N", "upper end of the 90 % band of the magnitude"),
)
MODE = (
    Column("pole_id", "int", "", "number of the pole, by ascending frequency"),
    Column("frequency_hz", "float", "Hz", "undamped natural frequency"),
    Column("damping_ratio", "float", "1", "damping ratio"),
    Column("dof", "text", "", "measured DOF, unsigned"),
    Column("shape_real", "float", "1/sqrt(kg), or 1 where not mass-normalised", "mode shape, real part"),
    Column("shape_imag", "float", "1/sqrt(kg), or 1 where not mass-normalised", "mode shape, imaginary part"),
    Column("mass_normalised", "flag", "", "true where a driving point was measured and the scale is known"),
    Column("mpc", "float", "1", "modal phase collinearity: 1 for a normal mode"),
    Column("mac", "float", "1", "largest modal assurance criterion with another mode"),
    Column("mac_pole_id", "int", "", "the mode of that largest value"),
    Column("highest_mac", "float", "1", "the same over the residues of all FRFs instead of the shape"),
    Column("significance", "float", "1", "what the mode takes off the misfit, over what the BIC demands for it"),
    Column("damping_std_ratio", "float", "1", "standard deviation of the damping over the damping"),
    Column("misfit_level", "float", "1", "misfit at its frequency over noise, median of the FRFs, at least 1"),
    FOUND_AGAIN,
    Column("quality", "text", "", "good, fair or poor"),
    Column("remarks", "text", "", "why"),
)
FIT = (
    Column("frf", "int", "", "number of the FRF, from 0, in the order of frf.parquet"),
    *LABEL[:2],
    Column("band_low_hz", "float", "Hz", "lower end of the band"),
    Column("band_high_hz", "float", "Hz", "upper end of the band"),
    Column("misfit", "float", "SI of the quantity per N", "root mean square of measured minus fitted"),
    Column("noise", "float", "SI of the quantity per N", "root mean square of the noise"),
    Column("ratio", "float", "1", "root mean square of misfit over noise, line by line"),
    Column("delay_s", "float", "s", "delay of the FRF that the fit took off: 0 without one"),
    Column("gain", "float", "1", "measured FRF over the true one; 1 unless [fit] gain names one of its channels"),
    Column("gain_std", "float", "1", "standard deviation of the gain"),
)
PARAMETER = (
    Column("phase", "text", "", "stiffness, damping, stiffness with damping or chosen parameters"),
    Column("iteration", "int", "1", "number of the iteration"),
    Column("misfit", "float", "1", "weighted sum of squares that is minimised"),
    Column("step", "float", "1", "fraction of the step taken (minimal-change), or its size (ipz)"),
    Column("largest_error", "float", "1", "largest relative error of a target (minimal-change)"),
    Column("size_of_change", "float", "1", "norm of the parameters over their expected size (minimal-change)"),
    Column("data_left_free", "float", "1", "number of combinations of parameters that the targets determine"),
    Column("gamma", "float", "1", "cosine between predicted and actual change of the poles (ipz)"),
    Column("std: *", "float", "1", "expected size of this kind of change, as the targets make it most likely"),
    Column("stiffness of *", "float", "1", "stiffness of these parts, updated over nominal (ipz: its parameter)"),
    Column("mass of *", "float", "1, or kg for a sensor", "parameter of the mass of these parts or of this sensor"),
    Column("damping of mode *", "float", "1", "damping of this mode, updated over that of the nominal model"),
    Column("stiffness *", "float", "1", "parameter of this pair of modes"),
    Column("pole parameter *", "float", "as published", "parameter of the published method that moves a pole"),
    Column("zero parameter *", "float", "as published", "parameter of the published method that moves a zero"),
    Column("* *", "float", "1", "change of this parameter of this effect, relative to what the diagnosis found"),
)
# Every table that a run writes. A name with * stands for all that fit: updating parameters have names of their own.
FILES = {
    "frf.parquet": FRF,
    "records.parquet": RECORD,
    "coherence.parquet": COHERENCE,
    "poles.parquet": POLE,
    "zeros.parquet": ZERO,
    "fit.parquet": FIT,
    "modes.parquet": MODE,
    "pairs.parquet": PAIR,
    "parameters.parquet": PARAMETER,
    "poi_frf.parquet": PREDICTION,
}


def frf_table(frfs: FrfSet, delay_s: Sequence[float] = ()) -> pa.Table:
    """Table of measured FRFs, one row a line and FRF.

    Parameters
    ----------
    frfs : FrfSet
        The FRFs.
    delay_s : sequence of float, optional
        Delay of each that a fit found, and that its values still have, s.

    Returns
    -------
    pyarrow.Table
        ``frf.parquet``; ``delay_s`` of its metadata is an object of the delays other than 0, ``output / input``.
    """
    late = {
        f"{label.output_dof} / {label.input_dof}": float(delay)
        for label, delay in zip(frfs.labels, delay_s, strict=bool(len(delay_s)))
        if delay
    }
    values = {
        **_label_columns(frfs.labels, frfs.n_lines),
        **_value_columns(frfs.values),
        "frequency_hz": np.tile(frfs.frequency_hz, frfs.n_frfs),
        "coherence": frfs.coherence.T.ravel(),
        "variance": frfs.variance.T.ravel(),
        "averages": np.repeat(frfs.averages, frfs.n_lines),
    }
    about = {"window_decay_1_s": repr(frfs.window_decay_1_s), "delay_s": json.dumps(late)}
    return make_table(FRF, values, about=about)


def pole_table(fit: ModalFit) -> pa.Table:
    """Table of the modes' poles.

    Parameters
    ----------
    fit : ModalFit
        The fitted model.

    Returns
    -------
    pyarrow.Table
        ``poles.parquet``.
    """
    count = fit.n_modes
    blocks = pair_blocks(fit.covariance)[:count]
    found_again = fit.modes["found_again"] if "found_again" in fit.modes else np.full(count, np.nan)
    roots = _roots(fit.model.poles[:count], blocks)
    return make_table(POLE, {"pole_id": range(1, count + 1), **roots, "found_again": found_again})


def zero_table(fit: ModalFit) -> pa.Table:
    """Table of the zeros of all FRFs; numbers are null where they are not identifiable.

    Parameters
    ----------
    fit : ModalFit
        The fitted model.

    Returns
    -------
    pyarrow.Table
        ``zeros.parquet``.
    """
    zeros = fit.zeros
    roots = _roots(zeros.values, pair_blocks(fit.covariance)[fit.n_modes :])
    return make_table(
        ZERO,
        {
            "zero_id": range(1, len(zeros.values) + 1),
            **_label_columns([fit.labels[index] for index in zeros.frf], 1),
            "kind": zeros.kind,
            "identifiable": zeros.identifiable,
            "reason": zeros.reason,
            **{name: np.where(zeros.identifiable, column, np.nan) for name, column in roots.items()},
        },
    )


def mode_table(fit: ModalFit, *, scale_is_known: bool = True) -> pa.Table:
    """Table of the modes, one row a mode and measured DOF.

    Parameters
    ----------
    fit : ModalFit
        The fitted model.
    scale_is_known : bool
        False where the absolute scale of the channels is not.

    Returns
    -------
    pyarrow.Table
        ``modes.parquet``.
    """
    modes = mode_shapes(fit)
    count = len(modes.dofs)
    assurance = modal_assurance(modes.shapes, modes.shapes)
    np.fill_diagonal(assurance, 0.0)
    frame = fit.modes.drop(columns=["mac", "mac_pole_id"], errors="ignore")
    frame = frame.loc[frame.index.repeat(count)].reset_index(drop=True)
    frame["dof"] = [dof.name for dof in modes.dofs] * fit.n_modes
    frame["shape_real"], frame["shape_imag"] = modes.shapes.T.real.ravel(), modes.shapes.T.imag.ravel()
    frame["mass_normalised"] = bool(driving_points(fit.labels)) and scale_is_known
    if fit.n_modes:
        frame["mac"] = np.repeat(assurance.max(axis=1), count)
        frame["mac_pole_id"] = np.repeat(assurance.argmax(axis=1) + 1, count)
    return frame_table(frame, MODE)


def pair_table(pairs: Pairs, after: ComplexArray | None = None) -> pa.Table:
    """Table of measured against computed poles and zeros.

    Parameters
    ----------
    pairs : Pairs
        The pairing.
    after : (n_targets,) complex array, optional
        Poles and zeros of the model after updating, in the order of `Pairs.targets`; their columns are null without.

    Returns
    -------
    pyarrow.Table
        ``pairs.parquet``.
    """
    rows = pairs.rows
    updated_values = {} if after is None else dict(zip(pairs.targets, after, strict=True))
    labels = pairs.labels
    stages = {
        "measured": np.array([row.measured_value for row in rows], complex),
        "before": np.array([row.computed_value for row in rows], complex),
        "after": np.array([updated_values.get(row, complex(np.nan, np.nan)) for row in rows], complex),
    }
    dofs = [
        ("", "") if row.frf < 0 else (str(labels[row.frf].output_dof), str(labels[row.frf].input_dof)) for row in rows
    ]
    values = {
        "kind": [row.kind for row in rows],
        "output_dof": [output for output, _ in dofs],
        "input_dof": [excited for _, excited in dofs],
        "measured_id": [row.measured + 1 if row.measured >= 0 else None for row in rows],
        "verdict": [row.verdict.value for row in rows],
        "reason": [row.reason for row in rows],
        "distance": np.array([row.distance for row in rows], float),
        **{f"{name}_hz": natural_frequency_hz(roots) for name, roots in stages.items()},
        **{f"{name}_damping_ratio": damping_ratio(roots) for name, roots in stages.items()},
    }
    return make_table(PAIR, values)


def prediction_table(prediction: Prediction) -> pa.Table:
    """Table of the FRFs at the points of interest.

    Parameters
    ----------
    prediction : Prediction
        The prediction.

    Returns
    -------
    pyarrow.Table
        ``poi_frf.parquet``.
    """
    lines = len(prediction.frequency_hz)
    values = {
        **_label_columns(prediction.labels, lines),
        **_value_columns(prediction.values),
        "frequency_hz": np.tile(prediction.frequency_hz, len(prediction.labels)),
        "magnitude_low": prediction.magnitude_low.T.ravel(),
        "magnitude_high": prediction.magnitude_high.T.ravel(),
    }
    return make_table(PREDICTION, values)


def history_table(updated: UpdatedModel) -> pa.Table:
    """Table of the updating parameters, one row an iteration.

    Parameters
    ----------
    updated : UpdatedModel
        The result of updating.

    Returns
    -------
    pyarrow.Table
        ``parameters.parquet``.
    """
    return frame_table(updated.history, PARAMETER)


def record_table(estimate: FrfEstimate) -> pa.Table:
    """Table of the records, one row each.

    Parameters
    ----------
    estimate : FrfEstimate
        FRFs and the quality of the records.

    Returns
    -------
    pyarrow.Table
        ``records.parquet``.
    """
    return frame_table(estimate.records, RECORD)


def coherence_table(estimate: FrfEstimate) -> pa.Table:
    """Table of coherences of several forces, one row an FRF and line.

    Parameters
    ----------
    estimate : FrfEstimate
        FRFs of several forces at once.

    Returns
    -------
    pyarrow.Table
        ``coherence.parquet``.
    """
    return frame_table(estimate.coherences, COHERENCE)


def misfit_table(fit: ModalFit) -> pa.Table:
    """Table of the misfit against noise, one row an FRF and band.

    Parameters
    ----------
    fit : ModalFit
        The fitted model.

    Returns
    -------
    pyarrow.Table
        ``fit.parquet``.
    """
    return frame_table(fit.misfit, FIT)


def frame_table(frame: pd.DataFrame, columns: Sequence[Column]) -> pa.Table:
    """Table of a data frame.

    Parameters
    ----------
    frame : DataFrame
        Columns of floats, ints, texts or flags.
    columns : sequence of Column
        What may stand in the table.

    Returns
    -------
    pyarrow.Table
        The columns of the frame, in its order.

    Raises
    ------
    KeyError
        If the frame has a column that is not declared: a fault of the program.
    """
    present = [declared_column(columns, str(name)) for name in frame.columns]
    return make_table(present, {str(name): frame[name].to_numpy() for name in frame.columns})


def _label_columns(labels: Sequence[FrfLabel], repeat: int) -> dict[str, pa.Array]:
    return {
        "output_dof": repeated([str(label.output_dof) for label in labels], repeat),
        "input_dof": repeated([str(label.input_dof) for label in labels], repeat),
        "quantity": repeated([label.quantity.value for label in labels], repeat),
    }


def _value_columns(values: ComplexArray) -> dict[str, FloatArray]:
    return {"real": values.real.T.ravel(), "imag": values.imag.T.ravel()}


def _roots(values: ComplexArray, blocks: FloatArray) -> dict[str, FloatArray]:
    """Frequency and damping of roots with their standard deviations, to first order."""
    modulus = np.maximum(np.abs(values), np.finfo(float).tiny)
    to_frequency = np.stack([values.real, values.imag], 1) / (2 * np.pi * modulus)[:, None]
    to_damping = np.stack([-(values.imag**2), values.real * values.imag], 1) / modulus[:, None] ** 3
    return {
        "frequency_hz": natural_frequency_hz(values),
        "damping_ratio": damping_ratio(values),
        "real_rad_s": values.real,
        "imag_rad_s": values.imag,
        "frequency_std_hz": _std(to_frequency, blocks),
        "damping_ratio_std": _std(to_damping, blocks),
        "real_std_rad_s": np.sqrt(blocks[:, 0, 0]),
        "imag_std_rad_s": np.sqrt(blocks[:, 1, 1]),
    }


def _std(gradient: FloatArray, blocks: FloatArray) -> FloatArray:
    with np.errstate(invalid="ignore"):  # roots that are not identifiable have an infinite variance
        return np.asarray(np.sqrt(np.einsum("ki,kij,kj->k", gradient, blocks, gradient)))
