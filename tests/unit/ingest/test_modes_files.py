"""Files of modes: what they hold is read, and what is wrong in them is named by file and line."""

import contextlib

import numpy as np
import pytest
import pyuff

import frf_ipz
from frf_ipz.ingest.formats.modes_file import ModesSource
from frf_ipz.ingest.formats.modes_uff import holds_shapes
from frf_ipz.ingest.formats.registry import read_modes_file
from stated_modes import TEST, as_csv, stated_modes

TYPES = "{:10d}" * 6
NUMBERS = "{:13.5E}"


def read(path):
    return read_modes_file(ModesSource(path=path))


def universal(modes, *, analysis=2):
    """Data sets 55 of single precision, written by hand."""
    lines = []
    for mode in range(len(modes.damping_ratio)):
        hertz, ratio = float(modes.natural_frequency_hz[mode]), float(modes.damping_ratio[mode])
        omega = 2 * np.pi * hertz
        head = (
            [hertz, 1.0, ratio, 0.0] if analysis == 2 else [-ratio * omega, omega * (1 - ratio**2) ** 0.5, *[0.0] * 4]
        )
        lines += ["    -1", "    55", *["NONE"] * 5, TYPES.format(1, analysis, 2, 8, 2 if analysis == 2 else 5, 3)]
        lines += [f"{2:10d}{len(head):10d}{1:10d}{mode + 1:10d}"]
        lines += ["".join(NUMBERS.format(value) for value in head)]
        for dof, value in zip(modes.dofs, modes.shapes[:, mode], strict=True):
            real = [0.0, 0.0, dof.sign * value.real]
            parts = real if analysis == 2 else [0.0, 0.0, 0.0, 0.0, dof.sign * value.real, dof.sign * value.imag]
            lines += [f"{dof.node:10d}", "".join(NUMBERS.format(float(part)) for part in parts)]
        lines += ["    -1"]
    return "\n".join(lines) + "\n"


def test_a_data_set_without_its_first_mark_is_refused(tmp_path):
    """It was lost without a word."""
    first, second = universal(stated_modes(1)), universal(stated_modes(1))
    (tmp_path / "modes.uff").write_text(first + second.removeprefix("    -1\n"))
    line = first.count("\n") + 1
    with pytest.raises(
        frf_ipz.FileFormatError, match=f"line {line}: a data set 55 begins without the line of -1 above"
    ):
        read(tmp_path / "modes.uff")


def test_csv(tmp_path):
    modes = stated_modes(1)
    (tmp_path / "modes.csv").write_text(as_csv(modes))
    got = read(tmp_path / "modes.csv")
    assert got.dofs == modes.dofs
    for name in ("natural_frequency_hz", "damping_ratio", "frequency_std_hz", "damping_ratio_std", "shapes"):
        np.testing.assert_array_equal(getattr(got, name), getattr(modes, name))


def test_csv_with_semicolons_without_deviations_in_any_order(tmp_path):
    text = "mode;dof;real;frequency_hz;damping_ratio\n2;1:z;1,0;20,5;0,02\n1;1:z;0,5;10,5;0,01\n"
    (tmp_path / "modes.csv").write_text(text)
    got = read(tmp_path / "modes.csv")
    assert got.natural_frequency_hz.tolist() == [10.5, 20.5]
    assert np.isnan(got.frequency_std_hz).all()
    assert got.shapes.tolist() == [[0.5, 1.0]]


@pytest.mark.parametrize("analysis", [2, 3])
def test_universal_file(tmp_path, analysis):
    modes = stated_modes(2)
    (tmp_path / "modes.unv").write_text(universal(modes, analysis=analysis))
    got = read(tmp_path / "modes.unv")
    assert [dof.name for dof in got.dofs] == [dof.name for dof in modes.dofs]
    np.testing.assert_allclose(got.natural_frequency_hz, modes.natural_frequency_hz, rtol=1e-5)
    np.testing.assert_allclose(got.damping_ratio, modes.damping_ratio, rtol=1e-4)
    signs = np.array([dof.sign for dof in modes.dofs])[:, None]
    np.testing.assert_allclose(got.shapes, signs * modes.shapes, rtol=1e-5)


def test_modes_at_the_ground_are_refused(tmp_path):
    (tmp_path / "modes.csv").write_text("mode,dof,real,frequency_hz,damping_ratio\n1,1:z,1,9,0.1\n1,0:z,2,9,0.1\n")
    (tmp_path / "modes.unv").write_text(
        universal(stated_modes(1)).replace(f"\n{stated_modes(1).dofs[0].node:10d}\n", f"\n{0:10d}\n")
    )
    for name in ("modes.csv", "modes.unv"):
        with pytest.raises(frf_ipz.InputError, match=rf"{name}.*'0:\+z' is at node 0, which is the ground"):
            read(tmp_path / name)


def test_universal_file_with_touching_columns(tmp_path):
    text = universal(stated_modes(3))
    assert "-1" in text
    (tmp_path / "modes.unv").write_text(text.replace(" 0.00000E+00", "-0.00000E+00"))
    assert read(tmp_path / "modes.unv").dofs[0].name == "6:z"


def results(path, modes, *, analysis):
    """Data sets 2414 by pyuff: stresses on elements, which are no modes, then the modes."""
    shapes = modes.shapes * np.array([dof.sign for dof in modes.dofs])[:, None]
    common = {"type": 2414, "analysis_dataset_name": "", **{f"id{number}": "" for number in range(1, 6)}}
    common |= {f"record10_field{number}": 0 for number in range(1, 9)} | {"model_type": 1}
    stresses = {"analysis_type": 1, "data_characteristic": 4, "result_type": 2, "data_type": 2}
    stresses |= {"number_of_data_values_for_the_data_component": 6, "dataset_location": 2, "analysis_dataset_label": 9}
    sets = [stresses | {"element_nums": np.array([1]), "data_at_element": np.ones((1, 6))}]
    for mode, (hertz, ratio) in enumerate(zip(modes.natural_frequency_hz, modes.damping_ratio, strict=True)):
        pole = 2 * np.pi * hertz * complex(-ratio, (1 - ratio**2) ** 0.5) * (analysis == 3)
        parts = np.stack([shapes[:, mode].real, shapes[:, mode].imag], 1)[:, : 1 if analysis == 2 else 2]
        values = np.concatenate([0 * parts, 0 * parts, parts], 1)
        entry = {"analysis_type": analysis, "data_characteristic": 2, "result_type": 8, "dataset_location": 1}
        entry |= {"data_type": 2 if analysis == 2 else 5, "number_of_data_values_for_the_data_component": 3}
        entry |= {"record12_field2": hertz, "record12_field5": ratio, "analysis_dataset_label": mode + 1}
        entry |= {"record13_field1": pole.real, "record13_field2": pole.imag}
        nodes = np.array([dof.node for dof in modes.dofs])
        sets.append(entry | {"node_nums": nodes, "data_at_node": values})
    pyuff.UFF(str(path)).write_sets([common | entry for entry in sets], "overwrite")


@pytest.mark.parametrize("analysis", [2, 3])
def test_results_of_a_computation(tmp_path, analysis):
    modes = stated_modes(2)
    results(tmp_path / "modes.unv", modes, analysis=analysis)
    got = read(tmp_path / "modes.unv")
    assert [dof.name for dof in got.dofs] == [dof.name for dof in modes.dofs]
    np.testing.assert_allclose(got.natural_frequency_hz, modes.natural_frequency_hz, rtol=1e-5)
    np.testing.assert_allclose(got.damping_ratio, modes.damping_ratio, rtol=1e-3)
    signs = np.array([dof.sign for dof in modes.dofs])[:, None]
    np.testing.assert_allclose(got.shapes, signs * modes.shapes, rtol=1e-5)
    assert holds_shapes(tmp_path / "modes.unv")


def test_results_that_are_no_modes(tmp_path):
    results(tmp_path / "modes.unv", stated_modes(2), analysis=4)  # transient
    assert not holds_shapes(tmp_path / "modes.unv")
    with pytest.raises(frf_ipz.FileFormatError, match="holds no mode shape"):
        read(tmp_path / "modes.unv")


ROWS = as_csv(stated_modes(4)).splitlines()
FAULTS = {
    "twice": ("\n".join([*ROWS, ROWS[-1]]), "line 18: mode 4 has '21:+z' twice"),
    "missing": ("\n".join(ROWS[:-1]), "mode 4 has no row for '21:+z'"),
    "other frequency": ("\n".join([*ROWS[:-1], ROWS[-1].replace("4,", "4,1", 1)]), "line 17: column 'frequency_hz'"),
    "no number": ("\n".join([*ROWS[:-1], ROWS[-1].rsplit(",", 2)[0] + ",,0"]), "line 17"),
    "no dof": ("\n".join([*ROWS[:-1], ROWS[-1].replace("21:+z", "tip")]), "line 17: 'tip' is no DOF label"),
    "no column": ("\n".join(row.rsplit(",", 2)[0] for row in ROWS), "has no column 'real'"),
    "damping": (
        "\n".join([ROWS[0], *(f"1,10,1.5,0.1,0.1,{n}:z,1,0" for n in (1, 2))]),
        "damping ratio of the mode at 10",
    ),
    "deviation": (
        "\n".join([ROWS[0], *(f"1,10,0.1,-0.1,0.1,{n}:z,1,0" for n in (1, 2))]),
        "frequency_std_hz holds -0.1",
    ),
    "nothing": ("\n".join([ROWS[0], *(f"1,10,0.1,0.1,0.1,{n}:z,0,0" for n in (1, 2))]), "is 0 at every DOF"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_of_a_csv_are_named(tmp_path, fault):
    text, message = FAULTS[fault]
    (tmp_path / "modes.csv").write_text(text + "\n")
    with pytest.raises(frf_ipz.FileFormatError) as error:
        read(tmp_path / "modes.csv")
    assert message in str(error.value)
    assert "modes.csv" in str(error.value)


UNIVERSAL = universal(stated_modes(5, n_modes=1)).splitlines()
FIRST_NODE = 10  # its line, from 0


@pytest.mark.parametrize("length", range(2, len(UNIVERSAL) - 1))
def test_a_universal_file_that_is_cut_off_is_refused_or_lacks_nodes(tmp_path, length):
    (tmp_path / "modes.unv").write_text("\n".join(UNIVERSAL[:length]) + "\n")
    ends_a_node = length > FIRST_NODE and (length - FIRST_NODE) % 2 == 0
    with contextlib.nullcontext() if ends_a_node else pytest.raises(frf_ipz.FileFormatError, match=r"modes\.unv"):
        assert len(read(tmp_path / "modes.unv").dofs) == (length - FIRST_NODE) // 2


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ((7, TYPES.format(1, 1, 2, 8, 2, 3)), "type 1 with data of type 2 is no mode"),
        ((7, TYPES.format(1, 2, 2, 8, 2, 9)), "9 values a node"),
        ((9, "".join(NUMBERS.format(value) for value in (16.0, 1.0, 0.0, 0.0))), "has no damping"),
        ((10, "node"), "the number of a node"),
    ],
)
def test_faults_of_a_universal_file_are_named(tmp_path, changed, message):
    lines = [*UNIVERSAL]
    lines[changed[0]] = changed[1]
    (tmp_path / "modes.unv").write_text("\n".join(lines) + "\n")
    with pytest.raises(frf_ipz.FileFormatError, match=message):
        read(tmp_path / "modes.unv")


@pytest.mark.parametrize(
    ("test", "message"),
    [
        (TEST.replace("modes.csv", "none.csv"), "none.csv: there is no such file"),
        (TEST + TEST.partition("[[")[1] + 'modes]]\nfile = "modes.csv"\n', "has 2 \\[\\[modes\\]\\]"),
        ('[test]\nkind = "modes"\n', "needs at least one \\[\\[modes\\]\\]"),
        (TEST + 'input_dofs = ["tip:z"]\n', "\\[\\[modes\\]\\] 'modes.csv': 'tip:z' is no DOF label"),
        (TEST.replace("modes.csv", "test.toml"), "is of no known format for modes"),
        (TEST.replace('"modes"', '"frf"'), "'frf' has \\[\\[frf\\]\\] entries"),
    ],
)
def test_faults_of_the_test_are_named(tmp_path, test, message):
    (tmp_path / "modes.csv").write_text(as_csv(stated_modes(6)))
    (tmp_path / "test.toml").write_text(test)
    with pytest.raises(frf_ipz.FileFormatError, match=message):
        frf_ipz.read_test(tmp_path / "test.toml")
