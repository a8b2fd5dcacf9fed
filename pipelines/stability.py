"""Count how stable the modes of a test are: fit it again and again, each time changed a little.

``python pipelines/stability.py TEST_TOML [LOW_HZ HIGH_HZ]``: band edges moved by 2 %, 1 % noise, a half or a third
of the lines, FRFs or impacts left out, other estimators. Of each change it prints how many modes there are, which share
of those with `found_again` over 0.9 is found again, and how far frequency and damping moved over their deviations.
"""

import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.optimize import linear_sum_assignment

import frf_ipz

Band = tuple[float, float]
SURE, SAME = 0.9, 0.5  # found_again; half widths within which two poles are one mode
EDGE, NOISE, SEEDS, MOST_LEFT_OUT = 0.02, 0.01, 5, 5
EDGES = [(low, high) for low in (0, 1, -1) for high in (0, 1, -1) if low or high]  # in units of EDGE


def perturbed(path: str, frfs: frf_ipz.FrfSet, band: Band) -> Iterator[tuple[str, frf_ipz.FrfSet, Band]]:
    """Give name, FRFs and band of each perturbation."""
    for low, high in EDGES:
        yield f"edges {low:+d} {high:+d}", frfs, (band[0] * (1 + low * EDGE), band[1] * (1 + high * EDGE))
    for seed in range(SEEDS):
        size = NOISE * np.abs(frfs.values) / np.sqrt(2)
        real, imag = np.random.default_rng(seed).standard_normal((2, *size.shape)) * size
        noisy = replace(frfs, values=frfs.values + real + 1j * imag, variance=frfs.variance + 2 * size**2)
        yield f"1 % noise, {seed}", noisy, band
    for step, first in ((2, 0), (2, 1), (3, 0), (3, 1), (3, 2)):
        yield f"line {first} of {step}", frfs.select_lines(np.arange(frfs.n_lines) % step == first), band
    for left_out in range(min(frfs.n_frfs, MOST_LEFT_OUT) if frfs.n_frfs > 1 else 0):
        yield f"without FRF {left_out}", frfs.select_frfs(np.delete(np.arange(frfs.n_frfs), left_out)), band
    test = frf_ipz.read_test(path)
    if test.kind != "frf":
        records = frf_ipz.estimate_frfs(test).records["record"].tolist()
        options = {name: frf_ipz.IngestOptions(estimator=name) for name in ("H2", "Hv")}
        options |= {f"without {one}": frf_ipz.IngestOptions(drop=(one,)) for one in records if len(records) > 1}
        for name, chosen in options.items():
            yield name, frf_ipz.estimate_frfs(test, options=chosen).frfs, band


def compare(base: frf_ipz.ModalFit, fit: frf_ipz.ModalFit) -> tuple[np.ndarray, np.ndarray]:
    """Give which sure modes of the first fit the second has, and the changes of their poles over their deviations."""
    poles, others = (one.model.poles[: one.n_modes] for one in (base, fit))
    distance = np.abs(poles[:, None] - others) / np.minimum(-poles.real[:, None], -others.real)
    rows, columns = linear_sum_assignment(np.minimum(distance, 1))
    same = distance[rows, columns] < SAME
    rows, change = rows[same], (others[columns] - poles[rows])[same]
    deviation = np.array([np.sqrt(np.diag(base.covariance[2 * k : 2 * k + 2, 2 * k : 2 * k + 2])) for k in rows])
    is_sure = base.modes["found_again"].to_numpy() > SURE
    changes = np.stack([change.real, change.imag], axis=1) / deviation.reshape(-1, 2)
    return np.isin(np.flatnonzero(is_sure), rows), changes[is_sure[rows]].ravel()


def main(path: str, band: Band | None = None) -> None:
    """Print a row a perturbation, and the sum of all."""
    frfs = frf_ipz.estimate_frfs(frf_ipz.read_test(path)).frfs
    base = frf_ipz.fit_modes(frfs, options=frf_ipz.FitOptions(band_hz=band))
    print(f"{'as it is':20s}{base.n_modes:4d} modes, {(base.modes['found_again'] > SURE).sum()} sure", flush=True)
    rows = []
    for name, other, edges in perturbed(path, frfs, base.band_hz):
        fit = frf_ipz.fit_modes(other, options=frf_ipz.FitOptions(band_hz=edges))
        rows.append((*compare(base, fit), fit.n_modes))
        again, size = np.mean(rows[-1][0]), np.sqrt(np.mean(rows[-1][1] ** 2))
        print(f"{name:20s}{fit.n_modes:4d} modes, {again:5.0%} again, {size:5.2f} deviations (rms)", flush=True)
    again, changes = (np.concatenate([row[part] for row in rows]) for part in range(2))
    typical = np.median([row[2] for row in rows])
    print(
        f"{len(rows)} perturbations: {np.mean(again):.1%} found again, changes of {np.sqrt(np.mean(changes**2)):.2f} "
        f"deviations (rms), {np.mean(np.abs(changes) > 3):.1%} beyond three; {typical:g} modes"
    )


if __name__ == "__main__":
    main(sys.argv[1], (float(sys.argv[2]), float(sys.argv[3])) if len(sys.argv) > 2 else None)
