"""The time is found however programs write their first columns; what is no table is left out, or said."""

import re
import threading
import time
import weakref

import numpy as np
import pyarrow as pa
import pytest

from frf_ipz.errors import InputError
from frf_ipz.ingest.campaign_file import read_test
from frf_ipz.ingest.estimate import estimate_frfs
from frf_ipz.ingest.formats import text_table
from frf_ipz.ingest.formats.text_layout import sniff
from frf_ipz.ingest.recording_files import RecordingFiles
from synthetic_campaign import HIT, Structure, impact, write_csv, write_test

RATE_HZ = 2048.0
N_SAMPLES = 256
SIGNALS = impact(Structure(), n_samples=N_SAMPLES)
DIGITS = 1e-14  # relative: the numbers are written with all of their digits
PRINTED_S = 1e-6  # resolution of the stamps


def write(folder, change):
    path = write_csv(folder / "hits" / "1.csv", SIGNALS, 1 / RATE_HZ)
    content = change(path.read_text(encoding="utf-8"))
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def read(path, head=""):
    test = read_test(write_test(path.parent.parent, HIT, head=head))
    return np.concatenate(list(RecordingFiles(test=test).blocks(test.setups[0], path)))


def expect(table):
    np.testing.assert_allclose(table[:, 0] - table[0, 0], np.arange(N_SAMPLES) / RATE_HZ, rtol=DIGITS)
    np.testing.assert_allclose(table[:, 1:].T, SIGNALS, rtol=DIGITS)


def message(path, head=""):
    with pytest.raises(InputError) as caught:
        read(path, head)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def lines_with(make):
    """Change each line of numbers: `make` gets its number and its fields."""

    def change(text):
        head, *rows = text.splitlines()
        return "\n".join([head, *(make(number, row.split(",")) for number, row in enumerate(rows) if row)]) + "\n"

    return change


def named(name):
    return lambda text: text.replace("time", name, 1)


def stamped(form):
    def make(number, fields):
        seconds = 59.95 + number / RATE_HZ
        return ";".join([form(int(seconds // 60), seconds % 60), *fields[1:]])

    return lambda text: lines_with(make)(text).replace("time,force,acc_1,acc_2", "time;force;acc_1;acc_2")


@pytest.mark.parametrize(
    "name",
    [
        "# time",
        "% t",
        "Zeit [s]",
        "X_Value",
        "Timestamp",
        "Elapsed Time (s)",
        "x-axis",
        "time_s",
        "second",
        "seconds",
        "Time",
        "T(s)",
        "abscissa",
        "",
        "Temps (s)",
        "Time [sec]",
    ],
)
def test_a_first_column_that_grows_evenly_is_the_time(tmp_path, name):
    expect(read(write(tmp_path, named(name))))


@pytest.mark.parametrize("name", ["Time (ms)", "time_ms", "Zeit/ms", "t [ms]", "Time ms", "milliseconds", "millis"])
def test_a_time_in_ms_is_brought_to_seconds(tmp_path, name):
    change = lines_with(lambda _, fields: ",".join([repr(1e3 * float(fields[0])), *fields[1:]]))
    expect(read(write(tmp_path, lambda text: named(name)(change(text)))))


@pytest.mark.parametrize("names", ["x-axis,1,2,3\nsecond,N,m/s^2,m/s^2", "time,1,2,3", "x-axis,1,2,3\n(s),(N),,"])
def test_columns_called_by_numbers(tmp_path, names):
    path = write(tmp_path, lambda text: text.replace("time,force,acc_1,acc_2", names))
    test_path = write_test(tmp_path, HIT)
    text = test_path.read_text(encoding="utf-8")
    for number, name in enumerate(("force", "acc_1", "acc_2"), start=1):
        text = text.replace(f'column = "{name}"', f"column = {number}")
    test_path.write_text(text, encoding="utf-8")
    test = read_test(test_path)
    expect(np.concatenate(list(RecordingFiles(test=test).blocks(test.setups[0], path))))


def test_columns_of_one_name_are_read_by_their_numbers(tmp_path):
    path = write(tmp_path, lambda text: text.replace("time,force,acc_1,acc_2", "second,Volt,Volt,Volt"))
    test_path = write_test(tmp_path, HIT)
    text = test_path.read_text(encoding="utf-8")
    for number, name in enumerate(("force", "acc_1", "acc_2"), start=2):
        text = text.replace(f'column = "{name}"', f"column = {number}")
    test_path.write_text(text, encoding="utf-8")
    test = read_test(test_path)
    expect(np.concatenate(list(RecordingFiles(test=test).blocks(test.setups[0], path))))


def test_the_index_of_pandas_is_not_the_time(tmp_path):
    number = lines_with(lambda number, fields: ",".join([str(number), *fields]))
    expect(read(write(tmp_path, lambda text: "," + number(text))))
    expect(read(write(tmp_path, lambda text: "sample," + named("abscissa")(number(text)))))


def test_the_time_is_the_column_that_the_test_names(tmp_path):
    swapped = lines_with(lambda _, fields: ",".join([*fields[1:], fields[0]]))
    path = write(tmp_path, lambda text: swapped(text).replace("time,force,acc_1,acc_2", "force,acc_1,acc_2,clock"))
    expect(read(path, 'time_column = "clock"'))
    assert "time_column = ... where another one is the time: 'force', 'acc_1', 'acc_2', 'clock'" in message(path)
    assert "has no column 'clok', which time_column names; did you mean 'clock'" in message(
        path, 'time_column = "clok"'
    )


def test_a_file_without_time_needs_a_rate(tmp_path):
    without = lines_with(lambda _, fields: ",".join(fields[1:]))
    path = write(tmp_path, lambda text: without(text).replace("time,", ""))
    expect(read(path, "sample_rate_hz = 2048.0"))
    assert re.search("'force' does not grow by equal steps; write sample_rate_hz = ... under .test", message(path))


@pytest.mark.parametrize("name", ["sample", "index", "", "n", "#"])
def test_a_count_of_samples_needs_a_rate(tmp_path, name):
    count = lines_with(lambda number, fields: ",".join([str(number), *fields[1:]]))
    path = write(tmp_path, lambda text: named(name)(count(text)))
    expect(read(path, "sample_rate_hz = 2048.0"))
    assert "counts the samples; write sample_rate_hz" in message(path)


def test_a_rate_that_contradicts_the_time_is_refused(tmp_path):
    path = write(tmp_path, str)
    expect(read(path, "sample_rate_hz = 2048.0"))
    for rate_hz in (1024, 2047):
        text = message(path, f"sample_rate_hz = {rate_hz}.0")
        assert re.search(rf"sample_rate_hz = {rate_hz}, but its column 'time' has a mean step.*2048 Hz", text)


def test_a_frequency_is_no_time(tmp_path):
    assert "has no column 'time'" in message(write(tmp_path, named("Frequency")))
    assert "has no column 'time'" in message(write(tmp_path, named("x [mm]")))


@pytest.mark.parametrize(
    "form",
    [
        lambda minutes, seconds: f"27/03/2025 {'00:00' if minutes else '23:59'}:{seconds:09.6f}",
        lambda minutes, seconds: f"2024-05-01T10:{51 + minutes}:{seconds:09.6f}Z",
        lambda minutes, seconds: f"2024-05-01 10:{51 + minutes}:{seconds:09.6f}+02:00",
        lambda minutes, seconds: f"27.03.2025 10:{51 + minutes}:{seconds:09.6f}".replace(
            f"{seconds:09.6f}", f"{seconds:09.6f}".replace(".", ",")
        ),
        lambda minutes, seconds: (
            f"3/27/2025 {12 if minutes else 11}:{'00' if minutes else '59'}:{seconds:09.6f} {'PM' if minutes else 'AM'}"
        ),
        lambda minutes, seconds: f"10:{51 + minutes}:{seconds:09.6f}",
    ],
    ids=["over midnight", "ISO", "with a zone", "decimal comma", "AM and PM", "time of day"],
)
def test_time_stamps_are_read(tmp_path, form):
    table = read(write(tmp_path, stamped(form)))
    np.testing.assert_allclose(table[:, 0] - table[0, 0], np.arange(N_SAMPLES) / RATE_HZ, atol=1.1 * PRINTED_S, rtol=0)
    np.testing.assert_allclose(table[:, 1:].T, SIGNALS, rtol=DIGITS)


@pytest.mark.parametrize("factor", [1, 1e3, 1e6, 1e9], ids=["s", "ms", "us", "ns"])
def test_times_since_1970_are_read_in_the_unit_that_makes_them_dates(tmp_path, factor):
    since_1970 = lines_with(
        lambda number, fields: ",".join([f"{1762163939 * factor + number / RATE_HZ * factor:.6f}", *fields[1:]])
    )
    table = read(write(tmp_path, lambda text: named("Timestamp")(since_1970(text))))
    np.testing.assert_allclose(table[:, 0] - table[0, 0], np.arange(N_SAMPLES) / RATE_HZ, atol=1.1 * PRINTED_S, rtol=0)


DAY_S = 86400.0
COUNTED = {  # first count, counts a second
    "days since 1900, Excel": (45912.512345, 1 / DAY_S),
    "days since 1970": (20410.512345, 1 / DAY_S),
    "days since the year 0, MATLAB": (740000.512345, 1 / DAY_S),
    "Julian days": (2461000.012345, 1 / DAY_S),
    "s since 1970": (1762163939.123, 1.0),
    "s since 1904, LabVIEW": (3845008739.123, 1.0),
    "whole us since 1970": (1762163939123456, 1e6),
    "whole ns since 1970": (1762163939123456000, 1e9),
    "0.1 us since 1601, Windows": (134066375391234560, 1e7),
    "0.1 us since the year 1, .NET": (638977607391234560, 1e7),
}


def counted(kind, rate_hz, name="Timestamp"):
    """Write times as a program that counts in double precision, or in whole numbers."""
    start, per_s = COUNTED[kind]

    def make(number, fields):
        count = start + number / rate_hz * per_s
        return ",".join([str(round(count)) if isinstance(start, int) else repr(count), *fields[1:]])

    return lambda text: named(name)(lines_with(make)(text))


@pytest.mark.parametrize("rate_hz", [200.0, 2048.0, 12800.0])
@pytest.mark.parametrize("kind", COUNTED)
def test_times_since_a_date_give_their_rate_however_they_are_rounded(tmp_path, kind, rate_hz):
    spacing_s = np.spacing(float(COUNTED[kind][0])) / COUNTED[kind][1]
    path = write(tmp_path, counted(kind, rate_hz))
    if 2.0 * spacing_s * rate_hz > 1.0:  # Julian days are 40 us apart
        assert "its times are rounded to 4e-05 s" in message(path)
        table = read(path, f"sample_rate_hz = {rate_hz}")
    else:
        table = read(path)
    rounded_s = max(spacing_s, 1.0 / COUNTED[kind][1] if isinstance(COUNTED[kind][0], int) else 0.0)
    np.testing.assert_allclose(table[:, 0] - table[0, 0], np.arange(N_SAMPLES) / rate_hz, atol=2 * rounded_s, rtol=0)


@pytest.mark.parametrize("kind", ["days since 1900, Excel", "days since the year 0, MATLAB", "s since 1970"])
def test_a_lost_sample_is_told_from_rounding(tmp_path, kind):
    def lose(text):
        lines = counted(kind, 12800.0)(text).splitlines(keepends=True)
        return "".join([*lines[:100], *lines[101:]])

    assert re.search(r"the time is not uniform: a step is 0\.0001[4-7]", message(write(tmp_path, lose)))


def rounded(digits, rate_hz, late_s=0.0, lost=None):
    """Write times with some significant digits, as csvwrite of MATLAB does with five; one may be late, one lost.

    From 1 s on, amid the record, the same number of digits is coarser.
    """

    def make(number, fields):
        time_s = 1.0 + (number - N_SAMPLES / 2) / rate_hz + (late_s if number == N_SAMPLES - 9 else 0.0)
        return "" if number == lost else ",".join([f"{time_s:.{digits}g}", *fields[1:]])

    def change(text):
        return "".join(line for line in lines_with(make)(text).splitlines(keepends=True) if line.strip())

    return change


@pytest.mark.parametrize(("digits", "rate_hz"), [(5, 1024.0), (5, 2400.0), (4, 300.0), (6, 12.8e3), (5, 1000.0)])
def test_times_with_few_significant_digits_give_their_rate(tmp_path, digits, rate_hz):
    table = read(write(tmp_path, rounded(digits, rate_hz)))
    last_digit = 10.0 ** (1 - digits)
    exact = 1.0 + (np.arange(N_SAMPLES) - N_SAMPLES / 2) / rate_hz
    np.testing.assert_allclose(table[:, 0], exact, atol=0.51 * last_digit, rtol=0)


@pytest.mark.parametrize("fault", [{"late_s": 2e-4}, {"lost": 40}, {"lost": N_SAMPLES - 40}])
def test_rounded_times_that_are_not_uniform_are_refused(tmp_path, fault):
    assert "the time is not uniform" in message(write(tmp_path, rounded(5, 2048.0, **fault)))


def test_seconds_of_a_day_are_no_days(tmp_path):
    late = lines_with(lambda number, fields: ",".join([repr(45912.5 + number / RATE_HZ), *fields[1:]]))
    table = read(write(tmp_path, late))
    np.testing.assert_allclose(table[:, 0], 45912.5 + np.arange(N_SAMPLES) / RATE_HZ, rtol=DIGITS)


def test_what_may_be_days_or_seconds_is_asked_for(tmp_path):
    """At 20 Hz in days; in seconds that were 1.7 MHz."""
    path = write(tmp_path, counted("days since 1900, Excel", 20.0))
    asked = r"'Timestamp'.*: its times .* of 20 samples .* name the unit, as in 'time \[d\]', or write sample_rate_hz"
    assert re.search(asked, message(path))
    stated = read(path, "sample_rate_hz = 20.0")
    named_so = read(write(tmp_path, counted("days since 1900, Excel", 20.0, "time [d]")))
    for table in (stated, named_so):
        np.testing.assert_allclose(table[:, 0] - table[0, 0], np.arange(N_SAMPLES) / 20.0, atol=2e-6, rtol=0)


def test_serial_days_of_too_few_digits_need_a_rate(tmp_path):
    start, per_s = COUNTED["days since 1900, Excel"]
    path = write(
        tmp_path, lines_with(lambda number, fields: ",".join([f"{start + number / RATE_HZ * per_s:.6f}", *fields[1:]]))
    )
    assert "write sample_rate_hz = ... under [test]" in message(path)
    expect(read(path, "sample_rate_hz = 2048.0"))


def test_stamps_of_too_few_digits_need_a_rate(tmp_path):
    coarse = stamped(lambda minutes, seconds: f"10:{51 + minutes}:{int(1e3 * seconds) / 1e3:06.3f}")
    path = write(tmp_path, coarse)
    assert "write sample_rate_hz = ... under [test]" in message(path)
    expect(read(path, "sample_rate_hz = 2048.0"))


def test_times_that_stand_still_are_said_to_have_too_few_digits(tmp_path):
    change = lines_with(lambda number, fields: ",".join([f"{number / RATE_HZ:.2f}", *fields[1:]]))
    text = message(write(tmp_path, change))
    assert re.search(r"line 3, column 'time': the time stands still in 9\d % .* too few digits .* sample_rate_hz", text)


def test_units_in_the_cells_are_named(tmp_path):
    units = ("s", "N", "m/s²", "m/s²")
    change = lines_with(
        lambda _, fields: ",".join(f"{field} {unit}" for field, unit in zip(fields, units, strict=True))
    )
    text = message(write(tmp_path, change))
    assert re.search(r"line 2: has units in its cells, as in '\S+ m/s²', .* write the units behind the names", text)


@pytest.mark.parametrize(
    "footer", ["End of data\n", "\n\nEnd of data", "Max,12.3,4.5,6\n", "Samples: 256\nDone\n" * 9000]
)
def test_text_below_the_numbers_is_left_out(tmp_path, footer):
    expect(read(write(tmp_path, lambda text: text + footer)))


def test_text_among_the_numbers_is_refused(tmp_path):
    path = write(tmp_path, lambda text: text + "pause\n" + text.partition("\n")[2])
    assert re.search(r"line 25[89]: has 1 value where the table has 4 columns", message(path))


def test_numbers_above_names_are_refused_where_they_are_more_than_those_below(tmp_path):
    """As where a recording was put behind another one."""
    path = write(tmp_path, lambda text: "rig 7\n" + text.partition("\n")[2] * 2 + text)
    assert message(path)


@pytest.mark.parametrize(
    "preamble",
    [
        "Test,Beam A\nSampling rate,2048\nTime of test,12:30:05\n\n",
        "Data file written by DAQ v3\nSampling rate: 2048 Hz\nChannels: 2\n\n",
        "# made by hand\n# on Monday\n",
        "free text, with commas\n" * 5000,
        "2048\n3\n",
        "Date,27/03/2025,x,y\n",
        "Channel,Input,Range,Coupling\n1,Dev1/ai0,5 V,IEPE\n2,Dev1/ai1,5 V,IEPE\n",
        "rig,7,2,11\nparam 1,1.5,1\n1,2,3,4\n\ncal,2.25,10.1,9.9\n\n",
        "Set-up\n" + "".join(f"{place},{place / 10},0,{place**2}\n" for place in range(12)) + "\nComment: none\n",
    ],
    ids=[
        "pairs",
        "sentences",
        "comments",
        "long",
        "numbers",
        "wide",
        "table of channels",
        "numbers above text",
        "points",
    ],
)
def test_text_above_the_names_is_left_out(tmp_path, preamble):
    expect(read(write(tmp_path, lambda text: preamble + text)))


def test_the_line_of_names_can_be_stated(tmp_path):
    path = write(tmp_path, lambda text: "a,force,acc_1,acc_2\n" + text)
    expect(read(path, "header_row = 2"))
    assert "header_row = 9, where no text stands before the numbers" in message(path, "header_row = 9")


def test_rows_of_numbers_above_the_stated_line_of_names_are_none_of_the_table(tmp_path):
    path = write(tmp_path, lambda text: "2024,5,17,9\n1.000,0.981,1.013,0.997\n" + text)
    expect(read(path, "header_row = 3"))


@pytest.mark.parametrize(
    "change",
    [
        lambda text: "sep=;\n" + text.replace(",", ";"),
        lambda text: text.replace("\n", "\r"),
        lambda text: text.encode("utf-16"),
        lambda text: text.encode("utf-16-le"),
        lambda text: ("\ufeff" + text).encode("utf-16-be"),
        lambda text: re.sub(r"e([+-]?\d+)", r"D\1", text.replace("force", "FORCE")).replace("FORCE", "force"),
        lambda text: lines_with(
            lambda _, fields: ",".join(f"{float(field):+.16E}".replace("E", "D") for field in fields)
        )(text),
        lambda text: "time,force,acc_1,acc_2,Comment\n" + text.partition("\n")[2],
    ],
    ids=["sep", "CR", "UTF-16", "UTF-16-LE", "UTF-16-BE", "some D", "D", "comment"],
)
def test_ways_to_write_a_table(tmp_path, change):
    expect(read(write(tmp_path, change)))


def test_what_reads_in_a_thread_has_let_go_of_the_file_before_it_goes_on(tmp_path, monkeypatch):
    """Python may end right after; a thread that then drops an object of Python's aborts the process."""
    held = []

    def hold(stream):
        time.sleep(0.05)
        del stream

    class SlowReader:
        def __init__(self, stream, **_):
            self.threads = [threading.Thread(target=hold, args=(stream,))]
            held.append(weakref.ref(stream))
            self.threads[0].start()

        def __iter__(self):
            return iter(())

    monkeypatch.setattr(text_table.arrow_csv, "open_csv", SlowReader)
    path = tmp_path / "a.csv"
    path.write_text("time,force\n0.0,1.0\n0.1,2.0\n", encoding="utf-8")
    layout = sniff(path)
    assert not list(text_table.read_blocks(layout, ["time", "force"], {0: pa.float64()}))
    assert [reference() for reference in held] == [None]


def test_a_time_without_a_unit_that_counts_by_one_counts_samples(tmp_path):
    """As seconds, these were a rate of 1 Hz."""
    counts = lines_with(lambda number, fields: ",".join([str(number), *fields[1:]]))
    path = write(tmp_path, counts)
    assert "the first column 'time' counts the samples; write sample_rate_hz = ... under [test]" in message(path)
    expect(read(path, "sample_rate_hz = 2048.0"))
    in_ms = write(tmp_path, lambda text: named("time [ms]")(counts(text)))
    np.testing.assert_allclose(np.diff(read(in_ms)[:, 0]), 1e-3, rtol=1e-9)


@pytest.mark.parametrize("name", ["micros", "Time (us)", "microseconds"])
def test_a_time_in_us_is_brought_to_seconds(tmp_path, name):
    expect(read(write(tmp_path, lambda text: named(name)(lines_with(in_us)(text)))))


def in_us(number, fields):
    return ",".join([repr(1e6 * number / RATE_HZ), *fields[1:]])


@pytest.mark.parametrize("factor", [1e3, 1e6])
def test_times_that_make_impacts_last_for_seconds_are_said_to_be_no_seconds(tmp_path, factor):
    change = lines_with(lambda _, fields: ",".join([repr(factor * float(fields[0])), *fields[1:]]))
    write(tmp_path, change)
    (text,) = (text for text in estimate_frfs(read_test(write_test(tmp_path, HIT))).warnings if "impacts last" in text)
    assert "seems not to be in seconds; name its unit in the column's header, as in 'time [ms]'" in text


NAMES = {"cp932": "力[N]", "gb18030": "力锤", "cp1251": "Сила", "cp949": "힘", "mac_roman": "Kraft ü", "utf-8": "力[N]"}


@pytest.mark.parametrize("encoding", NAMES)
def test_names_are_found_in_the_encoding_of_the_file(tmp_path, encoding):
    path = write(tmp_path, lambda text: text.replace("force", NAMES[encoding], 1).encode(encoding))
    test_path = write_test(tmp_path, HIT)
    text = test_path.read_text(encoding="utf-8").replace('column = "force"', f'column = "{NAMES[encoding]}"')
    test_path.write_text(text, encoding="utf-8")
    test = read_test(test_path)
    expect(np.concatenate(list(RecordingFiles(test=test).blocks(test.setups[0], path))))


def test_names_in_another_encoding_that_are_not_there_are_said_to_be_such(tmp_path):
    path = write(tmp_path, lambda text: text.replace("force", "力[N]", 1).encode("cp932"))
    assert "its names are not in UTF-8; save it as UTF-8, or write the number of the column" in message(path)
