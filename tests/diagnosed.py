"""A small beam and its FRFs with noise, for tests of the diagnosis: made by the FE stage, not by the diagnosis."""

from pathlib import Path

import numpy as np

from frf_ipz.diagnosis.catalogue.finder import shipped_effects
from frf_ipz.diagnosis.evidence.inference_problem import pose_problem
from frf_ipz.diagnosis.measured.data_split import split_data
from frf_ipz.diagnosis.observations import Observations
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.dofs import parse_dof
from frf_ipz.fe.model_file import read_model
from frf_ipz.fe.response import compute_frfs
from frf_ipz.frf import FrfLabel, FrfSet
from frf_ipz.quantities import FrfQuantity

BAND_HZ = (10.0, 700.0)
NOISE = 1e-3  # of each FRF's median modulus
BEAM = """
[model]
kind = "beam"
name = "beam"
[damping]
modal_ratio = 0.01
[beam]
length_m = 0.5
elements = {elements}
formulation = "{formulation}"
youngs_modulus_Pa = 69e9
density_kg_m3 = 2690.0
poisson_ratio = 0.33
width_m = 0.025
thickness_m = {thickness_m}
left = "{left}"
right = "{right}"
"""
LUMPED = """
[model]
kind = "lumped"
name = "frame"
[damping]
modal_ratio = 0.01
[lumped]
direction = "x"
[[lumped.mass]]
node = 1
mass_kg = 2.0
[[lumped.mass]]
node = 2
mass_kg = 3.0
[[lumped.mass]]
node = 3
mass_kg = 1.0
[[lumped.spring]]
id = "k1"
nodes = [0, 1]
stiffness_N_m = 4e5
[[lumped.spring]]
id = "k2"
nodes = [1, 2]
stiffness_N_m = 1e5
[[lumped.spring]]
id = "k3"
nodes = [2, 3]
stiffness_N_m = 2e5
"""


def beam(
    folder: Path,
    *,
    elements=16,
    formulation="euler-bernoulli",
    thickness_m=0.005,
    left="clamped",
    right="free",
    damping=0.01,
):
    text = BEAM.format(elements=elements, formulation=formulation, thickness_m=thickness_m, left=left, right=right)
    return _read(folder, text.replace("modal_ratio = 0.01", f"modal_ratio = {damping}"))


def lumped(folder: Path, *, damping: str = "modal_ratio = 0.01", dashpot_Ns_m: float = 0.0):
    """A frame; a dashpot acts across its last spring."""
    text = LUMPED.replace("modal_ratio = 0.01", damping)
    return _read(folder, text + (f"damping_Ns_m = {dashpot_Ns_m}\n" if dashpot_Ns_m else ""))


def _read(folder, text):
    path = folder / "model.toml"
    path.write_text(text, encoding="utf-8")
    return read_model(path)


def labels(outputs=("17:+z", "9:-z"), inputs=("6:+z",), quantity=FrfQuantity.ACCELERANCE):
    return tuple(
        FrfLabel(parse_dof(out), parse_dof(struck), quantity, f"acc_{index}", "force")
        for struck in inputs
        for index, out in enumerate(outputs, start=1)
    )


def measured(model, names=None, *, seed=0, factors=None, n_lines=1400, band_hz=BAND_HZ, noise=NOISE):
    """FRFs of a model with noise; factors multiply them, as a measuring chain does."""
    names = names or labels()
    frequency = np.linspace(*band_hz, n_lines)
    exact = compute_frfs(model, names, 2j * np.pi * frequency) * (1.0 if factors is None else factors(frequency))
    scale = noise * np.median(np.abs(exact), axis=0)
    drawn = np.random.default_rng(seed).standard_normal((2, *exact.shape))
    return FrfSet(
        frequency_hz=frequency,
        values=exact + scale * (drawn[0] + 1j * drawn[1]) / np.sqrt(2),
        labels=names,
        variance=np.broadcast_to(scale**2, exact.shape),
        coherence=np.full(exact.shape, np.nan),
        averages=np.zeros(len(names), int),
    )


def observed(frfs, band_hz=BAND_HZ):
    return Observations(kind="frf", records=(), band_hz=band_hz, frfs=frfs)


def problem_of(model, frfs, names):
    """Everything a search for some effects works with."""
    effects = {name: effect for name, effect in shipped_effects().items() if name in names}
    return pose_problem(model, split_data(observed(frfs)), BAND_HZ, DiagnoseOptions(), effects)
