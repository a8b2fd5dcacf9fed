"""A model that has no mode in the band is left as it was: every file is written, and the run says so."""

import json

import numpy as np
import pandas as pd
import pytest

import frf_ipz
from frf_ipz.export.run_tables import FILES, frame_table
from frf_ipz.runs.summary import summarise

BEAM = {
    "length_m": 0.5,
    "width_m": 0.02,
    "thickness_m": 0.005,
    "density_kg_m3": 2700,
    "elements": 10,
    "left": "clamped",
    "modal_ratio": 0.01,
}
LINES_HZ = np.arange(5, 400.0, 0.5)


@pytest.fixture(scope="module")
def frfs():
    beam = frf_ipz.make_beam(**BEAM, youngs_modulus_Pa=70e9)
    tip, middle = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
    labels = [frf_ipz.FrfLabel(dof, tip, frf_ipz.FrfQuantity.ACCELERANCE) for dof in (middle, tip)]
    values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * LINES_HZ)[:, :, None]
    noise = 1e-3 * np.random.default_rng(1).standard_normal((*values.shape, 2)).view(complex)[..., 0]
    return frf_ipz.FrfSet.from_arrays(
        LINES_HZ, values + noise, outputs=[middle, tip], inputs=[tip], variance=np.full(values.shape, 2e-6)
    )


@pytest.mark.parametrize("method", ["minimal-change", "ipz"])
def test_a_model_without_a_mode_in_the_band_is_exported_as_it_is(frfs, method, tmp_path):
    too_stiff = frf_ipz.make_beam(**BEAM, youngs_modulus_Pa=70e12)
    results = frf_ipz.Campaign(
        frfs,
        too_stiff,
        points=["9:+z"],
        update=frf_ipz.UpdateOptions(method=method),
        export=frf_ipz.ExportOptions(ensemble=3),
        diagnose=frf_ipz.DiagnoseOptions(run="never"),
    ).run(tmp_path / "run")
    updated = results.updated_model
    assert updated.status is frf_ipz.UpdateStatus.NOTHING_TO_DO
    np.testing.assert_array_equal(updated.model.stiffness, updated.nominal.stiffness)
    history = pd.read_parquet(tmp_path / "run" / "parameters.parquet")
    assert len(history) == 0
    assert list(history.columns) == ["phase", "iteration", "misfit", "step"]
    text = summarise(results)
    assert "there is no target in the band" in text
    assert "the model is left as it was" in text
    s = 2j * np.pi * np.array([2.0, 20.0])
    expected = frf_ipz.compute_frfs(
        too_stiff, [frf_ipz.FrfLabel(frf_ipz.Dof(9, "z"), frf_ipz.Dof(11, "z"), frf_ipz.FrfQuantity.ACCELERANCE)], s
    )[:, 0]
    exported = json.loads((tmp_path / "run" / "statespace.json").read_text("utf-8"))
    place = exported["output_names"].index("9:+z")
    A, B, C, D = (np.array(exported[name], float) for name in "ABCD")
    values = [(C @ np.linalg.solve(root * np.eye(len(A)) - A, B) + D)[place, 0] for root in s]
    np.testing.assert_allclose(values, expected, rtol=1e-4)  # residual flexibility in place of the modes far above


@pytest.mark.parametrize("name", FILES)
def test_every_table_of_a_run_takes_an_empty_result(name):
    """Pandas gives the columns of an empty frame the type of a float, or of an object."""
    for empty in (pd.DataFrame({column.name: [] for column in FILES[name]}), pd.DataFrame()):
        table = frame_table(empty, FILES[name])
        assert table.num_rows == 0
        by_name = {column.name: column.field.type for column in FILES[name]}
        assert all(field.type == by_name[field.name] for field in table.schema)
