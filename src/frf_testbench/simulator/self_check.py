"""Check the simulator against nominal models and against smaller steps, before its cases judge anything.

``frf-testbench check-simulator`` prints a table: for random specimens of every kind, without scatter, noise
and effects, how far the truth is from the nominal model in frequency and in the FRFs, and how far FRFs that are
estimated from the simulated records are from the nominal model and from the truth. Then the convergence of the
nonlinear laws with the time step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from frf_testbench.simulator.cases.case import make_case
from frf_testbench.simulator.cases.records import draw_excitations, simulate_records
from frf_testbench.simulator.cases.scatter import make_zero_scatter
from frf_testbench.simulator.cases.system import TrueSystem, build_system
from frf_testbench.simulator.set_up import draw_set_up
from frf_testbench.simulator.signals.receptance import ModalReceptance, make_receptance, solve_modes
from frf_testbench.simulator.specimens import KINDS, draw_specimen
from frf_testbench.simulator.structures.structure import Point, suspend

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

SIGMA = 12.0  # decay of the exponential window over a record, for estimates from records: what is cut off is e^-12


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """How far the truth without scatter is from the nominal model.

    Parameters
    ----------
    kind, seed
        Of the specimen.
    frequency : float
        Largest relative difference of the natural frequencies in band.
    frf : float
        Norm of the difference of all FRFs in band over their norm, at the decay of the estimates.
    recorded : float
        The same between FRFs estimated from simulated records and the nominal model.
    exact : float
        The same between FRFs estimated from simulated records and the truth: the simulation itself.
    median : float
        Median over all lines and FRFs of the relative difference: without the peaks, where a small shift weighs much.
    """

    kind: str
    seed: int
    frequency: float
    frf: float
    recorded: float
    exact: float
    median: float


def check_nominal(kind: str, seed: int) -> Check:
    """Compare truth, records and nominal model of one specimen.

    Parameters
    ----------
    kind : str
        Of the specimen.
    seed : int
        Of the draw.

    Returns
    -------
    Check
        Of a hammer test.
    """
    rng = np.random.default_rng([seed, 99])
    specimen = draw_specimen(rng, kind)
    drawn = specimen.build()
    modes = solve_modes(drawn)
    set_up = draw_set_up(rng, specimen, drawn, modes)
    early = 100 / set_up.rate_hz  # all that rings before the impact is in the record
    set_up = replace(set_up, kind="hammer", running=False, start_s=early, in_one_file=False)
    scatter = make_zero_scatter(specimen, set_up, float(modes.frequencies_hz[drawn.n_rigid]))
    ideal_system = build_system(specimen, set_up, scatter, ())
    nominal_hz, nominal_receptance = _solve_nominal_model(ideal_system)
    low, high = set_up.band_hz
    true_hz = ideal_system.modes.frequencies_hz
    inside = np.flatnonzero((true_hz >= low) & (true_hz <= high))
    ratio = nominal_hz[inside] / true_hz[inside]
    s, estimate = _estimate_from_records(ideal_system, rng)
    truth, model = ideal_system.motion(s), ideal_system.motion(s, nominal_receptance)
    return Check(
        kind=kind,
        seed=seed,
        frequency=float(np.abs(ratio - 1).max()),
        frf=_relative_difference(model, truth),
        recorded=_relative_difference(estimate, model),
        exact=_relative_difference(estimate, truth),
        median=float(np.median(np.abs(model / truth - 1))),
    )


def _relative_difference(a: ComplexArray | FloatArray, b: ComplexArray | FloatArray) -> float:
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))


def _solve_nominal_model(ideal_system: TrueSystem) -> tuple[FloatArray, ModalReceptance]:
    """Give natural frequencies and receptance of the nominal model, with the truth's damping and suspension."""
    structure = suspend(ideal_system.specimen.build_nominal_model().structure(), ideal_system.scatter.suspension_hz)
    modes = solve_modes(structure)
    set_up, direction = ideal_system.set_up, ideal_system.specimen.direction
    nodes = [sensor.node for sensor in set_up.sensors] + [node for node, _ in set_up.excited_points]
    rows = np.array([structure.row(Point(node, direction)) for node in nodes])
    ratio = np.concatenate(
        [np.full(structure.n_rigid, ideal_system.scatter.suspension_damping), [set_up.damping_ratio]]
    )
    return modes.frequencies_hz, make_receptance(modes, rows, ratio, float(modes.frequencies_hz[-1]))


def _estimate_from_records(system: TrueSystem, rng: np.random.Generator) -> tuple[ComplexArray, ComplexArray]:
    """Estimate FRFs (n_s, n_sensors, n_excited) at lines s from the strongest noise-free record of each point."""
    set_up = system.set_up
    excitations = draw_excitations(rng, replace(set_up, records_each=1))
    signals, _ = simulate_records(system, excitations)
    n = set_up.n_samples
    index = np.round(set_up.lines_hz * n / set_up.rate_hz).astype(int)
    sigma = SIGMA * set_up.rate_hz / n
    spectra = np.fft.rfft(signals * np.exp(-SIGMA * np.arange(n) / n), axis=-1)[:, :, index]
    units = np.array([sensor.unit_si for sensor in set_up.sensors])
    frf = spectra[:, 1:] * units[:, None] / spectra[:, :1]
    return np.asarray(sigma + 2j * np.pi * set_up.lines_hz, np.complex128), frf.transpose(2, 1, 0)


def check_step(effect: str, seed: int, *, structure: str | None = None) -> tuple[float, float]:
    """Halve the time step of a nonlinear case, and compare.

    Parameters
    ----------
    effect : str
        A nonlinear effect.
    seed : int
        Of the case.
    structure : str, optional
        Kind of specimen; drawn by default.

    Returns
    -------
    all, in_band : float
        Change of the responses, and of their part in the band, norm over norm.
    """
    case = make_case(seed, effect, structure=structure)
    system, excitations = case.system, case.excitations
    coarse, _ = simulate_records(system, excitations)
    fine, _ = simulate_records(system, excitations, refine=2)
    set_up = system.set_up
    index = np.round(set_up.lines_hz * set_up.n_samples / set_up.rate_hz).astype(int)
    a, b = (np.fft.rfft(signals[:, 1:], axis=-1)[:, :, index] for signals in (coarse, fine))
    return _relative_difference(coarse[:, 1:], fine[:, 1:]), _relative_difference(a, b)


def print_checks(*, n_specimens: int = 3, kinds: Sequence[str] | None = None, laws: bool = True) -> None:
    """Print the tables.

    Parameters
    ----------
    n_specimens : int
        Specimens of each kind.
    kinds : sequence of str, optional
        Kinds of specimens; all by default.
    laws : bool
        Halve the step of force laws too.
    """
    print(f"{'specimen':17}{'seed':>5}{'frequency':>12}{'FRF':>10}{'median':>10}{'records':>10}{'simulation':>12}")
    for kind in kinds or KINDS:
        for seed in range(n_specimens):
            c = check_nominal(kind, seed)
            print(
                f"{kind:17}{seed:5}{c.frequency:12.1e}{c.frf:10.1e}{c.median:10.1e}{c.recorded:10.1e}{c.exact:12.1e}",
                flush=True,
            )
    if not laws:
        return
    print(f"\n{'law':25}{'seed':>5}{'responses':>12}{'in band':>10}   (change when the step is halved)")
    effects = ("cubic_stiffness", "gap_contact", "dry_friction", "unknown:bouc_wen", "unknown:square_drag")
    for effect in effects:
        for seed in range(n_specimens):
            change, in_band = check_step(effect, seed)
            print(f"{effect:25}{seed:5}{change:12.1e}{in_band:10.1e}", flush=True)
