"""Silverbox: which law an electronic oscillator has, and its coefficient, from a record whose level grows.

Run from the checkout: ``python pipelines/silverbox.py ../shared/recordings/silverbox``. Input V1 and output V2 are
taken as a force and a displacement: the coefficient is in V of V1 per V^3 of V2. A first search has the laws of the
catalogue, a second one also a law of this file: the cube with a little of the square.
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from frf_ipz.diagnosis.nonlinear.laws.law import Law
from frf_ipz.diagnosis.nonlinear.search import LawSearch, search_laws
from frf_ipz.diagnosis.observations import Observations, ObservedRecord, Sensor
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.dofs import parse_dof
from frf_ipz.fe.model_file import read_model
from frf_ipz.quantities import FrfQuantity

RATE_HZ = 1e7 / 2**14
GROWING = slice(100, 40500)  # samples whose level grows from nothing
SEGMENTS = 4
MAINS_HZ = (148.0, 152.0)  # the third harmonic of the mains stands out of the weak part
TOLERANCES = DiagnoseOptions(frequency_tolerance=0.02, damping_tolerance=0.5, gain_tolerance=0.02)


class CubicWithSquare(Law):
    """Force k3 (w^3 + a w^2)."""

    name = "cubic_with_square"
    strength_name = "cubic_V_V3"
    shape_name = "square_over_cubic_V"
    strength_can_be_negative = True
    degree = 4.0
    phrase = "a spring of {} V/V^3 whose force is the cube with a part of the square"

    def unit_force(self, w: np.ndarray, v: np.ndarray, shape: float) -> np.ndarray:
        """Cube and square."""
        del v
        return w * w * (w + shape)

    def shapes(self, largest_w: float, largest_v: float) -> np.ndarray:
        """Parts of the largest motion."""
        del largest_v
        return np.array([-0.1, -0.03, -0.01, 0.01, 0.03, 0.1]) * largest_w


def linear_oscillator(force: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Mass, damping and stiffness of the weak beginning, by an exponentially damped transform."""
    step, n = 1 / RATE_HZ, len(force)
    sigma = 8 / (n * step)
    s = sigma + 2j * np.pi * np.fft.rfftfreq(n, step)
    damp = np.exp(-sigma * step * np.arange(n))
    F, W = np.fft.rfft(force * damp), np.fft.rfft(motion * damp)
    band = (s.imag > 2 * np.pi * 20) & (s.imag < 2 * np.pi * 120)
    A = np.stack([s**2 * W, s * W, W], 1)[band]
    both, right = np.vstack([A.real, A.imag]), np.concatenate([F[band].real, F[band].imag])
    return np.linalg.lstsq(both / np.abs(both).max(0), right, rcond=None)[0] / np.abs(both).max(0)


def main(folder: Path) -> None:
    """Search with the laws of the catalogue, and with the law of this file."""
    data = pd.read_csv(folder / "SNLS80mV.csv", usecols=["V1", "V2"]).to_numpy()[GROWING].T
    force, motion = data - data[:, :50].mean(1, keepdims=True)
    mass, damping, stiffness = linear_oscillator(force[:8000], motion[:8000])
    ratio = damping / (2 * np.sqrt(mass * stiffness))
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "model.toml"
        path.write_text(
            f'[model]\nkind = "lumped"\nname = "silverbox"\n[damping]\nmodal_ratio = {ratio}\n'
            f'[lumped]\ndirection = "x"\n[[lumped.mass]]\nnode = 1\nmass_kg = {mass}\n'
            f'[[lumped.spring]]\nid = "k"\nnodes = [0, 1]\nstiffness_N_m = {stiffness}\n',
            encoding="utf-8",
        )
        model = read_model(path)
    dof = parse_dof("1:+x")
    sensors = (Sensor(channel="V2", dof=dof, quantity=FrfQuantity.RECEPTANCE),)
    cuts = np.array_split(np.arange(len(force)), SEGMENTS)
    records = tuple(
        ObservedRecord(name=f"segment {i}", input_channel="V1", input_dof=dof, sensors=sensors, step_s=1 / RATE_HZ,
             force=force[cut], responses=motion[None, cut], starts_at_rest=i == 0)
        for i, cut in enumerate(cuts)
    )  # fmt: skip
    observations = Observations(kind="random", records=records, band_hz=(20.0, 180.0), exclude_hz=(MAINS_HZ,))
    print(f"weak: {np.sqrt(stiffness / mass) / 2 / np.pi:.2f} Hz, damping ratio {ratio:.4f}, k1 {stiffness:.4g}")
    show(search_laws(model, observations, TOLERANCES), stiffness)
    with_own_law = replace(TOLERANCES, extra_effects=("silverbox.py:CubicWithSquare",))
    show(search_laws(model, observations, with_own_law, folder=Path(__file__).parent), stiffness)


def show(result: LawSearch, stiffness: float) -> None:
    """Print the result of a search."""
    print(f"\n{result.verdict} (linearity {result.linearity.score:.3g} against {result.linearity.limit:g})")
    print(result.statement)
    for finding in result.findings:
        numbers = {name: f"{estimate.value:.4g} +- {estimate.std:.2g}" for name, estimate in finding.parameters.items()}
        print(f"  {finding.effect}: log Bayes factor {finding.log_evidence_gain:.0f}, {numbers}")
    for when, misfit in (("linear", result.updated), ("with the law", result.after)):
        print(f"  {when}: {misfit.training:.2%} of the response is left, {misfit.training_noise:.3g} times the noise")
    print(f"  k3 / k1 = {result.fit.strength / stiffness:.3g} 1/V^2")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
