"""Two recorders of one test: aligned by what both recorded, or by their trigger, and it is said how well."""

import re

import numpy as np
import pytest

from frf_ipz.errors import FileFormatError
from frf_ipz.ingest.campaign_file import read_test
from frf_ipz.ingest.estimate import estimate_frfs
from frf_ipz.ingest.options import IngestOptions
from frf_ipz.ingest.signals.alignment import align, join, resample
from synthetic_campaign import Structure, impact

RATE_HZ = 2048.0
NOISE = 0.01
SECOND = '[[hit]]\ndof = "7:+z"\nfiles = ["a/*.csv"]\nsecond_recorder = {{ files = ["b/*.csv"], {} }}\n'
COMMON = 'columns = { acc_2 = "probe" }, common = { force = "trigger" }'
CHANNELS = '[test]\nkind = "hammer"\n' + "".join(
    f'[[channel]]\ncolumn = "{name}"\nrole = "{role}"\nquantity = "{quantity}"\nunit = "{unit}"\n{dof}\n'
    for name, role, quantity, unit, dof in (
        ("force", "input", "force", "N", ""),
        ("acc_1", "output", "acceleration", "m/s^2", 'dof = "1:+z"'),
        ("acc_2", "output", "acceleration", "m/s^2", 'dof = "2:+z"'),
    )
)


def write_table(path, names, columns, start_s=0.0):
    path.parent.mkdir(parents=True, exist_ok=True)
    time = start_s + np.arange(len(columns[0])) / RATE_HZ
    np.savetxt(path, np.column_stack([time, *columns]), delimiter=",", header=",".join(["time", *names]), comments="")


def write_recorders(folder, delays, keys, *, start_s=0.0, order=None):
    """The second recorder begins later, by parts of samples, and has its own scale of the force."""
    rng = np.random.default_rng(5)
    for number, delay in enumerate(delays):
        force, acc_1, acc_2 = impact(Structure(), noise=NOISE, rng=rng, height=80.0 + 20 * number)
        positions = np.arange(max(0, int(np.ceil(-delay))), len(force) - max(0, int(np.ceil(delay)))) + delay
        late = resample(np.column_stack([force, acc_2]), positions[(positions >= 0) & (positions <= len(force) - 1)])
        write_table(folder / "a" / f"hit_{number}.csv", ["force", "acc_1"], [force, acc_1])
        place = number if order is None else order[number]
        write_table(folder / "b" / f"hit_{place}.csv", ["trigger", "probe"], [0.5 * late[:, 0], late[:, 1]], start_s)
    (folder / "test.toml").write_text(CHANNELS + SECOND.format(keys))
    return read_test(folder / "test.toml")


def error_of(result):
    band = result.frfs.in_band((20.0, 500.0))
    truth = Structure().accelerance(result.frfs.s[band])
    return np.abs(result.frfs.values[band] - truth).max(axis=0) / np.abs(truth).max(axis=0)


def test_recorders_are_aligned_by_what_both_recorded(tmp_path):
    test = write_recorders(tmp_path, (3.4, 5.7, 0.25), COMMON)
    assert len(test.files) == 6
    result = estimate_frfs(test, options=IngestOptions(exponential_window_s=0.2))
    assert error_of(result).max() < 0.01
    (text,) = [text for text in result.choices if "second recorder" in text]
    pattern = (
        r"it began (\S+) to (\S+) ms after the first \(\+- (\S+) ms\) by the cross-correlation of what both recorded"
    )
    low, high, std = map(float, re.search(pattern, text).groups())
    assert 0 < std < 0.1 * 1e3 / RATE_HZ
    np.testing.assert_allclose([low, high], np.array([0.25, 5.7]) * 1e3 / RATE_HZ, rtol=0.01)


def test_without_a_common_signal_the_times_of_the_files_count(tmp_path):
    test = write_recorders(tmp_path, (8, 8, 8), 'columns = { acc_2 = "probe" }', start_s=8 / RATE_HZ)
    result = estimate_frfs(test, options=IngestOptions(exponential_window_s=0.2))
    assert error_of(result).max() < 0.01
    assert any("by the trigger, at the times in their files" in text for text in result.choices)


def test_files_in_another_order_are_told(tmp_path):
    test = write_recorders(tmp_path, (3, 3, 3), 'columns = { acc_2 = "probe" }, common = { acc_1 = "trigger" }')
    with pytest.raises(FileFormatError, match=r"'trigger' is not 'acc_1' of hit_0\.csv.*correct 'common'"):
        estimate_frfs(test)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ('columns = { acc_3 = "probe" }', "'columns' names 'acc_3', which is no column"),
        ("columns = {}", "at least one, and not all"),
        ('columns = { acc_2 = "probe" }, common = { acc_2 = "probe" }', "'common' names one channel that the first"),
        ('columns = { acc_2 = "probe" }, clock = 3', "clock"),
    ],
)
def test_wrong_keys_are_named(tmp_path, keys, message):
    with pytest.raises(FileFormatError, match=message):
        write_recorders(tmp_path, (3, 3, 3), keys)


def test_each_record_has_a_file_of_each_recorder(tmp_path):
    write_recorders(tmp_path, (3, 3, 3), COMMON)
    (tmp_path / "b" / "hit_2.csv").unlink()
    with pytest.raises(FileFormatError, match="'files' are 2 and those of the first recorder 3"):
        read_test(tmp_path / "test.toml")


def test_a_clock_that_runs_at_another_rate():
    rng = np.random.default_rng(2)
    frequencies, phases = rng.uniform(5, 600, 200), rng.uniform(0, 6.28, 200)

    def signal(time):
        return np.cos(2 * np.pi * np.outer(time, frequencies) + phases).sum(axis=1)

    time, delay_s, drift = np.arange(8192) / RATE_HZ, 0.0321, 5e-5
    first = signal(time) + 0.5 * rng.standard_normal(8192)
    second = 1.7 * signal((time + delay_s) / (1 - drift))
    found = align(first, second, 1 / RATE_HZ, 1 / RATE_HZ)
    assert found.drift == pytest.approx(drift, rel=0.03)
    assert found.delay_s == pytest.approx(delay_s, abs=5 * found.std_s)
    joined = join(np.column_stack([time, first]), np.column_stack([time, second]), found)[100:-100]
    np.testing.assert_allclose(joined[:, 2], 1.7 * signal(joined[:, 0]), atol=0.01 * np.abs(second).max())


def test_stated_deviations_of_the_delay_hold():
    rng = np.random.default_rng(1)
    time = np.arange(4096) / RATE_HZ

    def pulse(time):
        return 100 * np.sin(np.pi * np.clip((time - 0.2) / 0.004, 0, 1)) ** 2

    for _ in range(20):
        delay_s = rng.uniform(-0.1, 0.1)
        signals = [pulse(shifted) + 0.1 * rng.standard_normal(4096) for shifted in (time, time + delay_s)]
        found = align(*signals, 1 / RATE_HZ, 1 / RATE_HZ)
        assert abs(found.delay_s - delay_s) < 4 * found.std_s
        assert found.std_s < 0.05 / RATE_HZ
