"""Two states of a real cantilever: the study reads them as they are, and one comparison holds."""

import numpy as np
import pytest

import frf_ipz
from frf_ipz.diagnosis.compare.compare import judge
from frf_ipz.diagnosis.compare.learnt_nuisance import learn
from frf_testbench.studies import cantilever_masses as study

SETUP = study.Setup(in_clamp_m=0.01625, modulus_pa=2.0076e11, piece=0.0249, sensor=0.0628, to_middle_m=0.0045)
TAUGHT, NEW = (0, 16, 32, 48), 17  # layouts of the healthy state


@pytest.fixture(scope="module")
def folder(recordings):
    return recordings / "cantilever_masses"


def healthy(folder, layouts, number):
    return study.read_state(study.healthy_file(folder, number), study.build_layout(SETUP, layouts[number]))


def test_layouts_are_in_metres_from_the_clamp(folder):
    layouts = study.read_layouts(folder)
    assert layouts.shape == (70, 6)
    assert layouts[0] == pytest.approx([0.05, 0.10, 0.15, 0.20, 0.25, 0.30])
    assert np.all(np.diff(layouts, axis=1) > 0)


def test_less_mass_raises_the_resonances(folder):
    rise = [
        np.log(
            study.find_resonances(study.second_file(folder, number))
            / study.find_resonances(study.healthy_file(folder, number))
        )
        for number in range(0, 70, 7)
    ]
    assert np.all(np.median(rise, axis=0)[1:] > 0.005)


@pytest.mark.slow
def test_another_layout_of_the_healthy_state_has_not_changed(folder):
    layouts = study.read_layouts(folder)
    options = frf_ipz.CompareOptions(effects=study.EFFECTS)
    learned = learn([healthy(folder, layouts, number) for number in TAUGHT], options)
    assert not judge(learned, healthy(folder, layouts, NEW), options).is_changed
