"""Count how stable the modes of a test are: fit it again and again, each time changed a little.

``python pipelines/stability.py TEST_TOML [LOW_HZ HIGH_HZ]``: band edges moved by 2 %, 1 % noise, a half or a third
of the lines, FRFs or impacts left out, other estimators. Of each it prints how many modes there are, which share of
those with `found_again` over 0.9 is found again, and how far frequency and damping moved over their deviations.
What is to be expected of overlapping data stands beside it (`pole_changes.py`).
"""

import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from pole_changes import SURE, Band, Lost, compare, expected, rms

import frf_ipz

EDGE, NOISE, SEEDS, MOST_LEFT_OUT = 0.02, 0.01, 5, 5
EDGES = [(low, high) for low in (0, 1, -1) for high in (0, 1, -1) if low or high]  # in units of EDGE


def perturbed(path: str, frfs: frf_ipz.FrfSet, band: Band) -> Iterator[tuple[str, frf_ipz.FrfSet, Band, Lost]]:
    """Give name, FRFs and band of each perturbation, the share of each value that is left, and the noise on it."""
    lines, every, whole = np.arange(frfs.n_lines), np.arange(frfs.n_frfs), (np.ones((1, 1)), 0.0)
    for low, high in EDGES:
        yield f"edges {low:+d} {high:+d}", frfs, (band[0] * (1 + low * EDGE), band[1] * (1 + high * EDGE)), whole
    for seed in range(SEEDS):
        size = NOISE * np.abs(frfs.values) / np.sqrt(2)
        real, imag = np.random.default_rng(seed).standard_normal((2, *size.shape)) * size
        noisy = replace(frfs, values=frfs.values + real + 1j * imag, variance=frfs.variance + 2 * size**2)
        yield f"1 % noise, {seed}", noisy, band, (np.ones((1, 1)), 2 * size**2)
    for step, first in ((2, 0), (2, 1), (3, 0), (3, 1), (3, 2)):
        kept = lines % step == first
        yield f"line {first} of {step}", frfs.select_lines(kept), band, (kept[:, None], 0.0)
    for left_out in range(min(frfs.n_frfs, MOST_LEFT_OUT) if frfs.n_frfs > 1 else 0):
        yield (
            f"without FRF {left_out}",
            frfs.select_frfs(np.delete(every, left_out)),
            band,
            (every[None] != left_out, 0.0),
        )
    test = frf_ipz.read_test(path)
    if test.kind != "frf":
        records = frf_ipz.estimate_frfs(test).records["record"].tolist()
        options = {name: (frf_ipz.IngestOptions(estimator=name), whole) for name in ("H2", "Hv")}
        fewer = np.full((1, 1), 1 - 1 / len(records)), 0.0
        for one in records if len(records) > 1 else ():
            options[f"without {one}"] = frf_ipz.IngestOptions(drop=(one,)), fewer
        for name, (chosen, lost) in options.items():
            yield name, frf_ipz.estimate_frfs(test, options=chosen).frfs, band, lost


def main(path: str, band: Band | None = None) -> None:
    """Print a row a perturbation, and the sum of all."""
    frfs = frf_ipz.estimate_frfs(frf_ipz.read_test(path)).frfs
    base = frf_ipz.fit_modes(frfs, options=frf_ipz.FitOptions(band_hz=band))
    print(f"{'as it is':20s}{base.n_modes:4d} modes, {(base.modes['found_again'] > SURE).sum()} sure", flush=True)
    rows = []
    for name, other, edges, lost in perturbed(path, frfs, base.band_hz):
        fit = frf_ipz.fit_modes(other, options=frf_ipz.FitOptions(band_hz=edges))
        found, changes, modes = compare(base, fit)
        due = np.sqrt(expected(base, frfs, edges, lost))[modes, None].repeat(2, axis=1)
        rows.append((found, changes.ravel(), due.ravel(), [fit.n_modes]))
        size = f"{rms(changes):5.2f} deviations (rms), {rms(due):.2f} to be expected"
        print(f"{name:24s}{fit.n_modes:4d} modes, {np.mean(found):5.0%} again, {size}", flush=True)
    again, changes, due, counts = (np.concatenate(column) for column in zip(*rows, strict=True))
    print(
        f"{len(rows)} perturbations: {np.mean(again):.1%} found again; changes of {rms(changes):.2f} deviations (rms), "
        f"{rms(changes) / rms(due):.2f} of what was to be expected; {np.mean(np.abs(changes) > 3):.1%} beyond three "
        f"deviations, {np.mean(np.abs(changes) > 3 * np.maximum(due, 1)):.1%} with those of smaller samples; "
        f"{np.median(counts):g} modes"
    )


if __name__ == "__main__":
    main(sys.argv[1], (float(sys.argv[2]), float(sys.argv[3])) if len(sys.argv) > 2 else None)
