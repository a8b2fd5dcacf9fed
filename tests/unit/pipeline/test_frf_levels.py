"""FRFs that an analyser gives at several levels of excitation: the weakest is fitted, the others show what moves."""

import re

import numpy as np
import pytest

import frf_ipz
from frf_ipz.errors import FileFormatError

FREQUENCY_HZ = np.arange(5.0, 120.0, 0.1)
# N, and natural frequencies, Hz: the first falls, at last farther from where it began than a mode is looked for
LEVELS = {0.1: (30.0, 80.0), 0.3: (29.4, 80.0), 1.0: (27.2, 80.0), 3.0: (24.8, 80.0)}
RATIO, NOISE = 0.01, 1e-3


def accelerance(frequencies):
    s = 2j * np.pi * FREQUENCY_HZ
    poles = [2 * np.pi * hertz * complex(-RATIO, np.sqrt(1 - RATIO**2)) for hertz in frequencies]
    return sum(s**2 / ((s - pole) * (s - np.conj(pole))) for pole in poles)


def write_files(folder, levels=LEVELS, *, stated=True):
    rng = np.random.default_rng(1)
    text = '[test]\nkind = "frf"\n'
    for place, (level, frequencies) in enumerate(levels.items()):
        values = accelerance(frequencies)
        values = values + NOISE * np.abs(values) * (rng.standard_normal((2, len(values))).T @ [1, 1j])
        pairs = zip(FREQUENCY_HZ, values, strict=True)
        rows = [f"{hertz},3:+z,5:+z,{value.real},{value.imag}" for hertz, value in pairs]
        name = f"at_{place}.csv"
        (folder / name).write_text("\n".join(["frequency_hz,output_dof,input_dof,real,imag", *rows]) + "\n")
        text += f'[[frf]]\nfile = "{name}"\nquantity = "accelerance"\n' + (f"level = {level}\n" if stated else "")
    (folder / "test.toml").write_text(text)
    (folder / "pipeline.toml").write_text('[pipeline]\nname = "levels"\ntest = "test.toml"\n')
    return folder / "pipeline.toml"


def test_the_weakest_is_fitted_and_the_others_show_which_mode_moves(tmp_path):
    results = frf_ipz.run_pipeline(write_files(tmp_path), tmp_path / "out")
    assert np.abs(results.fit.model.poles[:2]) / (2 * np.pi) == pytest.approx(LEVELS[0.1], rel=1e-4)
    assert any(re.search(r"4 levels, 0.1 to 3 N", text) for text in results.estimate.warnings)
    modes = results.level_dependence.modes
    for mode, place in ((0, 0), (1, 1)):
        rows = modes[modes["mode"] == mode].sort_values("level_N")
        assert rows["level_N"].tolist() == list(LEVELS)
        assert rows["frequency_hz"].to_numpy() == pytest.approx([hertz[place] for hertz in LEVELS.values()], rel=1e-4)
        assert rows["damping_ratio"].to_numpy() == pytest.approx(RATIO, rel=0.02)
    assert 'id="level-modes"' in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert results.level_dependence.weak_N.tolist() == [0.1]
    assert results.level_dependence.strong_N.tolist() == [3.0]


def test_one_level_is_a_test_as_ever(tmp_path):
    results = frf_ipz.run_pipeline(write_files(tmp_path, {0.1: LEVELS[0.1]}), tmp_path / "out")
    assert results.level_dependence is None
    assert not any("levels" in text for text in results.estimate.warnings)


def test_the_same_frf_twice_without_levels_names_the_key(tmp_path):
    with pytest.raises(FileFormatError, match=r"at_1\.csv.*holds already.*'level'"):
        frf_ipz.run_pipeline(write_files(tmp_path, stated=False), tmp_path / "out")
