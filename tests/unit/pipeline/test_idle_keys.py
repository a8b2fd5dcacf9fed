"""Keys that have no effect are named: those of recordings where there are none, and of models where there is none."""

import numpy as np
import pytest

import frf_ipz
from synthetic_campaign import Structure, impact, in_memory

LINES_HZ = np.arange(5.0, 250.0, 0.5)


def measured():
    structure = Structure()
    values = structure.accelerance(2j * np.pi * LINES_HZ)[:, :, None]
    return frf_ipz.FrfSet.from_arrays(
        LINES_HZ, values, outputs=["1:+z", "2:+z"], inputs=["7:+z"], variance=np.full(values.shape, 1e-6)
    )


def warnings_of(test, **options):
    campaign = frf_ipz.Campaign(test, diagnose=frf_ipz.DiagnoseOptions(run="never"), **options)
    return campaign.run(until="fit").estimate.warnings


def test_keys_of_recordings_have_no_effect_on_frfs():
    chosen = frf_ipz.IngestOptions(estimator="H2", force_window_s=0.01, drop=("a.csv",))
    expected = "[ingest] estimator, force_window_s, drop: no effect, as FRFs were estimated elsewhere"
    assert expected in warnings_of(measured(), ingest=chosen)
    assert not any("no effect" in text for text in warnings_of(measured()))


def test_impacts_are_not_cut_into_segments():
    test = in_memory([impact(Structure(), height=height) for height in (50.0, 80.0)])
    result = frf_ipz.estimate_frfs(test, options=frf_ipz.IngestOptions(segment_s=0.5, estimator="H2"))
    assert "[ingest] segment_s: no effect, as impacts are not cut into segments" in result.warnings


@pytest.mark.parametrize("files", [(), ("modes.csv",)])
def test_keys_of_stages_that_need_a_model_have_no_effect_without_one(files):
    texts = warnings_of(
        measured(),
        reduce=frf_ipz.ReduceOptions(modes=5),
        update=frf_ipz.UpdateOptions(alpha=0.2),
        export=frf_ipz.ExportOptions(pade_order=3, files=files),
    )
    assert "[reduce] modes; [update] alpha; [export] pade_order: no effect without an FE model" in texts
