"""CPU time and memory of the fitter against the poles of sdypy-EMA and the fit of scikit-rf, on the sets of the bench.

Run with ``pytest tests/benchmarks --benchmark-only -s`` where the extra ``peers`` is installed; numbers are CPU seconds
of one thread (set OPENBLAS_NUM_THREADS=1), ours and the peers' in the same run.
"""

import contextlib
import importlib.util
import io
import time

import numpy as np
import pytest

from frf_ipz.identification.fit import fit_modes
from frf_ipz.identification.measured_lines import measured_lines
from frf_ipz.identification.options import FitOptions
from frf_ipz.identification.stabilization import find_start_poles
from synthetic_frfs import of_bench

ROUNDS = 3
ORDERS = {"b": 60, "c": 100}  # of the peer: what its own examples use, as in the bench
POLES_FASTER = {"b": 2.0, "c": 20.0}  # pole step against sdypy-EMA's
WHOLE_FASTER = {"b": 2.0, "c": 2.0}  # whole fit with covariance against sdypy-EMA's poles, on b with their selection
AUTO_FASTER = 50.0  # whole fit against scikit-rf's auto_fit on set b
MEMORY_MB = 300.0  # above the data, on set c


@pytest.fixture(scope="module")
def truth_sets(bench_fit):
    spec = importlib.util.spec_from_file_location("make_truth", bench_fit / "make_truth.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return {name: getattr(module, f"set_{name}")() for name in "bc"}


def cpu_seconds(work):
    """Median CPU seconds after one run to warm up."""
    work()
    seconds = []
    for _ in range(ROUNDS):
        start = time.process_time()
        work()
        seconds.append(time.process_time() - start)
    return float(np.median(seconds))


def sdypy_seconds(truth, order, *, select):
    """CPU seconds of sdypy-EMA's stabilisation, and with `select` of its choice of poles nearest the true ones too."""
    ema = pytest.importorskip("sdypy.EMA", reason="needs the extra 'peers'")
    rows = truth["H"].reshape(-1, truth["H"].shape[2])

    def poles():
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            model = ema.Model(
                rows,
                truth["f"],
                lower=0.5 * truth["fn"][0],
                upper=truth["f"][-1],
                pol_order_high=order,
                frf_form="accelerance",
            )
            model.get_poles(method="lscf", show_progress=False)
            if select:
                model.select_closest_poles(list(truth["fn"]))

    return cpu_seconds(poles)


@pytest.mark.filterwarnings("ignore")  # of the peer
@pytest.mark.parametrize("name", ["b", "c"])
def test_against_sdypy(benchmark, timings, truth_sets, name):
    resource = pytest.importorskip("resource", reason="Windows does not tell the peak of a process's memory so")
    truth = truth_sets[name]
    frfs = of_bench(truth)
    peer = sdypy_seconds(truth, ORDERS[name], select=False)
    chosen = sdypy_seconds(truth, ORDERS[name], select=True)
    options = FitOptions()
    lines = measured_lines(frfs, options)
    poles = cpu_seconds(lambda: find_start_poles(frfs, lines))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    whole = cpu_seconds(lambda: fit_modes(frfs, options=options))
    memory = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    timings.add("poles of the start", f"set {name}, sdypy-EMA's stabilisation", peer / poles, POLES_FASTER[name])
    timings.add(
        "whole fit with covariance",
        f"set {name}, sdypy-EMA's poles" + (" with their choice" if name == "b" else ""),
        (chosen if name == "b" else peer) / whole,
        WHOLE_FASTER[name],
    )
    benchmark.extra_info.update(
        peer_cpu_s=peer, peer_chosen_cpu_s=chosen, poles_cpu_s=poles, whole_cpu_s=whole, memory_mb=memory
    )
    print(
        f"\nset {name}: poles {poles:.3f} s, whole fit {whole:.3f} s of CPU; sdypy-EMA's stabilisation {peer:.3f} s, "
        f"with its choice of poles {chosen:.3f} s: poles {peer / poles:.1f}, whole fit {peer / whole:.2f} and "
        f"{chosen / whole:.2f} times faster; {memory:.0f} MB more at the peak"
    )
    benchmark.pedantic(lambda: None, rounds=1)
    assert peer >= POLES_FASTER[name] * poles
    assert (chosen if name == "b" else peer) >= WHOLE_FASTER[name] * whole
    assert memory < MEMORY_MB


@pytest.mark.filterwarnings("ignore")  # of the peer
def test_against_auto_fit(benchmark, timings, truth_sets):
    skrf = pytest.importorskip("skrf", reason="needs the extra 'peers'")
    fitting = pytest.importorskip("skrf.vectorFitting", reason="needs the extra 'peers'")
    truth = truth_sets["b"]
    rows = truth["H"].reshape(-1, truth["H"].shape[2])[:, 1:]
    ports = int(np.ceil(np.sqrt(len(rows))))  # it takes square networks only
    square = np.zeros((ports * ports, rows.shape[1]), complex)
    square[: len(rows)] = rows
    values = square.reshape(ports, ports, -1).transpose(2, 0, 1) / np.sqrt(np.mean(np.abs(rows[0]) ** 2))
    network = skrf.Network(frequency=skrf.Frequency.from_f(truth["f"][1:], unit="hz"), s=values)
    start = time.process_time()
    with contextlib.redirect_stdout(io.StringIO()):
        fitting.VectorFitting(network).auto_fit(enforce_dc=False)
    peer = time.process_time() - start
    frfs = of_bench(truth)
    ours = cpu_seconds(lambda: fit_modes(frfs, options=FitOptions()))
    timings.add("whole fit with covariance", "set b, auto_fit of scikit-rf", peer / ours, AUTO_FASTER)
    benchmark.extra_info.update(peer_cpu_s=peer, ours_cpu_s=ours)
    print(f"\nset b: whole fit {ours:.3f} s, scikit-rf's auto_fit {peer:.2f} s of CPU: {peer / ours:.0f} times faster")
    benchmark.pedantic(lambda: None, rounds=1)
    assert peer >= AUTO_FASTER * ours
