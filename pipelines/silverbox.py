"""Silverbox: which law an electronic oscillator has, and its coefficient, from a record whose level grows.

Run from the checkout: ``python pipelines/silverbox.py ../shared/recordings/silverbox``. Input V1 and output V2 are
taken as a force and a displacement: the coefficient is in V of V1 per V^3 of V2.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

from frf_ipz.diagnosis.nonlinear.search import search_laws
from frf_ipz.diagnosis.observations import Blow, Observations, Sensor
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.dofs import parse_dof
from frf_ipz.fe.model_file import read_model
from frf_ipz.quantities import FrfQuantity

RATE_HZ = 1e7 / 2**14
GROWING = slice(100, 40500)  # samples whose level grows from nothing
PIECES = 4
TOLERANCES = DiagnoseOptions(frequency_tolerance=0.02, damping_tolerance=0.5, gain_tolerance=0.02)


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
    """Print what is found."""
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
    cuts = np.array_split(np.arange(len(force)), PIECES)
    blows = tuple(
        Blow(name=f"piece {i}", input_channel="V1", input_dof=dof, sensors=sensors, step_s=1 / RATE_HZ,
             force=force[cut], responses=motion[None, cut], rested=i == 0)
        for i, cut in enumerate(cuts)
    )  # fmt: skip
    observations = Observations(kind="random", blows=blows, band_hz=(20.0, 180.0))
    print(f"weak: {np.sqrt(stiffness / mass) / 2 / np.pi:.2f} Hz, damping ratio {ratio:.4f}")
    found = search_laws(model, observations, TOLERANCES)
    print(f"{found.verdict} (linearity {found.linearity.score:.3g} against {found.linearity.limit:g})")
    print(found.statement)
    for finding in found.findings:
        print(finding.effect, f"{finding.log_evidence_gain:.0f} nats", dict(finding.parameters))
    print(found.before, found.after, f"k3 / k1 = {found.fit.strength / stiffness if found.fit else 0:.3g} 1/V^2")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
