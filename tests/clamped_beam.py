"""The keys of a clamped beam that is small enough to be measured by formulas."""

BEAM = {
    "length_m": 0.5,
    "width_m": 0.02,
    "thickness_m": 0.005,
    "youngs_modulus_Pa": 70e9,
    "density_kg_m3": 2700,
    "elements": 20,
    "left": "clamped",
    "modal_ratio": 0.005,
}
