"""Leave out every sensor, or every struck point, of a measured structure in turn; predict its FRFs, and compare.

``python pipelines/left_out.py TEST MODEL LOW HIGH [NODE ...]``: test.toml and model.toml, the band in Hz, and the nodes
to leave out (all, by default) of the side of the test that has more points. Nothing of what is left out is used. Errors
are medians over lines in dB: as predicted, and after the one factor that suits all FRFs of the node best. Beside them
stand the measured poles with nominal shapes, which any prediction has to beat, and the share of lines that lie in the
90 % band, their own noise allowed for.
"""

import sys
from pathlib import Path

import pandas as pd

import frf_ipz
from frf_testbench.studies.left_out import BeamTest, predict_left_out


def nodes_of(frfs: frf_ipz.FrfSet) -> tuple[str, list[int]]:
    """Name the side that has more points, and its nodes."""
    sides = {side: {getattr(label, f"{side}_dof").node for label in frfs.labels} for side in ("output", "input")}
    side = max(sides, key=lambda name: len(sides[name]))
    return side, sorted(sides[side])


def main(test: str, model: str, low_hz: str, high_hz: str, *nodes: str) -> pd.DataFrame:
    """Leave out each node, and print the table."""
    frfs, fe_model = frf_ipz.estimate_frfs(frf_ipz.read_test(Path(test))).frfs, frf_ipz.read_model(Path(model))
    side, every = nodes_of(frfs)
    tested = BeamTest(frfs=frfs, fe_model=fe_model, band_hz=(float(low_hz), float(high_hz)), side=side)
    rows = {}
    for node in [int(name) for name in nodes] or every:
        table = predict_left_out(tested, node)
        nominal = table.loc["measured poles, nominal shapes", "dB after the factor"]
        rows[node] = {"nominal shapes, dB after the factor": nominal} | table.loc["updated"].to_dict()
    result = pd.DataFrame(rows).T.rename_axis(f"{side} left out")
    print(result.round(2).to_string())
    return result


if __name__ == "__main__":
    main(*sys.argv[1:])
