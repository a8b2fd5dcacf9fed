"""What a fleet knows: modes matched over machines, outliers, drift, population, and whose each finding is."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from frf_ipz.fleet.drift import Drift, find_drifts, position
from frf_ipz.fleet.findings import FleetFinding, add_up_findings
from frf_ipz.fleet.machine_record import MachineRecord, Roots
from frf_ipz.fleet.mode_matching import match_roots
from frf_ipz.fleet.outliers import FALSE_ALARMS, FEWEST, find_outliers
from frf_ipz.fleet.population import Population, make_population

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.arrays import BoolArray, FloatArray, IntArray

Key: TypeAlias = "tuple[str, int]"  # FRF and number; the FRF is empty for a pole
ALONG = ("date", "serial_number")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FleetRoots:
    """Poles, or zeros, of all machines, one row a machine and root.

    Parameters
    ----------
    machine : (n,) int array
        Which machine, among the records.
    frf : tuple of str
        FRF of each zero; empty texts for poles.
    number : (n,) int array
        Of the mode, or of the zero in its FRF, over the fleet.
    frequency_hz, damping_ratio, frequency_std_hz, damping_ratio_std : (n,) array
        As measured.
    deviation_sigma, damping_deviation_sigma : (n,) array
        Of the frequency and of the damping from the other machines; NaN for too few of them.
    is_outlier : (n,) bool array
        Either is more than chance.
    """

    machine: IntArray
    frf: tuple[str, ...]
    number: IntArray
    frequency_hz: FloatArray
    damping_ratio: FloatArray
    frequency_std_hz: FloatArray
    damping_ratio_std: FloatArray
    deviation_sigma: FloatArray
    damping_deviation_sigma: FloatArray
    is_outlier: BoolArray

    @property
    def keys(self) -> list[Key]:
        """FRF and number of each row."""
        return list(zip(self.frf, self.number.tolist(), strict=True))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FleetAnalysis:
    """What is known of a fleet.

    Parameters
    ----------
    records : tuple of MachineRecord
        One a machine.
    poles, zeros : FleetRoots
        Of all machines.
    drifts : tuple of Drift
        Of every mode of enough machines with a date or a serial number.
    findings : tuple of FleetFinding
        Over machines.
    outliers : tuple of str
        Ids of machines with a pole or a zero unlike the others'.
    population : Population
        Of machines that are no outliers.
    """

    records: tuple[MachineRecord, ...]
    poles: FleetRoots
    zeros: FleetRoots
    drifts: tuple[Drift, ...]
    findings: tuple[FleetFinding, ...]
    outliers: tuple[str, ...]
    population: Population


def analyse_fleet(records: Sequence[MachineRecord]) -> FleetAnalysis:
    """Look at all machines together.

    Parameters
    ----------
    records : sequence of MachineRecord
        One a machine.

    Returns
    -------
    FleetAnalysis
        What is known of the fleet.
    """
    gathered = [_gathered([getattr(record, name) for record in records]) for name in ("poles", "zeros")]
    n_tests = sum(2 * len(_large_groups(roots)) for roots in gathered)  # of frequency and damping each
    level = FALSE_ALARMS / max(n_tests, 1)
    poles, zeros = (_with_deviations(roots, level) for roots in gathered)
    positions = {along: np.array([position(along, record.particulars) for record in records]) for along in ALONG}
    modes = {
        number: (poles.machine[rows].tolist(), poles.frequency_hz[rows])
        for (_, number), rows in _large_groups(poles).items()
    }
    off = {*poles.machine[poles.is_outlier].tolist(), *zeros.machine[zeros.is_outlier].tolist()}
    return FleetAnalysis(
        records=tuple(records),
        poles=poles,
        zeros=zeros,
        drifts=tuple(find_drifts(modes, positions, level=FALSE_ALARMS)),
        findings=tuple(add_up_findings(records)),
        outliers=tuple(record.machine for place, record in enumerate(records) if place in off),
        population=make_population([record for place, record in enumerate(records) if place not in off]),
    )


def _gathered(machines: Sequence[Roots | None]) -> FleetRoots:
    present = [(place, roots) for place, roots in enumerate(machines) if roots is not None]
    numbers = match_roots([roots for _, roots in present])
    columns = {
        name: np.concatenate([getattr(roots, name) for _, roots in present] or [np.zeros(0)])
        for name in ("frequency_hz", "damping_ratio", "frequency_std_hz", "damping_ratio_std")
    }
    count = len(columns["frequency_hz"])
    return FleetRoots(
        machine=np.repeat([place for place, _ in present], [roots.count for _, roots in present]).astype(int),
        frf=tuple(frf for _, roots in present for frf in roots.frf),
        number=np.concatenate([*numbers, np.zeros(0, int)]).astype(int),
        **columns,
        deviation_sigma=np.full(count, np.nan),
        damping_deviation_sigma=np.full(count, np.nan),
        is_outlier=np.zeros(count, bool),
    )


def _large_groups(roots: FleetRoots) -> dict[Key, IntArray]:
    """Rows of each pole or zero that enough machines have."""
    rows: dict[Key, list[int]] = defaultdict(list)
    for row, key in enumerate(roots.keys):
        rows[key].append(row)
    return {key: np.array(places) for key, places in sorted(rows.items()) if len(places) >= FEWEST}


def _with_deviations(roots: FleetRoots, level: float) -> FleetRoots:
    sigma, damping_sigma = roots.deviation_sigma.copy(), roots.damping_deviation_sigma.copy()
    is_outlier = roots.is_outlier.copy()
    for rows in _large_groups(roots).values():
        frequency, std = roots.frequency_hz[rows], roots.frequency_std_hz[rows]
        found = find_outliers(np.log(frequency), np.nan_to_num(std / frequency), level=level)
        sigma[rows] = found.sigma
        is_outlier[rows] = found.is_outlier
        damping = roots.damping_ratio[rows]
        positive = rows[damping > 0]  # the logarithm of the others is not defined
        damping, std = roots.damping_ratio[positive], roots.damping_ratio_std[positive]
        found = find_outliers(np.log(damping), np.nan_to_num(std / damping), level=level)
        damping_sigma[positive] = found.sigma
        is_outlier[positive] |= found.is_outlier
    return replace(roots, deviation_sigma=sigma, damping_deviation_sigma=damping_sigma, is_outlier=is_outlier)
