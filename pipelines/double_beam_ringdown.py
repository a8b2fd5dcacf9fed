"""Double beam: how its two modes depend on amplitude, from twelve ring-downs after blows of different force.

Run from the checkout: ``python pipelines/double_beam_ringdown.py ../shared/recordings/double_beam_ringdown OUT``. OUT
gets a picture and a table. There is no force and no model: each ring-down is followed from window to window.
"""

import sys
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from frf_testbench.ringdown import (
    AmplitudeLaw,
    RingdownTrack,
    fit_amplitude_law,
    name_family,
    track_ringdown,
)

PEAKS_N = (64.2, 51.7, 40.8, 36.1, 57.2, 66.8, 46.4, 38.0, 50.6, 65.8, 42.0, 30.4)
FREQUENCIES_HZ = (122.5, 243.6)
WINDOW_S = 0.15
LEAST_M_S = (0.0, 0.1)  # below, the second harmonic of the first mode hides the second mode
UNITS = {"frequency_hz": "Hz", "damping_ratio": "1"}


def read_tracks(folder: Path) -> list[list[RingdownTrack]]:
    """Follow each mode along all ring-downs."""
    followed = []
    for path in sorted(folder.glob("ringdown_*.csv")):
        time, velocity = pd.read_csv(path).to_numpy().T
        step = (time[-1] - time[0]) / (len(time) - 1)
        followed.append(track_ringdown(velocity, step, FREQUENCIES_HZ, WINDOW_S))
    return [[one[mode].above(LEAST_M_S[mode]) for one in followed] for mode in range(len(FREQUENCIES_HZ))]


def draw(tracks: list[list[RingdownTrack]], laws: list[dict[str, AmplitudeLaw]], path: Path) -> None:
    """Frequencies and damping over amplitude, coloured by the peak force of the blow."""
    figure, axes = plt.subplots(2, len(tracks), figsize=(11, 7), layout="constrained", sharex="col")
    colours = mpl.colormaps["viridis"](np.interp(PEAKS_N, (min(PEAKS_N), max(PEAKS_N)), (0, 1)))
    for column, mode in enumerate(tracks):
        grid = np.geomspace(min(one.amplitude.min() for one in mode), max(one.amplitude.max() for one in mode), 200)
        for row, quantity in enumerate(UNITS):
            axis, law = axes[row, column], laws[column][quantity]
            for one, colour in zip(mode, colours, strict=True):
                std = getattr(one, quantity.replace("_hz", "") + "_std" + "_hz" * quantity.endswith("_hz"))
                axis.errorbar(one.amplitude, getattr(one, quantity), 2 * std, fmt=".", ms=4, lw=0.8, color=colour)
            axis.plot(grid, law.at(grid), "k--", lw=1, label=f"offset + c A^{law.power:.2f}")
            axis.set_ylabel(f"{quantity} of mode {column + 1}")
            axis.legend()
        axes[1, column].set(xlabel="amplitude of the tip's velocity, m/s", xscale="log")
    bar = mpl.cm.ScalarMappable(mpl.colors.Normalize(min(PEAKS_N), max(PEAKS_N)), "viridis")
    figure.colorbar(bar, ax=axes, label="peak force of the blow, N")
    figure.savefig(path, dpi=110)


def main(folder: Path, out: Path) -> None:
    """Print how frequency and damping depend on amplitude; write the picture and the table."""
    out.mkdir(parents=True, exist_ok=True)
    tracks = read_tracks(folder)
    laws = [{quantity: fit_amplitude_law(mode, quantity) for quantity in UNITS} for mode in tracks]
    for number, (mode, law) in enumerate(zip(tracks, laws, strict=True), 1):
        amplitude = np.concatenate([one.amplitude for one in mode])
        print(f"mode {number}: {len(amplitude)} windows, amplitudes {amplitude.min():.3g} to {amplitude.max():.3g} m/s")
        for quantity, one in law.items():
            low, high = one.at(np.array([amplitude.min(), amplitude.max()]))
            print(
                f"  {quantity}: {low:.6g} to {high:.6g} {UNITS[quantity]}; {one.offset:.6g} {one.change:+.3g} A^p, "
                f"p = {one.power:.2f} (95 %: {one.power_low:.2f} to {one.power_high:.2f}); leaves {one.misfit:.2g}, "
                f"a constant {one.misfit_of_constant:.2g}"
            )
        print(f"  {name_family(law['frequency_hz'], law['damping_ratio'])}")
    rows = [
        pd.DataFrame({
            "mode": number, "ringdown": i, "peak_force_N": peak, "time_s": one.time_s, "amplitude_m_s": one.amplitude,
            "frequency_hz": one.frequency_hz, "frequency_std_hz": one.frequency_std_hz,
            "damping_ratio": one.damping_ratio, "damping_ratio_std": one.damping_ratio_std,
        })
        for number, mode in enumerate(tracks, 1)
        for i, (one, peak) in enumerate(zip(mode, PEAKS_N, strict=True), 1)
    ]  # fmt: skip
    pd.concat(rows).to_csv(out / "ringdown.csv", index=False)
    draw(tracks, laws, out / "ringdown.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
