"""Columns of recordings that are exchanged, those of the force and of a response, or that hold the same.

Of a hammer's impacts, the force rings and the response is a pulse. The effective duration of a signal is that of a
rectangle with the same energy and the same integral of its fourth power, ``(int x^2)^2 / int x^4``: a pulse is short
however high it is, a lightly damped response is long however weak.

Of other recordings, what is called the FRF of that response is its inverse, and what is called that of another response
is their transmissibility: poles are where zeros should be. Once that is taken back, the modes agree with the model.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.assessment.assessment import LikelyCause
from frf_ipz.assessment.causes.cause import NO_MISTAKE, explains, log_evidence
from frf_ipz.assessment.causes.modal_comparison import cost_of_own_size, measured_modes, unrelated_log_likelihood
from frf_ipz.errors import FrfIpzError
from frf_ipz.identification.fit import fit_modes
from frf_ipz.identification.options import FitOptions

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import ComplexArray
    from frf_ipz.assessment.causes.cause import Situation
    from frf_ipz.frf import FrfLabel, FrfSet
    from frf_ipz.ingest.frf_estimate import Trace

PRINTED = 1e-3  # relative: what few printed digits make of two signals that are one
FEWEST_COMMON = 4  # times at which two signals are compared: one fixes their ratio


def find_exchanged_columns(
    impacts: Sequence[Trace], labels: Sequence[FrfLabel], *, test_file: str
) -> LikelyCause | None:
    """Find a response that looks like the hammer's force while that looks like a response, or is that force again.

    Durations are known to a step of what is drawn: only what is shorter by more is.

    Parameters
    ----------
    impacts : sequence of Trace
        Forces and responses of a hammer's impacts.
    labels : sequence of FrfLabel
        Name the channels.
    test_file : str
        Where the columns are named.

    Returns
    -------
    LikelyCause or None
        None where every response lasts longer than the force, or there are no recordings.
    """
    copied = _find_copied_force(impacts, labels, test_file=test_file)
    if copied is not None:
        return copied
    inputs = {label.input_channel for label in labels}
    records = dict.fromkeys(trace.name for trace in impacts)
    found: list[tuple[str, str]] = []
    looked_at = 0
    for record in records:
        traces = [trace for trace in impacts if trace.name == record]
        durations = {trace.channel: _duration(trace) for trace in traces}
        step_s = max((float(np.diff(trace.time_s).max(initial=0.0)) for trace in traces), default=0.0)
        forces = [channel for channel in durations if channel in inputs]
        responses = {channel: length for channel, length in durations.items() if channel not in inputs}
        if len(forces) != 1 or not responses:
            continue
        looked_at += 1
        shortest = min(responses, key=responses.__getitem__)
        if responses[shortest] < durations[forces[0]] - step_s:
            found.append((forces[0], shortest))
    if not found:
        return None
    force, response = max(dict.fromkeys(found), key=found.count)
    return LikelyCause(
        says=f"the columns '{force}' and '{response}' are exchanged: the one that is called force rings, and the other "
        "is a pulse",
        file=test_file,
        line_or_key=f"[[channel]] column = '{force}' and column = '{response}'",
        probability=found.count((force, response)) / looked_at,
    )


def _find_copied_force(impacts: Sequence[Trace], labels: Sequence[FrfLabel], *, test_file: str) -> LikelyCause | None:
    """Find a response that is in all records a multiple of the force, to the digits that are printed."""
    inputs = {label.input_channel for label in labels}
    forces = {trace.name: trace for trace in impacts if trace.channel in inputs}
    pairs = [(forces[trace.name], trace) for trace in impacts if trace.channel not in inputs and trace.name in forces]
    for response in dict.fromkeys(trace.channel for _, trace in pairs):
        of_it = [(force, trace) for force, trace in pairs if trace.channel == response]
        if not all(_is_multiple(trace, force) for force, trace in of_it):
            continue
        name = of_it[0][0].channel
        return LikelyCause(
            says=f"the column '{response}' holds the force '{name}' once more: one is a multiple of the other in all "
            "records",
            file=test_file,
            line_or_key=f"[[channel]] column = '{response}'",
            probability=1.0,
        )
    return None


def _is_multiple(trace: Trace, force: Trace) -> bool:
    """Compare two traces at the times that both are drawn at."""
    common, of_trace, of_force = np.intersect1d(trace.time_s, force.time_s, return_indices=True)
    values, own = trace.values[of_trace] - np.median(trace.values), force.values[of_force]
    power = float(own @ own)
    if len(common) < FEWEST_COMMON or not power or not np.any(values):
        return False
    return float(np.linalg.norm(values - (values @ own) / power * own)) <= PRINTED * float(np.linalg.norm(values))


def find_inverted_columns(frfs: FrfSet, situation: Situation) -> LikelyCause | None:
    """Find a response that was read as the force, and the force as that response, by the modes.

    Parameters
    ----------
    frfs : FrfSet
        As measured.
    situation : Situation
        Measurement and model, which nothing else explains.

    Returns
    -------
    LikelyCause or None
        None where no exchange brings the measurement to the model, or there are no channels.
    """
    if explains(NO_MISTAKE, situation):
        return None
    for response in dict.fromkeys(label.output_channel for label in frfs.labels if label.input_channel):
        force = next(label.input_channel for label in frfs.labels if label.output_channel == response)
        try:
            fit = fit_modes(
                _taken_back(frfs, response), options=FitOptions(band_hz=situation.measured.band_hz, delay=False)
            )
        except FrfIpzError:
            continue
        taken_back = replace(situation, measured=measured_modes(fit))
        cause = replace(NO_MISTAKE, gain=_gains(taken_back))
        # gains that are fitted explain one product of each FRF, whatever the model
        earned = log_evidence(cause, taken_back) - cost_of_own_size(len(fit.labels))
        if explains(cause, taken_back) and earned > unrelated_log_likelihood(taken_back.measured):
            return LikelyCause(
                says=f"the columns '{force}' and '{response}' are exchanged: so are poles and zeros, which agree with "
                "the model once that is taken back",
                file=situation.test_file,
                line_or_key=f"[[channel]] column = '{force}' and column = '{response}'",
                probability=1.0,
            )
    return None


def _taken_back(frfs: FrfSet, response: str) -> FrfSet:
    """Give the FRFs as they were, had a response not been read as the force."""
    columns = [place for place, label in enumerate(frfs.labels) if label.output_channel == response]
    by_input = {frfs.labels[column].input_dof: column for column in columns}
    kept = [place for place, label in enumerate(frfs.labels) if label.input_dof in by_input]
    inverse = [by_input[frfs.labels[place].input_dof] for place in kept]
    with np.errstate(divide="ignore", invalid="ignore"):  # an FRF may be 0
        relative = frfs.variance / np.abs(frfs.values) ** 2
        values = np.where(np.isin(kept, columns), 1.0, frfs.values[:, kept]) / frfs.values[:, inverse]
        variance = np.abs(values) ** 2 * (
            relative[:, inverse] + np.isin(kept, columns, invert=True) * relative[:, kept]
        )
    return replace(frfs.select_frfs(kept), values=np.nan_to_num(values), variance=variance)


def _gains(situation: Situation) -> ComplexArray:
    """(n_frfs,) factors of the FRFs: with the columns, their units are exchanged."""
    measured, computed = situation.measured, situation.computed
    nearest = np.argmin(np.abs(np.log(measured.frequency_hz[:, None] / computed.frequency_hz)), axis=1)
    products = computed.products(measured.labels, {}, {})[nearest]
    tiny = np.finfo(float).tiny
    ratios = np.log(np.maximum(np.abs(measured.products), tiny) / np.maximum(np.abs(products), tiny))
    return np.asarray(np.exp(np.median(ratios, axis=0)), complex)


def _duration(trace: Trace) -> float:
    values = trace.values - np.median(trace.values)
    fourth = float(np.trapezoid(values**4, trace.time_s))
    return float(np.trapezoid(values**2, trace.time_s)) ** 2 / fourth if fourth > 0 else np.inf
