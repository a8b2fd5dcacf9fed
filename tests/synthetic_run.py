"""A run's results without a run: a beam whose stiffness is off, its FRFs, fit, pairs, update and prediction.

For whatever draws results. The measured FRFs are those of a true structure with noise; everything after them is what
the stages give.
"""

from copy import copy
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd

from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.measured.levels import COLUMNS, LevelDependence
from frf_ipz.diagnosis.result import (
    Ambiguity,
    Curves,
    DataCheck,
    Diagnosis,
    DiagnosisVerdict,
    Estimate,
    Finding,
    LawInTime,
    Misfit,
)
from frf_ipz.dofs import Dof
from frf_ipz.export.state_space import make_state_space
from frf_ipz.fe.reduction.options import ReduceOptions
from frf_ipz.fe.reduction.reduce import reduce_to_dofs
from frf_ipz.frf import FrfLabel, FrfSet
from frf_ipz.ingest.frf_estimate import FrfEstimate, Trace
from frf_ipz.pairing.pair import pair_roots
from frf_ipz.prediction.predict import predict_frfs
from frf_ipz.quantities import FrfQuantity
from frf_ipz.updating.update import update_model
from frf_testbench.updating.random_structures import draw_beam, draw_stiffness_errors, scale_stiffness
from frf_testbench.updating.synthetic_fit import TrueModes, choose_band, list_labels, simulate_fit
from measured_labels import measured

NOISE = 0.002
SEED = 3


class Folder(SimpleNamespace):
    """Stands for a run's folder: ``load`` and ``record``."""

    name = "in memory"

    def load(self, name):
        return self.results.get(name)

    def is_stale(self, name):
        return name in self.stale


def synthetic_folder(*, without=(), diagnosed=False):
    """A folder with the results of every stage but some."""
    results = {name: result for name, result in synthetic_results().items() if name not in without}
    if diagnosed:
        results["levels"] = synthetic_levels(results["fit"].labels, results["fit"].band_hz)
        results["diagnose"] = synthetic_diagnosis(results["fit"].labels, results["model"].geometry.nodes.tolist())
    stages = {name: {"key": f"{place:064x}", "seconds": 0.1 * place} for place, name in enumerate(results)}
    manifest = {
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
    return Folder(results=results, manifest=manifest, stale=())


def synthetic_results():
    """Results of all stages by their names."""
    rng = np.random.default_rng(SEED)
    nominal = draw_beam(rng)
    factors, _ = draw_stiffness_errors(nominal, rng)
    free = [dof for dof in nominal.dofs if dof.direction == "z"]
    sensors, input_dofs, points = (free[-1], free[len(free) // 3]), (free[-3],), (free[len(free) // 2],)
    truth = TrueModes(scale_stiffness(nominal, factors), np.full(200, 0.004))
    labels = tuple(
        replace(label, output_channel=f"acc{label.output_dof.node}") for label in list_labels(input_dofs, sensors)
    )
    band = choose_band(truth, 5)
    fit = simulate_fit(truth, labels, band, noise=NOISE, rng=rng)
    recordings = recordings_of(truth, labels, band, rng)
    fit = with_tables(replace(fit, used_lines=recordings.frfs.in_band(band)), recordings.frfs)
    reduced = reduce_to_dofs(
        nominal,
        options=ReduceOptions(),
        actuators=input_dofs,
        sensors=sensors,
        points=points,
        band_hz=band,
        default_damping_ratio=0.003,
    )
    pairs = pair_roots(fit, reduced)
    updated = replace(update_model(fit, reduced, pairs=pairs), parts=parts_of(nominal))
    lines = recordings.frfs.frequency_hz[fit.used_lines]
    return {
        "ingest": recordings,
        "fit": fit,
        "reduce": reduced,
        "pair": pairs,
        "update": updated,
        "predict": predict_frfs(measured(labels), updated, points=points, frequency_hz=lines),
        "export": make_state_space(measured(labels), updated, points=points),
        "model": nominal,
        "reference": reference_of(truth, points, input_dofs, lines),
    }


def parts_of(model):
    """Changes of the parts with bands, as an update of the parts gives them: softer to the right."""
    count = len(model.parts)
    ratio = np.linspace(1.0, 0.95, count)
    return pd.DataFrame(
        {
            "kind": "element",
            "name": [f"element {part.name}" for part in model.parts],
            "nodes": [" ".join(map(str, part.nodes)) for part in model.parts],
            "x_m": np.linspace(0, 1, count),
            "y_m": 0.0,
            "z_m": 0.0,
            "stiffness_ratio": ratio,
            "stiffness_ratio_low": ratio - 0.02,
            "stiffness_ratio_high": ratio + 0.01,
        }
    )


def recordings_of(truth, labels, band, rng):
    """FRFs with noise, records of which one is left out, and traces."""
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
    records = pd.DataFrame(
        {
            "record": names,
            "input_dof": [str(labels[0].input_dof)] * 5,
            "peak_force_N": rng.uniform(5, 30, 5),
            "pulse_s": 8e-4,
            "used": [True, True, False, True, True],
            "weight": [0.3, 0.2, 0.0, 0.3, 0.2],
            "marks": ["", "", "double hit: 41 % of the pulse 18.7 ms after it", "", "weak impact"],
        }
    )
    time = np.linspace(0, 1, 400)
    traces = []
    for name in names:
        force = 20 * np.exp(-(((time - 0.02) / 0.005) ** 2))
        decay = np.sin(60 * time) * np.exp(-3 * time)
        traces.append(Trace(name=name, channel="force", unit="N", time_s=time[:40], values=force[:40]))
        traces.append(Trace(name=name, channel=labels[0].output_channel, unit="m/s^2", time_s=time, values=decay))
    return FrfEstimate(
        frfs=frfs, records=records, traces=tuple(traces), warnings=("hits/p_02.csv is left out: double hit",)
    )


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
    modes = {
        "pole_id": range(len(hertz)),
        "frequency_hz": hertz,
        "damping_ratio": ratio,
        "mpc": 0.99,
        "quality": "good",
    }
    used = frfs.select_lines(fit.used_lines)
    return replace(
        fit,
        stabilization=pd.DataFrame(rows),
        decisions=pd.DataFrame(decisions),
        misfit=pd.DataFrame(misfit),
        modes=pd.DataFrame(modes),
        frequency_hz=used.frequency_hz,
        value_std=0.2 * np.sqrt(used.variance),
    )


def reference_of(truth, points, input_dofs, lines):
    """The true FRFs at the points of interest."""
    labels = tuple(FrfLabel(point, input_dof, FrfQuantity.RECEPTANCE) for point in points for input_dof in input_dofs)
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


def synthetic_levels(labels, band):
    """Two modes of three records each; the second one falls with the level."""
    frequency = np.linspace(*band, 300)
    weak = np.abs(1 / (1 - (frequency / np.mean(band)) ** 2 + 0.02j))[:, None] * np.ones(len(labels))
    rows = [
        (
            mode,
            str(labels[0]),
            f"hits/p_{record:02d}.csv",
            level,
            100.0 * (1 + mode - 0.01 * mode * record),
            0.01,
            0.004,
            1e-4,
        )
        for mode in range(2)
        for record, level in enumerate((2.0, 8.0, 30.0))
    ]
    return LevelDependence(
        frequency_hz=frequency,
        labels=tuple(labels),
        weak=weak,
        strong=1.1 * weak,
        weak_N=np.full(len(labels), 4.0),
        strong_N=np.full(len(labels), 20.0),
        modes=pd.DataFrame(rows, columns=list(COLUMNS)),
    )


def many_frfs(n_frfs, n_lines):
    """FrfEstimate with very many FRFs of very many lines: sharp peaks and notches that no thinning may lose."""
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
    return FrfEstimate(
        frfs=FrfSet(
            frequency_hz=frequency,
            values=values,
            labels=labels,
            variance=1e-4 * np.abs(values) ** 2,
            coherence=np.full(values.shape, 0.999),
            averages=np.full(n_frfs, 5),
        ),
        records=pd.DataFrame(),
    )


def synthetic_law():
    """A cubic spring of 1e9 N/m^3 in a decay at 20 Hz that it stiffens; a thousandth of it is misfit."""
    time = np.linspace(0, 2, 2001)
    motion = 1e-3 * np.exp(-time) * np.sin(2 * np.pi * 20 * time)
    return LawInTime(
        motion_m=motion,
        velocity_m_s=np.gradient(motion, time),
        force_N=1e9 * motion**3,
        record="hits/p1_01.csv",
        is_held_out=True,
        channel="acc_1",
        response="acceleration",
        unit="m/s^2",
        time_s=time,
        measured=motion,
        without=0.5 * motion,
        simulated=0.999 * motion,
    )


def synthetic_diagnosis(labels, nodes):
    """A diagnosis that has found a mass and a gain, with everything that a picture is drawn from."""
    frequency = np.linspace(10, 500, 60)
    shape = (len(frequency), len(labels))
    misfit = [
        {"frf": str(label), "low_hz": low, "high_hz": 2 * low, "before": 30.0 / (1 + place), "after": 1.0}
        for place, label in enumerate(labels)
        for low in (10.0, 20.0, 40.0)
    ]
    mass = Finding(
        effect="added_mass",
        location=Location.at_node(nodes[1]),
        parameters={"mass_kg": Estimate(value=0.0123, std=0.0004, low=0.0115, high=0.0131)},
        probability=0.98,
        log_evidence_gain=812.4,
        statement=f"A mass of 12.3 g (+- 0.4 g) sits at node {nodes[1]} that the model lacks.",
    )
    gain = Finding(
        effect="sensor_gain",
        location=Location.on_channel(labels[0].output_channel),
        parameters={"gain_ratio": Estimate(value=-1.0, std=0.01, low=-1.02, high=-0.98)},
        probability=0.9995,
        log_evidence_gain=99.0,
        statement="The sensor's sign is flipped.",
    )
    return Diagnosis(
        verdict=DiagnosisVerdict.EXPLAINED,
        findings=(mass, gain),
        alternatives=(replace(mass, effect="local_stiffness", log_evidence_gain=3.0, probability=0.01),),
        mismatch_hz=frequency[:5],
        mismatch_where="all FRFs disagree",
        mismatch=pd.DataFrame(misfit),
        before=Misfit(training=0.41, held_out=0.43, training_noise=80.0, held_out_noise=82.0),
        updated=Misfit(training=0.2, held_out=0.22, training_noise=40.0, held_out_noise=41.0),
        after=Misfit(training=0.02, held_out=0.02, training_noise=1.0, held_out_noise=1.1),
        held_out_kind="records",
        ambiguity=(
            Ambiguity(effects=("added_mass", "local_stiffness"), log_bayes_factor=4.0, resolve_by="Strike 4:+z."),
        ),
        data_checks=(
            DataCheck(name="homogeneity", value=0.9, limit=1.5, statement="The structure behaves linearly."),
            DataCheck(name="reciprocity", value=np.nan, limit=4.0, statement="Reciprocity could not be checked."),
        ),
        detectability={"added_mass": {"mass_kg": 0.001}},
        statement="What is missing has been found.",
        curves=Curves(
            s=1.0 + 2j * np.pi * frequency,
            labels=tuple(labels),
            measured=np.ones(shape, complex),
            nominal=np.full(shape, 2.0 + 0j),
            updated=np.full(shape, 1.5 + 0j),
            explained=np.full(shape, 1.01 + 0j),
            expected=np.full(shape, 0.01),
        ),
    )


def with_results(run, **changes):
    """A run with some of its results changed, by the names that `Results` has for them."""
    changed = copy(run)
    vars(changed).update(changes)
    return changed
