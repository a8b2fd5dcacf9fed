"""Whatever is handed to a public function, what it raises is an error of the package that names what was given."""

from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import frf_ipz

LINES = np.arange(5, 400.0, 1.0)
BEAM = {
    "length_m": 0.5,
    "width_m": 0.02,
    "thickness_m": 0.005,
    "youngs_modulus_Pa": 70e9,
    "density_kg_m3": 2700,
    "elements": 10,
    "left": "clamped",
    "modal_ratio": 0.01,
}
MATRICES = {"mass": np.eye(2), "stiffness": np.array([[2.0, -1.0], [-1.0, 1.0]]), "dofs": ["1:x", "2:x"]}
RECORDING = {
    "force": np.ones(10),
    "responses": np.ones((1, 10)),
    "sample_rate_hz": 100.0,
    "input_dof": "1:x",
    "output_dofs": ["1:x"],
}
FRFS = {"frequency_hz": [1.0, 2.0], "values": np.ones((2, 1, 1)), "outputs": ["1:x"], "inputs": ["1:x"]}
NOTHING_OF_THE_KIND = (None, "text", 7, object(), np.zeros(3), {"a": 1})


@cache
def good():
    """One of each kind of thing that public functions take."""
    beam = frf_ipz.make_beam(**BEAM)
    tip, middle = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
    labels = [frf_ipz.FrfLabel(dof, tip, frf_ipz.FrfQuantity.ACCELERANCE) for dof in (middle, tip)]
    values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * LINES)[:, :, None]
    frfs = frf_ipz.FrfSet.from_arrays(
        LINES, values, outputs=[middle, tip], inputs=[tip], variance=np.full(values.shape, 1e-4)
    )
    fit = frf_ipz.fit_modes(frfs)
    reduced_model = frf_ipz.reduce_model(fit, beam, points=["9:+z"])
    test = frf_ipz.VibrationTest.from_frfs(frfs)
    state = frf_ipz.MachineState(observed=frf_ipz.observe(test, frfs=frfs), fe_model=beam)
    return SimpleNamespace(
        beam=beam,
        labels=labels,
        frfs=frfs,
        fit=fit,
        reduced_model=reduced_model,
        pairs=frf_ipz.pair_roots(fit, reduced_model),
        updated_model=frf_ipz.update_model(fit, reduced_model),
        test=test,
        state=state,
        modes=frf_ipz.solve_modes(beam, n_modes=3),
        run=frf_ipz.Campaign(frfs).run(),
        diagnosis=frf_ipz.diagnose(frfs, beam, options=frf_ipz.DiagnoseOptions(effects=("added_mass",))),
    )


def calls():
    """Give for each public function right arguments, and for some of them values that are wrong."""
    g = good()
    s = 2j * np.pi * LINES
    points = {"points": ["9:+z", 7, ["text"], ["99:+z"], [3]]}
    model_points = {"measured": g.fit, "updated_model": g.updated_model}
    return {
        "band_of_magnitudes": (
            model_points | {"labels": g.labels, "s": s},
            {"labels": [["1:x"], 3], "s": [np.zeros(3), np.array([np.nan]), np.ones((2, 2)), "text"]},
        ),
        "compare_frfs": (
            {"first": np.ones((2, 1)), "second": np.ones((2, 1))},
            {"second": [np.ones((3, 1)), np.ones(2)]},
        ),
        "compare_runs": (
            {"before": g.run, "after": g.run},
            {"before": ["results", 3], "frequency_scatter": [-1.0, np.nan, "text", True], "damping_scatter": [np.inf]},
        ),
        "compare_states": ({"before": g.state, "after": g.state}, {"before": [[], [g.state, 3]]}),
        "compute_frfs": (
            {"model": g.beam, "labels": g.labels, "s": s},
            {"labels": [["1:x"], g.labels[0]], "s": [np.array([np.nan]), np.ones((2, 2))]},
        ),
        "correct_frfs": ({"frfs": g.frfs, "diagnosis": g.diagnosis}, {}),
        "correct_model": ({"diagnosis": g.diagnosis, "fe_model": g.beam}, {}),
        "diagnose": (
            {"data": g.frfs, "fe_model": g.beam},
            {"options": [{"seed": 1}, 3], "effects": [["added_mass"], 3]},
        ),
        "estimate_frfs": ({"test": g.test}, {"options": [{"estimator": "H1"}, frf_ipz.FitOptions()]}),
        "estimate_gains": ({"fit": g.fit, "shapes": g.modes}, {}),
        "estimate_uncertainty_weights": (model_points, points),
        "fit_modes": ({"frfs": g.frfs}, {"options": [{}, frf_ipz.IngestOptions()]}),
        "fit_residues": (
            {"frfs": g.frfs, "poles": g.fit.model.poles[:3]},
            {"poles": [np.array([]), np.array([np.nan + 1j]), np.array([-1 - 1j]), np.ones((2, 2))]},
        ),
        "make_beam": (
            BEAM,
            {name: [-1.0, np.nan, np.inf, "text", None] for name in BEAM if name not in {"left", "modal_ratio"}}
            | {"left": ["glued", 3], "modal_ratio": [-0.1, 1.5, np.nan, "text"]},
        ),
        "make_diagnosed_basis": ({"diagnosis": g.diagnosis, "fe_model": g.beam, "reduced_model": g.reduced_model}, {}),
        "make_structural_basis": (
            {"fe_model": g.beam, "reduced_model": g.reduced_model},
            {"sensors": ["text", ["99:z"], 3]},
        ),
        "observe": ({"test": g.test, "frfs": g.frfs}, {"fit": [{}, 3]}),
        "open_results": ({"path": "results"}, {"path": [Path(__file__), Path(__file__).parent]}),
        "open_fleet": ({"path": "results"}, {"path": [Path(__file__), Path(__file__).parent]}),
        "pair_roots": ({"fit": g.fit, "reduced_model": g.reduced_model}, {}),
        "parse_dof": ({"text": "1:x"}, {"text": ["", "1", "1:q", "-1:x"]}),
        "predict_frfs": (
            model_points | {"points": ["9:+z"]},
            points | {"frequency_hz": [np.array([np.nan]), np.array([-1.0]), np.ones((2, 2)), "text"]},
        ),
        "propagate_position_tolerance": (
            {"measured": g.fit, "reduced_model": g.reduced_model, "fe_model": g.beam, "tolerance_m_per_m": 1e-3},
            {"tolerance_m_per_m": [-1.0, np.nan]},
        ),
        "read_ensemble": ({"path": "x.mat"}, {"path": [Path(__file__)]}),
        "read_recordings": (
            {"path": "x.csv"},
            {"path": [Path(__file__), Path("x.csv"), 3], "sample_rate_hz": [0.0, "fast"], "time_column": [3]},
        ),
        "read_frfs": (
            {"path": "x.csv"},
            {
                "path": [Path(__file__), Path("x.csv")],
                "quantity": ["inertia", 3],
                "unit": ["parsec", 3],
                "output": ["1:q", 3],
                "input": ["1:q", 3],
            },
        ),
        "read_model": ({"path": "x.toml"}, {"path": [Path(__file__)]}),
        "read_state_space": ({"path": "x.json"}, {"path": [Path(__file__)]}),
        "read_test": ({"path": "x.toml"}, {"path": [Path(__file__)]}),
        "read_updated_model": ({"path": "x.npz"}, {"path": [Path(__file__)]}),
        "rebuild_state_space": (
            {"path": "x.npz", "inputs": ["1:z"], "outputs": ["2:z"]},
            {"path": [Path(__file__)], "inputs": ["1:z", 3], "options": [3]},
        ),
        "decouple_rigid_body": ({"system": 3}, {"axes": ["height", 3]}),
        "read_uncertainty_weights": ({"path": "x.json"}, {"path": [Path(__file__)]}),
        "reduce_model": (
            {"measured": g.fit, "fe_model": g.beam},
            points | {"default_damping_ratio": [-0.1, 1.5, np.nan, "text"], "options": [{}, 3]},
        ),
        "run_fleet": (
            {"path": "x.toml", "out": "results"},
            {"path": [Path(__file__)], "out": [Path(__file__)], "jobs": [0, 1.5, "two", True], "only": [3, [3], "m1"]},
        ),
        "run_pipeline": ({"path": "x.toml", "out": "results"}, {"path": [Path(__file__)], "out": [Path(__file__)]}),
        "shift_to_measured_poles": ({"pairs": g.pairs, "reduced_model": g.reduced_model}, {}),
        "solve_modes": ({"model": g.beam}, {"n_modes": [0, -1, 2.5, "text"], "up_to_hz": [-1.0, np.nan, "text"]}),
        "to_frd": ({"frfs": g.frfs}, {}),
        "to_state_space": (
            model_points,
            points | {"options": [{}, 3], "delays_s": [{"output 99:z": 0.1}, 3, {"output 6:+z": -1.0}]},
        ),
        "to_state_space_ensemble": (
            model_points | {"options": frf_ipz.ExportOptions(ensemble=2)},
            points | {"options": [{}, 3]},
        ),
        "update_model": (
            {"fit": g.fit, "reduced_model": g.reduced_model},
            {"pairs": [3], "fe_model": [3], "options": [{}, frf_ipz.UpdateOptions(method="guess")], "basis": [3]},
        ),
        "write_frfs": ({"frfs": g.frfs, "path": "x.unv"}, {"path": ["x.txt"]}),
        "write_modes": ({"fit": g.fit, "path": "x.csv"}, {"path": ["x.txt"]}),
        "write_state_space": ({"system": 3, "path": "x.json"}, {"path": ["x.txt"]}),
        "FrfSet.from_arrays": (
            FRFS,
            {
                "frequency_hz": [[1.0], [2.0, 1.0], [np.nan, 1.0], [-1.0, 1.0], "text", [[1.0, 2.0]]],
                "values": [np.ones((2, 1)), np.full((2, 1, 1), np.nan), np.array([[[1.0]], [[np.inf]]]), "text", None],
                "outputs": [["1:q"], [], "1:x", 3],
                "inputs": [["1:q"], [], "1:x", 3],
                "quantity": ["inertia", 3, None],
                "variance": [np.ones(2), "text"],
                "coherence": [np.ones(2), "text"],
                "averages": ["text", -1],
                "unknown_scale": ["somehow", 3],
            },
        ),
        "StructuralModel.from_matrices": (
            MATRICES,
            {
                "mass": [np.eye(3), -np.eye(2), np.full((2, 2), np.nan), "text", np.ones(3), None],
                "stiffness": [np.eye(3), -np.eye(2), np.full((2, 2), np.nan), "text", [[1.0, 2.0], [0.0, 1.0]], None],
                "damping": [np.eye(3), np.full((2, 2), np.nan), "text"],
                "dofs": [["1:x"], ["1:x", "1:x"], ["text", "2:x"], "1:x", 3],
                "coordinates": [{1: (0, 0, 0)}, np.ones((3, 3)), "text", {1: "text", 2: "text"}],
                "modal_damping": [-0.1, 1.0, np.nan, "text"],
            },
        ),
        "VibrationTest.from_recordings": (
            {"recordings": [frf_ipz.Recording(**RECORDING)]},
            {"recordings": [[], [3], 3], "kind": ["shaker", 3], "unknown_scale": ["somehow", 3]},
        ),
        "VibrationTest.from_frfs": ({"frfs": g.frfs}, {}),
        "Recording": (
            RECORDING,
            {
                "force": [np.ones(9), np.full(10, np.nan), "text", np.ones((2, 10))],
                "responses": [np.ones((2, 10)), np.full((1, 10), np.inf), "text"],
                "sample_rate_hz": [0.0, -1.0, np.nan, "text"],
                "input_dof": ["1:q", 3],
                "output_dofs": [["1:q"], [], "1:x", 3],
                "quantity": ["force", 3],
            },
        ),
        "Campaign": (
            {"data": g.frfs, "fe_model": g.beam},
            {"points": ["9:+z", ["text"], ["99:z"], 3], "fit": [{}, 3], "reference": [3], "effects": [["text"], 3]},
        ),
    }


WITHOUT_DATA = {"parse_dof", "make_beam", "FrfSet.from_arrays", "StructuralModel.from_matrices", "Recording"}


def function(name):
    value = frf_ipz
    for part in name.split("."):
        value = getattr(value, part)
    return value


FUNCTIONS = sorted(
    name
    for name in frf_ipz.__all__
    if name != "plotting" and not isinstance(getattr(frf_ipz, name), type) and callable(getattr(frf_ipz, name))
)
CALLED = [
    *FUNCTIONS,
    "FrfSet.from_arrays",
    "StructuralModel.from_matrices",
    "VibrationTest.from_recordings",
    "VibrationTest.from_frfs",
    "Recording",
    "Campaign",
]


def wrong_values(name):
    arguments, wrong = calls()[name]
    if name not in WITHOUT_DATA:
        first, *_ = arguments
        models = [key for key in arguments if key.endswith("model") or key in {first, "fit", "diagnosis", "pairs"}]
        for key in dict.fromkeys([first, *models]):
            is_optional = (name, key) == ("Campaign", "fe_model")
            yield from ((arguments | {key: value}, value) for value in NOTHING_OF_THE_KIND[is_optional:])
    for key, values in wrong.items():
        yield from ((arguments | {key: value}, value) for value in values)


@pytest.mark.parametrize("name", CALLED)
def test_wrong_values_raise_errors_of_the_package(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    slips = []
    for arguments, value in wrong_values(name):
        try:
            function(name)(**arguments)
        except frf_ipz.FrfIpzError as error:
            if not str(error):
                slips.append(f"{value!r:.60}: no message")
        except Exception as error:
            slips.append(f"{value!r:.60}: {type(error).__name__}: {error}")
        else:
            slips.append(f"{value!r:.60}: nothing was raised")
    assert not slips, "\n".join(slips)


@pytest.mark.parametrize("value", NOTHING_OF_THE_KIND, ids=lambda value: type(value).__name__)
@pytest.mark.parametrize("name", [name for name in frf_ipz.plotting.__all__ if name.startswith("plot_")])
def test_a_plot_refuses_what_is_no_result(name, value):
    needs_fit = name in {"plot_fit", "plot_misfit"}
    with pytest.raises(frf_ipz.InputError, match="needed is a"):
        getattr(frf_ipz.plotting, name)(*([value, good().fit] if needs_fit else [value]))


def test_plots_refuse_an_frf_a_column_and_a_label_that_is_not_there():
    g = good()
    prediction = frf_ipz.predict_frfs(g.fit, g.updated_model, points=["9:+z"])
    for name, arguments in {
        "plot_prediction": {"prediction": prediction, "frf": 1},
        "plot_mismatch": {"diagnosis": g.diagnosis, "column": "never"},
        "plot_structure": {"geometry": g.beam.geometry, "sensors": ["1:q"]},
        "plot_fit": {"frfs": g.frfs, "fit": 3},
    }.items():
        with pytest.raises(frf_ipz.InputError):
            getattr(frf_ipz.plotting, name)(**arguments)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A run's folder with all that can be read again, and files of a test, a model and a pipeline."""
    folder = tmp_path_factory.mktemp("files")
    options = frf_ipz.ExportOptions(ensemble=2)
    frf_ipz.Campaign(good().frfs, good().beam, points=["9:+z"], export=options).run(folder / "run", until="export")
    (folder / "test.toml").write_text(
        '[test]\nkind = "frf"\n[[frf]]\nfile = "tip.csv"\nquantity = "accelerance"\n', encoding="utf-8"
    )
    tip = zip(LINES, good().frfs.values[:, 1], strict=True)
    rows = "".join(f"{hz},11:+z,11:+z,{value.real},{value.imag}\n" for hz, value in tip)
    (folder / "tip.csv").write_text("frequency_hz,output_dof,input_dof,real,imag\n" + rows, encoding="utf-8")
    keys = "".join(f"{key} = {value!r}\n" for key, value in BEAM.items() if key != "modal_ratio")
    (folder / "model.toml").write_text('[model]\nkind = "beam"\n[beam]\n' + keys, encoding="utf-8")
    (folder / "pipeline.toml").write_text('[pipeline]\ntest = "test.toml"\n', encoding="utf-8")
    return folder


@pytest.mark.parametrize("kind", [str, Path])
@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("read_test", "test.toml"),
        ("read_model", "model.toml"),
        ("read_frfs", "tip.csv"),
        ("open_results", "run"),
        ("read_state_space", "run/statespace.json"),
        ("read_state_space", "run/statespace.mat"),
        ("read_ensemble", "run/statespace_ensemble.mat"),
        ("read_uncertainty_weights", "run/uncertainty.json"),
    ],
)
def test_a_path_to_read_is_a_text_or_a_path(folder, name, file, kind):
    assert function(name)(kind(folder / file)) is not None


@pytest.mark.parametrize("kind", [str, Path])
def test_a_path_to_write_is_a_text_or_a_path(folder, tmp_path, kind):
    results = frf_ipz.run_pipeline(kind(folder / "pipeline.toml"), kind(tmp_path / "run"), until="fit")
    results.write_report(kind(tmp_path / "report.html"))
    system = frf_ipz.read_state_space(folder / "run" / "statespace.json")
    frf_ipz.write_state_space(system, kind(tmp_path / "statespace.mat"))
    frf_ipz.Campaign(good().frfs).run(kind(tmp_path / "campaign"), until="ingest")
    frf_ipz.plotting.save_figure(results.plot("fit"), kind(tmp_path / "fit.svg"), file_format="svg")
    assert {path.name for path in tmp_path.iterdir()} == {"run", "report.html", "statespace.mat", "campaign", "fit.svg"}


@pytest.mark.parametrize("name", [name for name in FUNCTIONS if name.startswith("read_")])
def test_a_file_that_is_not_there_is_named(name, tmp_path):
    path = tmp_path / "missing.mat"
    with pytest.raises(frf_ipz.FileFormatError, match="there is no such file") as raised:
        function(name)(path)
    assert str(path) in str(raised.value)
