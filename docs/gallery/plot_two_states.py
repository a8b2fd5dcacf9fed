"""
What changed between two tests?
===============================

A machine is measured as it should be, and again after something happened. The FE model is only roughly right.
"""

import matplotlib.pyplot as plt
import numpy as np

import frf_ipz

# %%
# The model states a modulus that is 4 % too high. In the second test 15 g sit at node 12.
drawing = {
    "length_m": 0.5, "width_m": 0.025, "thickness_m": 0.006, "density_kg_m3": 2700, "elements": 20, "left": "clamped",
    "modal_ratio": 0.005,
}  # fmt: skip
fe_model = frf_ipz.make_beam(**drawing, youngs_modulus_Pa=72.8e9)
before = frf_ipz.make_beam(**drawing, youngs_modulus_Pa=70e9)
after = frf_ipz.make_beam(**drawing, youngs_modulus_Pa=70e9, point_mass=[frf_ipz.BeamPointMass(node=12, mass_kg=0.015)])

# %%
# Each test: two FRFs, with noise of its own.
lines_hz = np.arange(8.0, 500.0, 0.5)
outputs, inputs = ["21:+z", "9:+z"], ["17:+z"]
quantity = frf_ipz.FrfQuantity.ACCELERANCE
labels = [frf_ipz.FrfLabel(frf_ipz.parse_dof(dof), frf_ipz.parse_dof("17:+z"), quantity) for dof in outputs]


def measure(machine, seed):
    """FRFs of a machine as a state of it."""
    exact = frf_ipz.compute_frfs(machine, labels, 2j * np.pi * lines_hz)
    deviation = 0.01 * np.median(abs(exact))
    parts = np.random.default_rng(seed).normal(scale=deviation / np.sqrt(2), size=(2, *exact.shape))
    frfs = frf_ipz.FrfSet.from_arrays(
        lines_hz, (exact + parts[0] + 1j * parts[1])[:, :, None], outputs=outputs, inputs=inputs,
        variance=np.full((*exact.shape, 1), deviation**2),
    )  # fmt: skip
    observed = frf_ipz.observe(frf_ipz.VibrationTest.from_frfs(frfs), frfs=frfs)
    return frf_ipz.MachineState(observed=observed, fe_model=fe_model)


# %%
# First the same machine twice, then the changed one. What the model is wrong by is learnt from the state before.
options = frf_ipz.CompareOptions(effects=("added_mass", "local_stiffness", "grounded_spring"))
healthy = measure(before, 1)
print(frf_ipz.compare_states(healthy, measure(before, 2), options=options).statement)
changed = measure(after, 3)
comparison = frf_ipz.compare_states(healthy, changed, options=options)
print(comparison.statement)

# %%
figure, axes = plt.subplots(layout="constrained")
for name, state in (("before", healthy), ("after", changed)):
    axes.semilogy(lines_hz, abs(state.observed.frfs.values[:, 0]), label=name)
axes.set(xlabel="Frequency, Hz", ylabel="Accelerance, m/s²/N", title="Two tests of one machine")
axes.legend()
plt.show()
