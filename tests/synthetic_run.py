"""A run's results without a run: a beam whose stiffness is off, its FRFs, fit, pairs, update and prediction.

For whatever draws results. The measured FRFs are those of a true structure with noise; everything after them is what
the stages give.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd

from frf_ipz.dofs import Dof
from frf_ipz.export.state_space import to_state_space
from frf_ipz.fe.options import ReduceOptions
from frf_ipz.fe.reduction import reduce_model
from frf_ipz.frf import FrfLabel, FrfSet
from frf_ipz.ingest.recordings import Recordings, Trace
from frf_ipz.pairing.assignment import pair
from frf_ipz.prediction.predict import predict_frfs
from frf_ipz.quantities import FrfQuantity
from frf_ipz.updating.update import update_model
from updating_bench.random_structures import random_beam, scaled, stiffness_errors
from updating_bench.synthetic_fit import Truth, band_of, labels_of, synthetic_fit

NOISE = 0.002
SEED = 3


class Folder(SimpleNamespace):
    """Stands for a run's folder: ``load`` and ``record``."""

    def load(self, name):
        return self.results.get(name)

    def is_stale(self, name):
        return name in self.stale


def synthetic_folder(*, without=()):
    """A folder with the results of every stage but some."""
    results = {name: result for name, result in synthetic_results().items() if name not in without}
    stages = {name: {"key": f"{place:064x}", "seconds": 0.1 * place} for place, name in enumerate(results)}
    record = {
        "frf_ipz": "0.1.0",
        "python": "3.11.7",
        "packages": {"numpy": np.__version__},
        "when": "2026-01-01T00:00:00+00:00",
        "pipeline": "pipeline.toml",
        "name": "synthetic <beam>",
        "configuration": {"fit": {"band_hz": None}},
        "inputs": {"test.toml": "0" * 64},
        "stages": stages,
    }
    return Folder(results=results, record=record, stale=())


def synthetic_results():
    """Results of all stages by their names."""
    rng = np.random.default_rng(SEED)
    nominal = random_beam(rng)
    factors, _ = stiffness_errors(nominal, rng)
    free = [dof for dof in nominal.dofs if dof.direction == "z"]
    sensors, blows, points = (free[-1], free[len(free) // 3]), (free[-3],), (free[len(free) // 2],)
    case = SimpleNamespace(sensors=sensors, blows=blows)
    truth = Truth(scaled(nominal, factors), np.full(200, 0.004))
    labels = tuple(replace(label, output_channel=f"acc{label.output_dof.node}") for label in labels_of(case))
    band = band_of(truth, 5)
    fit = synthetic_fit(truth, labels, band, noise=NOISE, rng=rng)
    recordings = recordings_of(truth, labels, band, rng)
    fit = with_tables(replace(fit, used_lines=recordings.frfs.in_band(band)), recordings.frfs)
    reduced = reduce_model(
        nominal,
        ReduceOptions(),
        actuators=blows,
        sensors=sensors,
        points=points,
        band_hz=band,
        default_damping_ratio=0.003,
    )
    pairs = pair(fit, reduced)
    updated = update_model(reduced, fit, pairs)
    lines = recordings.frfs.frequency_hz[fit.used_lines]
    return {
        "ingest": recordings,
        "fit": fit,
        "reduce": reduced,
        "pair": pairs,
        "update": updated,
        "predict": predict_frfs(updated, points, labels, lines),
        "export": to_state_space(updated, labels, points),
        "model": nominal,
        "reference": reference_of(truth, points, blows, lines),
    }


def recordings_of(truth, labels, band, rng):
    """FRFs with noise, blows of which one is left out, and traces."""
    frequency = np.linspace(0.5 * band[0], 1.2 * band[1], 1500)
    exact = np.stack([truth.receptance(2j * np.pi * frequency, label) for label in labels], 1)
    variance = np.broadcast_to((NOISE * np.sqrt(np.mean(np.abs(exact) ** 2, axis=0))) ** 2, exact.shape)
    noise = np.sqrt(variance / 2) * (rng.standard_normal(exact.shape) + 1j * rng.standard_normal(exact.shape))
    frfs = FrfSet(
        frequency_hz=frequency,
        values=exact + noise,
        labels=labels,
        variance=variance.copy(),
        coherence=1 / (1 + variance / np.abs(exact) ** 2),
        averages=np.full(len(labels), 5),
    )
    names = [f"hits/p_{number:02d}.csv" for number in range(5)]
    blows = pd.DataFrame(
        {
            "blow": names,
            "input_dof": [str(labels[0].input_dof)] * 5,
            "peak_force_N": rng.uniform(5, 30, 5),
            "pulse_s": 8e-4,
            "used": [True, True, False, True, True],
            "weight": [0.3, 0.2, 0.0, 0.3, 0.2],
            "marks": ["", "", "double hit: 41 % of the pulse 18.7 ms after it", "", "weak blow"],
        }
    )
    time = np.linspace(0, 1, 400)
    traces = []
    for name in names:
        force = 20 * np.exp(-(((time - 0.02) / 0.005) ** 2))
        decay = np.sin(60 * time) * np.exp(-3 * time)
        traces.append(Trace(name=name, channel="force", unit="N", time_s=time[:40], values=force[:40]))
        traces.append(Trace(name=name, channel=labels[0].output_channel, unit="m/s^2", time_s=time, values=decay))
    return Recordings(frfs=frfs, blows=blows, traces=tuple(traces), warnings=("hits/p_02.csv is left out: double hit",))


def with_tables(fit, frfs):
    """The fit with the tables that a fitter keeps."""
    hertz, ratio = fit.model.natural_frequency_hz, fit.model.damping_ratio
    rows = [
        {
            "order": order,
            "frequency_hz": value * (1 + 1e-3 / order),
            "damping_ratio": damping,
            "stable_frequency": order > 8,
            "stable_damping": order > 12,
            "stable_shape": order > 16,
            "taken": order == 20,
        }
        for order in range(6, 24, 2)
        for value, damping in zip(hertz, ratio, strict=True)
    ]
    decisions = {
        "frequency_hz": [hertz[0]],
        "damping_ratio": [ratio[0]],
        "action": ["dropped"],
        "reason": ["twice there"],
    }
    misfit = [
        {
            "frf": place,
            "output_dof": str(label.output_dof),
            "input_dof": str(label.input_dof),
            "band_low_hz": fit.band_hz[0],
            "band_high_hz": fit.band_hz[1],
            "misfit": 2e-7,
            "noise": 1e-7,
            "ratio": 2.5 - place,
        }
        for place, label in enumerate(fit.labels)
    ]
    modes = {"pole_id": range(len(hertz)), "frequency_hz": hertz, "damping_ratio": ratio, "mpc": 0.99, "quality": 0.9}
    used = frfs.lines(fit.used_lines)
    return replace(
        fit,
        stabilization=pd.DataFrame(rows),
        decisions=pd.DataFrame(decisions),
        misfit=pd.DataFrame(misfit),
        modes=pd.DataFrame(modes),
        value_std=0.2 * np.sqrt(used.variance),
    )


def reference_of(truth, points, blows, lines):
    """The true FRFs at the points of interest."""
    labels = tuple(FrfLabel(point, blow, FrfQuantity.RECEPTANCE) for point in points for blow in blows)
    values = np.stack([truth.receptance(2j * np.pi * lines, label) for label in labels], 1)
    unknown = np.full(values.shape, np.nan)
    return FrfSet(
        frequency_hz=lines,
        values=values,
        labels=labels,
        variance=unknown,
        coherence=unknown,
        averages=np.zeros(len(labels), int),
    )


def many_frfs(n_frfs, n_lines):
    """Recordings with very many FRFs of very many lines: sharp peaks and notches that no thinning may lose."""
    frequency = np.linspace(1.0, 5000.0, n_lines)
    s = 2j * np.pi * frequency[:, None]
    rng = np.random.default_rng(SEED)
    values = np.zeros((n_lines, n_frfs), complex)
    for hertz in rng.uniform(20, 4900, 25):
        omega = 2 * np.pi * hertz
        values += s**2 * rng.standard_normal(n_frfs) / (s**2 + 2e-4 * omega * s + omega**2)
    side = int(np.ceil(np.sqrt(n_frfs)))
    labels = tuple(
        FrfLabel(Dof(1 + number // side, "z"), Dof(1 + number % side, "z"), FrfQuantity.ACCELERANCE)
        for number in range(n_frfs)
    )
    return Recordings(
        frfs=FrfSet(
            frequency_hz=frequency,
            values=values,
            labels=labels,
            variance=1e-4 * np.abs(values) ** 2,
            coherence=np.full(values.shape, 0.999),
            averages=np.full(n_frfs, 5),
        ),
        blows=pd.DataFrame(),
    )
