"""Levels in decibels, through every door: what they are relative to, and where they are taken for plain magnitudes."""

import re

import h5py
import numpy as np
import pytest
from scipy import io

from frf_ipz.errors import InputError
from frf_ipz.ingest.campaign_file import read_test
from frf_ipz.ingest.estimate import estimate_frfs
from frf_ipz.ingest.options import IngestOptions
from synthetic_campaign import Structure, write_test

LINES_HZ = np.arange(0.5, 200.5, 0.5)
VALUES = Structure().accelerance(2j * np.pi * LINES_HZ)[:, 0]
PARTS = {"freq": LINES_HZ, "level": 20 * np.log10(np.abs(VALUES)), "phase": np.degrees(np.angle(VALUES))}
GRAVITY = 9.80665
SAID = "its decibels are taken re 1 m/s^2/N"
ROUNDING = 1e-9  # relative: of a logarithm and back


def read(folder, file, **keys):
    keys = {"file": file, "quantity": "accelerance", "output_dof": "1:+z", "input_dof": "1:+z", **keys}
    lines = [f"{key} = {value if value[0] in '{[' else repr(value)}" for key, value in keys.items()]
    body = "\n".join(["[[frf]]", *lines, ""])
    return estimate_frfs(read_test(write_test(folder, body, kind="frf")), options=IngestOptions())


def named(level="magnitude_db", phase="phase_deg"):
    return f'{{ frequency_hz = "freq", {phase} = "phase", {level} = "level" }}'


def write_arrays(path, parts, unit=""):
    if path.suffix == ".mat":
        io.savemat(path, parts)
    elif path.suffix == ".npz":
        np.savez(path, **parts)
    else:
        with h5py.File(path, "w") as file:
            for name, values in parts.items():
                file[name] = values
            if unit:
                file["level"].attrs["unit"] = unit
            file["phase"].attrs["unit"] = "deg"


def write_text(path, name):
    rows = "\n".join(";".join(map(repr, row)) for row in np.column_stack(list(PARTS.values())).tolist())
    path.write_text(f"Frequency [Hz];{name};Phase [deg]\n{rows}\n", encoding="utf-8")


@pytest.mark.parametrize("file", ["frf.mat", "frf.npz", "frf.h5"])
def test_it_is_said_of_arrays_what_their_decibels_are_taken_relative_to(tmp_path, file):
    write_arrays(tmp_path / file, PARTS, unit="dB")
    estimate = read(tmp_path, file, variables=named())
    np.testing.assert_allclose(estimate.frfs.values[:, 0], VALUES, rtol=ROUNDING)
    assert len([text for text in estimate.warnings if f"{file}: {SAID}" in text]) == 1


@pytest.mark.parametrize("unit", ["dB re 1 g/N", "g/N (dB)", "dB[g/N]"])
def test_an_array_may_say_what_its_decibels_are_relative_to(tmp_path, unit):
    write_arrays(tmp_path / "frf.h5", PARTS, unit)
    estimate = read(tmp_path, "frf.h5", variables=named())
    np.testing.assert_allclose(estimate.frfs.values[:, 0], GRAVITY * VALUES, rtol=ROUNDING)
    assert not [text for text in estimate.warnings if SAID in text]


@pytest.mark.parametrize("unit", ["g/N", "dB re 1 g/N"])
@pytest.mark.parametrize("file", ["frf.txt", "frf.npz"])
def test_a_test_may_say_what_decibels_are_relative_to(tmp_path, file, unit):
    if file == "frf.txt":
        write_text(tmp_path / file, "Magnitude [dB]")
        estimate = read(tmp_path, file, unit=unit)
    else:
        write_arrays(tmp_path / file, PARTS)
        estimate = read(tmp_path, file, unit=unit, variables=named())
    np.testing.assert_allclose(estimate.frfs.values[:, 0], GRAVITY * VALUES, rtol=ROUNDING)
    assert not [text for text in estimate.warnings if SAID in text]


def test_negative_magnitudes_in_arrays_are_refused_as_in_text(tmp_path):
    write_arrays(tmp_path / "frf.npz", PARTS)
    with pytest.raises(InputError, match=r"frf\.npz: holds negative magnitudes; .* magnitude_db in 'variables'"):
        read(tmp_path, "frf.npz", variables=named("magnitude"), unit="m/s^2/N")


@pytest.mark.parametrize("keys", [{}, {"unit": "mm/s^2/N"}, {"unit": "dB re 1 mm/s^2/N"}])
def test_columns_of_decibels_are_not_read_as_magnitudes(tmp_path, keys):
    path = tmp_path / "frf.txt"
    write_text(path, "Magnitude [dB]")
    path.write_text(re.sub(r";(-?[\d.e-]+);", lambda found: f";{float(found[1]) + 200.0};", path.read_text()))
    with pytest.raises(InputError, match=r"frf\.txt.* 'dB.*call them magnitude_db") as caught:
        read(tmp_path, "frf.txt", columns='["frequency_hz", "magnitude", "phase_deg"]', **keys)
    assert "unit'" not in str(caught.value).replace("key 'unit'", "")
