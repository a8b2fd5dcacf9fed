"""FRFs of files that break a convention are recognised: brought to it with a note, or refused with what to write."""

import re

import numpy as np
import pytest

import data_sets
import frf_ipz
from frf_ipz.errors import InputError
from synthetic_campaign import Structure

LINES_HZ = np.arange(0.0, 301.0)
EXACT = Structure(shapes=((1.0, 0.7, -0.5), (-0.6, 0.8, 0.9))).accelerance(2j * np.pi * LINES_HZ)
NOISE = 1e-3 * np.abs(EXACT).max() * np.random.default_rng(2).standard_normal((*EXACT.shape, 2)).view(complex)[..., 0]
VALUES = EXACT + NOISE
DIGITS = 1e-12  # relative: sixteen digits are written


def estimate(folder, values=VALUES, *, lines_hz=LINES_HZ, coherence=None, keys="", quantity="accelerance"):
    rows = ["frequency_hz,output_dof,input_dof,real,imag" + (",coherence" if coherence is not None else "")]
    for column in range(values.shape[1]):
        for place, (hertz, value) in enumerate(zip(lines_hz.tolist(), values[:, column].tolist(), strict=True)):
            extra = "" if coherence is None else f",{coherence[place]!r}"
            rows.append(f"{hertz!r},{column + 1}:+z,7:+z,{value.real!r},{value.imag!r}{extra}")
    (folder / "frf.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    test = f'[test]\nkind = "frf"\n[[frf]]\nfile = "frf.csv"\nquantity = "{quantity}"\n{keys}\n'
    (folder / "test.toml").write_text(test, encoding="utf-8")
    return frf_ipz.estimate_frfs(frf_ipz.read_test(folder / "test.toml"))


def message(folder, *arguments, **options):
    with pytest.raises(InputError) as caught:
        estimate(folder, *arguments, **options)
    assert "frf.csv" in str(caught.value)
    return str(caught.value)


def expect(result, values=VALUES):
    np.testing.assert_allclose(result.frfs.frequency_hz, LINES_HZ)
    assert np.abs(result.frfs.values - values).max() <= DIGITS * np.abs(values).max()


@pytest.mark.parametrize("power", [0, 1, 2])
def test_conjugated_frfs_are_named(tmp_path, power):
    """In accelerance, mobility and receptance; those that are right pass."""
    s = np.where(LINES_HZ, 2j * np.pi * LINES_HZ, 1.0)[:, None]
    values, quantity = EXACT / s**power, ("accelerance", "mobility", "receptance")[power]
    values = values + NOISE * (np.abs(values).max() / np.abs(EXACT).max())
    expect(estimate(tmp_path, values, quantity=quantity), values)
    text = message(tmp_path, np.conj(values), quantity=quantity)
    assert re.search("these FRFs look conjugated.*conjugated = true", text)
    read = estimate(tmp_path, np.conj(values), quantity=quantity, keys="conjugated = true")
    expect(read, values)
    assert read.warnings == ("frf.csv: its FRFs are conjugated, as 'conjugated' asks for",)
    assert "with 'conjugated' these FRFs look conjugated" in message(
        tmp_path, values, quantity=quantity, keys="conjugated = true"
    )


def test_one_conjugated_frf_beside_others_is_named(tmp_path):
    values = np.column_stack([VALUES[:, 0], np.conj(VALUES[:, 1]), VALUES[:, 2:]])
    assert "2:+z / 7:+z looks conjugated beside the other FRFs" in message(tmp_path, values)


def test_one_conjugated_receptance_is_named_where_one_peak_holds_the_power(tmp_path):
    """The lowest peak of a receptance stands on three lines, and has the power of all others many times over."""
    structure = Structure(shapes=((1.0, 0.7, -0.5), (-0.6, 0.8, 0.9)), frequency_hz=(9.0, 81.0, 177.0))
    values = structure.accelerance(2j * np.pi * LINES_HZ[1:]) / (2j * np.pi * LINES_HZ[1:, None]) ** 2
    right = estimate(tmp_path, values, lines_hz=LINES_HZ[1:], quantity="receptance")
    assert right.warnings == ()
    values = np.column_stack([values[:, 0], np.conj(values[:, 1])])
    text = message(tmp_path, values, lines_hz=LINES_HZ[1:], quantity="receptance")
    assert "2:+z / 7:+z looks conjugated beside the other FRFs" in text


@pytest.mark.parametrize("step", [1, 4, 9])
def test_conjugated_frfs_are_named_on_coarse_lines_and_not_seen_in_noise(tmp_path, step):
    assert "look conjugated" in message(tmp_path, np.conj(VALUES)[::step], lines_hz=LINES_HZ[::step])
    for seed in range(5):
        noise = np.random.default_rng(seed).standard_normal((*VALUES[::step].shape, 2)).view(complex)[..., 0]
        estimate(tmp_path, noise, lines_hz=LINES_HZ[::step])


def test_delayed_frfs_are_not_taken_for_conjugated(tmp_path):
    for delay_s in (-1e-3, 1e-3, 0.02):
        estimate(tmp_path, VALUES * np.exp(-2j * np.pi * LINES_HZ * delay_s)[:, None])


def test_negative_frequencies_are_left_out_and_said(tmp_path):
    lines = np.concatenate([-LINES_HZ[:0:-1], LINES_HZ])
    values = np.concatenate([np.conj(VALUES[:0:-1]), VALUES])
    for order in (np.arange(601), np.roll(np.arange(601), 301)):
        result = estimate(tmp_path, values[order], lines_hz=lines[order])
        expect(result)
        assert "two-sided; the 300 lines at negative frequencies are left out" in result.warnings[0]


@pytest.mark.parametrize("first", [0, 1])
def test_a_mirrored_upper_half_is_left_out_and_said(tmp_path, first):
    """Lines of a whole transform, with 0 Hz or without."""
    values = VALUES.copy()
    values[[0, 300]] = values[[0, 300]].real
    whole = np.concatenate([values, np.conj(values[299:0:-1])])[first:]
    lines = np.arange(first, first + len(whole), dtype=float)
    result = estimate(tmp_path, whole, lines_hz=lines)
    assert result.frfs.frequency_hz[-1] == 300.0
    np.testing.assert_allclose(result.frfs.values, values[first:], rtol=1e-12, atol=1e-15)
    assert "two-sided; the upper half from 300 Hz mirrors the lower" in result.warnings[0]


def test_magnitudes_alone_are_refused(tmp_path):
    for values in (np.abs(VALUES) + 0j, VALUES.real + 0j, VALUES.imag * 1j):
        assert "are zero: these are magnitudes only" in message(tmp_path, values)
    assert "is zero on all lines" in message(tmp_path, 0 * VALUES)


@pytest.mark.parametrize("gain", [1.0, 1e-3])
def test_level_in_decibels_and_phase_as_real_and_imaginary_part_are_refused(tmp_path, gain):
    values = 20 * np.log10(gain * np.abs(VALUES)) + 1j * np.degrees(np.angle(VALUES))
    assert "'magnitude_db', 'phase_deg'" in message(tmp_path, values)


def test_magnitude_and_phase_as_real_and_imaginary_part_are_refused(tmp_path):
    for phase in (np.angle(VALUES), np.degrees(np.angle(VALUES)), np.degrees(np.angle(VALUES)) % 360.0):
        assert "looks like magnitude and phase" in message(tmp_path, np.abs(VALUES) + 1j * phase)


def test_a_mobility_without_negative_real_parts_is_read_whatever_its_size(tmp_path):
    """As of a driving point; in some unit its imaginary part reaches just what an angle may."""
    driving = (
        1j
        * LINES_HZ[:, None]
        * sum(1 / (f**2 + 0.02j * f * LINES_HZ[:, None] - LINES_HZ[:, None] ** 2) for f in (61, 184))
    )
    for size in (np.pi, 180.0, 0.95 * 360.0):
        values = driving * size / np.abs(driving.imag).max()
        assert values.real.min() >= 0.0
        expect(estimate(tmp_path, values, quantity="mobility"), values)
        turned = np.abs(values) + 1j * (np.degrees(np.angle(values)) % 360.0)
        assert "looks like magnitude and phase" in message(
            tmp_path, 1e-3 * turned.real + 1j * turned.imag, quantity="mobility"
        )


def test_a_coherence_in_per_cent_or_above_1(tmp_path):
    coherence = np.linspace(0.6, 0.99, 301)
    result = estimate(tmp_path, coherence=(100 * coherence).tolist())
    np.testing.assert_allclose(result.frfs.coherence[:, 0], coherence)
    assert "goes up to 99: taken as per cent" in result.warnings[0]
    result = estimate(tmp_path, coherence=(1.5 * coherence).tolist())
    assert np.isnan(result.frfs.coherence).all()
    assert "goes up to 1.485, at 300 Hz, and none is above 1: left out" in result.warnings[0]
    mistyped = np.where(np.arange(301) == 40, 37.2, coherence)
    result = estimate(tmp_path, coherence=mistyped.tolist())
    assert "goes up to 37.2, at 40 Hz, and none is above 1: left out" in result.warnings[0]
    coherence[40] = -0.02
    text = message(tmp_path, coherence=coherence.tolist())
    assert "the FRF 1:+z / 7:+z has the coherence -0.02 at 40 Hz, below zero" in text
    coherence[40] = 0.9
    result = estimate(tmp_path, coherence=np.minimum(coherence * 1.0102, 1.0001).tolist())
    assert result.frfs.coherence.max() == 1.0
    assert result.warnings == ()


def test_a_coherence_of_0_on_all_lines_was_not_computed(tmp_path):
    result = estimate(tmp_path, coherence=[0.0] * 301)
    expect(result)
    assert np.isnan(result.frfs.coherence).all()
    assert "the coherence is 0 on all lines, as where none was computed: left out" in result.warnings[0]


def test_files_of_different_resolution_share_the_coarse_lines(tmp_path):
    fine_hz = np.arange(0.0, 300.1, 0.25)
    fine = Structure().accelerance(2j * np.pi * fine_hz)
    for name, lines, values, output in (("a", LINES_HZ, VALUES, "1:+z"), ("b", fine_hz, fine, "2:+z")):
        pairs = zip(lines.tolist(), values[:, 0].tolist(), strict=True)
        rows = [f"{hertz!r},{output},7:+z,{value.real!r},{value.imag!r}" for hertz, value in pairs]
        text = "\n".join(["frequency_hz,output_dof,input_dof,real,imag", *rows])
        (tmp_path / f"{name}.csv").write_text(text, encoding="utf-8")
    entries = "".join(f'[[frf]]\nfile = "{name}.csv"\nquantity = "accelerance"\n' for name in "ba")
    (tmp_path / "test.toml").write_text(f'[test]\nkind = "frf"\n{entries}', encoding="utf-8")
    result = frf_ipz.estimate_frfs(frf_ipz.read_test(tmp_path / "test.toml"))
    np.testing.assert_array_equal(result.frfs.frequency_hz, LINES_HZ)
    np.testing.assert_array_equal(result.frfs.values[:, 0], fine[::4, 0])
    used = "301 of up to 1201 lines are used: those that all FRFs share"
    assert f"{used}; b.csv has more; a.csv has the fewest" in result.warnings


@pytest.mark.parametrize(
    ("stated", "quantity"), [("dynamic_stiffness", "receptance"), ("apparent_mass", "accelerance")]
)
def test_force_over_response_is_turned_round(tmp_path, stated, quantity):
    hertz = np.arange(0.0, 200.0)
    omega = 2 * np.pi * hertz
    receptance = 1.0 / (2.0 * (2 * np.pi * 60.0) ** 2 * (1 + 0.02j) - 2.0 * omega**2)
    truth = receptance if quantity == "receptance" else -(omega**2) * receptance
    values = np.zeros(len(hertz), complex)
    np.divide(1.0, truth, out=values, where=truth != 0)
    rows = [
        f"{f!r},2:+z,1:+z,{v.real!r},{v.imag!r}" for f, v in zip(hertz.tolist(), (values / 1e3).tolist(), strict=True)
    ]
    (tmp_path / "a.csv").write_text("\n".join(["frequency_hz,output_dof,input_dof,real,imag", *rows]) + "\n")
    unit = "kN/m" if quantity == "receptance" else "kN/(m/s^2)"
    frfs = frf_ipz.read_frfs(tmp_path / "a.csv", quantity=stated, unit=unit)
    assert frfs.labels[0].quantity.value == quantity
    expected = truth[np.searchsorted(hertz, frfs.frequency_hz)]
    np.testing.assert_allclose(frfs.values[:, 0], expected, rtol=1e-12)
    assert len(frfs.frequency_hz) == (200 if quantity == "receptance" else 199)  # no mass at rest


def test_dynamic_stiffness_of_a_universal_file_says_where_the_motion_is(tmp_path):
    hertz = np.arange(1.0, 200.0)
    stiffness = 5e5 * (1 + 0.02j) - 2.0 * (2 * np.pi * hertz) ** 2
    axes = ((18, "Frequency", "Hz"), (13, "Force", "N"), (8, "Displacement", "mm"))
    ends = "      NONE         7   3       NONE         9   3"
    (tmp_path / "a.uff").write_text(data_sets.data_set(stiffness / 1e3, axes=axes, start=1.0, ends=ends))
    frfs = frf_ipz.read_frfs(tmp_path / "a.uff", quantity="dynamic_stiffness")
    assert str(frfs.labels[0]) == "9:+z / 7:+z"
    np.testing.assert_allclose(frfs.values[:, 0], 1.0 / stiffness, rtol=1e-10)


def test_a_force_over_a_response_that_is_zero_has_no_reciprocal(tmp_path):
    rows = [f"{line},2:+z,1:+z,{1.0 if line != 7 else 0.0},{0.1 if line != 7 else 0.0}" for line in range(1, 30)]
    (tmp_path / "a.csv").write_text("\n".join(["frequency_hz,output_dof,input_dof,real,imag", *rows]) + "\n")
    with pytest.raises(InputError, match="is zero at 7 Hz, and has no reciprocal there"):
        frf_ipz.read_frfs(tmp_path / "a.csv", quantity="impedance")


def test_of_frfs_in_one_file_that_which_lacks_lines_is_named(tmp_path):
    pairs = zip(LINES_HZ.tolist(), VALUES[:, 0].tolist(), strict=True)
    rows = [f"{hertz!r},{{}},7:+z,{value.real!r},{value.imag!r}" for hertz, value in pairs]
    both = [row.format("1:+z") for row in rows] + [row.format("2:+z") for row in (*rows[:50], *rows[51:])]
    (tmp_path / "a.csv").write_text("\n".join(["frequency_hz,output_dof,input_dof,real,imag", *both]))
    (tmp_path / "test.toml").write_text('[test]\nkind = "frf"\n[[frf]]\nfile = "a.csv"\nquantity = "accelerance"\n')
    first, second = (estimate := frf_ipz.estimate_frfs(frf_ipz.read_test(tmp_path / "test.toml"))).frfs.labels
    assert f"; {first} in a.csv has more; {second} in a.csv has the fewest" in " ".join(estimate.warnings)
