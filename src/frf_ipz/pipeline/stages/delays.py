"""Delays of the measuring chain that the fit or the diagnosis has found."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from frf_ipz.diagnosis.result import Diagnosis
    from frf_ipz.identification.modal_fit import ModalFit

DELAY = "time_delay"  # the effect of the catalogue


def known_delays(fit: ModalFit, corrected_by: Diagnosis | None) -> dict[str, float]:
    """Collect the delay of each late output channel.

    Parameters
    ----------
    fit : ModalFit
        Its model has a delay for each FRF, where the user had one fitted.
    corrected_by : Diagnosis or None
        What was taken off the FRFs before they were fitted, if anything was.

    Returns
    -------
    dict of str to float
        Seconds, by channel; channels that are not late, and forces, are left out.
    """
    outputs = {label.output_channel for label in fit.labels} - {""}
    delays = dict.fromkeys(outputs, 0.0)
    for label, delay in zip(fit.labels, fit.model.delay_s, strict=True):
        if label.output_channel:
            delays[label.output_channel] = max(delays[label.output_channel], float(delay))
    late = [finding for finding in (corrected_by.findings if corrected_by else ()) if finding.effect == DELAY]
    for finding in late:
        for channel in outputs.intersection(finding.location.channels):
            delays[channel] += float(finding.values[0])
    return {channel: delay for channel, delay in sorted(delays.items()) if delay > 0}
