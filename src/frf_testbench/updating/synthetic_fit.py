"""What a fitter would report of a structure that is known: poles, residues and zeros with their joint covariance.

The covariance is the smallest that unbiased estimates from noisy lines can have (linearised least squares); what is
reported is the truth plus one draw from it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from scipy.linalg import eigh

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from frf_ipz.frf import FrfLabel
from frf_ipz.identification.modal_fit import ModalFit
from frf_ipz.numerics.pencils import damped_zeros
from frf_ipz.pairing.pairs import Pair, Pairs, PairVerdict
from frf_ipz.quantities import FrfQuantity
from frf_ipz.rational import PoleResidueModel, ZeroSet, damping_ratio, natural_frequency_hz, underdamped_poles

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.dofs import AnyDof, Dof
    from frf_ipz.structure import StructuralModel

N_LINES = 800
ANTIRESONANCE_LIMIT = 0.5  # real part over modulus above which a zero has no antiresonance
LARGEST_POLE_STD = 3e-3  # standard deviation of a pole over its modulus up to which a fitter finds it
LARGEST_ZERO_STD = 0.03  # the same of a zero up to which it is identifiable
N_TRUE_MODES = 60  # modes of the true structure that are used; those beyond hardly reach into the band


class TrueModes:
    """Modes of a structure at all its free DOFs."""

    def __init__(self, model: StructuralModel, damping: FloatArray) -> None:
        values, shapes = eigh(model.stiffness.toarray(), model.mass.toarray())
        values[np.abs(values) < 1e-9 * values[-1] / len(values)] = 0
        self.omega = np.sqrt(np.maximum(values, 0))[:N_TRUE_MODES]
        self.damping = np.asarray(damping)[: len(self.omega)]
        self.shapes = shapes[:, : len(self.omega)]
        self.model = model

    def row(self, dof: AnyDof) -> FloatArray:
        """Motion of a DOF in every mode, (n,), 1/sqrt(kg)."""
        return np.asarray(self.model.rows([dof]).toarray()[0] @ self.shapes)

    def receptance(self, s: ComplexArray, label: FrfLabel) -> ComplexArray:
        """Give the receptance, whatever the label's quantity, (n_lines,), m/N."""
        products = self.row(label.output_dof) * self.row(label.input_dof)
        dynamic_stiffness = s[:, None] ** 2 + 2 * self.damping * self.omega * s[:, None] + self.omega**2
        return np.asarray((products / dynamic_stiffness).sum(1))

    def zeros(self, label: FrfLabel) -> ComplexArray:
        """Give the zeros of an FRF by ascending modulus, imaginary part > 0, rad/s."""
        matrices = np.eye(len(self.omega)), np.diag(2 * self.damping * self.omega), np.diag(self.omega**2)
        values = damped_zeros(*matrices, self.row(label.output_dof), self.row(label.input_dof)).values
        values = values[values.imag > 1e-3 * np.abs(values)]
        return values[np.argsort(np.abs(values))]

    def flexible(self) -> BoolArray:
        """Tell which modes are no rigid-body motion."""
        return np.asarray(self.omega > 1e-3 * self.omega[self.omega > 0].max() / len(self.omega))


def choose_band(truth: TrueModes, n_modes: int) -> tuple[float, float]:
    """Choose a band, Hz: from half the first flexible mode to half way between its last mode and the next."""
    omega = truth.omega[truth.flexible()]
    return omega[0] / 4 / np.pi, (omega[n_modes - 1] + omega[n_modes]) / 4 / np.pi


def simulate_fit(
    truth: TrueModes,
    labels: tuple[FrfLabel, ...],
    band_hz: tuple[float, float],
    *,
    noise: float = 0.002,
    rng: np.random.Generator | None = None,
) -> ModalFit:
    """Give the fit of all FRFs; `noise` is the standard deviation of a line over the root mean square of its FRF."""
    inside = truth.flexible() & (truth.omega > 2 * np.pi * band_hz[0]) & (truth.omega < 2 * np.pi * band_hz[1])
    while True:
        fit = simulate_fit_of_modes(truth, labels, band_hz, noise, rng, inside)
        spread = np.sqrt(np.diagonal(fit.covariance)[1 : 2 * fit.n_modes : 2]) / np.abs(fit.model.poles)
        if spread.max() < LARGEST_POLE_STD:
            return fit
        inside[np.flatnonzero(inside)[np.argmax(spread)]] = False  # nobody would find this mode in these data


def simulate_fit_of_modes(
    truth: TrueModes,
    labels: tuple[FrfLabel, ...],
    band_hz: tuple[float, float],
    noise: float,
    rng: np.random.Generator | None,
    inside: BoolArray,
) -> ModalFit:
    """Give the fit with some of the modes only."""
    s = np.asarray(2j * np.pi * np.linspace(*band_hz, N_LINES), np.complex128)
    poles = underdamped_poles(truth.omega[inside] / 2 / np.pi, truth.damping[inside])
    powers = (-2, 0, 2)
    scale = float(np.abs(s).max())
    residues, coefficients, frf_noise = [], [], []
    zero_values: list[complex] = []
    kinds: list[str] = []
    zero_frfs: list[int] = []
    for frf, label in enumerate(labels):
        values = truth.receptance(s, label)
        products = (truth.row(label.output_dof) * truth.row(label.input_dof))[inside]
        frf_residues = products / (2j * poles.imag)
        in_band = frf_residues / (s[:, None] - poles) + frf_residues.conj() / (s[:, None] - poles.conj())
        out_of_band = values - in_band.sum(1)
        terms = (s[:, None] / scale) ** np.array(powers)
        coefficients.append(
            np.linalg.lstsq(np.vstack([terms.real, terms.imag]), np.r_[out_of_band.real, out_of_band.imag])[0]
        )
        residues.append(frf_residues)
        selected_zeros, selected_kinds = select_zeros(truth.zeros(label), band_hz)
        zero_values += selected_zeros
        kinds += selected_kinds
        zero_frfs += [frf] * len(selected_zeros)
        frf_noise.append(noise * np.sqrt(np.mean(np.abs(values) ** 2)))
    model = PoleResidueModel(
        poles=poles,
        residues=np.array(residues).T,
        powers=powers,
        coefficients=np.array(coefficients).T,
        scale_rad_s=scale,
        delay_s=np.zeros(len(labels)),
    )
    zeros, zero_frf = np.array(zero_values, complex), np.array(zero_frfs, int)
    root, residue_covariance = propagate_noise(model, s, zeros, zero_frf, np.array(frf_noise))
    if rng is not None and noise > 0:
        parts = root @ rng.standard_normal(root.shape[1])
        error = parts[::2] + 1j * parts[1::2]
        poles, zeros = poles + error[: len(poles)], zeros + error[len(poles) :]
        model = PoleResidueModel(
            poles=poles,
            residues=model.residues,
            powers=powers,
            coefficients=model.coefficients,
            scale_rad_s=scale,
            delay_s=model.delay_s,
        )
    return make_modal_fit(model, labels, band_hz, zeros, zero_frf, kinds, root @ root.T, residue_covariance)


def make_fit_of_targets(
    poles: ComplexArray,
    zeros: ComplexArray,
    label: FrfLabel,
    band_hz: tuple[float, float],
    *,
    relative_std: float = 0.0,
) -> ModalFit:
    """Give a fit that holds given poles and zeros of one FRF and nothing else: residues are 0."""
    values = np.concatenate([poles, zeros])
    model = PoleResidueModel(
        poles=np.asarray(poles),
        residues=np.zeros((len(poles), 1), complex),
        powers=(),
        coefficients=np.zeros((0, 1)),
        scale_rad_s=1.0,
        delay_s=np.zeros(1),
    )
    covariance = np.diag(np.repeat((relative_std * np.abs(values)) ** 2, 2))
    kinds = ("complex",) * len(zeros)
    zero_frf = np.zeros(len(zeros), int)
    residue_covariance = np.zeros((len(poles), 1, 2, 2))
    return make_modal_fit(model, (label,), band_hz, np.asarray(zeros), zero_frf, kinds, covariance, residue_covariance)


def pair_in_order(fit: ModalFit, computed_poles: ComplexArray, computed_zeros: ComplexArray) -> Pairs:
    """Pair a fit of one FRF, the k-th with the k-th."""
    rows = []
    for kind, frf, measured_values, computed_values in (
        ("pole", -1, fit.model.poles, computed_poles),
        ("zero", 0, fit.zeros.values, computed_zeros),
    ):
        for k, (measured, computed) in enumerate(zip(measured_values, computed_values, strict=True)):
            rows.append(
                Pair(
                    kind=kind,
                    frf=frf,
                    measured=k,
                    computed=k,
                    measured_value=complex(measured),
                    computed_value=complex(computed),
                    distance=0.0,
                    verdict=PairVerdict.PAIRED,
                    reason="in order",
                )
            )
    return Pairs(rows=tuple(rows), labels=fit.labels)


def select_zeros(values: ComplexArray, band_hz: tuple[float, float]) -> tuple[list[complex], list[str]]:
    """Select those that a fitter would list, once a conjugate pair or quadruple, and name their kinds."""
    selected_zeros, kinds = [], []
    for z in values:
        mirrored = np.abs(values + z.conj()).min() < 0.5 * abs(z.real)
        if band_hz[0] < abs(z) / 2 / np.pi < band_hz[1] and z.real < 0 and abs(z.real) < ANTIRESONANCE_LIMIT * abs(z):
            selected_zeros.append(z)
            kinds.append("quadruple" if mirrored else "complex")
    return selected_zeros, kinds


def make_modal_fit(
    model: PoleResidueModel,
    labels: tuple[FrfLabel, ...],
    band_hz: tuple[float, float],
    zeros: ComplexArray,
    zero_frf: IntArray,
    kinds: Sequence[str],
    covariance: FloatArray,
    residue_covariance: FloatArray,
) -> ModalFit:
    """Build a ModalFit that carries what pairing and updating read."""
    n_modes = len(model.poles)
    is_identifiable = np.sqrt(np.diagonal(covariance)[2 * n_modes + 1 :: 2]) < LARGEST_ZERO_STD * np.abs(zeros)
    return ModalFit(
        model=model,
        n_modes=n_modes,
        labels=tuple(labels),
        band_hz=(band_hz[0], band_hz[1]),
        used_lines=np.ones(N_LINES, bool),
        frequency_hz=np.linspace(*band_hz, N_LINES),
        zeros=ZeroSet(
            values=zeros,
            frf=zero_frf,
            kind=tuple(kinds),
            identifiable=is_identifiable,
            reason=tuple("" if known else "its standard deviation is too large" for known in is_identifiable),
        ),
        covariance=covariance,
        residue_covariance=residue_covariance,
        value_std=np.zeros((N_LINES, len(labels))),
        stabilization=pd.DataFrame(),
        decisions=pd.DataFrame(),
        modes=pd.DataFrame(
            {
                "pole_id": np.arange(1, n_modes + 1),
                "frequency_hz": natural_frequency_hz(model.poles),
                "damping_ratio": damping_ratio(model.poles),
                "quality": "good",
                "remarks": "",
            }
        ),
        misfit=pd.DataFrame(),
        noise_from="recordings",
        gain=np.ones(len(labels)),
        channel_gains=pd.DataFrame(columns=["channel", "gain", "gain_std"]),
    )


def propagate_noise(
    model: PoleResidueModel, s: ComplexArray, zeros: ComplexArray, zero_frf: IntArray, noise: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Propagate noise to a root of the covariance of poles and zeros, and to the covariance of residues.

    By linearised least squares.
    """
    n, n_frfs = len(model.poles), model.residues.shape[1]
    rows, size = [], 2 * n + n_frfs * (2 * n + len(model.powers))
    for frf in range(n_frfs):
        block = np.zeros((len(s), size), complex)
        block[:, : 2 * n] = differentiate_by_poles(model, s, frf)
        start = 2 * n + frf * (2 * n + len(model.powers))
        block[:, start : start + 2 * n + len(model.powers)] = differentiate_by_residues(model, s)
        rows.append(block / max(noise[frf], 1e-30) * np.sqrt(2))
    jacobian = np.vstack([np.vstack([block.real, block.imag]) for block in rows])
    lengths = np.linalg.norm(jacobian, axis=0)
    inverse = np.linalg.pinv(jacobian / lengths)
    root = inverse / lengths[:, None]
    covariance = root @ root.T
    projection = np.zeros((2 * (n + len(zeros)), size))
    projection[: 2 * n, : 2 * n] = np.eye(2 * n)
    for k, (zero, frf) in enumerate(zip(zeros, zero_frf, strict=True)):
        start = 2 * n + frf * (2 * n + len(model.powers))
        gradient = np.zeros(size, complex)
        at = np.array([zero])
        gradient[: 2 * n] = differentiate_by_poles(model, at, frf)[0]
        gradient[start : start + 2 * n + len(model.powers)] = differentiate_by_residues(model, at)[0]
        step = 1e-6 * abs(zero)
        slope = (model(at + step)[0, frf] - model(at - step)[0, frf]) / (2 * step)
        sensitivity = -gradient / slope
        projection[2 * (n + k)], projection[2 * (n + k) + 1] = sensitivity.real, sensitivity.imag
    residue_covariance = np.zeros((n, n_frfs, 2, 2))
    for frf in range(n_frfs):
        start = 2 * n + frf * (2 * n + len(model.powers))
        for mode in range(n):
            parts = slice(start + 2 * mode, start + 2 * mode + 2)
            residue_covariance[mode, frf] = covariance[parts, parts]
    return projection @ root, residue_covariance


def differentiate_by_poles(model: PoleResidueModel, s: ComplexArray, frf: int) -> ComplexArray:
    """Differentiate one FRF by real and imaginary part of every pole in turn."""
    direct = model.residues[:, frf] / (s[:, None] - model.poles) ** 2
    mirrored = model.residues[:, frf].conj() / (s[:, None] - model.poles.conj()) ** 2
    return np.stack([direct + mirrored, 1j * (direct - mirrored)], axis=2).reshape(len(s), -1)


def differentiate_by_residues(model: PoleResidueModel, s: ComplexArray) -> ComplexArray:
    """Differentiate by real and imaginary part of every residue in turn, then by the residual terms."""
    direct, mirrored = 1 / (s[:, None] - model.poles), 1 / (s[:, None] - model.poles.conj())
    pairs = np.stack([direct + mirrored, 1j * (direct - mirrored)], axis=2).reshape(len(s), -1)
    return np.hstack([pairs, (s[:, None] / model.scale_rad_s) ** np.array(model.powers)])


def list_labels(input_dofs: Sequence[Dof], sensors: Sequence[Dof]) -> tuple[FrfLabel, ...]:
    """Label every input with every sensor, as receptances."""
    pairs = ((sensor, source) for source in input_dofs for sensor in sensors)
    return tuple(FrfLabel(sensor, source, FrfQuantity.RECEPTANCE) for sensor, source in pairs)
