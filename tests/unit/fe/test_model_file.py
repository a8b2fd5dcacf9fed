"""Kinds of models are found by themselves; the files of a model are known."""

import sys

from fe_models import BEAM_TEXT, LUMPED_TEXT, read_text_model
from frf_ipz.dofs import Dof
from frf_ipz.fe import kinds
from frf_ipz.fe.kinds.beam import build_beam
from frf_ipz.fe.model_file import model_files, model_kinds, read_model

NEW_KIND = """
from dataclasses import dataclass
from frf_ipz.fe.kinds import lumped
from frf_ipz.fe.kinds.lumped import LumpedFile, LumpedMass, LumpedOptions
from frf_ipz.fe.model_options import ModelSection

KIND = "pebble"

@dataclass(frozen=True)
class PebbleFile:
    model: ModelSection
    mass_kg: float

FILE = PebbleFile

def files(file, path):
    return (path.with_name("photograph.png"),)

def read(file, path):
    options = LumpedOptions(mass=(LumpedMass(node=1, mass_kg=file.mass_kg),))
    return lumped.read(LumpedFile(model=file.model, lumped=options), path)
"""


def test_the_three_kinds_are_known():
    assert set(model_kinds()) == {"beam", "lumped", "matrices"}


def test_a_module_that_is_put_there_is_a_kind(tmp_path, monkeypatch):
    (tmp_path / "pebble_kind.py").write_text(NEW_KIND, encoding="utf-8")
    monkeypatch.setattr(kinds, "__path__", [*kinds.__path__, str(tmp_path)])
    path = tmp_path / "model.toml"
    path.write_text('mass_kg = 0.3\n[model]\nkind = "pebble"\n', encoding="utf-8")
    try:
        assert read_model(path).mass.toarray().tolist() == [[0.3]]
        assert model_files(path) == (path, tmp_path / "photograph.png")
    finally:
        sys.modules.pop("frf_ipz.fe.kinds.pebble_kind", None)


def test_a_beam_and_a_lumped_model_are_one_file(tmp_path):
    for text in (BEAM_TEXT, LUMPED_TEXT):
        read_text_model(tmp_path, text)
        assert model_files(tmp_path / "model.toml") == (tmp_path / "model.toml",)


def test_the_beam_of_a_file(tmp_path):
    model = read_text_model(tmp_path, BEAM_TEXT)
    assert (model.name, model.kind) == ("beam", "beam")
    assert model.all_dofs[:3] == (Dof(1, "z"), Dof(1, "ry"), Dof(2, "z"))
    assert model.modal_damping.tolist() == [0.001]
    assert model.geometry.supports == {1: "clamped"}
    assert model.geometry.coordinates_m[-1].tolist() == [0.5, 0.0, 0.0]
    assert model.geometry.lines[0].tolist() == [1, 2]
    assert [part.name for part in model.parts[:2]] == ["1", "2"]
    assert (build_beam(model.source).stiffness != model.stiffness).nnz == 0


def test_line_ends_and_marks_of_other_systems_are_read(tmp_path):
    plain = read_text_model(tmp_path, BEAM_TEXT)
    path = tmp_path / "model.toml"
    path.write_bytes(b"\xef\xbb\xbf" + BEAM_TEXT.replace("\n", "\r\n").encode())
    assert (read_model(path).stiffness != plain.stiffness).nnz == 0
