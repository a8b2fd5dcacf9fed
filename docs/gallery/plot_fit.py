"""
Poles with their uncertainty
============================

A fit gives each pole a standard deviation. Are they right? On FRFs whose truth is known, the errors can be counted.
"""

import matplotlib.pyplot as plt
import numpy as np

import frf_ipz

# %%
# A steel beam with free ends, one force and three sensors, and noise that is the same on all lines.
beam = frf_ipz.make_beam(
    length_m=0.8, width_m=0.03, thickness_m=0.008, youngs_modulus_Pa=210e9, density_kg_m3=7850, elements=32,
    modal_ratio=0.004,
)  # fmt: skip
lines_hz = np.arange(20.0, 900.0, 0.5)
outputs, inputs = ["33:+z", "20:+z", "9:+z"], ["1:+z"]
quantity = frf_ipz.FrfQuantity.ACCELERANCE
labels = [frf_ipz.FrfLabel(frf_ipz.parse_dof(dof), frf_ipz.parse_dof("1:+z"), quantity) for dof in outputs]
exact = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * lines_hz)
noise = 0.5  # standard deviation, m/s²/N


def measure(seed):
    """FRFs with noise of their own."""
    parts = np.random.default_rng(seed).normal(scale=noise / np.sqrt(2), size=(2, *exact.shape))
    values = (exact + parts[0] + 1j * parts[1])[:, :, None]
    variance = np.full(values.shape, noise**2)
    return frf_ipz.FrfSet.from_arrays(lines_hz, values, outputs=outputs, inputs=inputs, variance=variance)


# %%
# Ten measurements, each fitted by itself.
fits = [frf_ipz.fit_modes(measure(seed), options=frf_ipz.FitOptions(band_hz=(20.0, 900.0))) for seed in range(10)]
print(fits[0])

# %%
# Errors of the natural frequencies in units of the standard deviation that the fit itself states.
true_hz = frf_ipz.solve_modes(beam, n_modes=7).natural_frequency_hz[2:]  # without rigid-body modes
tables = [fit.to_frame("poles") for fit in fits]
errors = np.array([(table["frequency_hz"] - true_hz) / table["frequency_std_hz"] for table in tables])
print("root mean square of the errors, in standard deviations:", np.sqrt(np.mean(errors**2)).round(2))

figure, axes = plt.subplots(layout="constrained")
axes.axhspan(-2, 2, alpha=0.2, label="± 2 standard deviations")
for row in errors:
    axes.plot(true_hz, row, "o", color="C0", markersize=4)
axes.set(xlabel="Natural frequency, Hz", ylabel="Error, standard deviations", title="Ten measurements, five modes")
axes.legend()
plt.show()
