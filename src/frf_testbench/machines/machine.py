"""One blind machine: what its owner hands in, and the sealed truth."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import mmwrite
from scipy.sparse.linalg import eigsh, splu

from frf_testbench.machines.concealed import Concealed, SensorChannel, Target, draw_concealed
from frf_testbench.machines.drawings import KINDS, draw_machine
from frf_testbench.machines.frames import DIRECTIONS, Drawing, FloatArray, Mesh, build_mesh, find_nominal_nodes
from frf_testbench.simulator.cases.files import write_recording, write_toml
from frf_testbench.simulator.signals.channels import AntiAlias, Noise, quantise
from frf_testbench.simulator.signals.forces import draw_impacts
from frf_testbench.simulator.signals.laplace import LaplaceGrid
from frf_testbench.simulator.signals.receptance import Attachment, DynamicStiffness, ModalReceptance

ATTEMPTS = 40
REFINE = 2  # elements of the real machine in one of the owner's model
HIGHEST = 4.0  # times the top of the band: modes above enter by their static compliance
MOST_COARSE = 1.5e-4  # error of a nominal frequency in band: a model that a user would trust
LEAST_CHANGE = 0.15  # of the FRFs by what is concealed: scatter makes some 0.05
UNITS = {"m/s^2": 1.0, "g_0": 9.80665}
RANGES = np.outer(10.0 ** np.arange(-6, 6), [1.0, 2.0, 5.0]).ravel()  # of the recorder
BITS = 24
STIFFNESS, MASS, FREQUENCY, DAMPING, GAIN, POSITION = 0.8e-3, 0.4e-3, 0.4e-3, 0.3, 5e-3, 1e-3  # half widths of scatter
TILT_DEG = (1.0, 2.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Excitation:
    """A struck point: node of the owner's model, direction, and sign of the blow."""

    node: int
    direction: str
    sign: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Campaign:
    """How a machine is tested.

    Parameters
    ----------
    sensors : tuple of SensorChannel
        Triaxial ones, and single ones.
    struck : tuple of Excitation
        In several directions.
    unit : str
        Of the sensors.
    band_hz : pair of float
        Hz.
    rate_hz : float
        Hz.
    n_samples : int
        Of a record.
    damping_ratio : float
        Of all modes, as the owner states it.
    """

    sensors: tuple[SensorChannel, ...]
    struck: tuple[Excitation, ...]
    unit: str
    band_hz: tuple[float, float]
    rate_hz: float
    n_samples: int
    damping_ratio: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Machine:
    """A blind case in memory.

    Parameters
    ----------
    drawing : Drawing
        As the owner knows it.
    nominal : Mesh
        The owner's model.
    campaign : Campaign
        The test.
    records : tuple of (int, array)
        Struck point and (n_channels, n_samples) recording in the channels' units, the force first.
    truth : dict
        What ``diagnosis.json`` is judged by.
    """

    drawing: Drawing
    nominal: Mesh
    campaign: Campaign
    records: tuple[tuple[int, FloatArray], ...]
    truth: dict[str, Any]

    def write(self, folder: Path, truth: Path) -> None:
        """Write what the owner hands in to `folder`, and the answer to `truth`."""
        truth.parent.mkdir(parents=True, exist_ok=True)
        truth.write_text(json.dumps(self.truth, indent=1) + "\n", encoding="utf-8")
        _write_model(folder, self.drawing, self.nominal, self.campaign)
        _write_test(folder, self.drawing, self.campaign)
        columns = ("force", *(sensor.column for sensor in self.campaign.sensors))
        counts = dict.fromkeys(range(len(self.campaign.struck)), 0)
        for point, signals in self.records:
            counts[point] += 1
            path = folder / "hits" / f"point_{point + 1}_{counts[point]:02d}.csv"
            write_recording(path, dict(zip(columns, signals, strict=True)), self.campaign.rate_hz, digits=7)


def make_machine(seed: int, effect: str = "null") -> Machine:
    """Make a blind machine.

    Parameters
    ----------
    seed : int
        The same machine comes out for the same seed and effect.
    effect : str
        ``null``, or one of `EFFECTS` in `frf_testbench.machines.concealed`.

    Returns
    -------
    Machine
        On which the effect shows.

    Raises
    ------
    RuntimeError
        If none was found.
    """
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([seed, attempt])
        machine = _draw(rng, str(rng.choice(list(KINDS))), effect, seed)
        if machine is not None:
            return machine
    raise RuntimeError(f"no machine was found for the effect '{effect}' with seed {seed} in {ATTEMPTS} attempts")


def _draw(rng: np.random.Generator, kind: str, effect: str, seed: int) -> Machine | None:
    drawing = draw_machine(rng, kind)
    nominal = build_mesh(drawing)
    nominal_hz, shapes = _solve(nominal, nominal.total_stiffness(), 20)
    shapes = shapes.reshape(len(nominal.nodes), 6, -1)
    campaign = _draw_campaign(rng, nominal_hz, shapes)
    in_band = (nominal_hz >= campaign.band_hz[0]) & (nominal_hz <= campaign.band_hz[1])
    target = Target(
        drawing=drawing,
        sensors=campaign.sensors,
        mass_kg=float(nominal.mass[2::6, 2::6].sum()),
        frequencies_hz=nominal_hz[in_band],
        shapes=shapes[:, :, in_band],
        band_hz=campaign.band_hz,
        damping_ratio=campaign.damping_ratio,
    )
    concealed = draw_concealed(rng, effect, target)
    reality = _Reality.draw(rng, drawing, nominal, campaign)
    system, sound = (reality.build(one) for one in (concealed, draw_concealed(rng, "null", target)))
    n_checked = int(np.count_nonzero(in_band))
    drawn_hz = _solve(fine := build_mesh(drawing, refine=REFINE), fine.total_stiffness(), n_checked + 2)[0]
    if np.abs(nominal_hz[:n_checked] / drawn_hz[:n_checked] - 1).max() > MOST_COARSE:
        return None
    s = 2j * np.pi * np.linspace(*campaign.band_hz, 2000)
    with_effect, without = system.measured_frf(s), sound.measured_frf(s)
    change = float(np.linalg.norm(with_effect - without) / np.linalg.norm(without))
    if concealed.name != "null" and change < LEAST_CHANGE:
        return None
    records = tuple(_record(rng, system))
    truth = {
        "generator": "machines",
        "seed": seed,
        "effect": concealed.name,
        "effect_asked": effect,
        "location": dict(concealed.location),
        "parameters": dict(concealed.parameters),
        "moved": {column: list(place) for column, place in concealed.moved.items()},
        "structure": {"kind": kind, "dofs": 6 * len(nominal.nodes), "modes_in_band": n_checked},
        "detectability": {"frf_change": change},
    }
    return Machine(drawing=drawing, nominal=nominal, campaign=campaign, records=records, truth=truth)


def _solve(mesh: Mesh, stiffness: Any, count: int) -> tuple[FloatArray, FloatArray]:  # noqa: ANN401 - a sparse array
    """Solve for the lowest modes: Hz, and mass-normalised shapes."""
    start = np.random.default_rng(0).standard_normal(mesh.mass.shape[0])
    squares, shapes = eigsh(stiffness, count, mesh.mass, sigma=0.0, v0=start)
    order = np.argsort(squares)
    return np.sqrt(squares[order]) / (2 * np.pi), shapes[:, order]


def _draw_campaign(rng: np.random.Generator, nominal_hz: FloatArray, shapes: FloatArray) -> Campaign:
    last = int(rng.integers(9, 15))
    gaps = nominal_hz[last : last + 4] - nominal_hz[last - 1 : last + 3]
    last += int(np.argmax(gaps / nominal_hz[last - 1 : last + 3]))
    band = float(f"{0.6 * nominal_hz[0]:.3g}"), float(f"{np.sqrt(nominal_hz[last - 1] * nominal_hz[last]):.3g}")
    damping = float(f"{rng.uniform(0.006, 0.02):.2g}")
    rate = float(2 ** np.ceil(np.log2(2.6 * band[1])))
    n_samples = int(2 ** np.ceil(np.log2(rate * np.clip(4 / (damping * 2 * np.pi * nominal_hz[0]), 2.0, 12.0))))
    motion = np.sum(shapes[:, :3, :last] ** 2, axis=(1, 2))
    moving = np.flatnonzero(motion > np.quantile(motion, 0.3))
    n_triaxial, n_single = int(rng.integers(2, 4)), int(rng.integers(0, 4))
    nodes = rng.choice(moving, n_triaxial + n_single, replace=False)
    sensors = []
    for number, node in enumerate(nodes.tolist()):
        axes = "xyz" if number < n_triaxial else str(rng.choice(list("xyz")))
        sensors += [
            SensorChannel(column=f"a{number + 1}{axis}", node=node, direction=axis, sign=int(rng.choice([-1, 1, 1])))
            for axis in axes
        ]
    n_struck = int(rng.integers(3, 5))
    candidates = [*rng.choice(nodes, 1), *rng.choice(moving, n_struck - 1, replace=False)]
    across = [*rng.permutation(list("xyz")), str(rng.choice(list("xyz")))]
    struck = [
        Excitation(node=int(node), direction=str(axis), sign=int(rng.choice([-1, 1])))
        for node, axis in zip(candidates, across[:n_struck], strict=True)
    ]
    return Campaign(
        sensors=tuple(sensors),
        struck=tuple(struck),
        unit=str(rng.choice(list(UNITS))),
        band_hz=band,
        rate_hz=rate,
        n_samples=n_samples,
        damping_ratio=damping,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Reality:
    """The machine and its test as they really are, but for what is concealed."""

    drawing: Drawing
    campaign: Campaign
    mesh: Mesh
    scale: float
    damping: FloatArray
    frequency: FloatArray
    gains: FloatArray
    tilts: tuple[FloatArray, ...]
    offsets: tuple[FloatArray, ...]
    nodes: NDArray[np.int64]

    @classmethod
    def draw(cls, rng: np.random.Generator, drawing: Drawing, nominal: Mesh, campaign: Campaign) -> _Reality:
        n_members, scale = len(drawing.members), float(rng.uniform(0.3, 1.0))
        mesh = build_mesh(
            drawing,
            refine=REFINE,
            stiffer=1 + scale * STIFFNESS * rng.uniform(-1, 1, n_members),
            heavier=1 + scale * MASS * rng.uniform(-1, 1, n_members),
        )
        places = list(dict.fromkeys([sensor.node for sensor in campaign.sensors]))
        tilts = {node: _draw_rotation(rng) for node in places}  # a triaxial sensor is tilted as a whole
        extent = np.ptp(nominal.nodes, axis=0)
        offset = {node: POSITION * scale * extent * rng.uniform(-1, 1, 3) for node in places}
        ends = [(sensor.node, tilts[sensor.node], offset[sensor.node]) for sensor in campaign.sensors]
        ends += [
            (point.node, _draw_rotation(rng), POSITION * scale * extent * rng.uniform(-1, 1, 3))
            for point in campaign.struck
        ]
        return cls(
            drawing=drawing,
            campaign=campaign,
            mesh=mesh,
            scale=scale,
            damping=1 + scale * DAMPING * rng.uniform(-1, 1, 500),
            frequency=1 + scale * FREQUENCY * rng.uniform(-1, 1, 500),
            gains=1 + scale * GAIN * rng.uniform(-1, 1, 1 + len(campaign.sensors)),
            tilts=tuple(tilt for _, tilt, _ in ends),
            offsets=tuple(offset for _, _, offset in ends),
            nodes=find_nominal_nodes(drawing, REFINE),
        )

    def row(self, node: int, axis: FloatArray, offset: FloatArray) -> FloatArray:
        """Motion along an axis near a node."""
        row = np.zeros(6 * len(self.mesh.nodes))
        start = 6 * int(self.nodes[node])
        row[start : start + 6] = np.concatenate([axis, np.cross(offset, axis)])
        return row

    def build(self, concealed: Concealed) -> _System:
        """Put the machine together with an effect."""
        campaign, mesh, unit = self.campaign, self.mesh, np.eye(3)
        stiffness = mesh.total_stiffness(concealed.stiffness_ratios)
        count, frequencies = 40, np.zeros(1)
        while frequencies[-1] < HIGHEST * campaign.band_hz[1] and count <= 320:
            frequencies, shapes = _solve(mesh, stiffness, count)
            count *= 2
        rows = []
        for number, sensor in enumerate(campaign.sensors):
            node, axis = concealed.moved.get(sensor.column, (sensor.node, sensor.direction))
            direction = sensor.sign * self.tilts[number] @ unit["xyz".index(axis)]
            rows.append(self.row(node, direction, self.offsets[number]))
        for number, point in enumerate(campaign.struck, start=len(campaign.sensors)):
            direction = point.sign * self.tilts[number] @ unit["xyz".index(point.direction)]
            rows.append(self.row(point.node, direction, self.offsets[number]))
        for motion, _ in concealed.attached:
            parts = [
                weight * self.row(node, unit["xyz".index(axis)], np.zeros(3)) for (node, axis), weight in motion.items()
            ]
            rows.append(np.sum(parts, axis=0))
        R = np.array(rows)
        omega, at_rows = 2 * np.pi * frequencies, R @ shapes
        static = R @ splu(stiffness).solve(np.ascontiguousarray(R.T)) - (at_rows / omega**2) @ at_rows.T
        own = R[-len(concealed.attached) :] if concealed.attached else R[:0]
        selected = np.eye(len(R))[len(R) - len(own) :]
        receptance = ModalReceptance(
            omega_rad_s=omega * self.frequency[: len(omega)],
            damping_ratio=campaign.damping_ratio * concealed.damping_factor * self.damping[: len(omega)],
            shapes=at_rows,
            static=(static + static.T) / 2,
            attachments=tuple(
                Attachment(rows=selected[[number]], stiffness=_as_matrices(law))
                for number, (_, law) in enumerate(concealed.attached)
            ),
        )
        return _System(campaign=campaign, concealed=concealed, receptance=receptance, gains=self.gains)


def _as_matrices(law: DynamicStiffness) -> DynamicStiffness:
    """Give the dynamic stiffness against one motion as (n_s, 1, 1) matrices."""
    return lambda s: law(s)[:, None, None]


def _draw_rotation(rng: np.random.Generator) -> FloatArray:
    """Draw a small rotation about any axis, (3, 3) array."""
    axis = rng.standard_normal(3)
    x, y, z = axis / np.linalg.norm(axis)
    angle = np.deg2rad(rng.uniform(*TILT_DEG))
    turn = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * turn + (1 - np.cos(angle)) * turn @ turn)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _System:
    """Transfer functions from what strikes to what the channels show."""

    campaign: Campaign
    concealed: Concealed
    receptance: ModalReceptance
    gains: FloatArray

    def motion(self, s: Any, point: int) -> Any:  # noqa: ANN401 - complex arrays
        """Give the (n_s, n_sensors) accelerations for a unit force at a struck point, as the channels show them."""
        n = len(self.campaign.sensors)
        motion = s[:, None] ** 2 * self.receptance(s, list(range(n)), [n + point])[:, :, 0]
        for number, sensor in enumerate(self.campaign.sensors):
            gain = self.concealed.gains.get(sensor.column)
            motion[:, number] *= self.gains[1 + number] * (1.0 if gain is None else gain(s))
        return motion

    def measured_frf(self, s: Any) -> Any:  # noqa: ANN401 - complex arrays
        """Give all FRFs without noise, (n_s, n_sensors, n_struck)."""
        return np.stack([self.motion(s, point) / self.gains[0] for point in range(len(self.campaign.struck))], axis=2)


def _record(rng: np.random.Generator, system: _System) -> list[tuple[int, FloatArray]]:
    """Record all impacts: noise in proportion to the range that the recorder chooses, hum, and offsets."""
    campaign = system.campaign
    grid = LaplaceGrid(n_samples=campaign.n_samples, rate_hz=campaign.rate_hz)
    filtered, units = AntiAlias().gain(grid), np.array([1.0] + [UNITS[campaign.unit]] * len(campaign.sensors))
    n_channels = len(units)
    noise_of_range = 10 ** (rng.uniform(-4.7, -3.7) + rng.uniform(-0.3, 0.3, n_channels))
    hum_of_range = np.where(rng.random(n_channels) < 0.5, 10 ** rng.uniform(-4.5, -3.0, n_channels), 0.0)
    offset_of_range = np.where(rng.random(n_channels) < 0.6, rng.uniform(-1, 1, n_channels) * 2e-3, 0.0)
    pink, hum_hz = float(rng.uniform(0.05, 0.5)), float(rng.choice([50.0, 60.0])) + rng.uniform(-0.02, 0.02)
    contact = rng.uniform(0.5, 0.9) / campaign.band_hz[1]
    time = np.arange(campaign.n_samples) / campaign.rate_hz
    records = []
    for point in range(len(campaign.struck)):
        motion = system.motion(grid.s, point)
        impacts = draw_impacts(
            rng,
            int(rng.integers(3, 6)),
            peak_n=float(rng.uniform(100, 400)),
            spread=float(rng.uniform(1.2, 3.0)),
            contact_s=contact,
            start_s=120 / campaign.rate_hz,
        )
        for impact in impacts:
            force = grid.spectrum(impact.force(grid.fine_time_s))
            spectra = np.column_stack([system.gains[0] * force, motion * force[:, None]]) * filtered[:, None]
            signals = grid.signal(spectra.T) / units[:, None]
            for channel, signal in enumerate(signals):
                full_scale = float(RANGES[np.searchsorted(RANGES, 1.1 * np.abs(signal).max())])
                hum = np.zeros(len(time))
                for order, part in ((1, 1.0), (3, 0.3)):
                    tone = part * np.sin(2 * np.pi * order * hum_hz * time + rng.uniform(0, 2 * np.pi))
                    hum += tone * (order * hum_hz < AntiAlias().passband * campaign.rate_hz)  # what a converter passes
                disturbed = signal + Noise(rms=full_scale * float(noise_of_range[channel]), pink_fraction=pink).draw(
                    rng, len(signal)
                )
                disturbed += full_scale * (hum_of_range[channel] * hum + offset_of_range[channel])
                signals[channel] = quantise(disturbed, full_scale, BITS)
            records.append((point, signals))
    return records


def _write_model(folder: Path, drawing: Drawing, nominal: Mesh, campaign: Campaign) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    matrices = {"M": nominal.mass, "K": nominal.total_stiffness()}
    matrices |= {f"K_{name}": matrix for name, matrix in nominal.stiffness.items()}
    for name, matrix in matrices.items():
        mmwrite(folder / f"{name}.mtx", (matrix + matrix.T) / 2, precision=15, symmetry="symmetric")
    rows = ["node,direction,x_m,y_m,z_m"]
    for node, position in enumerate(nominal.nodes, start=1):
        place = ",".join(f"{value:.9g}" for value in position)
        rows += [f"{node},{direction},{place}" for direction in DIRECTIONS]
    (folder / "dofs.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    text = (
        f'[model]\nkind = "matrices"\nname = "{drawing.kind}"\n\n[damping]\nmodal_ratio = {campaign.damping_ratio!r}\n'
    )
    text += '\n[matrices]\nmass = "M.mtx"\nstiffness = "K.mtx"\ndofs = "dofs.csv"\n'
    for name in drawing.groups:
        text += f'\n[[matrices.group]]\nname = "{name}"\nstiffness = "K_{name}.mtx"\n'
    write_toml(folder / "model.toml", text)


def _write_test(folder: Path, drawing: Drawing, campaign: Campaign) -> None:
    def dof(place: SensorChannel | Excitation) -> str:
        return f"{place.node + 1}:{'+' if place.sign > 0 else '-'}{place.direction}"

    text = f'[test]\nname = "{drawing.kind}"\nkind = "hammer"\n\n'
    text += '[[channel]]\ncolumn = "force"\nrole = "input"\nquantity = "force"\nunit = "N"\n'
    for sensor in campaign.sensors:
        text += f'\n[[channel]]\ncolumn = "{sensor.column}"\nrole = "output"\nquantity = "acceleration"\n'
        text += f'unit = "{campaign.unit}"\ndof = "{dof(sensor)}"\n'
    for number, point in enumerate(campaign.struck, start=1):
        text += f'\n[[hit]]\ndof = "{dof(point)}"\nfiles = ["hits/point_{number}_*.csv"]\n'
    write_toml(folder / "test.toml", text)
    low, high = campaign.band_hz
    write_toml(
        folder / "pipeline.toml",
        f'[pipeline]\nname = "{drawing.kind}"\ntest = "test.toml"\nmodel = "model.toml"\n\n'
        f"[fit]\nband_hz = [{low!r}, {high!r}]\n",
    )
