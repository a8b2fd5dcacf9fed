"""Columns are known by their names in the languages of analysers and recorders, in any usual encoding."""

import numpy as np
import pytest

from frf_ipz.errors import InputError
from frf_ipz.ingest.campaign_file import read_test
from frf_ipz.ingest.estimate import estimate_frfs
from frf_ipz.ingest.options import IngestOptions
from frf_ipz.ingest.recording_files import RecordingFiles
from synthetic_campaign import HIT, Structure, impact, write_csv, write_test

LINES_HZ = np.arange(10.0, 200.5, 0.5)
VALUES = Structure().accelerance(2j * np.pi * LINES_HZ)[:, 0]
DIGITS = 1e-12  # relative: the numbers are written with 17 digits, and go through a logarithm
GRAVITY = 9.80665
RATE_HZ = 2048.0
SIGNALS = impact(Structure(), n_samples=256)
PRINTED_S = 1e-6  # resolution of the stamps
PARTS = {
    "cartesian": (VALUES.real, VALUES.imag),
    "degrees": (np.abs(VALUES), np.degrees(np.angle(VALUES))),
    "radians": (np.abs(VALUES), np.angle(VALUES)),
    "decibels": (20.0 * np.log10(np.abs(VALUES)), np.degrees(np.angle(VALUES))),
}
HEADERS = [
    ("Frequency [Hz];Re;Im", "cartesian"),
    ("freq;RE;IM", "cartesian"),
    ("Hz;Re;Im", "cartesian"),
    ("f_Hz;H_re;H_im", "cartesian"),
    ("f/Hz;Re{H};Im{H}", "cartesian"),
    ("FREQUENCY;REAL;IMAG", "cartesian"),
    ("Frequenz [Hz];Realteil;Imaginärteil", "cartesian"),
    ("Frequenz;Betrag;Phase [°]", "degrees"),
    ("Frequenz;Betrag [dB];Phasenwinkel [Grad]", "decibels"),
    ("Frequenz;Pegel [dB];Winkel [°]", "decibels"),
    ("Fréquence [Hz];Réel [m/s²/N];Imaginaire [m/s²/N]", "cartesian"),
    ("FRÉQUENCE;RÉEL;IMAGINAIRE", "cartesian"),
    ("Fréquence;Partie réelle;Partie imaginaire", "cartesian"),
    ("Fréquence;Reel;Imag", "cartesian"),
    ("Fréquence;Module;Phase (degrés)", "degrees"),
    ("Fréquence Hz;Module dB;Phase deg", "decibels"),
    ("Frequenza [Hz];Parte reale;Parte immaginaria", "cartesian"),
    ("Frequenza;Modulo;Fase [gradi]", "degrees"),
    ("Frecuencia [Hz];Parte real;Parte imaginaria", "cartesian"),
    ("Frecuencia;Módulo;Fase [grados]", "degrees"),
    ("Frecuencia;Magnitud [dB];Ángulo [°]", "decibels"),
    ("Frequentie [Hz];Reëel;Imaginair", "cartesian"),
    ("Frequentie;Modulus;Fase [graden]", "degrees"),
    ("Linear;Real;Imaginary\nHz;m/s²/N;m/s²/N", "cartesian"),
    ("Frequency;Magnitude;Phase\nHz;dB;deg", "decibels"),
    ("Frequency;Magnitude;Phase\nHz;m/s²/N;rad", "radians"),
]


def frf_file(folder, header, parts, *, encoding="utf-8", frequency=LINES_HZ):
    rows = [";".join(map(repr, map(float, row))) for row in zip(frequency, *parts, strict=True)]
    (folder / "frf.txt").write_bytes("\n".join([header, *rows, ""]).encode(encoding))


def frf_values(folder, keys=""):
    entry = f'[[frf]]\nfile = "frf.txt"\nquantity = "accelerance"\noutput_dof = "1:+z"\ninput_dof = "7:+z"\n{keys}\n'
    frfs = estimate_frfs(read_test(write_test(folder, entry, kind="frf")), options=IngestOptions()).frfs
    np.testing.assert_allclose(frfs.frequency_hz, LINES_HZ, rtol=DIGITS)
    return frfs.values[:, 0]


@pytest.mark.parametrize(("header", "kind"), HEADERS, ids=[header.replace("\n", " / ") for header, _ in HEADERS])
def test_columns_of_frfs_are_known_by_their_names(tmp_path, header, kind):
    frf_file(tmp_path, header, PARTS[kind])
    np.testing.assert_allclose(frf_values(tmp_path), VALUES, rtol=DIGITS)


@pytest.mark.parametrize("encoding", ["cp1252", "cp850", "mac_roman"])
@pytest.mark.parametrize(
    ("header", "kind"), [(header, kind) for header, kind in HEADERS if not header.isascii() and "²" not in header]
)
def test_names_are_known_in_the_encodings_of_their_systems(tmp_path, header, kind, encoding):
    frf_file(tmp_path, header, PARTS[kind], encoding=encoding)
    np.testing.assert_allclose(frf_values(tmp_path), VALUES, rtol=DIGITS)


@pytest.mark.parametrize("names", ["Pulsation", "Kreisfrequenz", "Pulsazione", "Pulsación", "Angular frequency"])
def test_angular_frequencies_are_known_by_their_names(tmp_path, names):
    frf_file(tmp_path, f"{names};Real;Imag", PARTS["cartesian"], frequency=2.0 * np.pi * LINES_HZ)
    np.testing.assert_allclose(frf_values(tmp_path), VALUES, rtol=DIGITS)


@pytest.mark.parametrize("skip_rows", [0, 1])
@pytest.mark.parametrize("header", ["freq;Re;Im", "Hz;Re;Im", "x;a;e", "f;RE;IM", "Hz;d;h"])
def test_names_of_stated_columns_are_no_units(tmp_path, header, skip_rows):
    frf_file(tmp_path, header, PARTS["cartesian"])
    keys = f'columns = ["frequency_hz", "real", "imag"]\nskip_rows = {skip_rows}'
    np.testing.assert_allclose(frf_values(tmp_path, keys), VALUES, rtol=DIGITS)


@pytest.mark.parametrize("row", ["Hz;g/N;g/N", "Hz;g/N;"])
def test_a_row_of_units_below_short_names_is_taken(tmp_path, row):
    frf_file(tmp_path, f"freq;Re;Im\n{row}", [part / GRAVITY for part in PARTS["cartesian"]])
    np.testing.assert_allclose(frf_values(tmp_path), VALUES, rtol=DIGITS)


LEVELS = [
    ("Magnitude [dB re 1 m/s²/N]", 1.0),
    ("Magnitude [dB re 1 g/N]", GRAVITY),
    ("Magnitude [dB re 1e-6 m/s²/N]", 1e-6),
    ("Magnitude dB (ref. 1 g/N)", GRAVITY),
    ("Magnitude dB re 1 g/N", GRAVITY),
    ("Betrag [dB, rel. 1 (m/s²)/N]", 1.0),
    ("Magnitude [g/N dB]", GRAVITY),
    ("Magnitude [g/N] (dB)", GRAVITY),
    ("Magnitude dB g/N", GRAVITY),
    ("Magnitude [dB re 1]", 1.0),
]
DECIBELS = 'columns = ["frequency_hz", "magnitude_db", "phase_deg"]'


@pytest.mark.parametrize("keys", ["", DECIBELS, f"{DECIBELS}\nskip_rows = 1"])
@pytest.mark.parametrize(("name", "reference"), LEVELS)
def test_decibels_are_relative_to_the_unit_beside_them(tmp_path, name, reference, keys):
    level = 20.0 * np.log10(np.abs(VALUES) / reference)
    frf_file(tmp_path, f"Frequency [Hz];{name};Phase [deg]", (level, PARTS["decibels"][1]))
    np.testing.assert_allclose(frf_values(tmp_path, keys), VALUES, rtol=DIGITS)


@pytest.mark.parametrize("header", ["f;Magnitude;Phase\nHz;{};deg", "f [Hz];Y1 [{}];Y2", "f [Hz] Y1 [{}] Y2"])
@pytest.mark.parametrize("unit", ["dB re 1e-3 g/N", "1e-3 g/N dB"])
def test_a_reference_of_decibels_is_found_below_names_and_in_brackets(tmp_path, header, unit):
    level = 20.0 * np.log10(np.abs(VALUES) / (1e-3 * GRAVITY))
    frf_file(tmp_path, header.format(unit), (level, PARTS["decibels"][1]))
    np.testing.assert_allclose(frf_values(tmp_path, DECIBELS), VALUES, rtol=DIGITS)


@pytest.mark.parametrize("keys", [True, False])
@pytest.mark.parametrize(
    ("name", "role", "unit"),
    [
        ("Magnitude [dB re 1e-6]", "magnitude_db", "1e-6"),
        ("Magnitude [dB re 1 g/N rms]", "magnitude_db", "1 g/N rms"),
        ("Magnitude [dB re 1 foo]", "magnitude_db", "1 foo"),
        ("Magnitude [g/N foo dB]", "magnitude_db", "g/N foo"),
        ("Magnitude [g/N foo]", "magnitude", "g/N foo"),
        ("Magnitude (g pro N)", "magnitude", "g pro N"),
        ("Magnitude [foo]", "magnitude", "foo"),
        ("Magnitude g/N foo", "magnitude", "g/N foo"),
        ("Magnitude\n;g/N foo;", "magnitude", "g/N foo"),
        ("Magnitude\n;g/N foo dB;", "magnitude_db", "g/N foo"),
    ],
)
def test_what_stands_in_the_place_of_a_unit_and_is_none_is_refused(tmp_path, name, role, unit, keys):
    head, _, row = name.partition("\n")
    frf_file(
        tmp_path, f"Frequency;{head};Phase [deg]" + (f"\n{row}" if row else ""), (np.abs(VALUES), np.angle(VALUES))
    )
    columns = f'columns = ["frequency_hz", "{role}", "phase_deg"]' if keys else ""
    with pytest.raises(InputError, match=f"its header gives values in '{unit}'"):
        frf_values(tmp_path, columns)
    keys = f'{columns}\nunit = "g/N"'
    assert np.isfinite(frf_values(tmp_path, keys)).all()


@pytest.mark.parametrize("name", ["Magnitude [H11]", "Magnitude [abs]", "Magnitude [-]", "Magnitude (point 3)"])
def test_other_words_in_brackets_are_no_units(tmp_path, name):
    frf_file(tmp_path, f"Frequency [Hz];{name};Phase [deg]", PARTS["degrees"])
    np.testing.assert_allclose(frf_values(tmp_path), VALUES, rtol=DIGITS)


def test_names_that_say_nothing_are_named(tmp_path):
    frf_file(tmp_path, "Frequency;Y1;Y2", PARTS["cartesian"])
    with pytest.raises(
        InputError, match=r"columns 'Frequency', 'Y1', 'Y2' do not all say what they are: write .*columns = "
    ):
        frf_values(tmp_path)


def stamped(folder, names, date, fields_before=()):
    """Write a record with a column of dates and one of times of day."""
    path = write_csv(folder / "hits" / "1.csv", SIGNALS, 1 / RATE_HZ)
    head, *rows = path.read_text(encoding="utf-8").splitlines()
    lines = [";".join([names, *head.split(",")[1:]])]
    for number, row in enumerate(rows):
        seconds = 3.0 + number / RATE_HZ
        lines.append(";".join([*fields_before, date, f"10:51:{seconds:09.6f}", *row.split(",")[1:]]))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    test = read_test(write_test(folder, HIT))
    return np.concatenate(list(RecordingFiles(test=test).blocks(test.setups[0], path)))


def expect_record(table):
    np.testing.assert_allclose(table[:, 0] - table[0, 0], np.arange(256) / RATE_HZ, atol=1.1 * PRINTED_S, rtol=0)
    np.testing.assert_allclose(table[:, 1:].T, SIGNALS, rtol=DIGITS)


@pytest.mark.parametrize(
    "names",
    [
        "Datum;Uhrzeit",
        "Datum;Zeit",
        "Date;Time",
        "Date;Heure",
        "Fecha;Hora",
        "Data;Ora",
        "Datum;Tijd",
        "Dato;Klokkeslæt",
    ],
)
def test_the_time_of_day_beside_a_date_is_the_time(tmp_path, names):
    expect_record(stamped(tmp_path, names, "30.11.2026"))


@pytest.mark.parametrize("date", ["2026-11-30", "11/30/2026", "30-Nov-2026", "28-févr.-2026"])
def test_dates_may_be_written_in_any_way(tmp_path, date):
    expect_record(stamped(tmp_path, "Date;Heure", date))


def test_a_time_of_day_that_is_no_signal_needs_no_name(tmp_path):
    expect_record(stamped(tmp_path, "A;B", "30.11.2026"))


def test_the_time_of_day_behind_other_columns_is_the_time(tmp_path):
    expect_record(stamped(tmp_path, "Nr;Messung;Datum;Uhrzeit", "30.11.2026", ("1", "a")))
