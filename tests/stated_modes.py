"""Modes of a clamped beam that is softer than its model, as somebody has identified them: in memory, and as files."""

import numpy as np

import frf_ipz
from clamped_beam import BEAM

SENSORS = ("6:+z", "11:-z", "16:+z", "21:+z")
POINT = "14:+z"
FREQUENCY_STD, DAMPING_STD = 2e-4, 0.03  # relative
MODEL = f"""
[model]
kind = "beam"
[damping]
modal_ratio = {BEAM["modal_ratio"]}
[beam]
length_m = {BEAM["length_m"]}
width_m = {BEAM["width_m"]}
thickness_m = {BEAM["thickness_m"]}
density_kg_m3 = {BEAM["density_kg_m3"]}
youngs_modulus_Pa = {BEAM["youngs_modulus_Pa"]}
elements = {BEAM["elements"]}
left = "clamped"
"""
PIPELINE = f'[pipeline]\ntest = "test.toml"\nmodel = "model.toml"\n[predict]\npoints = ["{POINT}"]\n'
TEST = '[test]\nkind = "modes"\n[[modes]]\nfile = "modes.csv"\n'


def softer_beam():
    return frf_ipz.make_beam(**BEAM | {"youngs_modulus_Pa": 0.95 * BEAM["youngs_modulus_Pa"], "modal_ratio": 0.008})


def stated_modes(seed, n_modes=4, sensors=SENSORS, **changes):
    """Modes with errors of the stated size; each shape has a scale and a sign of its own."""
    rng = np.random.default_rng(seed)
    modes = frf_ipz.solve_modes(softer_beam(), n_modes=n_modes)
    dofs = [frf_ipz.parse_dof(text) for text in sensors]
    shapes = np.array([dof.sign * modes.shapes[modes.dofs.index(dof.unsigned)] for dof in dofs])
    shapes = shapes * (1 + 0.02 * rng.standard_normal(shapes.shape)) * rng.uniform(-3, 3, n_modes)
    values = {
        "natural_frequency_hz": modes.natural_frequency_hz * (1 + FREQUENCY_STD * rng.standard_normal(n_modes)),
        "damping_ratio": modes.damping_ratio * (1 + DAMPING_STD * rng.standard_normal(n_modes)),
        "frequency_std_hz": FREQUENCY_STD * modes.natural_frequency_hz,
        "damping_ratio_std": DAMPING_STD * modes.damping_ratio,
    }
    return frf_ipz.ModalParameters(shapes=shapes, dofs=sensors, **values | changes)


def as_csv(modes):
    rows = ["mode,frequency_hz,damping_ratio,frequency_std_hz,damping_ratio_std,dof,real,imag"]
    for mode, hertz in enumerate(modes.natural_frequency_hz):
        numbers = modes.damping_ratio[mode], modes.frequency_std_hz[mode], modes.damping_ratio_std[mode]
        for dof, value in zip(modes.dofs, modes.shapes[:, mode], strict=True):
            cells = [float(hertz), *map(float, numbers), str(dof), float(value.real), float(value.imag)]
            rows.append(",".join([str(mode + 1), *(cell if isinstance(cell, str) else repr(cell) for cell in cells)]))
    return "\n".join(rows) + "\n"


def write_campaign(folder, modes, *, pipeline=PIPELINE, test=TEST):
    texts = {"modes.csv": as_csv(modes), "test.toml": test, "model.toml": MODEL, "pipeline.toml": pipeline}
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder / "pipeline.toml"
