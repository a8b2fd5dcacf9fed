"""Responses against closed formulas: no droop, no wrap-around."""

import numpy as np
from numpy.testing import assert_allclose

from frf_testbench.simulator.effects.dissipative import make_lossy_modulus
from frf_testbench.simulator.signals.channels import AntiAlias, Noise, quantise
from frf_testbench.simulator.signals.forces import Impact, draw_impacts
from frf_testbench.simulator.signals.laplace import LaplaceGrid
from frf_testbench.simulator.signals.receptance import Attachment, ModalReceptance

EXACT = 1e-4  # what comes round after twice the length of the record


def oscillator(frequency_hz, ratio, attachments=()):
    return ModalReceptance(
        omega_rad_s=2 * np.pi * np.array([frequency_hz]), damping_ratio=np.array([ratio]), shapes=np.ones((1, 1)),
        static=np.zeros((1, 1)), attachments=attachments,
    )  # fmt: skip


def test_the_response_of_an_oscillator_is_that_of_duhamels_integral():
    grid = LaplaceGrid(n_samples=2000, rate_hz=1000.0, oversampling=16)
    impact = Impact(peak_n=10.0, start_s=0.02, contact_s=0.004)
    force = grid.spectrum(impact.force(grid.fine_time_s)) * AntiAlias().gain(grid)
    for frequency in (30.0, 200.0, 400.0):
        model = oscillator(frequency, 0.002)
        got = grid.signal(model(grid.s, [0], [0])[:, 0, 0] * force)
        omega = 2 * np.pi * frequency
        pole = complex(-0.002 * omega, omega * np.sqrt(1 - 0.002**2))
        contact = np.linspace(0.02, 0.024, 4001)
        impulse = np.trapezoid(impact.force(contact) * np.exp(-pole * contact), contact)
        time = np.arange(2000) / 1000
        expected = (impulse * np.exp(pole * time) / pole.imag).imag
        after = time > 0.12  # the filter rings for 0.08 s
        assert_allclose(got[after], expected[after], rtol=0, atol=EXACT * np.abs(expected).max())


def test_what_is_recorded_has_exactly_the_transfer_function_of_the_structure():
    grid = LaplaceGrid(n_samples=4096, rate_hz=1000.0)
    impact = Impact(peak_n=10.0, start_s=0.05, contact_s=0.002)
    filtered = grid.spectrum(impact.force(grid.fine_time_s)) * AntiAlias().gain(grid)
    model = oscillator(60.0, 0.01)
    force, motion = grid.signal(filtered), grid.signal(model(grid.s, [0], [0])[:, 0, 0] * filtered)
    sigma = 12 / 4.096  # an exponential window makes the cut-off record exact at s = sigma + i omega
    window = np.exp(-sigma * np.arange(4096) / 1000)
    lines = np.arange(10, 1600) / 4.096
    ratio = (np.fft.rfft(motion * window) / np.fft.rfft(force * window))[10:1600]
    expected = model(sigma + 2j * np.pi * lines, [0], [0])[:, 0, 0]
    assert_allclose(ratio, expected, rtol=EXACT)


def test_a_spring_attached_by_its_dynamic_stiffness_shifts_the_resonance():
    extra = Attachment(rows=np.ones((1, 1)), stiffness=lambda s: np.full((s.size, 1, 1), (2 * np.pi * 40) ** 2 + 0j))
    s = 2j * np.pi * np.linspace(1, 100, 300)
    with_spring = oscillator(30.0, 0.0, (extra,))(s, [0], [0])[:, 0, 0]
    assert_allclose(with_spring, oscillator(50.0, 0.0)(s, [0], [0])[:, 0, 0], rtol=1e-9)  # 30, 40, 50 Hz: Pythagoras


def test_a_lossy_stiffness_has_its_loss_factor_throughout_and_is_causal():
    band = (20.0, 1000.0)
    stiffness = make_lossy_modulus(0.05, band)
    on_axis = stiffness(2j * np.pi * np.geomspace(*band, 50))
    assert_allclose(on_axis.imag / on_axis.real, 0.05, rtol=2e-3)  # the solids end somewhere
    assert_allclose(stiffness(2j * np.pi * np.array([np.sqrt(20 * 1000)])).real, 1, rtol=1e-9)
    growth = stiffness(np.geomspace(1, 1e5, 30) + 0j)  # real for growing motions: what is causal has no complex memory
    assert_allclose(growth.imag, 0, atol=1e-12)  # rounding
    assert (np.diff(growth.real) > 0).all()


def test_the_filter_passes_its_band_and_stops_what_would_fold():
    for symmetric in (True, False):
        grid = LaplaceGrid(n_samples=100_000, rate_hz=1000.0)  # long: its lines are near the imaginary axis
        gain = np.abs(AntiAlias(symmetric=symmetric).gain(grid))
        frequencies = np.arange(gain.size) / 200.0
        assert_allclose(gain[frequencies < 420], 1.0, rtol=1e-3)  # ripple of a filter of 100 dB, with margin
        assert gain[-1] < 1e-3


def test_noise_has_its_rms_and_its_colour():
    noise = Noise(rms=0.3, pink_fraction=0.5).draw(np.random.default_rng(1), 200_000)
    assert_allclose(noise.std(), 0.3, rtol=0.02)  # four times the scatter of such a record
    power = np.abs(np.fft.rfft(noise)) ** 2
    assert power[10:1000].mean() > 5 * power[-50_000:].mean()


def test_quantised_values_are_multiples_of_the_step_within_the_range():
    values = quantise(np.linspace(-3, 3, 1001), 2.0, 8)
    assert_allclose(values / (2.0 / 128), np.round(values / (2.0 / 128)), rtol=0, atol=1e-9)  # whole numbers
    assert values.min() == -2.0
    assert values.max() == 2.0 - 2.0 / 128


def test_impacts_spread_over_the_levels_asked_for():
    impacts = draw_impacts(np.random.default_rng(3), 6, peak_n=100.0, spread=8.0, contact_s=1e-3, start_s=0.01)
    peaks = [impact.peak_n for impact in impacts]
    assert max(peaks) == 100.0
    assert 5 < max(peaks) / min(peaks) < 12
    time = np.linspace(0, 0.02, 20_001)
    assert_allclose(max(impacts[0].force(time)), impacts[0].peak_n, rtol=1e-3)  # the grid hardly misses the top
