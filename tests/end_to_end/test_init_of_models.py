"""`init` finds the model of an FE program in a folder, and the model file that it writes is read."""

import numpy as np
import pytest
import scipy.io
from scipy import sparse

from fe_models import beam
from frf_ipz.fe.model_file import read_model
from frf_ipz.pipeline.init.folder_contents import look_into
from frf_ipz.pipeline.init.model_draft import draft_model


def lower(matrix):
    rows, columns = np.nonzero(np.tril(matrix))
    return "".join(f"{i + 1} {j + 1} {matrix[i, j]:.16e}\n" for i, j in zip(rows, columns, strict=True))


def write_calculix(folder, model):
    (folder / "job.sti").write_text(lower(model.stiffness.toarray()))
    (folder / "job.mas").write_text(lower(model.mass.toarray()))
    numbers = {"z": 3, "ry": 5}
    (folder / "job.dof").write_text("".join(f"{dof.node}.{numbers[dof.direction]}\n" for dof in model.dofs))
    places = zip(model.geometry.nodes, model.geometry.coordinates_m, strict=True)
    (folder / "job.inp").write_text("*NODE\n" + "".join(f"{node}, {x}, {y}, {z}\n" for node, (x, y, z) in places))


def write_numpy(folder, model):
    for name, matrix in (("K", model.stiffness), ("M", model.mass)):
        sparse.save_npz(folder / f"{name}.npz", matrix)
    places = dict(zip(model.geometry.nodes.tolist(), model.geometry.coordinates_m.tolist(), strict=True))
    rows = "".join(f"{dof.node},{dof.direction},{','.join(map(str, places[dof.node]))}\n" for dof in model.dofs)
    (folder / "dofs.csv").write_text("node,direction,x_m,y_m,z_m\n" + rows)


def write_matlab(folder, model):
    write_numpy(folder, model)
    scipy.io.savemat(folder / "fem.mat", {name: sparse.load_npz(folder / f"{name}.npz") for name in "KM"})
    for name in "KM":
        (folder / f"{name}.npz").unlink()


def write_named_rows(folder, model):
    places = dict(zip(model.geometry.nodes.tolist(), model.geometry.coordinates_m.tolist(), strict=True))
    rows = {"dofs": [dof.name for dof in model.dofs], "coordinates": [places[dof.node] for dof in model.dofs]}
    np.savez(folder / "fem.npz", K=model.stiffness.toarray(), M=model.mass.toarray(), **rows)


@pytest.mark.parametrize(
    ("write", "marks"),
    [
        (write_matlab, 'mass = "fem.mat"'),
        (write_named_rows, 'mass = "fem.npz"'),
        (write_calculix, 'units = "SI"'),
        (write_numpy, 'mass = "M.npz"'),
    ],
)
def test_a_model_in_the_folder_is_found_and_read(tmp_path, write, marks):
    model = beam(left="clamped", elements=5)
    write(tmp_path, model)
    lines = "".join(f"{hertz},6:+z,6:+z,1.0,0.1\n" for hertz in range(10, 60))
    (tmp_path / "frf.csv").write_text("frequency_hz,output_dof,input_dof,real,imag\n" + lines)
    contents = look_into(tmp_path)
    assert [path.name for path in contents.frfs] == ["frf.csv"]
    assert not contents.recordings
    text = draft_model(contents)
    assert marks in text
    (tmp_path / "model.toml").write_text(text)
    found = read_model(tmp_path / "model.toml")
    assert found.dofs == model.dofs
    np.testing.assert_allclose(np.ptp(found.geometry.coordinates_m[:, 0]), 0.8 * 0.4995, rtol=1e-9)
