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


def true_frfs(labels: tuple[frf_ipz.FrfLabel, ...], lines_hz: np.ndarray) -> np.ndarray:
    """FRFs kept aside, in the order of the labels: (n_lines, n_frfs) complex array."""
    table = pd.read_csv(TRUTH)
    columns = []
    for label in labels:
        rows = table[(table["output_dof"] == str(label.output_dof)) & (table["input_dof"] == str(label.input_dof))]
        rows = rows.set_index("frequency_hz").reindex(lines_hz, method="nearest", tolerance=1e-3)
        columns.append(rows["real"].to_numpy() + 1j * rows["imag"].to_numpy())
    return np.stack(columns, axis=1)


def compare(run: frf_ipz.Results) -> pd.DataFrame:
    """Agreement with the FRFs kept aside: nominal, with measured poles on nominal shapes, updated."""
    prediction, nominal = run.prediction, run.updated_model.nominal
    s = 2j * np.pi * prediction.frequency_hz
    shifted = frf_ipz.shift_to_measured_poles(run.pairs, nominal)
    models = {
        "before updating": prediction.nominal,
        "measured poles, nominal shapes": frf_ipz.compute_frfs(shifted, prediction.labels, s),
        "after updating": prediction.values,
    }
    truth = true_frfs(prediction.labels, prediction.frequency_hz)
    names = [*prediction.labels, "all"]
    tables = {}
    for model, values in models.items():
        one, pooled = (
            frf_ipz.compare_frfs(truth, values),
            frf_ipz.compare_frfs(truth.reshape(-1, 1), values.reshape(-1, 1)),
        )
        tables[model] = pd.concat([one.to_frame(names[:-1]), pooled.to_frame(names[-1:])])
    return pd.concat(tables, names=["model"]).reset_index(level=0)


def main(out: Path) -> None:
    """Run the chain and say how well the point of interest was predicted."""
    run = frf_ipz.run_pipeline(HERE / "cantilever.toml", out)
    print(run.summary())
    print("\nPoint of interest against the FRF that was kept aside:")
    print(compare(run).to_string(index=False, float_format="{:.4f}".format))
    print(f"\nOpen {out / 'report.html'} in a browser.")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "results/cantilever"))
