"""Constant gains of channels: amplifiers set wrongly, sensitivities that are not those of the data sheet.

A recorded channel is its gain times the true signal. Poles and zeros do not tell a gain, and residues take any in. It
shows only where two FRFs must be equal but for gains: the same two DOFs with blow and sensor exchanged (reciprocity),
or the same FRF recorded by two channels. So a user names the channels that are in doubt, and all others are trusted.
Shapes that are known from elsewhere tell more: one gain an FRF, against all the others.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from frf_ipz.errors import InputError, did_you_mean

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.frf import FrfLabel
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.modes import ModeSet

ITERATIONS = 20  # of the ratio of two FRFs; of gains and scales in turn
UNKNOWN = 1e-6  # part of a gain that equations leave open: above, they do not tell it
DIFFERENT = 3.0  # mean square over that of noise, above which two FRFs differ by more than a gain
SHAPE_ERROR = 0.02  # of the largest product of a mode: what computed shapes are trusted to


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChannelGains:
    """Gains of the channels in doubt.

    Parameters
    ----------
    table : DataFrame
        One row a channel: ``channel, gain, gain_std``.
    of_frf, of_frf_std : (n_frfs,) array
        Gain of each FRF, that of its response over that of its force, and its standard deviation.
    remarks : tuple of str
        What the user has to know.
    """

    table: pd.DataFrame
    of_frf: FloatArray
    of_frf_std: FloatArray
    remarks: tuple[str, ...]


def find_gains(
    labels: Sequence[FrfLabel], residues: ComplexArray, covariance: FloatArray, channels: Sequence[str]
) -> ChannelGains:
    """Find the gains of the channels in doubt.

    Parameters
    ----------
    labels : sequence of FrfLabel
        The FRFs.
    residues : (n_modes, n_frfs) complex array
        Of receptances.
    covariance : (n_modes, n_frfs, 2, 2) array
        Of their real and imaginary parts.
    channels : sequence of str
        Those in doubt.

    Returns
    -------
    ChannelGains
        Their gains; 1 for all the others.

    Raises
    ------
    InputError
        If a channel does not exist, if the FRFs do not tell its gain, or if two FRFs have opposite signs.
    """
    if not channels:
        ones = np.ones(len(labels))
        table = pd.DataFrame(columns=["channel", "gain", "gain_std"])
        return ChannelGains(table=table, of_frf=ones, of_frf_std=0 * ones, remarks=())
    ends = [_ends(label) for label in labels]
    _require_known(channels, ends)
    exponents = np.array([[(end[0] == name) - (end[1] == name) for name in channels] for end in ends], float)
    rows, values, weights, remarks = [], [], [], []
    for first, second in _equal_pairs(labels):
        row = exponents[second] - exponents[first]
        if not row.any():
            continue
        sign = labels[first].sign * labels[second].sign
        ratio, std, spread = _ratio(residues[:, [first, second]], covariance[:, [first, second]])
        if ratio * sign < 0:
            raise InputError(
                f"the FRFs {labels[first]} and {labels[second]} must be equal but for gains and have opposite signs; "
                "turn the sign of one of their DOFs in test.toml"
            )
        if spread > DIFFERENT:
            remarks.append(
                f"the FRFs {labels[first]} and {labels[second]} differ by more than a gain: {np.sqrt(spread):.2g} "
                "times their noise; one of the two was not measured where or how the test says"
            )
        rows.append(row)
        values.append(np.log(abs(ratio)))
        weights.append(abs(ratio) / (std * np.sqrt(max(spread, 1.0))))
    found, root = _solved(np.array(rows).reshape(-1, len(channels)), np.array(values), np.array(weights), channels)
    gain, of_frf = np.exp(found), np.exp(exponents @ found)
    table = pd.DataFrame({"channel": list(channels), "gain": gain, "gain_std": gain * np.linalg.norm(root, axis=1)})
    remarks += [_said(*row) for row in table.itertuples(index=False)]
    of_frf_std = of_frf * np.linalg.norm(exponents @ root, axis=1)
    return ChannelGains(table=table, of_frf=of_frf, of_frf_std=of_frf_std, remarks=tuple(remarks))


def _said(channel: str, gain: float, std: float) -> str:
    return f"the channel '{channel}' records {gain:.4g} times the true signal (standard deviation {std:.2g})"


def gains_from_shapes(fit: ModalFit, shapes: ModeSet) -> pd.DataFrame:
    """Find one gain an FRF, against shapes that are known from elsewhere, such as those of an FE model.

    The scale of each mode is free: only how an FRF stands against the others is found.

    Parameters
    ----------
    fit : ModalFit
        The fitted model.
    shapes : ModeSet
        Shapes at the measured DOFs; each fitted mode takes the one that looks most like it.

    Returns
    -------
    DataFrame
        One row an FRF: ``output_dof, input_dof, gain, gain_std``; the median gain is 1.
    """
    poles = fit.model.poles[: fit.n_modes]
    powers = np.array([label.quantity.power for label in fit.labels])
    signs = np.array([label.sign for label in fit.labels])
    delays = np.exp(-poles[:, None] * fit.model.delay_s)
    receptances = fit.model.residues[: fit.n_modes] * delays / poles[:, None] ** powers
    measured = (2j * poles.imag[:, None] * receptances).real
    at_dof = dict(zip([dof.unsigned for dof in shapes.dofs], shapes.shapes.real, strict=True))
    every = np.stack(
        [at_dof[label.output_dof.unsigned] * at_dof[label.input_dof.unsigned] for label in fit.labels], axis=1
    )
    every = every[np.abs(every).any(axis=1)] * signs
    alike = np.abs(measured @ every.T) / np.linalg.norm(every, axis=1)
    products = every[np.argmax(alike, axis=1)]
    gain, std = _bilinear(measured, products)
    return pd.DataFrame(
        {
            "output_dof": [str(label.output_dof) for label in fit.labels],
            "input_dof": [str(label.input_dof) for label in fit.labels],
            "gain": gain,
            "gain_std": std,
        }
    )


def _bilinear(measured: FloatArray, products: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Fit ``measured[r, f] = scale[r] gain[f] products[r, f]``, and the standard deviation of the gains."""
    size = np.abs(measured).max(axis=1, keepdims=True)
    measured = measured / size
    gain = np.ones(measured.shape[1])
    for _ in range(ITERATIONS):
        ahead = products * gain
        scale = np.sum(measured * ahead, axis=1) / np.sum(ahead**2, axis=1)
        behind = products * scale[:, None]
        gain = np.sum(measured * behind, axis=0) / np.sum(behind**2, axis=0)
        gain = gain / np.median(gain)
    left = measured - behind * gain
    free = max(left.size - sum(left.shape) + 1, 1)
    error = max(float(np.sqrt(np.sum(left**2) / free)), SHAPE_ERROR)
    return gain, np.asarray(error / np.sqrt(np.sum(behind**2, axis=0)))


def _ends(label: FrfLabel) -> tuple[str, str]:
    """Name the channels of an FRF: of the response and of the force."""
    return label.output_channel or f"output {label.output_dof}", label.input_channel or f"input {label.input_dof}"


def _require_known(channels: Sequence[str], ends: list[tuple[str, str]]) -> None:
    every = list(dict.fromkeys(name for end in ends for name in end))
    for name in channels:
        if name not in every:
            raise InputError(f"[fit] gain names the channel '{name}', which no FRF has; {did_you_mean(name, every)}")


def _equal_pairs(labels: Sequence[FrfLabel]) -> list[tuple[int, int]]:
    """Pair FRFs that must be equal but for gains: same DOFs and directions, in whatever order."""
    groups: dict[frozenset[str], list[int]] = {}
    for number, label in enumerate(labels):
        key = frozenset({label.output_dof.unsigned.name, label.input_dof.unsigned.name})
        groups.setdefault(key, []).append(number)
    return [pair for group in groups.values() for pair in pairwise(group)]


def _ratio(residues: ComplexArray, covariance: FloatArray) -> tuple[float, float, float]:
    """Real ratio of the second FRF to the first, its standard deviation, and the mean square over that of noise.

    Both have errors: the true residues are estimated along with the ratio, which maximises the likelihood.
    """
    a, b = (np.stack([residues[:, k].real, residues[:, k].imag], axis=1) for k in (0, 1))
    ratio = float(np.sum(a * b) / np.sum(a * a))
    for _ in range(ITERATIONS):
        weight = np.linalg.inv(covariance[:, 1] + ratio**2 * covariance[:, 0])
        left = np.einsum("rij,rj->ri", weight, b - ratio * a)
        true = a + ratio * np.einsum("rij,rj->ri", covariance[:, 0], left)
        seen = np.einsum("ri,rij->rj", true, weight)
        ratio = float(np.sum(seen * b) / np.sum(seen * a))
    spread = float(np.sum((b - ratio * a) * left)) / max(a.size - 1, 1)
    return ratio, float(1 / np.sqrt(np.sum(seen * true))), spread


def _solved(
    rows: FloatArray, values: FloatArray, weights: FloatArray, channels: Sequence[str]
) -> tuple[FloatArray, FloatArray]:
    """Solve for the logarithms of the gains, with a root of their covariance; refuse those that are left open."""
    told = np.linalg.pinv(rows) @ rows
    open_ones = [name for number, name in enumerate(channels) if told[number, number] < 1 - UNKNOWN]
    if open_ones:
        raise InputError(
            f"[fit] gain: these FRFs do not tell the gain of the channel '{open_ones[0]}'; a gain shows only against a "
            "trusted channel: exchange blow and sensor between two DOFs, or record one FRF with both channels, or take "
            "it out of the list"
        )
    root = np.asarray(np.linalg.pinv(rows * weights[:, None]), np.float64)
    return root @ (values * weights), root
