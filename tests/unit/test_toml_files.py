"""TOML files into options, with errors that a user can act on."""

from dataclasses import dataclass, field

import pytest

from frf_ipz.errors import FileFormatError
from frf_ipz.input_files import read_text
from frf_ipz.toml_files import STRICT, read_toml


@dataclass(frozen=True, kw_only=True)
class Strike:
    __pydantic_config__ = STRICT
    hz: float
    why: str


@dataclass(frozen=True, kw_only=True)
class Section:
    __pydantic_config__ = STRICT
    band_hz: tuple[float, float] | None = None
    strike: tuple[Strike, ...] = ()


@dataclass(frozen=True, kw_only=True)
class File:
    __pydantic_config__ = STRICT
    fit: Section = field(default_factory=Section)


def read(tmp_path, text, **options):
    path = tmp_path / "file.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_toml(path, File, **options)


def test_a_file_becomes_its_dataclass(tmp_path):
    file = read(tmp_path, '[fit]\nband_hz = [1, 2]\nstrike = [{ hz = 50, why = "mains" }]\n')
    assert file == File(fit=Section(band_hz=(1.0, 2.0), strike=(Strike(hz=50.0, why="mains"),)))


@pytest.mark.parametrize("text", [b"\xef\xbb\xbf[fit]\r\n", "[fit] # é".encode("latin-1")], ids=["bom", "latin-1"])
def test_encodings_of_the_contract_are_read(tmp_path, text):
    assert read(tmp_path, text) == File()


@pytest.mark.parametrize(
    ("text", "where", "problem"),
    [
        ("[fitt]", "key 'fitt'", "did you mean 'fit'"),
        ("[fit]\nbandhz = [1, 2]", "key 'fit.bandhz'", "did you mean 'band_hz'"),
        ('[fit]\nstrike = [{ hz = 1, wy = "x" }]', "key 'fit.strike.[1]", "why"),
        ('[fit]\nband_hz = [1, "a"]', "key 'fit.band_hz.[2]'", "given is 'a'"),
        ("[fit]\nband_hz = 3", "key 'fit.band_hz'", "given is 3"),
        ("[fit]\nstrike = [{ hz = 1 }]", "key 'fit.strike.[1].why'", "is missing"),
        (
            "[fit]\nstrike = [91.7]",
            "key 'fit.strike.[1]'",
            "must be a table { ... } with keys of hz, why; given is 91.7",
        ),
        ("[fit]\nband_hz = []", "key 'fit.band_hz.[2]'", "value 2 is missing"),
        ("[fit\n", "", "not valid TOML"),
    ],
)
def test_what_does_not_fit_is_named(tmp_path, text, where, problem):
    with pytest.raises(FileFormatError) as caught:
        read(tmp_path, text)
    message = str(caught.value)
    assert str(tmp_path / "file.toml") in message
    assert where in message
    assert problem in message
    assert "\n" not in message


def test_all_that_does_not_fit_is_named_at_once(tmp_path):
    with pytest.raises(FileFormatError) as caught:
        read(tmp_path, '[fitt]\n[fit]\nband_hz = [1, "a"]\nstrike = [{ hz = 1, wy = "x" }, { hz = "b", why = "y" }]')
    message = str(caught.value)
    assert "4 keys do not fit" in message
    for part in ("key 'fitt'", "did you mean 'fit'", "key 'fit.band_hz.[2]'", "'fit.strike.[1].wy'", "given is 'b'"):
        assert part in message
    assert "is missing" not in message  # 'why', which is what 'wy' was meant to be
    with pytest.raises(FileFormatError, match="and 4 more"):
        read(tmp_path, "[fit]\n" + "\n".join(f"key_{number} = 1" for number in range(14)))


def test_a_missing_section_and_a_missing_file_are_reported(tmp_path):
    with pytest.raises(FileFormatError, match=r"no section \[pipeline\]"):
        read(tmp_path, "[fit]", required="pipeline")
    with pytest.raises(FileFormatError, match="no such file"):
        read_toml(tmp_path / "none.toml", File)


def test_a_folder_instead_of_a_file_is_reported(tmp_path):
    with pytest.raises(FileFormatError, match="is a folder, but a file is expected"):
        read_text(tmp_path)


@pytest.mark.parametrize(
    "text",
    ["fit = " + 5000 * "[" + 5000 * "]", "fit = " + 40 * "{ a = " + "1" + 40 * " }", "fit." + "a." * 5000 + "b = 1"],
    ids=["lists", "tables", "dotted keys"],
)
def test_deep_nesting_is_refused_in_one_line(tmp_path, text):
    with pytest.raises(FileFormatError, match="nested too deeply"):
        read(tmp_path, text)
