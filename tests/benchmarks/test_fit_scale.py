"""How the work of the fit grows with FRFs and with lines: exponents over a decade, and sdypy-EMA in the same run.

Run with ``pytest tests/benchmarks/test_fit_scale.py --benchmark-only -s``; numbers are CPU seconds of one thread. The
peer needs the extra ``peers``; its time is that of the poles alone, at the order that its own examples use.
"""

import contextlib
import io
import time
from dataclasses import replace

import numpy as np
import pytest
from scipy import io as io_matlab

from frf_ipz.frf import FrfSet
from frf_ipz.identification.fit import fit_modes
from synthetic_frfs import accelerances, random_modes

MODES_HZ = np.geomspace(40.0, 950.0, 20)
DAMPING_RATIO = 0.004
EXPONENT = 1.2  # in FRFs: the bar of the project
LONG_S = 30.0  # of one FRF of 500 000 lines, its noise unknown: the bar of the project
MANY_FRFS_S = 2.0  # of 300 FRFs by 1000 lines by 20 modes, with covariance: the bar of the project
GRID_S = 20.0  # of 10 FRFs by 16 385 lines of a grid of rulers: the bar of the project
RULERS = "ruler_grid/ruler_grid_acc_3.mat"
PEER_ORDER = 60


def frfs_of(n_outputs, n_inputs, n_lines):
    modes = random_modes(MODES_HZ, DAMPING_RATIO, n_outputs=n_outputs, n_inputs=n_inputs)
    return accelerances(modes, np.linspace(20.0, 1000.0, n_lines))


def cpu_seconds(work):
    start = time.process_time()
    work()
    return time.process_time() - start


def exponent(few, many, *, times):
    return float(np.log(many / few) / np.log(times))


def test_exponent_in_frfs(benchmark):
    sets = [frfs_of(count, 3, 1000) for count in (10, 100)]
    seconds = [cpu_seconds(lambda frfs=frfs: fit_modes(frfs)) for frfs in sets]
    grows = exponent(*seconds, times=10)
    print(f"\nfit of 30 and 300 FRFs: {seconds[0]:.2f} and {seconds[1]:.2f} CPU s, exponent {grows:.2f}")
    benchmark.extra_info.update(exponent=grows)
    benchmark.pedantic(lambda: None, rounds=1)
    assert grows < EXPONENT


def test_exponent_in_lines(benchmark):
    sets = [frfs_of(10, 1, count) for count in (5_000, 50_000)]
    seconds = [cpu_seconds(lambda frfs=frfs: fit_modes(frfs)) for frfs in sets]
    grows = exponent(*seconds, times=10)
    print(f"\nfit of 10 FRFs, 5000 and 50 000 lines: {seconds[0]:.2f} and {seconds[1]:.2f} CPU s, exponent {grows:.2f}")
    benchmark.extra_info.update(exponent=grows)
    benchmark.pedantic(lambda: None, rounds=1)
    assert grows < EXPONENT


def test_one_long_record(benchmark):
    frfs = frfs_of(1, 1, 500_000)
    frfs = replace(frfs, variance=np.full(frfs.values.shape, np.nan))
    seconds = cpu_seconds(lambda: fit_modes(frfs))
    print(f"\nfit of one FRF of 500 000 lines, noise unknown: {seconds:.1f} CPU s")
    benchmark.extra_info.update(cpu_s=seconds)
    benchmark.pedantic(lambda: None, rounds=1)
    assert seconds < LONG_S


def test_three_hundred_frfs(benchmark):
    frfs = frfs_of(100, 3, 1000)
    seconds = min(cpu_seconds(lambda: fit_modes(frfs)) for _ in range(3))
    print(f"\nfit of 300 FRFs, 1000 lines, 20 modes: {seconds:.2f} CPU s")
    benchmark.extra_info.update(cpu_s=seconds)
    benchmark.pedantic(lambda: None, rounds=1)
    assert seconds < MANY_FRFS_S


def test_grid_of_rulers(benchmark, recordings):
    recorded = io_matlab.loadmat(recordings / RULERS)
    values = recorded["yspec"]
    lines_hz = np.arange(len(values)) * float(recorded["freq"].item()) / (2 * (len(values) - 1))
    outputs = [f"{number}:+z" for number in range(1, values.shape[1] + 1)]
    frfs = FrfSet.from_arrays(lines_hz, values[:, :, None], outputs=outputs, inputs=["3:+z"])
    seconds = cpu_seconds(lambda: fit_modes(frfs))
    print(f"\nfit of {frfs.n_frfs} FRFs of {frfs.n_lines} lines, a grid of rulers: {seconds:.1f} CPU s")
    benchmark.extra_info.update(cpu_s=seconds)
    benchmark.pedantic(lambda: None, rounds=1)
    assert seconds < GRID_S


@pytest.mark.filterwarnings("ignore")  # of the peer
@pytest.mark.parametrize("n_outputs", [10, 100, 1000])
def test_against_sdypy(benchmark, timings, n_outputs):
    ema = pytest.importorskip("sdypy.EMA", reason="needs the extra 'peers'")
    frfs = frfs_of(n_outputs, 1, 1000)

    def poles():
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            model = ema.Model(
                frfs.values.T,
                frfs.frequency_hz,
                lower=float(frfs.frequency_hz[0]),
                upper=float(frfs.frequency_hz[-1]),
                pol_order_high=PEER_ORDER,
                frf_form="accelerance",
            )
            model.get_poles(method="lscf", show_progress=False)

    peer, ours = cpu_seconds(poles), cpu_seconds(lambda: fit_modes(frfs))
    timings.add("whole fit with covariance", f"{n_outputs} FRFs, sdypy-EMA's poles alone", peer / ours, 0.0)
    print(f"\n{n_outputs} FRFs: whole fit {ours:.2f} CPU s, sdypy-EMA's poles alone {peer:.2f}: {peer / ours:.2f}")
    benchmark.extra_info.update(peer_cpu_s=peer, ours_cpu_s=ours)
    benchmark.pedantic(lambda: None, rounds=1)
