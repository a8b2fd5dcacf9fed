"""Keys that are wrong in several files are told at once, each with its file, and what is wrong in one as before."""

import pytest

from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.pipeline.inputs import read_inputs
from small_campaign import MODEL, PIPELINE, TEST

WRONG = {
    "pipeline.toml": PIPELINE.replace("band_hz", "bandhz"),
    "test.toml": TEST.replace('unit = "', 'unti = "'),
    "model.toml": MODEL.replace("width_m", "widht_m"),
}
SAID = {
    "pipeline.toml": ("key 'fit.bandhz'",),
    "test.toml": ("key 'channel.[1].unti'", "key 'channel.[2].unti'"),
    "model.toml": ("key 'beam.widht_m'",),
}


@pytest.fixture
def refusal(tmp_path):
    """Say what is wrong where some files are; the recordings of the test are missing in any case."""

    def read(*wrong):
        for name, text in {"pipeline.toml": PIPELINE, "test.toml": TEST, "model.toml": MODEL}.items():
            (tmp_path / name).write_text(WRONG[name] if name in wrong else text)
        with pytest.raises(InputError) as caught:
            read_inputs(tmp_path / "pipeline.toml")
        return caught.value

    return read


@pytest.mark.parametrize("wrong", [tuple(WRONG), ("pipeline.toml", "test.toml"), ("test.toml", "model.toml")], ids=len)
def test_wrong_keys_of_all_files_are_told_at_once(refusal, wrong):
    message = str(refusal(*wrong))
    places = [f"{name}, {place}: unknown key" for name in wrong for place in SAID[name]]
    assert message.startswith(f"{len(places)} mistakes in {len(wrong)} files: (1) ")
    assert [place for place in places if place not in message] == []
    assert "\n" not in message


def test_wrong_keys_beside_the_kind_of_the_model_are_told_with_those_of_the_rest(refusal, monkeypatch):
    monkeypatch.setitem(WRONG, "model.toml", WRONG["model.toml"].replace("[model]", "[model]\nnam = 'plate'"))
    message = str(refusal("model.toml", "test.toml"))
    assert "key 'model.nam': unknown key 'nam'" in message
    assert "key 'beam.widht_m': unknown key 'widht_m'" in message


def test_as_many_wrong_keys_are_told_of_each_of_several_files_as_of_one(refusal, monkeypatch):
    monkeypatch.setitem(WRONG, "pipeline.toml", PIPELINE + "".join(f"[wrong_{number}]\n" for number in range(9)))
    message = str(refusal(*WRONG))
    assert "12 mistakes in 3 files" in message
    assert "(12) " in message


def test_wrong_keys_are_told_with_a_file_that_is_missing(refusal):
    message = str(refusal("model.toml"))
    assert "2 mistakes in 2 files: (1) " in message
    assert "no file fits 'hits/*.csv'" in message
    assert "model.toml, key 'beam.widht_m'" in message


def test_what_is_wrong_in_one_file_is_told_of_that_file(refusal, tmp_path):
    error = refusal("test.toml")
    assert isinstance(error, FileFormatError)
    assert str(error).startswith(f"{tmp_path / 'test.toml'}: 2 keys do not fit: (1) key 'channel.[1].unti': ")
