"""Studies find on small made measurements what was put into them."""

import zipfile
from dataclasses import replace

import numpy as np
import pytest

import frf_ipz
from frf_ipz.progress import silent
from frf_testbench.studies import beam_physics, silverbox
from frf_testbench.studies import cantilever_masses as masses
from frf_testbench.studies.double_beam_ringdown import study_double_beam_ringdown
from frf_testbench.studies.left_out import study_left_out

MODEL = """
[model]
kind = "beam"
name = "made beam"
[damping]
modal_ratio = 0.01
[beam]
length_m = 0.5
elements = 20
formulation = "euler-bernoulli"
youngs_modulus_Pa = {modulus}
density_kg_m3 = 8000.0
width_m = 0.02
thickness_m = 0.002
left = "free"
right = "free"
"""
TEST = """
[test]
name = "made beam"
kind = "frf"
[[frf]]
file = "frf.csv"
quantity = "receptance"
"""


def write_beam(folder, modulus):
    """A folder like that of the steel beam: three sensors, two actuators, and a beam that is stiffer than drawn."""
    folder.mkdir()
    real = folder / "real.toml"
    real.write_text(MODEL.format(modulus=modulus), encoding="utf-8")
    (folder / "model.toml").write_text(MODEL.format(modulus=200e9), encoding="utf-8")
    (folder / "test.toml").write_text(TEST, encoding="utf-8")
    f = np.arange(10.0, 620.0, 0.5)
    labels = [
        frf_ipz.FrfLabel(frf_ipz.Dof(out, "z"), frf_ipz.Dof(struck, "z"), frf_ipz.FrfQuantity.RECEPTANCE)
        for out in (3, 9, 15)
        for struck in (3, 19)
    ]
    values = frf_ipz.compute_frfs(frf_ipz.read_model(real), labels, 2j * np.pi * f)
    random = np.random.default_rng(1)
    values = values + 1e-3 * np.median(np.abs(values)) * (random.normal(size=values.shape) + 1j)
    lines = ["frequency_hz,output_dof,input_dof,real,imag"]
    lines += [
        f"{hertz},{label.output_dof},{label.input_dof},{value.real:.8g},{value.imag:.8g}"
        for label, column in zip(labels, values.T, strict=True)
        for hertz, value in zip(f, column, strict=True)
    ]
    (folder / "frf.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


def test_a_sensor_that_was_left_out_is_predicted(tmp_path):
    fractions = []

    def show(fraction, text):
        fractions.append(fraction)
        assert text.startswith("predicting node")

    folder = write_beam(tmp_path / "steel_beam_5x3", 215e9)
    (table,) = study_left_out(folder, progress=show).values()
    assert sorted(set(table.index.get_level_values("node"))) == [3, 9, 15]
    updated, nominal = (table.xs(name, level="model") for name in ("updated", "nominal"))
    assert np.all(updated["dB"] < 0.5)
    assert np.all(nominal["dB"] > 2 * updated["dB"])
    assert np.allclose(updated["factor"].astype(float), 1, atol=0.05)
    assert fractions == sorted(fractions)


def test_the_frequency_that_falls_with_amplitude_is_found(tmp_path):
    """The first mode loses 0.6 Hz per m/s, the second one nothing."""
    time = np.arange(5120) / 5120
    for number in range(1, 13):
        first = (0.5 + 0.04 * number) * np.exp(-2 * np.pi * 122.5 * 0.001 * time)
        second = 0.5 * np.exp(-2 * np.pi * 243.6 * 0.0025 * time)
        phase = 2 * np.pi * np.cumsum(122.5 - 0.6 * first) / 5120
        velocity = first * np.cos(phase) + second * np.cos(2 * np.pi * 243.6 * time)
        rows = "\n".join(f"{t:.8f},{v:.8f}" for t, v in zip(time, velocity, strict=True))
        (tmp_path / f"ringdown_{number:02}.csv").write_text(f"time,velocity_m_s\n{rows}\n", encoding="utf-8")
    laws, families = study_double_beam_ringdown(tmp_path).values()
    first = laws[(laws["mode"] == 1) & (laws["quantity"] == "frequency_hz")].iloc[0]
    assert first["offset"] == pytest.approx(122.5, abs=0.01)
    assert first["change"] == pytest.approx(-0.6, rel=0.05)
    assert first["power_low"] < 1.05
    assert first["power_high"] > 0.95
    assert families["family"][0].startswith("softening")
    second = laws[(laws["mode"] == 2) & (laws["quantity"] == "frequency_hz")].iloc[0]
    assert second["at_weakest"] == pytest.approx(243.6, abs=0.05)
    assert second["at_strongest"] == pytest.approx(243.6, abs=0.05)


def make_oscillator(n, cubic):
    """Force and motion of a hardening oscillator like the Silverbox, whose level grows: small explicit steps."""
    random, mass, stiffness = np.random.default_rng(5), 1 / (2 * np.pi * 68) ** 2, 1.0
    damping, finer = 2 * 0.05 * np.sqrt(mass * stiffness), 8
    spectrum = np.fft.rfft(random.normal(size=n))
    spectrum[np.fft.rfftfreq(n, 1 / silverbox.RATE_HZ) > 150] = 0
    force = 0.1 * np.linspace(0, 1, n) * np.fft.irfft(spectrum, n) / np.std(np.fft.irfft(spectrum, n))
    fine = np.fft.irfft(np.fft.rfft(force), n * finer) * finer
    step, x, v, motion = 1 / silverbox.RATE_HZ / finer, 0.0, 0.0, np.zeros(n * finer)
    for index, f in enumerate(fine):
        motion[index] = x
        v += step * (f - damping * v - stiffness * x - cubic * x**3) / mass
        x += step * v
    return force, motion[::finer]


def test_the_weak_oscillator_is_fitted():
    force, motion = make_oscillator(8000, 0.0)
    mass, damping, stiffness = silverbox.fit_linear_oscillator(force, motion)
    assert np.sqrt(stiffness / mass) / (2 * np.pi) == pytest.approx(68, rel=0.01)
    assert damping / (2 * np.sqrt(mass * stiffness)) == pytest.approx(0.05, rel=0.1)


@pytest.mark.slow
def test_the_cubic_spring_of_an_oscillator_is_found(tmp_path):
    force, motion = make_oscillator(40600, 4.0)
    random = np.random.default_rng(6)
    rows = np.stack([force, motion + 1e-5 * random.normal(size=len(motion))]).T
    np.savetxt(tmp_path / "SNLS80mV.csv", rows, delimiter=",", header="V1,V2", comments="")
    weak, laws = silverbox.study_silverbox(tmp_path).values()
    assert weak["frequency_hz"][0] == pytest.approx(68, rel=0.02)
    assert laws.loc["law", "catalogue"] == "cubic_stiffness"
    assert laws.loc["k3 / k1, 1/V^2", "catalogue"] == pytest.approx(4.0, rel=0.1)


@pytest.mark.slow
def test_a_mass_that_the_model_lacks_is_the_first_cause(monkeypatch):
    monkeypatch.setattr(beam_physics, "MOST_CAUSES", 1)
    drawn = {"length_m": 0.5, "width_m": 0.02, "thickness_m": 0.002, "youngs_modulus_Pa": 200e9}
    drawn |= {"density_kg_m3": 8000.0, "elements": 20, "modal_ratio": 0.01}
    real = frf_ipz.make_beam(**drawn, point_mass=[frf_ipz.BeamPointMass(node=15, mass_kg=0.02)])
    f = np.arange(20.0, 300.0, 0.5)
    labels = [
        frf_ipz.FrfLabel(frf_ipz.Dof(out, "z"), frf_ipz.Dof(3, "z"), frf_ipz.FrfQuantity.RECEPTANCE)
        for out in (3, 9, 19)
    ]
    values = frf_ipz.compute_frfs(real, labels, 2j * np.pi * f)
    frfs = frf_ipz.FrfSet.from_arrays(
        f, values[:, :, None], outputs=["3:+z", "9:+z", "19:+z"], inputs=["3:+z"], quantity="receptance",
        variance=(0.003 * np.abs(values[:, :, None])) ** 2, unknown_scale="per_channel",
    )  # fmt: skip
    beam = beam_physics.BeamTest(frfs=frfs, fe_model=frf_ipz.make_beam(**drawn), band_hz=(20.0, 300.0), side="output")
    known = replace(beam_physics.TESTS["steel_beam_5x3"], left_out=19)
    causes, before, after, predicted = beam_physics.explain_beam(beam, known).values()
    assert len(causes) == 2
    assert "mass" in causes["cause"][1]
    assert causes["log Bayes factor"][1] > 100
    assert before.iloc[:, 1:].to_numpy().max() > 5 * after.iloc[:, 1:].to_numpy().max()
    dB = predicted.xs("nominal", level="model")["dB"]
    assert dB[1] < 0.2 * dB[0]


SETUP = masses.Setup(in_clamp_m=0.016, modulus_pa=2.0e11, piece=0.025, sensor=0.06, to_middle_m=0.0045)
LAYOUTS_M = 0.05 + 0.05 * np.arange(6) + 0.01 * np.array([[0], [0.7], [1.6], [2.5]])


def write_frf(path, setup, layout):
    """FRF of a layout as the analyser wrote it: Hz, dB, degrees, through a lowpass' inverse."""
    made = masses.build_layout(setup, layout)
    f = np.arange(1.0, 900.0, 0.5)
    label = frf_ipz.FrfLabel(
        frf_ipz.Dof(made.sensor, "z"), frf_ipz.Dof(made.struck, "z"), frf_ipz.FrfQuantity.ACCELERANCE
    )
    values = frf_ipz.compute_frfs(made.fe_model, [label], 2j * np.pi * f)[:, 0] * (1 + 1j * f / masses.CORNER_HZ)
    table = np.stack([f, 20 * np.log10(np.abs(values)), np.rad2deg(np.angle(values))]).T
    np.savetxt(path, table, header="Hz dB degrees", comments="")
    return made


def test_the_resonances_of_a_layout_are_read(tmp_path):
    made = write_frf(tmp_path / "P-1.txt", SETUP, LAYOUTS_M[0])
    natural = frf_ipz.solve_modes(made.fe_model, n_modes=4).natural_frequency_hz[1:4]
    assert masses.find_resonances(tmp_path / "P-1.txt") == pytest.approx(natural, rel=1e-3)


def test_layouts_are_read_from_the_sheet(tmp_path):
    cells = "".join(
        f'<c r="{column}{row}"><v>{5 + number + row / 100}</v></c>'
        for row in range(3, 73)
        for number, column in enumerate("BCDEFG")
    )
    sheet = f'<worksheet xmlns="{masses.SHEET.strip("{}")}"><row>{cells}</row></worksheet>'
    with zipfile.ZipFile(tmp_path / "mass_positions.xlsx", "w") as book:
        book.writestr("xl/worksheets/sheet1.xml", sheet)
    layouts = masses.read_layouts(tmp_path)
    assert layouts.shape == (70, 6)
    assert layouts[0] == pytest.approx([0.0503, 0.0603, 0.0703, 0.0803, 0.0903, 0.1003])


@pytest.mark.slow
def test_what_layouts_share_is_calibrated():
    resonances = [
        frf_ipz.solve_modes(masses.build_layout(SETUP, layout, exact=True).fe_model, n_modes=4)
        .natural_frequency_hz[1:4]
        for layout in LAYOUTS_M
    ]  # fmt: skip
    setup = masses.calibrate(list(LAYOUTS_M), resonances)
    fitted = [
        frf_ipz.solve_modes(masses.build_layout(setup, layout, exact=True).fe_model, n_modes=4)
        .natural_frequency_hz[1:4]
        for layout in LAYOUTS_M
    ]  # fmt: skip
    start = frf_ipz.solve_modes(masses.build_layout(masses.START, LAYOUTS_M[0], exact=True).fe_model, n_modes=4)
    assert np.abs(start.natural_frequency_hz[1:4] / resonances[0] - 1).max() > 0.02
    assert np.array(fitted) == pytest.approx(np.array(resonances), rel=0.01)


@pytest.mark.slow
def test_pieces_that_lost_mass_are_found_in_all_layouts_together(tmp_path):
    states, after = [], {}
    for number, layout in enumerate(LAYOUTS_M):
        path = tmp_path / f"P-{number + 1}.txt"
        made = write_frf(path, SETUP, layout)
        states.append(masses.read_state(path, made))
    path = tmp_path / "P-1-1.txt"
    write_frf(path, replace(SETUP, piece=0.02), LAYOUTS_M[3])
    made = masses.build_layout(SETUP, LAYOUTS_M[3])
    after = {("healthy", 4): (states[3], made), ("second", 4): (masses.read_state(path, made), made)}
    each, together = masses.compare_layouts(states[:3], after, progress=silent).values()
    healthy, second = each["verdict"]
    assert healthy == "consistent"
    assert second != "consistent"
    assert together["second"].max() > 10
    assert together["healthy"].max() < 3
