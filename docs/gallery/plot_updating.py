"""
Pairing and updating
====================

An FE model that is too stiff at its clamp is brought to the measured poles and zeros.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import frf_ipz

DATA = Path("../../data/raw/cantilever")  # as seen from docs/gallery

# %%
# Measurement and fit, FE model and reduction.
frfs = frf_ipz.estimate_frfs(frf_ipz.read_test(DATA / "test.toml")).frfs
fit = frf_ipz.fit_modes(frfs, options=frf_ipz.FitOptions(band_hz=(10.0, 700.0)))
fe_model = frf_ipz.read_model(DATA / "model.toml")
reduced_model = frf_ipz.reduce_model(fit, fe_model, points=["49:+z"])

# %%
# Measured poles and zeros, and their counterparts in the model.
pairs = frf_ipz.pair_roots(fit, reduced_model)
print(pairs)

# %%
# The smallest change of the model that explains them. Masses may be off too: the model has no accelerometer.
updated_model = frf_ipz.update_model(fit, reduced_model, options=frf_ipz.UpdateOptions(mass=True), fe_model=fe_model)
print(updated_model)

# %%
# FRFs of both models beside the measured one.
s = 2j * np.pi * fit.frequency_hz
label = fit.labels[0]
band = frfs.in_band(fit.band_hz)
figure, axes = plt.subplots(layout="constrained")
axes.loglog(frfs.frequency_hz[band], abs(frfs.values[band, 0]), color="0.7", linewidth=4, label="measured")
for name, model, style in (("as drawn", updated_model.nominal, "--"), ("updated", updated_model.model, "-")):
    axes.loglog(fit.frequency_hz, abs(frf_ipz.compute_frfs(model, [label], s)[:, 0]), style, label=name)
axes.set(xlabel="Frequency, Hz", ylabel="Accelerance, m/s²/N", title=str(label))
axes.legend()
plt.show()
