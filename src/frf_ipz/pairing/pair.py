"""Pairing: which measured pole or zero is which one of the model, with the reason for every verdict.

Sits between identification and updating. Only what is paired beyond doubt becomes a target.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.pairing.model_roots import ModelPoles, ModelZeros, model_poles, model_zeros
from frf_ipz.pairing.pairs import Pair, Pairs, Verdict
from frf_ipz.pairing.poles import PolePairing, pair_poles
from frf_ipz.pairing.zeros import ZeroPairing, in_band, pair_zeros

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import FloatArray
    from frf_ipz.frf import FrfLabel
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.pairing.matching import Matching
    from frf_ipz.structure import ReducedModel

SURE = 1.0  # rise of the cost, in squared standard deviations, that a second-best assignment must have
HARDLY_SEEN = 0.05  # amplitude over the mean amplitude, in every FRF, below which a mode need not show
CANCELLING = 3.0  # standard deviations of distance below which a zero and a pole cannot be told apart
NOWHERE = complex(np.nan, np.nan)


def pair(fit: ModalFit, model: ReducedModel) -> Pairs:
    """Assign measured poles and zeros to those of the model, one to one.

    Parameters
    ----------
    fit : ModalFit
        Poles, residues and zeros as measured.
    model : ReducedModel
        The reduced model.

    Returns
    -------
    Pairs
        Every measured pole and zero and every one that the model has in the band, each with a verdict and its reason.
    """
    poles = model_poles(model, fit.labels)
    found = pair_poles(fit, poles)
    rows = _pole_rows(fit, poles, found)
    known = _paired_logs(rows)
    for frf in range(len(fit.labels)):
        zeros = model_zeros(model, fit.labels[frf])
        matched = pair_zeros(fit, frf, zeros, known, float(found.gains[frf]))
        rows += _zero_rows(fit, frf, zeros, matched, known)
    return Pairs(rows=tuple(rows), warnings=tuple(_warnings(rows, found, fit.labels)))


def _pole_rows(fit: ModalFit, model: ModelPoles, found: PolePairing) -> list[Pair]:
    rows = []
    for place in range(fit.n_modes):
        partner = int(found.matching.partner[place])
        verdict, reason = _verdict(found.matching, place, model.values, "mode")
        rows.append(_row("pole", -1, place, partner, fit.model.poles[place], model.values, found, verdict, reason))
    seen = np.abs(model.amplitudes) / np.sqrt(np.mean(np.abs(model.amplitudes) ** 2, axis=0))
    inside = in_band(model.values, fit.band_hz, _paired_logs(rows))
    for place in np.setdiff1d(np.flatnonzero(inside), found.matching.partner):
        reason = (
            "the model has its nodes at the measured points: it hardly shows there"
            if seen[place].max() < HARDLY_SEEN
            else "the model has a mode here that the measurement does not show"
        )
        rows.append(_unmeasured("pole", -1, int(place), model.values[place], reason))
    return rows


def _zero_rows(
    fit: ModalFit, frf: int, model: ModelZeros, found: ZeroPairing, known: tuple[FloatArray, FloatArray]
) -> list[Pair]:
    rows = []
    for index, place in enumerate(found.measured):
        value = fit.zeros.values[place]
        partner = int(found.matching.partner[index])
        verdict, reason = _verdict(found.matching, index, model.values, "zero")
        verdict, reason = _no_target(fit, int(place)) or (verdict, reason)
        rows.append(_row("zero", frf, int(place), partner, value, model.values, found, verdict, reason, index=index))
    inside = in_band(model.values, fit.band_hz, known) & (np.array(model.kind) != "real")
    for place in np.setdiff1d(np.flatnonzero(inside), found.matching.partner):
        reason = f"the model has a {model.kind[place]} zero here that the measurement does not show"
        rows.append(_unmeasured("zero", frf, int(place), model.values[place], reason))
    return rows


def _verdict(matching: Matching, place: int, computed: np.ndarray, what: str) -> tuple[Verdict, str]:
    partner, rival = int(matching.partner[place]), int(matching.rival[place])
    if partner < 0:
        return Verdict.MISSING_IN_MODEL, f"the model has no {what} near enough in frequency, kind and shape"
    if matching.margin[place] >= SURE:
        return Verdict.PAIRED, f"the next best choice is worse by {matching.margin[place]:.1f} squared deviations"
    other = "to leave it alone" if rival < 0 else f"the one at {abs(computed[rival]) / (2 * np.pi):.5g} Hz"
    return Verdict.AMBIGUOUS, f"{other} would be as likely (worse by {matching.margin[place]:.1f})"


def _no_target(fit: ModalFit, place: int) -> tuple[Verdict, str] | None:
    """Why a measured zero must not become a target, if so."""
    zeros = fit.zeros
    if not zeros.identifiable[place]:
        return Verdict.AMBIGUOUS, f"not identifiable: {zeros.reason[place]}"
    if zeros.kind[place] == "real":
        return Verdict.AMBIGUOUS, "a real zero: no measured line shows where it is"
    start = 2 * (fit.n_modes + place)
    std = float(np.sqrt(max(fit.covariance[start + 1, start + 1], 0.0)))
    poles = fit.model.poles[: fit.n_modes]
    distance = np.abs(poles - zeros.values[place])
    if len(poles) and distance.min() < CANCELLING * std:
        near = abs(poles[np.argmin(distance)]) / (2 * np.pi)
        return Verdict.AMBIGUOUS, f"it nearly cancels the pole at {near:.5g} Hz: the sensor or the blow sits at a node"
    return None


def _row(
    kind: str,
    frf: int,
    measured: int,
    partner: int,
    value: complex,
    computed: np.ndarray,
    found: PolePairing | ZeroPairing,
    verdict: Verdict,
    reason: str,
    *,
    index: int | None = None,
) -> Pair:
    paired = partner >= 0
    return Pair(
        kind=kind,
        frf=frf,
        measured=measured,
        computed=partner,
        measured_value=complex(value),
        computed_value=complex(computed[partner]) if paired else NOWHERE,
        distance=float(found.costs[measured if index is None else index, partner]) if paired else float("nan"),
        verdict=verdict,
        reason=reason,
    )


def _unmeasured(kind: str, frf: int, place: int, value: complex, reason: str) -> Pair:
    return Pair(
        kind=kind,
        frf=frf,
        measured=-1,
        computed=place,
        measured_value=NOWHERE,
        computed_value=complex(value),
        distance=float("nan"),
        verdict=Verdict.MISSING_IN_MEASUREMENT,
        reason=reason,
    )


def _paired_logs(rows: list[Pair]) -> tuple[FloatArray, FloatArray]:
    """Logarithms of the moduli of paired poles, measured and computed."""
    paired = [row for row in rows if row.kind == "pole" and row.computed >= 0 and row.measured >= 0]
    return (
        np.log(np.abs([row.measured_value for row in paired])),
        np.log(np.abs([row.computed_value for row in paired])),
    )


def _warnings(rows: list[Pair], found: PolePairing, labels: Sequence[FrfLabel]) -> list[str]:
    texts = []
    poles = [row for row in rows if row.kind == "pole"]
    lonely = [row for row in poles if row.verdict is Verdict.MISSING_IN_MODEL]
    if lonely:
        where = ", ".join(f"{abs(row.measured_value) / (2 * np.pi):.4g}" for row in lonely)
        texts.append(
            f"the model has no counterpart of the measured modes at {where} Hz: something may be missing in it"
        )
    if not any(row.verdict is Verdict.PAIRED for row in poles):
        texts.append("no measured mode could be paired: check units, materials and supports of the FE model")
    flipped = np.flatnonzero(found.gains < 0)
    if len(flipped):
        names = ", ".join(str(labels[int(frf)]) for frf in flipped)
        texts.append(f"the polarity of {names} is opposite to the model's")
    return texts
