"""A small hammer campaign on a clamped beam, simulated by modal superposition from formulas.

The beam is the continuous Euler-Bernoulli cantilever: its frequencies and shapes come from the roots of
``cos x cosh x = -1``, not from elements.
"""

import numpy as np
from scipy.optimize import brentq

LENGTH, WIDTH, THICKNESS = 0.5, 0.025, 0.005
YOUNG, DENSITY, DAMPING = 69e9, 2700.0, 0.01
RATE, SAMPLES, START = 4096.0, 4096, 0.02
MODES = 6

TEST = """
[test]
name = "small cantilever"
kind = "hammer"
[[channel]]
column = "force"
role = "input"
quantity = "force"
unit = "N"
[[channel]]
column = "acc"
role = "output"
quantity = "acceleration"
unit = "m/s^2"
dof = "21:+z"
[[hit]]
dof = "15:+z"
files = ["hits/*.csv"]
"""
MODEL = f"""
[model]
kind = "beam"
name = "small cantilever"
[damping]
modal_ratio = {DAMPING}
[beam]
length_m = {LENGTH}
elements = 20
formulation = "euler-bernoulli"
youngs_modulus_Pa = {0.95 * YOUNG}
density_kg_m3 = {DENSITY}
poisson_ratio = 0.33
width_m = {WIDTH}
thickness_m = {THICKNESS}
left = "clamped"
right = "free"
"""
PIPELINE = """
[pipeline]
name = "small cantilever"
test = "test.toml"
model = "model.toml"
[fit]
band_hz = [10.0, 600.0]
[diagnose]
run = "never"
[predict]
points = ["11:+z"]
"""
QUICK = (
    ("[diagnose]\n", '[diagnose]\neffects = ["global_stiffness"]\n'),
    ("[predict]\n", "[update]\nensemble = 10\n[predict]\n"),
)


def roots():
    """The first roots x of cos x cosh x = -1."""
    return np.array(
        [brentq(lambda x: np.cos(x) + 1 / np.cosh(x), np.pi * k + 1e-6, np.pi * (k + 1) - 1e-6) for k in range(MODES)]
    )


def shape(x, position):
    """Mass-normalised shapes at a relative position."""
    ratio = (np.cosh(x) + np.cos(x)) / (np.sinh(x) + np.sin(x))
    z = x * position
    bend = np.cosh(z) - np.cos(z) - ratio * (np.sinh(z) - np.sin(z))
    return bend / np.sqrt(DENSITY * WIDTH * THICKNESS * LENGTH)


def accelerance(s, output, struck):
    """Accelerance between two relative positions at complex s."""
    x = roots()
    omega = x**2 * np.sqrt(YOUNG * THICKNESS**2 / 12 / DENSITY) / LENGTH**2
    gain = shape(x, output) * shape(x, struck)
    return s**2 * np.sum(gain / (s[:, None] ** 2 + 2 * DAMPING * omega * s[:, None] + omega**2), 1)


def blow(rng, *, level=40.0, samples=SAMPLES):
    """Force and acceleration of one blow: a smooth pulse, transformed exactly on a damped line."""
    time = np.arange(samples) / RATE
    width = 1.2e-3
    pulse = np.where(abs(time - START) < width, np.cos(np.pi * (time - START) / width / 2) ** 4, 0.0) * level
    decay = 12.0 / time[-1]
    window = np.exp(-decay * time)
    s = decay + 2j * np.pi * np.fft.rfftfreq(samples, 1 / RATE)
    response = np.fft.irfft(accelerance(s, 1.0, 14 / 20) * np.fft.rfft(pulse * window), samples) / window
    noise = rng.standard_normal((2, samples))
    return time, pulse + 1e-3 * level * noise[0] / 40, response + 2e-4 * np.abs(response).max() * noise[1]


def write_csv(path, time, force, acceleration):
    """One blow as a CSV of the contract."""
    path.parent.mkdir(parents=True, exist_ok=True)
    table = np.column_stack([time, force, acceleration])
    np.savetxt(path, table, delimiter=",", header="time,force,acc", comments="", fmt="%.8g")


def write_campaign(folder, *, records=3, seed=1):
    """A whole campaign: recordings, test, model and pipeline."""
    rng = np.random.default_rng(seed)
    for number in range(1, records + 1):
        write_csv(folder / "hits" / f"blow_{number}.csv", *blow(rng, level=30.0 + 10 * number))
    for name, text in (("test", TEST), ("model", MODEL), ("pipeline", PIPELINE)):
        (folder / f"{name}.toml").write_text(text)
    return folder / "pipeline.toml"


def write_quick_campaign(folder, **options):
    """The same for tests of what becomes of the files, whatever their numbers: one cause, and a small ensemble."""
    pipeline = write_campaign(folder, **options)
    text = pipeline.read_text()
    for old, new in QUICK:
        text = text.replace(old, new)
    pipeline.write_text(text)
    return pipeline
