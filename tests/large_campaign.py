"""Campaigns of many FRFs on a plate of thin rectangles, as files that a user would hand in, of any size.

The structure that is measured has a thicker strip and a softer modulus than the FE model; the FE model has no parts, or
a few groups. Ten-degree damping, white noise that the FRFs state as their variance.
"""

import numpy as np
import pyarrow as pa
import pyarrow.csv as arrow_csv
from scipy import io, sparse
from scipy.sparse.linalg import eigsh

SIDES_M = (0.6, 0.4)
THICKNESS_M = 4e-3
MODULUS_PA = 70e9
POISSON = 0.33
DENSITY_KG_M3 = 2700.0
DAMPING_RATIO = 0.004
NOISE = 2e-3  # of the largest modulus of an FRF
POWERS = [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3), (3, 1), (1, 3)]
GAUSS, WEIGHTS = np.polynomial.legendre.leggauss(4)


def plate_element(sides_m):
    """Stiffness for a bending stiffness of 1 and mass for a mass per area of 1, of w, rx, ry at four corners."""
    a, b = sides_m

    def row(x, y, dx=0, dy=0):
        def power(value, n, times):
            for _ in range(times):
                value, n = (value, n)
            factor = np.prod([n - k for k in range(times)]) if times else 1.0
            return factor * value ** max(n - times, 0) if n >= times else 0.0

        return np.array([power(x, i, dx) * power(y, j, dy) for i, j in POWERS])

    corners = [(0, 0), (a, 0), (a, b), (0, b)]
    nodal = np.array([r for x, y in corners for r in (row(x, y), row(x, y, dy=1), -row(x, y, dx=1))])
    inverse = np.linalg.inv(nodal)
    elasticity = np.array([[1, POISSON, 0], [POISSON, 1, 0], [0, 0, (1 - POISSON) / 2]])
    stiffness, mass = np.zeros((12, 12)), np.zeros((12, 12))
    for u, wu in zip(GAUSS, WEIGHTS, strict=True):
        for v, wv in zip(GAUSS, WEIGHTS, strict=True):
            x, y, weight = a * (1 + u) / 2, b * (1 + v) / 2, wu * wv * a * b / 4
            curvature = np.array([row(x, y, dx=2), row(x, y, dy=2), 2 * row(x, y, dx=1, dy=1)]) @ inverse
            shape = row(x, y) @ inverse
            stiffness += weight * curvature.T @ elasticity @ curvature
            mass += weight * np.outer(shape, shape)
    return stiffness, mass


def plate(nx=31, ny=32):
    """Free nodes' stiffness per element strip, mass, coordinates: clamped along x = 0; (nx * (ny + 1) * 3 DOFs)."""
    stiffness, mass = plate_element((SIDES_M[0] / nx, SIDES_M[1] / ny))
    bending = MODULUS_PA * THICKNESS_M**3 / 12 / (1 - POISSON**2)
    number = np.arange((nx + 1) * (ny + 1)).reshape(nx + 1, ny + 1)
    corners = np.stack(
        [number[:-1, :-1].ravel(), number[1:, :-1].ravel(), number[1:, 1:].ravel(), number[:-1, 1:].ravel()], 1
    )
    rows = (3 * corners[:, :, None] + np.arange(3)).reshape(len(corners), 12)
    order = 3 * number.size
    free = np.arange(3 * (ny + 1), order)

    def assemble(matrix, chosen):
        at = (np.repeat(rows[chosen], 12, 1).ravel(), np.tile(rows[chosen], (1, 12)).ravel())
        values = np.tile(matrix.ravel(), len(chosen))
        return sparse.csr_array(sparse.coo_array((values, at), shape=(order, order)))[free][:, free]

    def groups(count):
        strips = np.array_split(np.arange(len(corners)), count)
        return [
            (bending * assemble(stiffness, strip), DENSITY_KG_M3 * THICKNESS_M * assemble(mass, strip))
            for strip in strips
        ]

    grid = np.stack(np.meshgrid(np.linspace(0, SIDES_M[0], nx + 1), np.linspace(0, SIDES_M[1], ny + 1), indexing="ij"))
    return groups, grid.reshape(2, -1).T[ny + 1 :]


def modes_of(stiffness, mass, count):
    """Lowest modes, mass-normalised."""
    values, vectors = eigsh(stiffness, count, mass, sigma=0.0)
    order = np.argsort(values)
    return np.sqrt(values[order]), vectors[:, order]


def measure(n_outputs, n_inputs=3, *, n_lines=1000, n_modes=20, seed=0):
    """FRFs of the true plate: lines, labels, values and variance, and what the FE model is."""
    groups, positions = plate()
    parts = groups(8)
    rng = np.random.default_rng(seed)
    factors = np.exp(0.06 + 0.05 * rng.standard_normal(8))
    true_stiffness = sum(factor * stiffness for factor, (stiffness, _) in zip(factors, parts, strict=True))
    mass = sum(m for _, m in parts)
    omega, shapes = modes_of(true_stiffness, mass, 120)
    nodes = len(positions)
    chosen = rng.permutation(nodes)[: n_outputs + n_inputs + 2]
    outputs, inputs, points = chosen[:n_outputs], chosen[n_outputs:-2], chosen[-2:]
    band_hz = (0.5 * omega[0] / 2 / np.pi, 0.5 * (omega[n_modes - 1] + omega[n_modes]) / 2 / np.pi)
    lines = np.linspace(*band_hz, n_lines)
    s = 2j * np.pi * lines
    ratios = DAMPING_RATIO * np.exp(0.3 * rng.standard_normal(len(omega)))
    gains = s[:, None] ** 2 / (s[:, None] ** 2 + 2 * ratios * omega * s[:, None] + omega**2)
    values = np.einsum("lk,ok,ik->loi", gains, shapes[3 * outputs], shapes[3 * inputs], optimize=True)
    std = NOISE * np.abs(values).max(axis=0) / np.sqrt(2)
    noisy = values + std * (rng.standard_normal(values.shape) + 1j * rng.standard_normal(values.shape))
    return {
        "lines": lines,
        "values": noisy,
        "variance": np.broadcast_to(2 * std**2, values.shape),
        "outputs": outputs,
        "inputs": inputs,
        "points": points,
        "parts": parts,
        "positions": positions,
    }


def write_campaign(folder, n_outputs, n_inputs=3, *, n_groups=0, **options):
    """Write test, model and pipeline; gives the path of the pipeline."""
    folder.mkdir(parents=True, exist_ok=True)
    measured = measure(n_outputs, n_inputs, **options)
    lines, values, variance = measured["lines"], measured["values"], measured["variance"]
    outputs = [f"{node + 1}:+z" for node in measured["outputs"]]
    inputs = [f"{node + 1}:+z" for node in measured["inputs"]]
    flat = values.transpose(1, 2, 0)
    table = pa.table(
        {
            "frequency_hz": np.tile(lines, flat.shape[0] * flat.shape[1]),
            "output_dof": np.repeat(outputs, len(inputs) * len(lines)),
            "input_dof": np.tile(np.repeat(inputs, len(lines)), len(outputs)),
            "real": flat.real.ravel(),
            "imag": flat.imag.ravel(),
            "variance": variance.transpose(1, 2, 0).ravel(),
        }
    )
    arrow_csv.write_csv(table, folder / "frf.csv")
    stiffness, mass = (sum(pair[k] for pair in measured["parts"]) for k in (0, 1))
    io.mmwrite(folder / "K.mtx", sparse.coo_array(stiffness), symmetry="symmetric")
    io.mmwrite(folder / "M.mtx", sparse.coo_array(mass), symmetry="symmetric")
    rows = [
        f"{node + 1},{direction},{x:.9g},{y:.9g},0"
        for node, (x, y) in enumerate(measured["positions"])
        for direction in ("z", "rx", "ry")
    ]
    (folder / "dofs.csv").write_text("node,direction,x_m,y_m,z_m\n" + "\n".join(rows) + "\n", encoding="utf-8")
    model = '[model]\nkind = "matrices"\nname = "plate"\n[damping]\nmodal_ratio = 0.005\n[matrices]\nmass = "M.mtx"\n'
    model += 'stiffness = "K.mtx"\ndofs = "dofs.csv"\n'
    if n_groups:
        for number, (part, of_mass) in enumerate(plate()[0](n_groups)):
            io.mmwrite(folder / f"K_{number}.mtx", sparse.coo_array(part), symmetry="symmetric")
            io.mmwrite(folder / f"M_{number}.mtx", sparse.coo_array(of_mass), symmetry="symmetric")
            model += f'[[matrices.group]]\nname = "strip {number}"\nstiffness = "K_{number}.mtx"\n'
            model += f'mass = "M_{number}.mtx"\n'
    (folder / "model.toml").write_text(model, encoding="utf-8")
    (folder / "test.toml").write_text(
        '[test]\nname = "plate"\nkind = "frf"\n[[frf]]\nfile = "frf.csv"\nquantity = "accelerance"\n', encoding="utf-8"
    )
    points = ", ".join(f'"{node + 1}:+z"' for node in measured["points"])
    (folder / "pipeline.toml").write_text(
        '[pipeline]\nname = "plate"\ntest = "test.toml"\nmodel = "model.toml"\n[diagnose]\nrun = "never"\n'
        f"[predict]\npoints = [{points}]\n",
        encoding="utf-8",
    )
    return folder / "pipeline.toml"
