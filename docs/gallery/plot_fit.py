"""
FRFs of a hammer test and their fit
===================================

From recordings to FRFs with their coherence, and from FRFs to poles with standard deviations.
"""

# %%
# Recordings into FRFs: five impacts at two points of a cantilever.

from pathlib import Path

import frf_ipz

data = next(folder for folder in Path.cwd().resolve().parents if (folder / "data" / "raw").is_dir()) / "data" / "raw"
test = frf_ipz.read_test(data / "cantilever" / "test.toml")
estimate = frf_ipz.estimate_frfs(test)
print(estimate)

# %%
# The poles of the band, each with its standard deviation, and the fit over what was measured.

fit = frf_ipz.fit_modes(estimate.frfs, options=frf_ipz.FitOptions(band_hz=(10.0, 700.0)))
print(fit)
frf_ipz.plotting.plot_fit(estimate.frfs, fit)
