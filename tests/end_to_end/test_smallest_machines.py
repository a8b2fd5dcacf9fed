"""Machines so small that a table has no row: one mass, two masses, FRFs without a zero."""

import json

import numpy as np
import pandas as pd
import pytest

import frf_ipz
from frf_ipz.runs.summary import summarise

LINES_HZ = np.arange(5.0, 150.0, 0.25)
ONE = ([(1, 2.0)], [("k1", (0, 1), 4e5)], ("1:+x",))
TWO = ([(1, 2.0), (2, 3.0)], [("k1", (0, 1), 2e5), ("k2", (1, 2), 1e5)], ("2:+x",))  # over 1:+x there is no zero


def lumped(folder, masses, springs, factor=1.0):
    text = '[model]\nkind = "lumped"\n[damping]\nmodal_ratio = 0.01\n[lumped]\ndirection = "x"\n'
    text += "".join(f"[[lumped.mass]]\nnode = {node}\nmass_kg = {mass}\n" for node, mass in masses)
    for name, nodes, stiffness in springs:
        text += f'[[lumped.spring]]\nid = "{name}"\nnodes = {list(nodes)}\nstiffness_N_m = {factor * stiffness}\n'
    path = folder / "model.toml"
    path.write_text(text)
    return frf_ipz.read_model(path)


@pytest.mark.parametrize("method", ["minimal-change", "ipz"])
@pytest.mark.parametrize("machine", [ONE, TWO], ids=["one mass", "two masses"])
def test_a_machine_without_zeros_goes_from_frfs_to_the_page(machine, method, tmp_path):
    masses, springs, outputs = machine
    truth = lumped(tmp_path, masses, springs, 0.97)
    labels = [
        frf_ipz.FrfLabel(frf_ipz.parse_dof(output), frf_ipz.parse_dof("1:+x"), "accelerance") for output in outputs
    ]
    values = frf_ipz.compute_frfs(truth, labels, 2j * np.pi * LINES_HZ)[:, :, None]
    values = values + 1e-3 * np.random.default_rng(2).standard_normal((*values.shape, 2)).view(complex)[..., 0]
    frfs = frf_ipz.FrfSet.from_arrays(
        LINES_HZ, values, outputs=list(outputs), inputs=["1:+x"], variance=np.full(values.shape, 2e-6)
    )
    campaign = frf_ipz.Campaign(
        frfs,
        lumped(tmp_path, masses, springs),
        points=["1:+x"],
        update=frf_ipz.UpdateOptions(method=method),
        export=frf_ipz.ExportOptions(ensemble=3 if method == "minimal-change" else 0),
    )
    results = campaign.run(tmp_path / "run")
    assert f"{len(masses)} of {len(masses)} measured poles" in summarise(results)
    assert len(pd.read_parquet(tmp_path / "run" / "poles.parquet")) == len(masses)
    updated = results.updated_model
    nominal = np.linalg.eigvals(np.linalg.solve(updated.nominal.mass, updated.nominal.stiffness))
    natural = np.linalg.eigvals(np.linalg.solve(updated.model.mass, updated.model.stiffness))
    np.testing.assert_allclose(np.sort(natural), 0.97 * np.sort(nominal), rtol=1e-3)
    assert np.shape(json.loads((tmp_path / "run" / "statespace.json").read_text("utf-8"))["A"])[0] >= 2 * len(masses)
    assert (tmp_path / "run" / "report.html").stat().st_size > 0
