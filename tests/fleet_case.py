"""A fleet of small cantilevers whose stiffness scatters, written as a user would hand it in."""

import numpy as np

import small_campaign
from small_campaign import write_campaign

FLEET = """
[fleet]
name = "line 3"
model = "model.toml"
pipeline = "pipeline.toml"
machines = "machines/*/test.toml"
"""


def write_fleet(folder, count, *, seed=0, scatter=0.01, factors=(), records=2, more="", write=write_campaign):
    """Write `fleet.toml` with machines m01, m02 and so on; `factors` are on the modulus of the first ones.

    `write` makes the campaign of each.
    """
    rng = np.random.default_rng(seed)
    whole = small_campaign.YOUNG
    try:
        for number in range(1, count + 1):
            factor = factors[number - 1] if number <= len(factors) else 1 + scatter * rng.standard_normal()
            small_campaign.YOUNG = whole * factor
            machine = folder / "machines" / f"m{number:02d}"
            write(machine, records=records, seed=seed + number)
            for name in ("model.toml", "pipeline.toml"):
                (machine / name).rename(folder / name)
    finally:
        small_campaign.YOUNG = whole
    path = folder / "fleet.toml"
    path.write_text(FLEET + more)
    return path
