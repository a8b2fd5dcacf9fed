"""
From recordings to FRFs
=======================

Twelve hammer recordings of a clamped beam become two FRFs. One record is a double hit: it is found and left out.
"""

from pathlib import Path

import matplotlib.pyplot as plt

import frf_ipz

DATA = Path("../../data/raw/cantilever")  # as seen from docs/gallery

# %%
# ``test.toml`` says which files belong to which point and what their columns hold.
test = frf_ipz.read_test(DATA / "test.toml")
estimate = frf_ipz.estimate_frfs(test)
print(estimate.frfs)

# %%
# Each record has a row with what was measured of it and what was decided.
columns = ["record", "peak_force_N", "remaining_amplitude", "snr_db", "used"]
print(estimate.records[columns].round(4).to_string(index=False))
for warning in estimate.warnings:
    print(warning)

# %%
# Magnitude, and the standard deviation that the scatter between records leaves.
frfs = estimate.frfs
band = frfs.in_band((5.0, 700.0))
figure, axes = plt.subplots(layout="constrained")
for column, label in enumerate(frfs.labels):
    (line,) = axes.loglog(frfs.frequency_hz[band], abs(frfs.values[band, column]), label=str(label))
    deviation = frfs.variance[band, column] ** 0.5
    axes.loglog(frfs.frequency_hz[band], deviation, ":", color=line.get_color(), label=f"{label}, standard deviation")
axes.set(xlabel="Frequency, Hz", ylabel="Accelerance, m/s²/N", title="FRFs and how well they are known")
axes.legend()
plt.show()
