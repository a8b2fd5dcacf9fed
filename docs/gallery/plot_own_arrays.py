"""
From arrays in memory to a controller-ready model
=================================================

FRFs and matrices that are in Python already need no file, and the state space comes back without one. A machine of
three masses, a measurement at two of them.
"""

import matplotlib.pyplot as plt
import numpy as np

import frf_ipz

# %%
# The model: three masses in a row, the first on a spring to the ground.
mass = np.diag([1.0, 0.8, 0.5])


def stiffness(first, second, third):
    """Of the springs ground to 1, 1 to 2, 2 to 3, N/m."""
    return np.array([[first + second, -second, 0], [-second, second + third, -third], [0, -third, third]])


names = ["1:x", "2:x", "3:x"]
model = frf_ipz.StructuralModel.from_matrices(mass, stiffness(4e5, 3e5, 2e5), dofs=names, modal_damping=0.01)
machine = frf_ipz.StructuralModel.from_matrices(mass, stiffness(4.2e5, 2.7e5, 2.1e5), dofs=names, modal_damping=0.01)

# %%
# The measurement as an array ``H[frequency, output, input]``: forces at mass 1, sensors at 1 and 3.
lines_hz = np.arange(20.0, 250.0, 0.1)
outputs, inputs = ["1:+x", "3:+x"], ["1:+x"]
labels = [
    frf_ipz.FrfLabel(frf_ipz.parse_dof(dof), frf_ipz.parse_dof("1:+x"), frf_ipz.FrfQuantity.ACCELERANCE)
    for dof in outputs
]
H = frf_ipz.compute_frfs(machine, labels, 2j * np.pi * lines_hz)[:, :, None]
H = H + 1e-3 * np.random.default_rng(0).normal(size=(*H.shape, 2)).view(complex)[..., 0]
frfs = frf_ipz.FrfSet.from_arrays(lines_hz, H, outputs=outputs, inputs=inputs, variance=np.full(H.shape, 2e-6))

# %%
# Mass 2 carries the tool, and no sensor. The springs are known to a tenth: such a difference is nothing missing.
tolerances = frf_ipz.DiagnoseOptions(stiffness_tolerance=0.1, frequency_tolerance=0.05)
results = frf_ipz.Campaign(frfs, model, points=["2:+x"], diagnose=tolerances).run(until="export")
print(results.summary())

# %%
# The state space, in memory too: a python-control system with the names of the DOFs.
system = results.state_space
print(system.nstates, "states; inputs", system.input_labels, "outputs", system.output_labels)

# %%
# Its response at the tool is the prediction, which has a band of 90 %.
prediction = results.prediction
tool = system[system.output_labels.index("2:+x"), 0]
response = tool.frequency_response(2 * np.pi * prediction.frequency_hz).complex
true = frf_ipz.compute_frfs(machine, prediction.labels, 2j * np.pi * prediction.frequency_hz)
figure, axes = plt.subplots(layout="constrained")
axes.semilogy(prediction.frequency_hz, abs(true), color="0.7", linewidth=4, label="machine")
axes.semilogy(prediction.frequency_hz, abs(prediction.nominal), "--", label="model")
axes.semilogy(prediction.frequency_hz, abs(response), label="state space of the updated model")
band = prediction.magnitude_low[:, 0], prediction.magnitude_high[:, 0]
axes.fill_between(prediction.frequency_hz, *band, color="C1", alpha=0.3, label="90 % band")
axes.set(xlabel="Frequency, Hz", ylabel="Accelerance, m/s²/N", title=str(prediction.labels[0]))
axes.legend()
plt.show()
