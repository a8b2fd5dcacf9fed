"""
A state space for control
=========================

The updated model as a state space with named inputs and outputs, its Bode plot, and members of its uncertainty.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import frf_ipz

DATA = Path("../../data/raw/cantilever")  # as seen from docs/gallery

# %%
results = frf_ipz.Campaign(
    frf_ipz.read_test(DATA / "test.toml"),
    frf_ipz.read_model(DATA / "model.toml"),
    points=["49:+z"],
    fit=frf_ipz.FitOptions(band_hz=(10.0, 700.0)),
    update=frf_ipz.UpdateOptions(mass=True),
    diagnose=frf_ipz.DiagnoseOptions(run="never"),
).run(until="export")
system = results.state_space
print(system.nstates, "states; inputs", system.input_labels, "outputs", system.output_labels)

# %%
# A controller may prefer displacements, sampled at its own rate.
options = frf_ipz.ExportOptions(outputs="displacement", sample_time_s=1e-4, ensemble=30)
sampled = frf_ipz.to_state_space(results.fit, results.updated_model, points=["49:+z"], options=options)
print("sampled every", sampled.dt, "s")

# %%
# Bode plot from the force at node 89 to the point of interest, with thirty members of the posterior.
members = frf_ipz.to_state_space_ensemble(results.fit, results.updated_model, points=["49:+z"], options=options)
output, force = sampled.output_labels.index("49:+z"), sampled.input_labels.index("89:+z")
lines_hz = np.geomspace(10, 700, 500)
figure, (magnitude, phase) = plt.subplots(2, sharex=True, layout="constrained")
for member in members:
    response = member[output, force].frequency_response(2 * np.pi * lines_hz).complex
    magnitude.loglog(lines_hz, abs(response), color="C0", alpha=0.15)
response = sampled[output, force].frequency_response(2 * np.pi * lines_hz).complex
magnitude.loglog(lines_hz, abs(response), color="k")
phase.semilogx(lines_hz, np.unwrap(np.angle(response)) * 180 / np.pi, color="k")
magnitude.set(ylabel="Receptance, m/N", title="49:+z / 89:+z")
phase.set(xlabel="Frequency, Hz", ylabel="Phase, degrees")
plt.show()
