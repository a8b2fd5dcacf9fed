"""
Diagnosis: a mass that hangs on a beam
======================================

A beam carries a mass that its FE model does not know. Where it sits and how large it is follow from two FRFs.
"""

import matplotlib.pyplot as plt
import numpy as np

import frf_ipz

# %%
# The machine: a clamped beam with 20 g at node 14. The FE model is the same without the mass.
drawing = {
    "length_m": 0.5, "width_m": 0.025, "thickness_m": 0.006, "youngs_modulus_Pa": 70e9, "density_kg_m3": 2700,
    "elements": 20, "left": "clamped", "modal_ratio": 0.005,
}  # fmt: skip
machine = frf_ipz.make_beam(**drawing, point_mass=[frf_ipz.BeamPointMass(node=14, mass_kg=0.02)])
fe_model = frf_ipz.make_beam(**drawing)

# %%
# Two measured FRFs, with noise.
lines_hz = np.arange(8.0, 500.0, 0.5)
outputs, inputs = ["21:+z", "9:+z"], ["17:+z"]
quantity = frf_ipz.FrfQuantity.ACCELERANCE
labels = [frf_ipz.FrfLabel(frf_ipz.parse_dof(dof), frf_ipz.parse_dof("17:+z"), quantity) for dof in outputs]
exact = frf_ipz.compute_frfs(machine, labels, 2j * np.pi * lines_hz)
random = np.random.default_rng(1)
deviation = 0.01 * np.median(abs(exact))
noise = deviation / np.sqrt(2) * (random.normal(size=exact.shape) + 1j * random.normal(size=exact.shape))
frfs = frf_ipz.FrfSet.from_arrays(
    lines_hz, (exact + noise)[:, :, None], outputs=outputs, inputs=inputs,
    variance=np.full((*exact.shape, 1), deviation**2),
)  # fmt: skip

# %%
# Three candidates are enough for a quick answer; without ``effects`` the whole catalogue is tried.
options = frf_ipz.DiagnoseOptions(effects=("added_mass", "grounded_spring", "global_stiffness"))
diagnosis = frf_ipz.diagnose(frfs, fe_model, options=options)
print(diagnosis.verdict)
print(diagnosis.statement)

# %%
# Put the finding into the model: it now meets the measurement.
corrected = frf_ipz.correct_model(diagnosis, fe_model)
figure, axes = plt.subplots(layout="constrained")
axes.semilogy(lines_hz, abs(frfs.values[:, 0]), color="0.7", linewidth=4, label="measured")
for name, model, style in (("FE model", fe_model, "--"), ("with the finding", corrected, "-")):
    axes.semilogy(lines_hz, abs(frf_ipz.compute_frfs(model, labels[:1], 2j * np.pi * lines_hz)), style, label=name)
axes.set(xlabel="Frequency, Hz", ylabel="Accelerance, m/s²/N", title=diagnosis.findings[0].effect.replace("_", " "))
axes.legend()
plt.show()
