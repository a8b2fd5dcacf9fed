"""FRFs in files of arrays: of `modalfrf`, of `frd` and `idfrd` structures, of Testlab, and under any names."""

import h5py
import numpy as np
import pytest
import scipy.io

import frf_ipz
from array_files import write_matlab_7_3
from frf_ipz.errors import InputError
from frf_ipz.ingest.campaign_file import read_test

LINES_HZ = np.arange(1.0, 200.0)
STATES = {"v5.mat": scipy.io.savemat, "v7_3.mat": write_matlab_7_3}


def receptances():
    """Give FRFs of two masses and two modes, [line, output, input]."""
    omega = 2 * np.pi * LINES_HZ
    shapes = np.array([[1.0, 0.6], [0.5, -1.2]])
    poles = 2 * np.pi * np.array([40.0, 110.0])
    modal = 1.0 / (poles**2 - omega[:, None] ** 2 + 2j * 0.01 * poles * omega[:, None])
    return np.einsum("im,fm,jm->fij", shapes, modal, shapes)


FRFS = receptances()


def read(path, **keys):
    both = {"output": ["1:+z", "2:+z"], "input": ["1:+z", "2:+z"]}
    return frf_ipz.read_frfs(path, quantity="receptance", **{**both, **keys})


def expect(frfs, labels=("1:+z / 1:+z", "1:+z / 2:+z", "2:+z / 1:+z", "2:+z / 2:+z")):
    assert [str(label) for label in frfs.labels] == list(labels)
    np.testing.assert_allclose(frfs.frequency_hz, LINES_HZ, rtol=1e-12)
    np.testing.assert_allclose(frfs.values, FRFS.reshape(len(FRFS), -1)[:, : len(labels)], rtol=1e-9)


@pytest.mark.parametrize("name", STATES)
def test_what_modalfrf_returns(tmp_path, name):
    coherence = np.full(FRFS.shape, 0.97)
    STATES[name](tmp_path / name, {"frf": FRFS, "f": LINES_HZ[:, None], "coh": coherence})
    frfs = read(tmp_path / name)
    expect(frfs)
    np.testing.assert_allclose(frfs.coherence, 0.97, rtol=1e-12)


@pytest.mark.parametrize("name", STATES)
def test_a_structure_of_an_idfrd_object(tmp_path, name):
    names = ["1:+z", "2:+z"]
    system = {
        "ResponseData": np.moveaxis(1e6 * FRFS, 0, 2),
        "Frequency": 2 * np.pi * LINES_HZ[:, None],
        "FrequencyUnit": "rad/TimeUnit",
        "OutputName": names if name == "v7_3.mat" else np.array(names, object),
        "InputName": names if name == "v7_3.mat" else np.array(names, object),
        "OutputUnit": ["um", "um"] if name == "v7_3.mat" else np.array(["um", "um"], object),
        "InputUnit": ["N", "N"] if name == "v7_3.mat" else np.array(["N", "N"], object),
    }
    STATES[name](tmp_path / name, {"sys": system})
    expect(read(tmp_path / name, output=None, input=None))


def test_frequencies_in_the_order_of_a_transform(tmp_path):
    two_sided = np.concatenate([FRFS[:1].real, FRFS, FRFS[::-1].conj()])
    frequency_hz = np.concatenate([[0.0], LINES_HZ, -LINES_HZ[::-1]])
    np.savez(tmp_path / "frf.npz", frequency_hz=frequency_hz, frf=two_sided)
    frfs = read(tmp_path / "frf.npz")
    np.testing.assert_array_equal(frfs.frequency_hz, np.concatenate([[0.0], LINES_HZ]))
    np.testing.assert_allclose(frfs.values[1:], FRFS.reshape(len(FRFS), -1), rtol=1e-12)


def test_an_unknown_unit_of_frequencies_names_the_file(tmp_path):
    system = {"ResponseData": np.moveaxis(FRFS, 0, 2), "Frequency": LINES_HZ[:, None], "FrequencyUnit": "rad/TimeU"}
    scipy.io.savemat(tmp_path / "a.mat", {"sys": system})
    with pytest.raises(InputError, match=r"a\.mat, 'sys\.FrequencyUnit': 'rad/TimeU' is no unit"):
        read(tmp_path / "a.mat")


def test_what_testlab_exports(tmp_path):
    names = [f"FRF beam:{output}:+Z/beam:{input_}:+Z" for output in (1, 2) for input_ in (1, 2)]
    block = {
        "x_values": {"start_value": 1.0, "increment": 1.0, "number_of_values": 199.0},
        "y_values": {"values": 1e3 * FRFS.reshape(199, 4), "quantity": {"label": "mm/N"}},
        "function_record": {"name": np.array(names, object)},
    }
    scipy.io.savemat(tmp_path / "a.mat", {"FRF": block})
    expect(read(tmp_path / "a.mat", output=None, input=None))


def test_parts_by_variables(tmp_path):
    first = FRFS[:, 0, 0]
    scipy.io.savemat(
        tmp_path / "a.mat",
        {"H": np.column_stack([first.real, first.imag]), "df": 1.0, "f0": 1.0, "w": 2 * np.pi * LINES_HZ},
    )
    parts = {"real": "H(:,1)", "imag": "H(:,2)"}
    for grid in (
        {"frequency_step_hz": "df", "frequency_start_hz": "f0"},
        {"frequency_rad_s": "w"},
        {},
    ):
        expect(
            read(tmp_path / "a.mat", output="1:+z", input="1:+z", variables={**parts, **grid}), labels=["1:+z / 1:+z"]
        )
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["m/db"], file["m/phase"] = 20 * np.log10(abs(first)), np.degrees(np.angle(first))
        file["m/freq"] = LINES_HZ
    variables = {"magnitude_db": "m/db", "phase_deg": "m/phase"}
    expect(read(tmp_path / "a.h5", output="1:+z", input="1:+z", variables=variables), labels=["1:+z / 1:+z"])


def test_a_test_of_a_matlab_file(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"yspec": FRFS[:, :, 0], "freq": LINES_HZ, "other": FRFS})
    (tmp_path / "test.toml").write_text(
        '[test]\nkind = "frf"\n[[frf]]\nfile = "a.mat"\nquantity = "receptance"\nunit = "mm/N"\n'
        'variables = { frequency_hz = "freq", frf = "yspec" }\noutput_dof = ["1:+z", "2:+z"]\ninput_dof = "1:+z"\n'
    )
    estimate = frf_ipz.estimate_frfs(read_test(tmp_path / "test.toml"))
    np.testing.assert_allclose(estimate.frfs.values, 1e-3 * FRFS[:, :, 0], rtol=1e-9)
    assert estimate.warnings == ()


def test_what_is_chosen_by_shape_is_said(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"H": FRFS, "f": LINES_HZ, "fs": 4096.0})
    (tmp_path / "test.toml").write_text(
        '[test]\nkind = "frf"\n[[frf]]\nfile = "a.mat"\nquantity = "receptance"\n'
        'output_dof = ["1:+z", "2:+z"]\ninput_dof = ["1:+z", "2:+z"]\n'
    )
    (warning,) = frf_ipz.estimate_frfs(read_test(tmp_path / "test.toml")).warnings
    assert warning == "a.mat: FRFs in 'H' (199 x 2 x 2, complex), frequencies in 'f'"


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"output": None, "input": None}, r'in \'H\', 2 outputs x 2 inputs on 199 lines; .*output_dof = \["1:\+z", "2'),
        ({"output": ["1:+z"], "input": ["2:+z"]}, "given are 1 and 1"),
        ({"variables": {"frf": "H", "freq": "f"}}, "'freq'; did you mean 'frequency_hz'|known are"),
        ({"variables": {"frf": "H", "frequency_hz": "short"}}, "there are 7 frequencies: no axis fits"),
        ({"variables": {"real": "f"}}, "needed is frf, or real and imag"),
        ({"variables": {"frf": "G"}}, "has no array 'G'"),
    ],
)
def test_what_does_not_fit_is_said(tmp_path, keys, message):
    scipy.io.savemat(tmp_path / "a.mat", {"H": FRFS, "f": LINES_HZ, "short": np.arange(7.0)})
    with pytest.raises(InputError, match=message):
        read(tmp_path / "a.mat", **keys)


def test_two_arrays_of_frfs_are_not_mixed(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"H": FRFS, "H2": 2 * FRFS, "f": LINES_HZ})
    with pytest.raises(InputError, match=r"several arrays that may be FRFs.*variables = \{ frf = \"H\" \}"):
        read(tmp_path / "a.mat")


def test_functions_that_carry_their_axis_in_the_first_column(tmp_path):
    both = [np.column_stack([LINES_HZ, FRFS[:, 0, input_]]) for input_ in (0, 1)]
    time = np.arange(400) / 400.0
    scipy.io.savemat(
        tmp_path / "a.mat", {"H1_2": both[0], "H1_3": both[1], "S1": both[0], "X1": np.column_stack([time, time**2])}
    )
    frfs = read(tmp_path / "a.mat", output="1:+z", input="2:+z", variables={"frf": "H1_3"})
    np.testing.assert_allclose(frfs.frequency_hz, LINES_HZ)
    np.testing.assert_allclose(frfs.values[:, 0], FRFS[:, 0, 1])
    with pytest.raises(InputError, match=r"several arrays that may be FRFs: 'H1_2'.*'H1_3'"):
        read(tmp_path / "a.mat", output="1:+z", input="2:+z")


def test_lines_of_a_whole_transform(tmp_path):
    values = np.concatenate([[0.5], FRFS[:, 0, 0]])
    scipy.io.savemat(tmp_path / "a.mat", {"yspec": values, "freq": 398.0, "npts": 398.0})
    for variables in ({}, {"frf": "yspec", "sample_rate_hz": "freq"}):
        frfs = read(tmp_path / "a.mat", output="1:+z", input="1:+z", variables=variables)
        np.testing.assert_allclose(frfs.frequency_hz[1:], LINES_HZ)


def test_frfs_that_are_each_followed_by_their_coherence(tmp_path):
    """As Cambridge's data logger saves them: real numbers from 0 to 1 are no FRF."""
    n_lines = 129
    frf = 1.0 / (1.0 - np.linspace(0.0, 3.0, n_lines) ** 2 + 0.02j)
    columns = np.column_stack([frf, np.full(n_lines, 0.9), 2 * frf, np.linspace(0.0, 1.0, n_lines)])
    numbers = {"tfun": 1, "npts": 256.0, "freq": 512.0, "dt2": np.array([0.0, 4.0, 0.0])}
    scipy.io.savemat(tmp_path / "a.mat", {"yspec": columns, **numbers})
    frfs = frf_ipz.read_frfs(tmp_path / "a.mat", quantity="receptance", output=["1:+z", "2:+z"], input="1:+z")
    np.testing.assert_array_equal(frfs.values, columns[:, ::2])
    np.testing.assert_array_equal(frfs.coherence, columns[:, 1::2].real)


@pytest.mark.parametrize(("beside", "first"), [({"df": 1.0, "f_start": 1, "f_end": 199.5}, 1.0), ({"df": 1.0}, 0.0)])
def test_two_columns_are_the_parts_of_frfs_with_a_step(tmp_path, beside, first):
    frf = FRFS[:, 0, 0]
    scipy.io.savemat(tmp_path / "a.mat", {"H00": np.column_stack([frf.real, frf.imag]), **beside})
    for variables in ({}, {"frf": "H00"}):
        frfs = read(tmp_path / "a.mat", output="1:+z", input="1:+z", variables=variables)
        np.testing.assert_allclose(frfs.values[:, 0], frf, rtol=1e-12)
        np.testing.assert_allclose(frfs.frequency_hz, LINES_HZ - 1.0 + first, rtol=1e-12)


def test_a_step_that_does_not_lead_to_the_last_frequency_is_not_taken(tmp_path):
    frf = FRFS[:, 0, 0]
    columns = np.column_stack([frf.real, frf.imag])
    scipy.io.savemat(tmp_path / "a.mat", {"H00": columns, "df": 1.0, "f_start": 1, "f_end": 300.0})
    with pytest.raises(InputError, match="no complex array with a vector of as many frequencies"):
        read(tmp_path / "a.mat", output="1:+z", input="1:+z")


WIDE = {
    "frf.npz": lambda path, frequency_hz: np.savez(path, frequency_hz=frequency_hz, frf=FRFS),
    "frf.h5": lambda path, frequency_hz: write_data_sets(path, {"frequency_hz": frequency_hz, "frf": FRFS}),
}


def write_data_sets(path, arrays):
    with h5py.File(path, "w") as file:
        for name, values in arrays.items():
            file[name] = values


@pytest.mark.skipif(np.finfo(np.longdouble).max <= np.finfo(float).max, reason="long doubles are doubles here")
@pytest.mark.parametrize("name", WIDE)
def test_long_doubles_are_read_whole_or_refused(tmp_path, name):
    frequency_hz = LINES_HZ.astype(np.longdouble)
    WIDE[name](tmp_path / name, frequency_hz)
    expect(read(tmp_path / name))
    frequency_hz[-1] = np.longdouble("1e4000")
    WIDE[name](tmp_path / name, frequency_hz)
    with pytest.raises(InputError, match=f"{name}.*'/?frequency_hz' holds numbers above 1.8e.308, in float128"):
        read(tmp_path / name)


def test_long_doubles_in_the_fields_of_an_array(tmp_path):
    table = np.zeros(len(LINES_HZ), [("frequency_hz", np.longdouble), ("frf", np.clongdouble)])
    table["frequency_hz"], table["frf"] = LINES_HZ, FRFS[:, 0, 0]
    np.save(tmp_path / "frf.npy", table)
    frfs = read(tmp_path / "frf.npy", output="1:+z", input="1:+z")
    np.testing.assert_allclose(frfs.values[:, 0], FRFS[:, 0, 0], rtol=1e-15)
    assert frfs.frequency_hz.dtype == np.float64


def test_a_coherence_of_signalling_nans_is_none(tmp_path):
    signalling = np.full(FRFS.shape, 0x7FF0000000000001, np.uint64).view(np.float64)
    np.savez(tmp_path / "frf.npz", f=LINES_HZ, frf=FRFS, coh=signalling)
    assert np.isnan(read(tmp_path / "frf.npz").coherence).all()
