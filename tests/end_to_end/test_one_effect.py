"""A search for one effect that sits nowhere in particular: it has no second location to be paired with."""

import frf_ipz
from mutated_inputs import write_inputs


def test_a_search_for_an_effect_without_a_location_ends(tmp_path):
    write_inputs(tmp_path, diagnosed=False)
    pipeline = tmp_path / "matrices" / "pipeline.toml"
    text = pipeline.read_text(encoding="utf-8").replace('run = "never"', 'effects = ["global_stiffness"]')
    pipeline.write_text(text, encoding="utf-8")
    results = frf_ipz.run_pipeline(pipeline, tmp_path / "out", until="diagnose")
    assert {finding.effect for finding in results.diagnosis.findings} <= {"global_stiffness"}
