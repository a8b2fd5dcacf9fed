"""Where numbers end in no result, what most likely has to be corrected is said with its file and key."""

import pytest

import frf_ipz
from frf_ipz.errors import InputError, NumericalError
from frf_ipz.pipeline.inputs import read_inputs
from frf_ipz.pipeline.stages.hints import naming_the_cause
from small_campaign import write_campaign


def fail_with(folder, change):
    """Let a stage after the fit of a small campaign fail, whose model was changed."""
    pipeline = write_campaign(folder)
    model = folder / "model.toml"
    model.write_text(change(model.read_text()))
    inputs = read_inputs(pipeline)
    estimate = frf_ipz.estimate_frfs(inputs.test)
    fit = frf_ipz.fit_modes(estimate.frfs, options=inputs.options.fit)
    with naming_the_cause(inputs, estimate, fit, inputs.fe_model):
        raise NumericalError("the numbers have no end")


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
