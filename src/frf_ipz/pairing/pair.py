"""Pairing of measured poles and zeros with those of the model, with the reason for every verdict.

Sits between identification and updating. Only unambiguous pairs become targets.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arguments import require_type
from frf_ipz.identification.modal_fit import ModalFit
from frf_ipz.numerics.one_thread import on_one_thread
from frf_ipz.pairing.model_roots import ModelPoles, ModelZeros, model_poles, model_shapes, model_zeros
from frf_ipz.pairing.pairs import Pair, Pairs, PairVerdict
from frf_ipz.pairing.poles import PolePairing, pair_poles
from frf_ipz.pairing.zeros import ZeroPairing, highest_zero, in_band, pair_zeros
from frf_ipz.structure import ReducedModel

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import FloatArray
    from frf_ipz.frf import FrfLabel

SURE = 0.8  # probability from which a pair becomes a target: a wrong one costs the update some four times a missing one
HARDLY_OBSERVABLE = 0.05  # amplitude over the mean amplitude, in every FRF, below which a mode need not show
CANCELLING = 3.0  # standard deviations of distance below which a zero and a pole cannot be distinguished
NO_ROOT = complex(np.nan, np.nan)


@on_one_thread
def pair_roots(fit: ModalFit, reduced_model: ReducedModel) -> Pairs:
    """Assign measured poles and zeros to those of the model, one to one.

    Parameters
    ----------
    fit : ModalFit
        Poles, residues and zeros as measured.
    reduced_model : ReducedModel
        The reduced model.

    Returns
    -------
    Pairs
        Every measured pole and zero and every one that the model has in the band, each with a verdict and its reason.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> lines = np.arange(5, 400.0, 0.5)
    >>> tip, middle = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
    >>> labels = [frf_ipz.FrfLabel(output, tip, frf_ipz.FrfQuantity.ACCELERANCE) for output in (middle, tip)]
    >>> values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=[middle, tip], inputs=[tip], variance=np.full(values.shape, 1e-4)
    ... )
    >>> fit = frf_ipz.fit_modes(frfs)
    >>> reduced_model = frf_ipz.reduce_model(fit, beam, points=["9:+z"])
    >>> pairs = frf_ipz.pair_roots(fit, reduced_model)
    >>> pairs.count("zero").text
    '3 of 7 measured zeros have a counterpart in the model, 4 are undecided'
    """
    require_type("fit", fit, ModalFit)
    require_type("reduced_model", reduced_model, ReducedModel)
    given = fit.modes_given
    poles = model_poles(reduced_model, fit.labels) if given is None else model_shapes(reduced_model, given.dofs)
    pole_pairing = pair_poles(fit, poles)
    rows = _pole_rows(fit, poles, pole_pairing)
    paired_poles = _paired_logs(rows)
    zero_std = np.sqrt(np.maximum(fit.covariance.diagonal()[2 * fit.n_modes + 1 :: 2], 0.0))
    limit = highest_zero(fit, paired_poles)
    for frf, zeros in enumerate(model_zeros(reduced_model, fit.labels, limit_rad_s=limit)):
        zero_pairing = pair_zeros(fit, frf, zeros, paired_poles, float(pole_pairing.gains[frf]))
        rows += _zero_rows(fit, frf, zeros, zero_pairing, paired_poles, zero_std)
    elastic = poles.values[reduced_model.rigid.shape[1] :]
    on_springs = float(np.abs(elastic[0])) if reduced_model.rigid.size and len(elastic) else 0.0
    texts = _warnings(rows, pole_pairing, fit.labels, on_springs)
    return Pairs(rows=tuple(rows), labels=fit.labels, warnings=tuple(texts))


def sure_partners(pairing: PolePairing) -> dict[int, int]:
    """Give the measured poles that have a sure counterpart in a model.

    Parameters
    ----------
    pairing : PolePairing
        The assignment with its probabilities.

    Returns
    -------
    dict of int to int
        The model's pole of each.
    """
    partners = pairing.matching.partner.tolist()
    return {
        mode: partner
        for mode, partner in enumerate(partners)
        if partner >= 0 and pairing.probabilities[mode, partner] >= SURE
    }


def _pole_rows(fit: ModalFit, model: ModelPoles, pairing: PolePairing) -> list[Pair]:
    rows = []
    for mode in range(fit.n_modes):
        partner = int(pairing.matching.partner[mode])
        verdict, reason = _verdict(partner, pairing.probabilities[mode], model.values, "mode")
        rows.append(_row("pole", -1, mode, partner, fit.model.poles[mode], model.values, pairing, verdict, reason))
    observability = np.abs(model.amplitudes) / np.sqrt(np.mean(np.abs(model.amplitudes) ** 2, axis=0))
    inside = in_band(model.values, fit.band_hz, _paired_logs(rows))
    for mode in np.setdiff1d(np.flatnonzero(inside), pairing.matching.partner):
        reason = (
            "the mode has its nodes at the measured points and hardly shows there"
            if observability[mode].max() < HARDLY_OBSERVABLE
            else "the model has a mode here that the measurement does not show"
        )
        rows.append(_unmeasured("pole", -1, int(mode), model.values[mode], reason))
    return rows


def _zero_rows(
    fit: ModalFit,
    frf: int,
    model: ModelZeros,
    pairing: ZeroPairing,
    paired_poles: tuple[FloatArray, FloatArray],
    zero_std: FloatArray,
) -> list[Pair]:
    rows = []
    for row, zero in enumerate(pairing.measured):
        value = fit.zeros.values[zero]
        partner = int(pairing.matching.partner[row])
        verdict, reason = _verdict(partner, pairing.probabilities[row], model.values, "zero")
        verdict, reason = _exclusion(fit, int(zero), float(zero_std[zero])) or (verdict, reason)
        rows.append(_row("zero", frf, int(zero), partner, value, model.values, pairing, verdict, reason, row=row))
    inside = in_band(model.values, fit.band_hz, paired_poles) & (np.array(model.kind) != "real")
    for zero in np.setdiff1d(np.flatnonzero(inside), pairing.matching.partner):
        reason = f"the model has a {model.kind[zero]} zero here that the measurement does not show"
        rows.append(_unmeasured("zero", frf, int(zero), model.values[zero], reason))
    return rows


def _verdict(partner: int, probability: FloatArray, computed: np.ndarray, what: str) -> tuple[PairVerdict, str]:
    if partner < 0:
        return PairVerdict.MISSING_IN_MODEL, f"the model has no {what} near enough in frequency, kind and shape"
    if probability[partner] >= SURE:
        return PairVerdict.PAIRED, f"probability {probability[partner]:.3f}"
    others = np.where(np.arange(len(probability)) == partner, 0.0, probability)
    rival = int(np.argmax(others))
    is_none = rival == len(probability) - 1
    alternative = "no partner" if is_none else f"the one at {abs(computed[rival]) / (2 * np.pi):.5g} Hz"
    return (
        PairVerdict.AMBIGUOUS,
        f"probability {probability[partner]:.2f}; {alternative} is it with probability {others[rival]:.2f}",
    )


def _exclusion(fit: ModalFit, zero: int, std: float) -> tuple[PairVerdict, str] | None:
    """PairVerdict and reason for a measured zero that must not become a target; None for one that may."""
    zeros = fit.zeros
    if not zeros.identifiable[zero]:
        return PairVerdict.AMBIGUOUS, f"not identifiable: {zeros.reason[zero]}"
    if zeros.kind[zero] == "real":
        return PairVerdict.AMBIGUOUS, "a real zero: no measured line shows where it is"
    poles = fit.model.poles[: fit.n_modes]
    distance = np.abs(poles - zeros.values[zero])
    if len(poles) and distance.min() < CANCELLING * std:
        pole_hz = abs(poles[np.argmin(distance)]) / (2 * np.pi)
        return (
            PairVerdict.AMBIGUOUS,
            f"it nearly cancels the pole at {pole_hz:.5g} Hz: the sensor or the excitation is at a node of the mode",
        )
    return None


def _row(
    kind: str,
    frf: int,
    measured: int,
    partner: int,
    value: complex,
    computed: np.ndarray,
    pairing: PolePairing | ZeroPairing,
    verdict: PairVerdict,
    reason: str,
    *,
    row: int | None = None,
) -> Pair:
    paired = partner >= 0
    return Pair(
        kind=kind,
        frf=frf,
        measured=measured,
        computed=partner,
        measured_value=complex(value),
        computed_value=complex(computed[partner]) if paired else NO_ROOT,
        distance=float(pairing.costs[measured if row is None else row, partner]) if paired else float("nan"),
        verdict=verdict,
        reason=reason,
    )


def _unmeasured(kind: str, frf: int, computed: int, value: complex, reason: str) -> Pair:
    return Pair(
        kind=kind,
        frf=frf,
        measured=-1,
        computed=computed,
        measured_value=NO_ROOT,
        computed_value=complex(value),
        distance=float("nan"),
        verdict=PairVerdict.MISSING_IN_MEASUREMENT,
        reason=reason,
    )


def _paired_logs(rows: list[Pair]) -> tuple[FloatArray, FloatArray]:
    """Logarithms of the moduli of paired poles, measured and computed; of the likeliest where none is sure."""
    joined = [row for row in rows if row.kind == "pole" and row.computed >= 0 and row.measured >= 0]
    paired = [row for row in joined if row.verdict is PairVerdict.PAIRED] or joined
    return (
        np.log(np.abs([row.measured_value for row in paired])),
        np.log(np.abs([row.computed_value for row in paired])),
    )


def _warnings(rows: list[Pair], pairing: PolePairing, labels: Sequence[FrfLabel], on_springs_rad_s: float) -> list[str]:
    """Say what could not be paired; below ``on_springs_rad_s`` a free model has rigid-body modes only."""
    texts = []
    poles = [row for row in rows if row.kind == "pole"]
    unpaired = [abs(row.measured_value) for row in poles if row.verdict is PairVerdict.MISSING_IN_MODEL]
    reasons = {
        "it is free, and a structure on its suspension has such modes": [
            size for size in unpaired if size < on_springs_rad_s
        ],
        "something may be missing in it": [size for size in unpaired if size >= on_springs_rad_s],
    }
    for reason, sizes in reasons.items():
        if sizes:
            where = ", ".join(f"{size / (2 * np.pi):.4g}" for size in sizes)
            texts.append(f"the model has no counterpart of the measured modes at {where} Hz: {reason}")
    if not any(row.verdict is PairVerdict.PAIRED for row in poles):
        texts.append("no measured mode could be paired: check units, materials and supports of the FE model")
    flipped = np.flatnonzero(pairing.gains < 0)
    if len(flipped):
        names = ", ".join(str(labels[int(frf)]) for frf in flipped)
        texts.append(f"the polarity of {names} is opposite to the model's")
    return texts
