"""Constant gains of channels: amplifiers set wrongly, sensitivities that are not those of the data sheet.

A recorded channel is its gain times the true signal. Poles and zeros do not depend on a gain, and residues follow any.
It shows only where two FRFs must be equal but for gains: the same two DOFs with excitation and sensor exchanged
(reciprocity), or the same FRF recorded by two channels. So a user names the channels whose gain is unknown, and all
others are trusted. Known shapes, as those of an FE model, show more: one gain an FRF, relative to the other FRFs.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arguments import require_type
from frf_ipz.errors import InputError, did_you_mean
from frf_ipz.identification.modal_fit import ModalFit
from frf_ipz.late_imports import import_late
from frf_ipz.modes import ModeSet

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from frf_ipz.arrays import ComplexArray, FloatArray
    from frf_ipz.frf import FrfLabel
else:
    pd = import_late("pandas")

ITERATIONS = 20  # of the ratio of two FRFs; of gains and scales in turn
UNDETERMINED = 1e-6  # part of a gain that the equations leave open: above, they do not determine it
DIFFERENT = 3.0  # mean square over that of noise, above which two FRFs differ by more than a gain
SHAPE_ERROR = 0.02  # of the largest product of a mode: what computed shapes are trusted to


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChannelGains:
    """Gains of the channels whose gain is unknown.

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


def find_channel_gains(
    labels: Sequence[FrfLabel], residues: ComplexArray, covariance: FloatArray, channels: Sequence[str]
) -> ChannelGains:
    """Find the gains of some channels.

    Parameters
    ----------
    labels : sequence of FrfLabel
        The FRFs.
    residues : (n_modes, n_frfs) complex array
        Of receptances.
    covariance : (n_modes, n_frfs, 2, 2) array
        Of their real and imaginary parts.
    channels : sequence of str
        Those whose gain is unknown.

    Returns
    -------
    ChannelGains
        Their gains; 1 for all the others.

    Raises
    ------
    InputError
        If a channel does not exist, if the FRFs do not determine its gain, or if two FRFs have opposite signs.
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
    log_gain, root = _solve_log_gains(
        np.array(rows).reshape(-1, len(channels)), np.array(values), np.array(weights), channels
    )
    gain, of_frf = np.exp(log_gain), np.exp(exponents @ log_gain)
    table = pd.DataFrame({"channel": list(channels), "gain": gain, "gain_std": gain * np.linalg.norm(root, axis=1)})
    remarks += [_remark(*row) for row in table.itertuples(index=False)]
    of_frf_std = of_frf * np.linalg.norm(exponents @ root, axis=1)
    return ChannelGains(table=table, of_frf=of_frf, of_frf_std=of_frf_std, remarks=tuple(remarks))


def _remark(channel: str, gain: float, std: float) -> str:
    return f"the channel '{channel}' records {gain:.4g} times the true signal (standard deviation {std:.2g})"


def estimate_gains(fit: ModalFit, shapes: ModeSet) -> pd.DataFrame:
    """Find one gain an FRF from known shapes, such as those of an FE model.

    The scale of each mode is free: only gains relative to the other FRFs are found.

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
    >>> frf_ipz.estimate_gains(fit, frf_ipz.solve_modes(beam, n_modes=4))[["output_dof", "gain"]].round(3)
      output_dof  gain
    0       6:+z   1.0
    1      11:+z   1.0
    """
    require_type("fit", fit, ModalFit)
    require_type("shapes", shapes, ModeSet)
    poles = fit.model.poles[: fit.n_modes]
    powers = np.array([label.quantity.power for label in fit.labels])
    signs = np.array([label.sign for label in fit.labels])
    receptances = fit.model.residues[: fit.n_modes] / poles[:, None] ** powers
    measured = (2j * poles.imag[:, None] * receptances).real
    at_dof = dict(zip([dof.unsigned for dof in shapes.dofs], shapes.shapes.real, strict=True))
    products = np.stack(
        [at_dof[label.output_dof.unsigned] * at_dof[label.input_dof.unsigned] for label in fit.labels], axis=1
    )
    products = products[np.abs(products).any(axis=1)] * signs
    likeness = np.abs(measured @ products.T) / np.linalg.norm(products, axis=1)
    products = products[np.argmax(likeness, axis=1)]
    gain, std = _fit_bilinear(measured, products)
    return pd.DataFrame(
        {
            "output_dof": [str(label.output_dof) for label in fit.labels],
            "input_dof": [str(label.input_dof) for label in fit.labels],
            "gain": gain,
            "gain_std": std,
        }
    )


def _fit_bilinear(measured: FloatArray, products: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Fit ``measured[r, f] = scale[r] gain[f] products[r, f]``, and the standard deviation of the gains."""
    size = np.abs(measured).max(axis=1, keepdims=True)
    measured = measured / size
    gain = np.ones(measured.shape[1])
    for _ in range(ITERATIONS):
        with_gain = products * gain
        scale = np.sum(measured * with_gain, axis=1) / np.sum(with_gain**2, axis=1)
        with_scale = products * scale[:, None]
        gain = np.sum(measured * with_scale, axis=0) / np.sum(with_scale**2, axis=0)
        gain = gain / np.median(gain)
    misfit = measured - with_scale * gain
    degrees_of_freedom = max(misfit.size - sum(misfit.shape) + 1, 1)
    error = max(float(np.sqrt(np.sum(misfit**2) / degrees_of_freedom)), SHAPE_ERROR)
    return gain, np.asarray(error / np.sqrt(np.sum(with_scale**2, axis=0)))


def _ends(label: FrfLabel) -> tuple[str, str]:
    """Name the channels of an FRF: of the response and of the force."""
    return label.output_channel or f"output {label.output_dof}", label.input_channel or f"input {label.input_dof}"


def _require_known(channels: Sequence[str], ends: list[tuple[str, str]]) -> None:
    known = list(dict.fromkeys(name for end in ends for name in end))
    for name in channels:
        if name not in known:
            raise InputError(f"[fit] gain names the channel '{name}', which no FRF has; {did_you_mean(name, known)}")


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
        weighted_misfit = np.einsum("rij,rj->ri", weight, b - ratio * a)
        estimate = a + ratio * np.einsum("rij,rj->ri", covariance[:, 0], weighted_misfit)
        weighted_estimate = np.einsum("ri,rij->rj", estimate, weight)
        ratio = float(np.sum(weighted_estimate * b) / np.sum(weighted_estimate * a))
    spread = float(np.sum((b - ratio * a) * weighted_misfit)) / max(a.size - 1, 1)
    return ratio, float(1 / np.sqrt(np.sum(weighted_estimate * estimate))), spread


def _solve_log_gains(
    rows: FloatArray, values: FloatArray, weights: FloatArray, channels: Sequence[str]
) -> tuple[FloatArray, FloatArray]:
    """Solve for the logarithms of the gains, with a root of their covariance; refuse those that are not determined."""
    resolution = np.linalg.pinv(rows) @ rows
    undetermined = [name for number, name in enumerate(channels) if resolution[number, number] < 1 - UNDETERMINED]
    if undetermined:
        raise InputError(
            f"[fit] gain: these FRFs do not determine the gain of the channel '{undetermined[0]}'; a gain shows only "
            "against a trusted channel: exchange excitation and sensor between two DOFs, or record one FRF with both "
            "channels, or take it out of the list"
        )
    root = np.asarray(np.linalg.pinv(rows * weights[:, None]), np.float64)
    return root @ (values * weights), root
