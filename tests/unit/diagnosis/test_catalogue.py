"""Effects are found by themselves, and users' own files are read with care."""

from pathlib import Path

import pytest

from frf_ipz.diagnosis.catalogue.finder import chosen_effects, shipped_effects
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.errors import InputError

LINEAR = {
    "boundary_compliance", "added_mass", "local_stiffness", "global_stiffness", "grounded_spring", "coupling_spring",
    "attached_resonator", "axial_load", "shear_rotary_inertia", "damping_level", "local_damper", "structural_damping",
    "viscoelastic_joint", "time_delay", "sensor_dynamics", "sensor_gain", "sensor_misplaced",
}  # fmt: skip


def test_all_linear_effects_of_the_contract_are_shipped():
    assert set(shipped_effects()) == LINEAR


def test_imitators_are_effects():
    for effect in shipped_effects().values():
        assert set(effect.imitators) <= LINEAR
        assert effect.name not in effect.imitators


def test_only_chosen_effects_are_looked_for():
    assert set(chosen_effects(DiagnoseOptions(effects=("added_mass",)), Path())) == {"added_mass"}


@pytest.mark.parametrize(
    ("reference", "content", "problem"),
    [
        ("mine.py", "", "file.py:ClassName"),
        ("other.py:Mine", "", "no file"),
        ("mine.py:Mine", "x = (", "SyntaxError"),
        ("mine.py:Mine", "x = 1", "no effect 'Mine'"),
    ],
)
def test_a_bad_file_of_the_user_is_refused(tmp_path, reference, content, problem):
    (tmp_path / "mine.py").write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=problem):
        chosen_effects(DiagnoseOptions(extra_effects=(reference,)), tmp_path)
