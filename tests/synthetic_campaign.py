"""Small campaigns of recordings with a known truth, written as a user would hand them in.

The responses are transforms of the exact transfer function at complex frequencies, to the right of the imaginary axis,
on a longer record, so that nothing wraps around however long it rings; the force is a smooth pulse, so that sampling
changes nothing.
"""

import io
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.csv as arrow_csv

from frf_ipz import Recording, VibrationTest

PAD = 4  # times the record: what the transform is made on
WRAPPED = 24.0  # exp(-24) of the motion wraps around
AT_S = 0.03  # when the hammer touches
PULSE_S = 0.8e-3  # standard deviation of the pulse: its spectrum vanishes before half of the sampling rate


@dataclass(frozen=True)
class Structure:
    """Accelerances of one input and a few outputs by modes."""

    frequency_hz: tuple = (31.0, 88.0, 173.0)
    damping_ratio: tuple = (0.05, 0.02, 0.012)  # 1e-8 of the motion remains after 2 s
    shapes: tuple = ((1.0, 0.7, -0.5), (0.6, -0.8, 0.9))  # residues, one row an output, 1/kg

    def accelerance(self, s):
        """Give the (n_lines, n_outputs) transfer function, m/s^2/N."""
        omega = 2 * np.pi * np.array(self.frequency_hz)
        ratio = np.array(self.damping_ratio)
        s = np.asarray(s, complex)[:, None]
        modes = s**2 / (s**2 + 2 * ratio * omega * s + omega**2)
        return modes @ np.array(self.shapes).T

    @property
    def n_outputs(self):
        return len(self.shapes)


def respond(structure, force, step_s):
    """Give the responses to a force from rest, one row an output."""
    n = len(force)
    sigma = WRAPPED / (PAD * n * step_s)
    window = np.exp(-sigma * np.arange(n) * step_s)
    s = sigma + 2j * np.pi * np.fft.rfftfreq(PAD * n, step_s)
    spectrum = np.fft.rfft(force * window, PAD * n)[:, None] * structure.accelerance(s)
    return (np.fft.irfft(spectrum, PAD * n, axis=0)[:n] / window[:, None]).T


def pulse(n_samples, step_s, *, height=100.0, at_s=AT_S, length_s=PULSE_S):
    """Give the force of one impact."""
    time = np.arange(n_samples) * step_s
    return height * np.exp(-0.5 * ((time - at_s) / length_s) ** 2)


def impact(structure, *, n_samples=4096, step_s=1 / 2048, noise=0.0, rng=None, force=None, **pulse_options):
    """Give force and responses of one impact, (1 + n_outputs, n_samples)."""
    force = pulse(n_samples, step_s, **pulse_options) if force is None else force
    signals = np.vstack([force, respond(structure, force, step_s)])
    if noise:
        signals += noise * rng.standard_normal(signals.shape)
    return signals


def in_memory(impacts, *, step_s=1 / 2048, input_dof="7:+z", output_dofs=("1:+z", "2:+z")):
    """Make a test of impacts, each force and responses, without files."""
    recordings = [
        Recording(
            force=signals[0],
            responses=signals[1:],
            sample_rate_hz=1 / step_s,
            input_dof=input_dof,
            output_dofs=list(output_dofs),
        )
        for signals in impacts
    ]
    return VibrationTest.from_recordings(recordings)


def write_csv(path, signals, step_s, *, columns=None, delimiter=",", decimal=".", units=None, start_s=0.0):
    """Write a recording, with as many digits as the numbers have."""
    columns = columns or ["force", *(f"acc_{index + 1}" for index in range(len(signals) - 1))]
    time = start_s + np.arange(signals.shape[1]) * step_s
    table = pa.table(dict(zip(["time", *columns], [time, *signals], strict=True)))
    stream = io.BytesIO()
    arrow_csv.write_csv(table, stream, arrow_csv.WriteOptions(include_header=False, delimiter=delimiter))
    text = stream.getvalue().decode()
    if decimal == ",":
        text = text.replace(".", ",")
    head = [delimiter.join(row) for row in (["time", *columns], units) if row]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join([*head, text]), encoding="utf-8")
    return path


def channels_toml(n_outputs, *, force_unit="N", unit="m/s^2"):
    """Give the channels of a test: the force and accelerometers at nodes 1, 2 and so on."""
    text = f'[[channel]]\ncolumn = "force"\nrole = "input"\nquantity = "force"\nunit = "{force_unit}"\n'
    for index in range(n_outputs):
        text += (
            f'[[channel]]\ncolumn = "acc_{index + 1}"\nrole = "output"\nquantity = "acceleration"\n'
            f'unit = "{unit}"\ndof = "{index + 1}:+z"\n'
        )
    return text


def write_test(folder, body, *, kind="hammer", n_outputs=2, head="", **channel_options):
    """Write `test.toml`."""
    channels = channels_toml(n_outputs, **channel_options) if kind != "frf" else ""
    path = folder / "test.toml"
    path.write_text(f'[test]\nkind = "{kind}"\n{head}\n{channels}\n{body}\n', encoding="utf-8")
    return path


HIT = '[[hit]]\ndof = "7:+z"\nfiles = ["hits/*.csv"]\n'


def hammer_campaign(folder, *, structure=None, heights=(100.0, 60.0, 150.0), noise=0.0, seed=0, **impact_options):
    """Write a hammer test with one impact a file, and return the path of `test.toml`."""
    structure = structure or Structure()
    rng = np.random.default_rng(seed)
    step_s = impact_options.setdefault("step_s", 1 / 2048)
    for number, height in enumerate(heights, start=1):
        signals = impact(structure, height=height, noise=noise, rng=rng, **impact_options)
        write_csv(folder / "hits" / f"p7_{number:02d}.csv", signals, step_s)
    return write_test(folder, HIT, n_outputs=structure.n_outputs)
