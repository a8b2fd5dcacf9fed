"""A controller designed on the predicted point of interest does on the real beam what its model promised."""

import pytest

pytestmark = pytest.mark.slow  # the pipeline, and three designs of some fifty Riccati equations each


def test_the_updated_model_promises_what_the_beam_keeps(tmp_path, capsys):
    import poi_controller

    poi_controller.main(tmp_path / "run")
    lines = capsys.readouterr().out.splitlines()[1:]
    found = {line[:13]: [float(text) for text in line.split()[2:]] for line in lines}
    stable, promised, kept, sensitivity = found["updated model"][:4]
    assert stable == 1
    assert abs(kept / promised - 1) < 0.1
    assert sensitivity < 1.1 * poi_controller.MAX_SENSITIVITY
    assert kept < found["nominal model"][2]
    assert kept < found["sensor only  "][2] * 0.9
    assert found["nominal model"][2] > 2 * found["nominal model"][1]
