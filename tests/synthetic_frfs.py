"""FRFs of a structure given by its modes, with noise whose variance is known: what a fitter is tried on."""

from dataclasses import dataclass

import numpy as np

from frf_ipz.dofs import Dof
from frf_ipz.frf import FrfLabel, FrfSet
from frf_ipz.quantities import FrfQuantity
from frf_ipz.rational import underdamped_poles

FOUND_FREQUENCY = 1e-3  # relative: the gate that the bench of peers uses
FOUND_DAMPING = (0.5, 2.0)  # times the truth: the same


@dataclass(frozen=True)
class Modes:
    """Normal modes and how much each sensor and each excitation moves with them."""

    frequency_hz: np.ndarray
    damping_ratio: np.ndarray
    outputs: np.ndarray
    inputs: np.ndarray

    @property
    def poles(self):
        return underdamped_poles(self.frequency_hz, self.damping_ratio)

    def residues(self):
        """Give the residues of the receptances, (n_modes, n_outputs * n_inputs)."""
        products = self.outputs.T[:, :, None] * self.inputs.T[:, None, :]
        return products.reshape(len(self.poles), -1) / (2j * self.poles.imag[:, None])

    def receptance(self, s):
        """Give the (n_lines, n_frfs) receptances, m/N."""
        poles, residues = self.poles, self.residues()
        return (1 / (s[:, None] - poles)) @ residues + (1 / (s[:, None] - poles.conj())) @ residues.conj()


def random_modes(frequency_hz, damping_ratio, *, n_outputs=6, n_inputs=2, seed=0):
    """Give modes with random shapes; the excitation is at the first sensors."""
    rng = np.random.default_rng(seed)
    frequency_hz = np.asarray(frequency_hz, float)
    outputs = rng.standard_normal((n_outputs, len(frequency_hz)))
    damping = np.broadcast_to(damping_ratio, frequency_hz.shape).astype(float)
    return Modes(frequency_hz, damping, outputs, outputs[:n_inputs])


def labels_of(n_outputs, n_inputs, quantity=FrfQuantity.ACCELERANCE):
    return tuple(
        FrfLabel(Dof(output + 1, "z"), Dof(excited + 1, "z"), quantity)
        for output in range(n_outputs)
        for excited in range(n_inputs)
    )


def frf_set(frequency_hz, values, labels, variance=None, *, window_decay_1_s=0.0):
    """Give an FrfSet; without a variance the noise is unknown."""
    unknown = np.full(values.shape, np.nan)
    return FrfSet(
        frequency_hz=frequency_hz,
        values=values,
        labels=labels,
        variance=unknown if variance is None else np.broadcast_to(variance, values.shape).copy(),
        coherence=unknown,
        averages=np.zeros(values.shape[1], int),
        window_decay_1_s=window_decay_1_s,
    )


def with_noise(frequency_hz, exact, labels, std, rng):
    """Give noisy FRFs; `std` is the root of E of the squared modulus of the error."""
    std = np.broadcast_to(std, exact.shape)
    noise = (rng.standard_normal(exact.shape) + 1j * rng.standard_normal(exact.shape)) / np.sqrt(2)
    return frf_set(frequency_hz, exact + std * noise, labels, std**2)


def accelerances(modes, frequency_hz, *, noise=0.01, seed=1):
    """Give noisy accelerances; the noise is relative to the root mean square of each FRF."""
    s = 2j * np.pi * frequency_hz
    exact = modes.receptance(s) * s[:, None] ** 2
    std = noise * np.sqrt(np.mean(np.abs(exact) ** 2, axis=0))
    labels = labels_of(len(modes.outputs), len(modes.inputs))
    return with_noise(frequency_hz, exact, labels, std, np.random.default_rng(seed))


def of_bench(truth, *, seed=None):
    """Give a truth set of the bench as FRFs; with a seed, with fresh noise."""
    exact = truth["H0"].reshape(-1, truth["H0"].shape[2]).T
    std = 0.01 * np.sqrt(np.mean(np.abs(exact) ** 2, axis=0))
    n_outputs, n_inputs = truth["H0"].shape[:2]
    labels = labels_of(n_outputs, n_inputs)
    if seed is None:
        return frf_set(truth["f"], truth["H"].reshape(exact.shape[1], -1).T, labels, std**2)
    return with_noise(truth["f"], exact, labels, std, np.random.default_rng(seed))


def count(poles, truth, *, frequency=FOUND_FREQUENCY, damping=FOUND_DAMPING):
    """Count modes that were found (one to one), missed and spurious."""
    ratio = np.abs(poles)[:, None] / np.abs(truth) - 1
    dampings = (poles.real / np.abs(poles))[:, None] / (truth.real / np.abs(truth))
    fits = (np.abs(ratio) < frequency) & (dampings > damping[0]) & (dampings < damping[1])
    free, n_found = np.ones(len(truth), bool), 0
    for row in range(len(poles)):
        choice = np.flatnonzero(fits[row] & free)
        if len(choice):
            free[choice[np.argmin(np.abs(ratio[row, choice]))]] = False
            n_found += 1
    return n_found, len(truth) - n_found, len(poles) - n_found


def normalised_errors(fit, truth):
    """Errors of frequency and damping over their standard deviations, (2, n_modes)."""
    poles = fit.model.poles[: fit.n_modes]
    modulus = np.abs(truth)
    gradients = [
        np.stack([truth.real, truth.imag], 1) / modulus[:, None],
        np.stack([-(truth.imag**2), truth.real * truth.imag], 1) / modulus[:, None] ** 3,
    ]
    blocks = np.stack([fit.covariance[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] for k in range(fit.n_modes)])
    std = [np.sqrt(np.einsum("ki,kij,kj->k", gradient, blocks, gradient)) for gradient in gradients]
    errors = [np.abs(poles) - modulus, -poles.real / np.abs(poles) + truth.real / modulus]
    return np.array([error / size for error, size in zip(errors, std, strict=True)])
