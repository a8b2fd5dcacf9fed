"""Where numbers end in no result, what most likely has to be corrected is said with its file and key."""

import re

import numpy as np
import pytest
from scipy import io, linalg

import frf_ipz
from frf_ipz.errors import FileFormatError, IllConditionedError, InputError, NoModesError, NumericalError
from frf_ipz.pipeline.inputs import read_inputs
from frf_ipz.pipeline.stages.hints import naming_exchanged_columns, naming_the_cause
from small_campaign import write_campaign

NO_END = NumericalError("the numbers have no end")


def fail_with(folder, change, error=NO_END):
    """Let a stage after the fit of a small campaign fail, whose model was changed."""
    pipeline = write_campaign(folder)
    model = folder / "model.toml"
    model.write_text(change(model.read_text()))
    inputs = read_inputs(pipeline)
    estimate = frf_ipz.estimate_frfs(inputs.test)
    fit = frf_ipz.fit_modes(estimate.frfs, options=inputs.options.fit)
    with naming_the_cause(inputs, estimate, fit, inputs.fe_model):
        raise error


def test_a_wrong_unit_of_the_model_is_an_error_of_the_input(tmp_path):
    def in_megapascal(text):
        (line,) = [line for line in text.splitlines() if line.startswith("youngs_modulus_Pa")]
        return text.replace(line, f"youngs_modulus_Pa = {float(line.partition('=')[2]) / 1e6}")

    with pytest.raises(InputError) as caught:
        fail_with(tmp_path, in_megapascal)
    message = str(caught.value)
    assert "pipeline.toml: the numbers have no end; most likely" in message
    assert "youngs_modulus_Pa" in message
    assert "model.toml" in message


def test_without_a_likely_cause_the_error_stays_what_it_is(tmp_path):
    with pytest.raises(NumericalError, match=r"^the numbers have no end$"):
        fail_with(tmp_path, lambda text: text)


@pytest.mark.parametrize(
    ("key", "place"), [("", "model.toml: the modes"), ("reduce.dofs", "pipeline.toml, key 'reduce.dofs': the modes")]
)
def test_matrices_that_cannot_be_computed_with_are_an_error_of_their_file(tmp_path, key, place):
    error = IllConditionedError("the modes can hardly be told apart", key=key)
    with pytest.raises(FileFormatError, match=f"{re.escape(place)} can hardly be told apart$"):
        fail_with(tmp_path, lambda text: text, error)


def overflow(*_, **__):
    raise np.linalg.LinAlgError


def do_not_end(*_, **__):
    linalg.eigvalsh([[np.inf]])


def be_singular(*_, **__):
    raise IllConditionedError("a matrix of order 3 is singular; check the model's mass and stiffness matrices")


@pytest.mark.parametrize("fault", [overflow, do_not_end, be_singular])
@pytest.mark.parametrize(
    ("module", "function", "tried"),
    [
        ("modelling", "pair_roots", "'pair' tried to pair measured with computed poles and zeros"),
        ("modelling", "update_model", "'update' tried to bring the model to the measured poles and zeros"),
        ("outputs", "predict_frfs", "'predict' tried to predict FRFs with the updated model"),
    ],
)
def test_numbers_of_a_late_stage_are_laid_to_no_file(tmp_path, monkeypatch, module, function, tried, fault):
    monkeypatch.setattr(f"frf_ipz.pipeline.stages.{module}.{function}", fault)
    with pytest.raises(
        NumericalError, match=f"^the stage {tried}: (numbers|a matrix) [^;]*; (look at|check)"
    ) as caught:
        frf_ipz.run_pipeline(write_campaign(tmp_path), tmp_path / "run")
    assert "model.toml" not in str(caught.value)
    assert "mass and stiffness matrices" not in str(caught.value)


def test_a_diagnosis_that_fails_on_its_own_numbers_names_no_model(tmp_path, monkeypatch):
    monkeypatch.setattr("frf_ipz.pipeline.stages.mismatch.find_causes", overflow)
    pipeline = write_campaign(tmp_path)
    pipeline.write_text(pipeline.read_text().replace('run = "never"', 'run = "always"'))
    with pytest.raises(NumericalError, match=r"^the stage 'diagnose' tried to say .*; \[diagnose\] run = \"never\""):
        frf_ipz.run_pipeline(pipeline, tmp_path / "run")


@pytest.mark.parametrize("diagnosis", ["", '[diagnose]\nrun = "always"\n', "[diagnose]\napply = true\n"])
def test_a_run_names_the_file_of_a_stiffness_of_few_digits(tmp_path, diagnosis):
    pipeline = write_campaign(tmp_path)
    beam = frf_ipz.read_model(tmp_path / "model.toml")
    for name, matrix, digits in (("M", beam.mass, 17), ("K", beam.stiffness, 4)):
        io.mmwrite(tmp_path / f"{name}.mtx", matrix, precision=digits)
    rows = [f"{dof.node},{dof.direction},{0.025 * (dof.node - 1)},0,0" for dof in beam.dofs]
    (tmp_path / "dofs.csv").write_text("\n".join(["node,direction,x_m,y_m,z_m", *rows]))
    matrices = 'mass = "M.mtx"\nstiffness = "K.mtx"\ndofs = "dofs.csv"\n'
    (tmp_path / "model.toml").write_text(f'[model]\nkind = "matrices"\n[matrices]\n{matrices}')
    if diagnosis:
        pipeline.write_text(pipeline.read_text().replace('[diagnose]\nrun = "never"\n', diagnosis))
    with pytest.raises(FileFormatError, match=r"model\.toml: the stiffness of the model .* is printed with about 4"):
        frf_ipz.run_pipeline(pipeline, tmp_path / "run")


def fail_to_fit(folder, change):
    """Let the fit of a small campaign fail, whose test was changed."""
    pipeline = write_campaign(folder)
    test = folder / "test.toml"
    test.write_text(change(test.read_text()))
    inputs = read_inputs(pipeline)
    with naming_exchanged_columns(inputs, frf_ipz.estimate_frfs(inputs.test)):
        raise NoModesError("no mode stands out")


def test_exchanged_columns_are_named_where_nothing_can_be_fitted(tmp_path):
    def exchange(text):
        return text.replace('"force"', '"other"', 1).replace('"acc"', '"force"', 1).replace('"other"', '"acc"', 1)

    with pytest.raises(InputError, match=r"no mode stands out; most likely the columns .* are exchanged"):
        fail_to_fit(tmp_path, exchange)


@pytest.mark.parametrize("factor", [1.0, -2.5])
def test_a_response_that_is_the_force_again_is_not_called_exchanged(tmp_path, factor):
    pipeline = write_campaign(tmp_path)
    for path in tmp_path.glob("hits/*.csv"):
        head, *_ = path.read_text().splitlines()
        table = np.loadtxt(path, delimiter=",", skiprows=1)
        table[:, 2] = factor * table[:, 1]
        np.savetxt(path, table, delimiter=",", header=head, comments="", fmt="%.6g")
    with pytest.raises(InputError, match="most likely the column 'acc' holds the force 'force' once more"):
        frf_ipz.run_pipeline(pipeline, tmp_path / "run", until="fit")


def test_a_fit_that_fails_for_other_reasons_says_only_that(tmp_path):
    with pytest.raises(NoModesError, match=r"^no mode stands out$"):
        fail_to_fit(tmp_path, lambda text: text)
