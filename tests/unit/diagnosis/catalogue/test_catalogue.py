"""Effects are found by themselves, and users' own files are read with care."""

from pathlib import Path

import pytest

from frf_ipz.diagnosis.catalogue.finder import shipped_effects
from frf_ipz.diagnosis.effect_selection import EffectCatalogue
from frf_ipz.diagnosis.nonlinear.laws.finder import select_laws
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.errors import InputError

LINEAR = {
    "boundary_compliance", "added_mass", "local_stiffness", "global_stiffness", "grounded_spring", "coupling_spring",
    "attached_resonator", "axial_load", "shear_rotary_inertia", "damping_level", "local_damper", "structural_damping",
    "viscoelastic_joint", "time_delay", "sensor_dynamics", "sensor_gain", "sensor_misplaced",
}  # fmt: skip

USERS_LAW = """
from frf_ipz.diagnosis.nonlinear.laws.law import Law


class SquareDrag(Law):
    name = "square_drag"
    strength_name = "drag_Ns2_m2"

    def unit_force(self, w, v, shape):
        return v * abs(v)
"""


def test_all_linear_effects_of_the_contract_are_shipped():
    assert set(shipped_effects()) == LINEAR


def test_only_chosen_effects_are_looked_for():
    assert set(EffectCatalogue(options=DiagnoseOptions(effects=("added_mass",)), folder=Path()).effects()) == {
        "added_mass"
    }


@pytest.mark.parametrize("name", ["cubic_stiffness", "gap_contact", "dry_friction"])
def test_a_force_law_can_be_chosen_alone(name):
    options = DiagnoseOptions(effects=(name,))
    assert EffectCatalogue(options=options, folder=Path()).effects() == {}
    assert [law.name for law in select_laws(options)] == [name]


def test_force_laws_can_be_left_out():
    assert select_laws(DiagnoseOptions(effects=("added_mass",))) == ()


def test_an_unknown_effect_is_refused_with_the_nearest_one():
    with pytest.raises(InputError, match="cubic_stiffness"):
        EffectCatalogue(options=DiagnoseOptions(effects=("cubic_stifness",)), folder=Path()).effects()


def test_a_users_force_law_is_looked_for(tmp_path):
    (tmp_path / "mine.py").write_text(USERS_LAW, encoding="utf-8")
    options = DiagnoseOptions(effects=("added_mass",), extra_effects=("mine.py:SquareDrag",))
    assert set(EffectCatalogue(options=options, folder=tmp_path).effects()) == {"added_mass"}
    assert [law.name for law in EffectCatalogue(options=options, folder=tmp_path).laws()] == ["square_drag"]


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
        EffectCatalogue(options=DiagnoseOptions(extra_effects=(reference,)), folder=tmp_path).effects()
