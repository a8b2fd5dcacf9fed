"""Transmissibilities become FRFs by the FRF of their reference."""

import numpy as np
import pytest
import scipy.io

import data_sets
import frf_ipz
from frf_ipz.errors import InputError
from frf_ipz.ingest.campaign_file import read_test
from synthetic_campaign import Structure

LINES_HZ = np.arange(1.0, 301.0)
FRFS = Structure().accelerance(2j * np.pi * LINES_HZ)
RATIO = FRFS[:, 1] / FRFS[:, 0]
REFERENCE = """
[[frf]]
file = "driving.csv"
quantity = "accelerance"
unit = "g/N"
"""


def write(folder, entry, *, reference=REFERENCE):
    rows = [
        f"{f!r},1:+z,7:+z,{v.real!r},{v.imag!r}" for f, v in zip(LINES_HZ.tolist(), FRFS[:, 0].tolist(), strict=True)
    ]
    (folder / "driving.csv").write_text("\n".join(["frequency_hz,output_dof,input_dof,real,imag", *rows]) + "\n")
    (folder / "test.toml").write_text(f'[test]\nkind = "frf"\n{reference}\n[[frf]]\n{entry}\n')
    return read_test(folder / "test.toml")


ENTRY = 'file = "t.mat"\nquantity = "transmissibility"\noutput_dof = "2:-z"\ninput_dof = "1:+z"\nforce_dof = "7:+z"'


def test_the_frf_over_the_force(tmp_path):
    scipy.io.savemat(tmp_path / "t.mat", {"T": RATIO[::2], "f": LINES_HZ[::2]})
    test = write(tmp_path, ENTRY)
    assert [str(label) for label in test.labels] == ["1:+z / 7:+z", "2:-z / 7:+z"]
    estimate = frf_ipz.estimate_frfs(test)
    np.testing.assert_allclose(estimate.frfs.values, 9.80665 * FRFS[::2], rtol=1e-12)
    assert "t.mat: 2:-z over 1:+z, times 1:+z / 7:+z" in estimate.warnings


def test_two_units_in_a_universal_file(tmp_path):
    axes = ((18, "Frequency", "Hz"), (12, "Acc", "mm/s^2"), (12, "Acc", "m/s^2"))
    ends = "      NONE         2   3       NONE         1   3"
    (tmp_path / "t.uff").write_text(data_sets.data_set(1e3 * RATIO, axes=axes, start=1.0, ends=ends))
    entry = 'file = "t.uff"\nquantity = "transmissibility"\nforce_dof = "7:+z"'
    frfs = frf_ipz.estimate_frfs(write(tmp_path, entry)).frfs
    np.testing.assert_allclose(frfs.values, 9.80665 * FRFS, rtol=1e-10)


@pytest.mark.parametrize(
    ("entry", "reference", "message"),
    [
        (ENTRY, "", r"needs the FRF 1:\+z / 7:\+z too"),
        (ENTRY.replace('"7:+z"', '"8:+z"'), REFERENCE, r"needs the FRF 1:\+z / 8:\+z too"),
        (ENTRY.replace('force_dof = "7:+z"', ""), REFERENCE, "needs 'force_dof'"),
        (ENTRY.replace("transmissibility", "mobility"), REFERENCE, "and no other quantity, needs 'force_dof'"),
    ],
)
def test_what_is_missing_is_said(tmp_path, entry, reference, message):
    scipy.io.savemat(tmp_path / "t.mat", {"T": RATIO, "f": LINES_HZ})
    with pytest.raises(InputError, match=message):
        write(tmp_path, entry, reference=reference)
