"""The demo campaign can be made again, and tells what its README says."""

import hashlib
import re

import numpy as np
import pandas as pd
import pytest
from make_cantilever import (
    ACCELERATION_RANGE,
    BITS,
    DATA,
    FORCE_RANGE_N,
    IMPACTS,
    build_receptance,
    compute_reference_frf,
    simulate_record,
)
from numpy.testing import assert_allclose

CAMPAIGN = DATA / "raw" / "cantilever"


@pytest.mark.parametrize("name", ["p89_04", "p69_03"])
def test_an_impact_made_again_is_the_one_that_is_stored(name):
    stored = pd.read_csv(CAMPAIGN / "hits" / f"{name}.csv")
    for column, full_scale in (("force", FORCE_RANGE_N), ("acc_tip", ACCELERATION_RANGE)):
        step = full_scale / 2 ** (BITS - 1)  # another linear algebra library may round to the next step
        assert_allclose(simulate_record(name)[column], stored[column], rtol=1e-5, atol=1.01 * step)


def test_the_frf_kept_aside_is_the_one_that_is_stored():
    stored = (DATA / "reference" / "cantilever_poi_frf.csv").read_text(encoding="utf-8").splitlines()
    made = compute_reference_frf()
    assert len(stored) == len(made)
    for i in (1, 1500, 5000, 8000):
        for a, b in zip(stored[i].split(",")[3:], made[i].split(",")[3:], strict=True):
            assert_allclose(float(a), float(b), rtol=1e-5)  # seven digits are stored


def test_recorded_impacts_give_the_accelerance_of_the_beam():
    table = pd.read_csv(CAMPAIGN / "hits" / "p89_03.csv")
    sigma = 8 / 4.0
    window = np.exp(-sigma * table["time"])
    quiet = table["force"].where(table["time"] < 0.05, 0.0)
    ratio = np.fft.rfft(table["acc_tip"] * window) / np.fft.rfft(quiet * window)
    s = sigma + 2j * np.pi * np.arange(ratio.size) / 4.0
    model, rows = build_receptance()
    truth = (s**2 * model(s, [0], [rows[89]])[:, 0, 0])[40:2801]  # 10 to 700 Hz
    error = np.linalg.norm(ratio[40:2801] - truth) / np.linalg.norm(truth)
    assert error < 0.02  # gains of 0.3 and 0.2 %, position, noise and quantisation of one impact


def test_the_readme_states_the_checksums_of_all_files():
    text = (DATA / "README.md").read_text(encoding="utf-8")
    lines = re.findall(r"^([0-9a-f]{64})  (\S+)$", text, flags=re.MULTILINE)
    stated = {path: digest for digest, path in lines}
    files = {f"raw/cantilever/hits/{name}.csv" for name in IMPACTS} | {"reference/cantilever_poi_frf.csv"}
    assert set(stated) == files
    for path, digest in stated.items():
        assert hashlib.sha256((DATA / path).read_bytes()).hexdigest() == digest, path
