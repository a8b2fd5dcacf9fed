"""A simulated wafer stage: six actuators, six sensors, and points of interest that are a mean and two tilts.

The body is a plate of bricks that floats; its mass is known, as if it had been weighed. The real one differs from
the model in the stiffness of its quarters, so that frequencies are 2 % off (root mean square of the flexible ones), and
in the damping of each mode, by 30 %. Its FRFs are computed from its own matrices by modal superposition, without the
package.
"""

import numpy as np
from scipy import linalg, sparse

import frf_ipz
from brick_plate import CORNERS, brick_matrices

COUNTS, SIDES_M = (6, 5, 1), (0.45, 0.40, 0.03)
MODULUS_PA, DENSITY = 70e9, 2700.0
RIGID, FLEXIBLE = 6, 20
RATIO, RATIO_SPREAD, FREQUENCY_ERROR = 0.006, 0.3, 0.02
NOISE = 0.01  # of the median magnitude of each FRF
LINES = 1600
ACTUATORS, SENSORS = tuple(f"actuator {k}" for k in range(1, 7)), tuple(f"sensor {k}" for k in range(1, 7))
POINTS = ("height", "pitch", "roll")


def parts():
    """Stiffness and mass of each quarter, (4, n, n) sparse, and places of nodes."""
    stiffness, mass = brick_matrices(np.array(SIDES_M) / COUNTS, youngs_modulus_Pa=MODULUS_PA, density_kg_m3=DENSITY)
    nx, ny, nz = COUNTS
    number = np.arange((nx + 1) * (ny + 1) * (nz + 1)).reshape(nz + 1, ny + 1, nx + 1)
    quarters = [[sparse.coo_array((3 * number.size, 3 * number.size)).tocsr()] * 2 for _ in range(4)]
    for z, y, x in np.ndindex(nz, ny, nx):
        corners = [number[z + c, y + b, x + a] for a, b, c in CORNERS]
        rows = (3 * np.array(corners)[:, None] + np.arange(3)).ravel()
        at = (np.repeat(rows, 24), np.tile(rows, 24))
        quarter = quarters[int(x >= nx // 2) + 2 * int(y >= ny // 2)]
        for place, block in enumerate((stiffness, mass)):
            added = sparse.coo_array((block.ravel(), at), shape=quarter[place].shape)
            quarter[place] = sparse.csr_array(quarter[place] + added)
    grid = np.stack(np.unravel_index(np.arange(number.size), number.shape)[::-1], 1)
    return quarters, grid * (np.array(SIDES_M) / COUNTS)


def node_at(places, x, y, z):
    """Number of the node nearest to parts of the sides."""
    return int(np.argmin(np.linalg.norm(places - np.array([x, y, z]) * SIDES_M, axis=1))) + 1


def ports(places):
    """Actuators push at the bottom, so that those in the plane tilt the stage too; points of interest are above."""

    def node(*at):
        return node_at(places, *at)

    pushed = [(0.2, 0.2, "z"), (0.8, 0.2, "z"), (0.5, 0.8, "z"), (0.5, 0.0, "x"), (0.0, 0.5, "y"), (1.0, 0.5, "y")]
    seen = [(0.0, 0.0, "z"), (1.0, 0.0, "z"), (0.35, 1.0, "z"), (0.0, 0.4, "x"), (0.2, 1.0, "y"), (0.8, 1.0, "y")]
    made = []
    for name, (x, y, axis) in zip(ACTUATORS, pushed, strict=True):  # each spreads over two nodes
        along = (0.0, 0.2) if axis == "y" else (0.17, 0.0)
        first, second = node(x, y, 0.0), node(min(x + along[0], 1.0), y + along[1], 0.0)
        made.append(frf_ipz.Port(name, {f"{first}:{axis}": 0.5, f"{second}:{axis}": 0.5}))
    for name, (x, y, axis) in zip(SENSORS, seen, strict=True):
        made.append(frf_ipz.Port(name, {f"{node(x, y, 0.0)}:{axis}": 1.0}))
    corners = {(x, y): node(x, y, 1.0) for x in (0.33, 0.67) for y in (0.4, 0.6)}
    span = [abs(places[corners[0.33, 0.4] - 1] - places[corners[0.67, 0.6] - 1])[axis] for axis in (0, 1)]
    height = {f"{number}:z": 0.25 for number in corners.values()}
    pitch = {f"{number}:z": (0.5 if x < 0.5 else -0.5) / span[0] for (x, _), number in corners.items()}
    roll = {f"{number}:z": (-0.5 if y < 0.5 else 0.5) / span[1] for (_, y), number in corners.items()}
    return [
        *made,
        frf_ipz.Port("height", height),
        frf_ipz.Port("pitch", pitch, "rad"),
        frf_ipz.Port("roll", roll, "rad"),
    ]


def make_stage(seed):
    """FE model of the stage, the real one as a function from names to FRFs, and the lines of the test."""
    rng = np.random.default_rng(seed)
    quarters, places = parts()
    nominal = [sum(quarter[place] for quarter in quarters) for place in range(2)]
    labels = [f"{node + 1}:{axis}" for node in range(len(places)) for axis in "xyz"]
    model = frf_ipz.StructuralModel.from_matrices(
        nominal[1], nominal[0], dofs=labels, coordinates=places, modal_damping=RATIO, name="stage"
    ).with_ports(ports(places))
    before = _flexible(*nominal)[0][:FLEXIBLE]
    draws, size = rng.normal(size=4), 0.05
    for _ in range(8):  # so large that frequencies are off by what they are meant to be
        stiffness = sum(factor * quarter[0] for factor, quarter in zip(np.exp(size * draws), quarters, strict=True))
        matrices = stiffness, nominal[1]
        omega = _flexible(*matrices)[0][:FLEXIBLE]
        size *= FREQUENCY_ERROR / np.sqrt(np.mean((omega / before - 1) ** 2))
    omega, shapes, rigid = _flexible(*matrices)
    ratios = RATIO * np.exp(RATIO_SPREAD * rng.normal(size=len(omega)))
    weights = {port.name: _row(port, labels) for port in model.ports}
    top_hz = 1.02 * np.sqrt(omega[FLEXIBLE - 1] * omega[FLEXIBLE]) / (2 * np.pi)
    lines_hz = np.linspace(0.3 * omega[0] / (2 * np.pi), top_hz, LINES)

    def responses(outputs, inputs, s, power=2):
        """Receptances times ``s**power``, (n_lines, n_outputs, n_inputs)."""
        rows = [np.array([weights[name] for name in names]) for names in (outputs, inputs)]
        values = (rows[0] @ rigid) @ (rows[1] @ rigid).T / s[:, None, None] ** 2
        resonances = 1 / (s[:, None] ** 2 + 2 * ratios * omega * s[:, None] + omega**2)
        values = values + np.einsum("ok,sk,ik->soi", rows[0] @ shapes, resonances, rows[1] @ shapes)
        return values * s[:, None, None] ** power

    responses.omega = omega
    return model, responses, lines_hz


def measure(responses, lines_hz, seed):
    """FRFs of the stage with noise."""
    values = responses(SENSORS, ACTUATORS, 2j * np.pi * lines_hz)
    noise = NOISE * np.median(np.abs(values), axis=0)
    draws = np.random.default_rng([seed, 1]).normal(size=(*values.shape, 2)) / np.sqrt(2)
    return frf_ipz.FrfSet.from_arrays(
        lines_hz,
        values + noise * draws.view(complex)[..., 0],
        outputs=SENSORS,
        inputs=ACTUATORS,
        variance=np.broadcast_to(noise**2, values.shape),
    )


def _flexible(stiffness, mass):
    values, vectors = linalg.eigh(stiffness.toarray(), mass.toarray())
    return np.sqrt(values[RIGID:]), vectors[:, RIGID:], vectors[:, :RIGID]


def _row(port, labels):
    number = {label: place for place, label in enumerate(labels)}
    row = np.zeros(len(labels))
    for dof, weight in port.weights.items():
        row[number[dof.name]] = weight
    return row
