"""The demo: predict the FRF at a point that was never measured, and compare it with the one that was kept aside.

python pipelines/cantilever.py [DIR]
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

import frf_ipz

HERE = Path(__file__).parent
TRUTH = HERE.parent / "data" / "reference" / "cantilever_poi_frf.csv"


def compare(run):
    """Agreement with the FRFs kept aside: nominal, with measured poles on nominal shapes, updated."""
    prediction, nominal = run.load("predict"), run.load("update").nominal
    lines, labels = prediction.frequency_hz, prediction.labels
    truth = pd.read_csv(TRUTH).set_index(["output_dof", "input_dof", "frequency_hz"])
    truth = (truth["real"] + 1j * truth["imag"]).unstack(["output_dof", "input_dof"])
    truth = truth.reindex(lines)[[(str(label.output_dof), str(label.input_dof)) for label in labels]].to_numpy()
    shifted = frf_ipz.with_measured_poles(nominal, run.load("pair"))
    models = {
        "before updating": prediction.nominal,
        "measured poles, nominal shapes": frf_ipz.model_frfs(shifted, labels, 2j * np.pi * lines),
        "after updating": prediction.values,
    }
    rows = []
    for name, values in models.items():
        found = frf_ipz.compare_frfs(truth, values)
        for k, label in enumerate(labels):
            row = {"model": name, "FRF": str(label), "X_S": found.shape[k], "X_A": found.amplitude[k]}
            rows.append({**row, "median dB": found.median_db[k], "largest dB": found.largest_db[k]})
    return pd.DataFrame(rows)


def main(out):
    """Run the chain and say how well the point of interest was predicted."""
    run = frf_ipz.run_pipeline(HERE / "cantilever.toml", out)
    print(frf_ipz.summarise(run))
    print("\nPoint of interest against the FRF that was kept aside:")
    print(compare(run).to_string(index=False, float_format="{:.4f}".format))
    print(f"\nOpen {out / 'report.html'} in a browser.")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "results/cantilever"))
