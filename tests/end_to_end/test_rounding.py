"""Kernels of linear algebra round differently, and so do machines: no decision may hang on that."""

import json
import os
import subprocess
import sys

import pytest

KERNELS = ("Prescott", "Haswell")  # of OpenBLAS on x86
LEFT_OUT = """
import json, sys
from pathlib import Path
from frf_testbench.studies.left_out import predict_left_out, read_beam
print(json.dumps(predict_left_out(read_beam(Path(sys.argv[1])), int(sys.argv[2])).loc["updated"].to_dict()))
"""


@pytest.mark.slow
@pytest.mark.parametrize(("folder", "node"), [("steel_beam_5x3", 30)])
def test_a_prediction_is_the_same_with_other_kernels(recordings, folder, node):
    results = []
    for kernel in KERNELS:
        done = subprocess.run(
            [sys.executable, "-c", LEFT_OUT, str(recordings / folder), str(node)],
            env=os.environ | {"OPENBLAS_CORETYPE": kernel},
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode < 0:
            pytest.skip(f"this processor has no kernel {kernel}")
        assert done.returncode == 0, done.stderr
        results.append(json.loads(done.stdout))
    first, second = results
    assert first["X_S"] == pytest.approx(second["X_S"], abs=1e-6)
    assert first["dB after the factor"] == pytest.approx(second["dB after the factor"], abs=0.05)
    assert first["in the band"] == pytest.approx(second["in the band"], abs=0.02)
