"""Files for other modal software: read back by pyuff and openpyxl, and by this program."""

import numpy as np
import openpyxl
import pytest
import pyuff

import frf_ipz
from clamped_beam import BEAM
from frf_ipz.ingest.formats.modes_file import ModesSource
from frf_ipz.ingest.formats.registry import read_modes_file
from frf_ipz.meshes.registry import read_mesh

SIX_DIGITS, TWELVE_DIGITS = 1e-5, 1e-11
LINES = np.arange(5.0, 400.0, 0.5)


@pytest.fixture(scope="module")
def frfs():
    beam = frf_ipz.make_beam(**BEAM)
    outputs, force = ["21:+z", "11:-z", "16:+ry"], "21:+z"
    labels = [frf_ipz.FrfLabel(output, force, "mobility") for output in outputs]
    values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * LINES)[:, :, None]
    values += 1e-4 * np.abs(values).max(axis=0) * np.random.default_rng(0).standard_normal(values.shape)
    return frf_ipz.FrfSet.from_arrays(
        LINES, values, outputs=outputs, inputs=[force], quantity="mobility",
        variance=np.full(values.shape, 1e-8) * np.abs(values).max(axis=0) ** 2, coherence=np.full(values.shape, 0.97),
    )  # fmt: skip


@pytest.fixture(scope="module")
def fit(frfs):
    return frf_ipz.fit_modes(frfs)


def data_sets(path):
    sets = pyuff.UFF(str(path)).read_sets()
    return sets if isinstance(sets, list) else [sets]


def test_frfs_are_read_back_by_pyuff(frfs, tmp_path):
    frf_ipz.write_frfs(frfs, tmp_path / "frf.unv")
    sets = data_sets(tmp_path / "frf.unv")
    assert [entry["type"] for entry in sets] == [164, *[58] * 6]
    functions = [entry for entry in sets if entry["type"] == 58 and entry["func_type"] == 4]
    for entry, label, values in zip(functions, frfs.labels, frfs.values.T, strict=True):
        np.testing.assert_allclose(entry["data"], values, rtol=TWELVE_DIGITS, atol=0)
        np.testing.assert_allclose(entry["x"], LINES, rtol=SIX_DIGITS)
        directions = {"z": 3, "ry": 5}
        assert entry["rsp_node"] == label.output_dof.node
        assert entry["rsp_dir"] == label.output_dof.sign * directions[label.output_dof.direction]
        assert (entry["ref_node"], entry["ref_dir"]) == (21, 3)
        assert (entry["ordinate_spec_data_type"], entry["orddenom_spec_data_type"]) == (11, 13)
    coherences = [entry for entry in sets if entry["type"] == 58 and entry["func_type"] == 6]
    np.testing.assert_allclose(coherences[1]["data"], 0.97)


@pytest.mark.parametrize("lines", [LINES, np.geomspace(5.0, 400.0, 301)])
def test_frfs_are_read_back_by_this_program(frfs, lines, tmp_path):
    some = frfs.select_lines(np.arange(len(LINES)) < len(lines))
    values = dict.fromkeys(["variance", "coherence"], np.full((len(lines), 3), np.nan))
    some = frf_ipz.FrfSet(frequency_hz=lines, values=some.values[: len(lines)], labels=frfs.labels,
                          averages=frfs.averages, **values)  # fmt: skip
    frf_ipz.write_frfs(some, str(tmp_path / "frf.uff"))
    got = frf_ipz.read_frfs(tmp_path / "frf.uff", quantity="mobility")
    assert [str(label) for label in got.labels] == [str(label) for label in frfs.labels]
    np.testing.assert_allclose(got.frequency_hz, lines, rtol=SIX_DIGITS)
    np.testing.assert_allclose(got.values, some.values, rtol=TWELVE_DIGITS, atol=0)


def test_shapes_are_read_back_by_pyuff(frfs, tmp_path):
    fit = frf_ipz.fit_modes(frfs.select_frfs([0, 1]))  # pyuff reads complex motions of three DOFs a node
    frf_ipz.write_modes(fit, tmp_path / "modes.unv")
    sets = data_sets(tmp_path / "modes.unv")
    table = fit.to_frame("modes")
    assert [entry["type"] for entry in sets] == [55] * fit.n_modes
    for number, entry in enumerate(sets, start=1):
        of_mode = table[table["pole_id"] == number].set_index("dof")
        pole = complex(fit.model.poles[number - 1])
        assert entry["analysis_type"] == 3
        assert entry["mode_n"] == number
        assert abs(complex(entry["eig"]) - pole) < SIX_DIGITS * abs(pole)
        node = list(entry["node_nums"]).index(11)
        shape = complex(of_mode.loc["11:z", "shape_real"], of_mode.loc["11:z", "shape_imag"])
        assert abs(entry["r3"][node] - shape) < SIX_DIGITS * abs(shape)
        assert abs(entry["r1"][node]) == 0


SQUARE = frf_ipz.Mesh(
    nodes=np.array([3, 11, 21, 40]), coordinates_m=np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]], float),
    lines=np.array([[3, 11], [11, 21], [21, 40]]), faces=np.array([[3, 11, 21, 21], [3, 11, 21, 40]]),
)  # fmt: skip


def test_the_geometry_is_read_back_by_pyuff_and_by_this_program(frfs, tmp_path):
    fit = frf_ipz.fit_modes(frfs.select_frfs([0, 1]))
    nodes = np.append(SQUARE.nodes, 16)
    places = np.vstack([SQUARE.coordinates_m, [[1 / 3, 0.0, 1e-20]]])
    geometry = frf_ipz.Geometry(nodes=nodes, coordinates_m=places, lines=SQUARE.lines, mesh=SQUARE)
    frf_ipz.write_modes(fit, tmp_path / "modes.unv", geometry=geometry)
    sets = {entry["type"]: entry for entry in data_sets(tmp_path / "modes.unv")}
    assert list(sets) == [164, 2411, 82, 2412, 55]
    np.testing.assert_array_equal(sets[2411]["node_nums"], [3, 11, 21, 40])  # 16 was not measured
    np.testing.assert_allclose(np.stack([sets[2411][axis] for axis in "xyz"], 1), SQUARE.coordinates_m)
    assert list(sets[82]["nodes"]) == [3, 11, 0, 11, 21, 0, 21, 40]
    assert [sets[2412][kind][0]["nodes_nums"] for kind in (91, 94)] == [[3, 11, 21], [3, 11, 21, 40]]
    drawn = read_mesh(tmp_path / "modes.unv").geometry().mesh
    assert {tuple(face) for face in drawn.faces.tolist()} == {tuple(face) for face in SQUARE.faces.tolist()}
    assert len(read_modes_file(ModesSource(path=tmp_path / "modes.unv")).damping_ratio) == fit.n_modes


@pytest.mark.parametrize(("name", "tolerance"), [("modes.unv", SIX_DIGITS), ("modes.csv", 1e-14)])
def test_modes_are_read_back_by_this_program(fit, tmp_path, name, tolerance):
    frf_ipz.write_modes(fit, tmp_path / name)
    modes = read_modes_file(ModesSource(path=tmp_path / name))
    poles = fit.model.poles[: fit.n_modes]
    np.testing.assert_allclose(modes.natural_frequency_hz, np.abs(poles) / (2 * np.pi), rtol=tolerance)
    np.testing.assert_allclose(modes.damping_ratio, -poles.real / np.abs(poles), rtol=10 * tolerance)
    table = fit.to_frame("modes")
    for mode in range(fit.n_modes):
        of_mode = table[table["pole_id"] == mode + 1].set_index("dof")
        expected = [
            complex(of_mode.loc[dof.name, "shape_real"], of_mode.loc[dof.name, "shape_imag"]) for dof in modes.dofs
        ]
        np.testing.assert_allclose(
            modes.shapes[:, mode], expected, rtol=0, atol=10 * tolerance * np.abs(expected).max()
        )


def test_workbook(fit, tmp_path):
    frf_ipz.write_modes(fit, tmp_path / "modes.xlsx")
    book = openpyxl.load_workbook(tmp_path / "modes.xlsx")
    assert book.sheetnames == ["modes", "shapes"]
    head, first, *_ = book["modes"].iter_rows(values_only=True)
    row = dict(zip(head, first, strict=True))
    poles = fit.to_frame("poles")
    assert row["mode"] == 1
    assert row["frequency_hz"] == pytest.approx(poles["frequency_hz"][0], rel=1e-14)
    assert row["damping_ratio_std"] == pytest.approx(poles["damping_ratio_std"][0], rel=1e-14)
    assert book["shapes"].max_row == 1 + len(fit.to_frame("modes"))


@pytest.mark.parametrize(("write", "name"), [("write_modes", "modes.txt"), ("write_frfs", "frf.csv")])
def test_other_endings_are_refused(fit, frfs, write, name, tmp_path):
    with pytest.raises(frf_ipz.InputError, match="is no format"):
        getattr(frf_ipz, write)(fit if write == "write_modes" else frfs, tmp_path / name)


def test_run_writes_what_is_asked_for(frfs, tmp_path):
    options = frf_ipz.ExportOptions(files=("modes.csv", "frf.unv"))
    results = frf_ipz.Campaign(frfs, export=options).run(tmp_path / "out")
    names = {path.name for path in results.path.iterdir()}
    assert {"modes.csv", "frf.unv"} <= names
    assert "modes.xlsx" not in names
