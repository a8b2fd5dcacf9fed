"""
Prediction where no sensor can sit
==================================

The FRF at a point of interest with its 90 % band, beside the true FRF, which was kept aside.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import frf_ipz

ROOT = Path("../../data")  # as seen from docs/gallery

# %%
# The whole chain in one call.
results = frf_ipz.Campaign(
    frf_ipz.read_test(ROOT / "raw" / "cantilever" / "test.toml"),
    frf_ipz.read_model(ROOT / "raw" / "cantilever" / "model.toml"),
    points=["49:+z"],
    fit=frf_ipz.FitOptions(band_hz=(10.0, 700.0)),
    update=frf_ipz.UpdateOptions(mass=True),
    diagnose=frf_ipz.DiagnoseOptions(run="never"),
).run(until="predict")
prediction = results.prediction
print(prediction)

# %%
# The truth is used for this comparison only. The band holds what noise and prior leave open. A wrong sensitivity of a
# sensor, here 0.5 %, moves all lines alike and is not in it.
truth = frf_ipz.read_frfs(ROOT / "reference" / "cantilever_poi_frf.csv", quantity="accelerance")
column = [str(label) for label in truth.labels].index(str(prediction.labels[1]))
true_magnitude = np.interp(prediction.frequency_hz, truth.frequency_hz, abs(truth.values[:, column]))
inside = (true_magnitude > prediction.magnitude_low[:, 1]) & (true_magnitude < prediction.magnitude_high[:, 1])
print(f"the band holds the truth on {inside.mean():.0%} of the lines")

# %%
# Ratios to the predicted magnitude, since all curves lie on each other otherwise.
predicted = abs(prediction.values[:, 1])
figure, (above, below) = plt.subplots(2, sharex=True, layout="constrained")
above.loglog(prediction.frequency_hz, abs(prediction.nominal[:, 1]), "--", label="FE model as drawn")
above.loglog(prediction.frequency_hz, predicted, label="updated model")
above.loglog(prediction.frequency_hz, true_magnitude, ":", color="k", label="truth")
above.set(ylabel="Accelerance, m/s²/N", title=str(prediction.labels[1]))
above.legend()
low, high = (20 * np.log10(edge[:, 1] / predicted) for edge in (prediction.magnitude_low, prediction.magnitude_high))
below.fill_between(prediction.frequency_hz, low, high, alpha=0.4, label="90 % band")
below.semilogx(prediction.frequency_hz, 20 * np.log10(true_magnitude / predicted), ":", color="k", label="truth")
below.set(xlabel="Frequency, Hz", ylabel="Beside the prediction, dB", ylim=(-2, 2))
below.legend()
plt.show()
