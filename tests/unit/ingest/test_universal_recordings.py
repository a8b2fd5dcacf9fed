"""Recordings as universal files: time responses in data sets 58, named by DOF, label or number."""

import numpy as np
import pytest

import data_sets
import frf_ipz
from data_sets import NONE
from frf_ipz.errors import InputError
from synthetic_campaign import Structure, hammer_campaign, impact

RATE_HZ = 2048
SIGNALS = impact(Structure())


def data_set(values, *, node, label, unit="NONE", kind=1):
    return data_sets.data_set(
        values,
        axes=((17, "Time", "s"), (0, label, unit), NONE),
        kind=kind,
        ends=f"      NONE{node:10d}   3       NONE         0   0",
        ordinate_type=4,
        step=1.0 / RATE_HZ,
    )


def recording(force_unit="N", unit="g"):
    force, first, second = SIGNALS
    return [
        data_set(force, node=7, label="Force", unit=force_unit),
        data_set(first / 9.80665, node=1, label="Acceleration", unit=unit),
        data_set(second / 9.80665, node=2, label="Acceleration", unit=unit),
    ]


def write(folder, sets, columns=("force", "1:+z", "3"), head="", unit=""):
    (folder / "hit.uff").write_text("".join(sets))
    text = f'[test]\nkind = "hammer"\n{head}\n[[hit]]\ndof = "7:+z"\nfiles = ["*.uff"]\n'
    text += f'[[channel]]\ncolumn = "{columns[0]}"\nrole = "input"\nquantity = "force"\n'
    for node, column in enumerate(columns[1:], start=1):
        text += (
            f'[[channel]]\ncolumn = "{column}"\nrole = "output"\nquantity = "acceleration"\ndof = "{node}:+z"\n{unit}'
        )
    (folder / "test.toml").write_text(text)
    return folder / "test.toml"


def frfs_of(test_toml):
    return frf_ipz.estimate_frfs(frf_ipz.read_test(test_toml)).frfs


def message(test_toml):
    with pytest.raises(InputError) as caught:
        frfs_of(test_toml)
    assert "hit.uff" in str(caught.value)
    return str(caught.value)


def test_a_universal_file_gives_the_frfs_of_the_same_csv(tmp_path):
    expected = frfs_of(hammer_campaign(tmp_path, heights=(100.0,)))
    frfs = frfs_of(write(tmp_path, recording()))
    assert [str(label) for label in frfs.labels] == [str(label) for label in expected.labels]
    band = frfs.frequency_hz < 800.0  # beyond, the force is so small that the 12 digits of the file count
    np.testing.assert_allclose(frfs.values[band], expected.values[band], rtol=1e-6, atol=1e-8)


def test_a_column_that_is_not_there_is_told_with_those_that_are(tmp_path):
    text = message(write(tmp_path, recording(), columns=("force", "acc", "3")))
    assert "has no column 'acc'" in text
    assert "1 ('7:+z', 'Force'), 2 ('1:+z', 'Acceleration'), 3 ('2:+z', 'Acceleration')" in text
    number = "9" * 5000  # more digits than Python makes a number of
    assert "has no column '999" in message(write(tmp_path, recording(), columns=("force", number, "3")))
    assert "has no column 'acceleration', or several" in message(
        write(tmp_path, recording(), columns=("force", "acceleration", "3"))
    )


def test_units_come_from_the_file_or_the_test_and_may_not_contradict(tmp_path):
    assert "has no unit" in message(write(tmp_path, recording(unit="NONE")))
    stated = frfs_of(write(tmp_path, recording(unit="NONE"), unit='unit = "g"\n'))
    np.testing.assert_array_equal(stated.values, frfs_of(write(tmp_path, recording())).values)
    assert "in 'g' by the file" in message(write(tmp_path, recording(), unit='unit = "m/s^2"\n'))


def test_what_cannot_be_a_recording_is_refused(tmp_path):
    force, first, second = recording()
    other = data_set(SIGNALS[1][:-4], node=1, label="Acceleration", unit="g")
    assert "data sets 1 and 2 have different times" in message(write(tmp_path, [force, other, second]))
    spoilt = first.replace(first.splitlines()[20][:20], f"{'nan':>20s}")
    assert "sample 29 of data set 2 is not finite" in message(write(tmp_path, [force, spoilt, second]))
    frf = data_set(SIGNALS[1], node=1, label="Acceleration", kind=6)
    assert "holds no time response" in message(write(tmp_path, [frf]))
    assert "leave out time_column" in message(write(tmp_path, recording(), head="sample_rate_hz = 2048.0"))
