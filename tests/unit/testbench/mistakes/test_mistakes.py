"""Simulated mistakes change what they say, and nothing else."""

import numpy as np
import pandas as pd
import pytest

from frf_testbench.mistakes.campaign_files import CampaignFiles
from frf_testbench.mistakes.mistakes import MISTAKES

TEST = """[test]
kind = "hammer"

[[channel]]
column = "force"
role = "input"
quantity = "force"
unit = "N"

[[channel]]
column = "acc_1"
role = "output"
quantity = "acceleration"
unit = "m/s^2"
dof = "4:+z"

[[channel]]
column = "acc_2"
role = "output"
quantity = "acceleration"
unit = "m/s^2"
dof = "9:-z"

[[hit]]
dof = "4:+z"
files = ["hits/p4_*.csv"]

[[hit]]
dof = "7:+z"
files = ["hits/p7_*.csv"]
"""
BEAM = """[model]
kind = "beam"
[beam]
length_m = 0.5
elements = 20
youngs_modulus_Pa = 7e10
density_kg_m3 = 2700.0
thickness_m = 0.005
left = "clamped"
right = "free"
"""
MATRICES = '[model]\nkind = "matrices"\n'
MATRIX = "%%MatrixMarket matrix coordinate real symmetric\n2 2 2\n1 1 3.0\n2 2 5.0\n"
NEEDS_MATRICES = {"matrices in mm, t, s", "mass in t", "stiffness in N/mm"}
BY_NAME = {mistake.name: mistake for mistake in MISTAKES}


def campaign(folder, model):
    folder.mkdir(parents=True)
    (folder / "test.toml").write_text(TEST, encoding="utf-8")
    (folder / "model.toml").write_text(model, encoding="utf-8")
    (folder / "pipeline.toml").write_text('[predict]\npoints = ["12:+z"]\n', encoding="utf-8")
    for name in ("M.mtx", "K.mtx"):
        (folder / name).write_text(MATRIX, encoding="utf-8")
    (folder / "hits").mkdir()
    rng = np.random.default_rng(0)
    for name in ("p4_1.csv", "p7_1.csv"):
        table = pd.DataFrame(rng.normal(size=(5, 3)), columns=["force", "acc_1", "acc_2"])
        table.insert(0, "time", np.arange(5) * 0.001)
        table.to_csv(folder / "hits" / name, index=False)
    return CampaignFiles(folder)


def contents(files):
    return {path.name: path.read_text(encoding="utf-8") for path in sorted(files.folder.rglob("*")) if path.is_file()}


@pytest.mark.parametrize("name", BY_NAME)
def test_a_mistake_changes_its_own_files_only(tmp_path, name):
    files = campaign(tmp_path / "case", MATRICES if name in NEEDS_MATRICES else BEAM)
    before = contents(files)
    assert BY_NAME[name].apply(files, np.random.default_rng(1))
    changed = {file for file, text in contents(files).items() if text != before[file]}
    assert changed
    kinds = {".csv", ".toml"} if BY_NAME[name].file == "test.toml" else {".toml", ".mtx"}
    assert {f".{file.rsplit('.')[-1]}" for file in changed} <= kinds
    assert not {"pipeline.toml"} & changed


@pytest.mark.parametrize("name", sorted(NEEDS_MATRICES))
def test_a_mistake_that_cannot_be_made_says_so_and_changes_nothing(tmp_path, name):
    files = campaign(tmp_path / "case", BEAM)
    before = contents(files)
    assert not BY_NAME[name].apply(files, np.random.default_rng(1))
    assert contents(files) == before


def test_values_are_scaled_where_they_stand(tmp_path):
    files = campaign(tmp_path / "case", BEAM)
    BY_NAME["modulus in GPa"].apply(files, np.random.default_rng(1))
    assert "youngs_modulus_Pa = 70.0" in files.model.replace("70.00000000000001", "70.0")
