"""A description becomes traces: with its numbers, its names as text, and all peaks that a screen can show."""

import numpy as np
import pytest

from frf_ipz.plotting.frfs import describe_frfs
from frf_ipz.plotting.picture import (
    Areas,
    Axis,
    Band,
    Bars,
    HeatMap,
    Labels,
    Line,
    Panel,
    Picture,
    Points,
    Role,
    Span,
    VerticalLines,
    in_hover,
)
from frf_ipz.report.plotly_drawing import BINS, FEWEST, POINTS, ROWS, draw_picture, straighten, thin
from synthetic_run import many_frfs

N_BINS = 300


def lines_with_extremes(rng):
    frequency = np.linspace(0.5, 5000.0, 50_000)
    curve = 0.1 * rng.standard_normal(len(frequency))
    peaks, notches = rng.choice(len(frequency), (2, 20), replace=False)
    curve[peaks] += 10.0 + np.arange(20)
    curve[notches] -= 10.0 + np.arange(20)
    return frequency, curve, peaks, notches


@pytest.mark.parametrize("seed", range(5))
def test_every_peak_and_notch_that_is_the_largest_in_its_neighbourhood_is_kept(seed):
    frequency, curve, peaks, notches = lines_with_extremes(np.random.default_rng(seed))
    lines = thin(frequency, [curve], N_BINS)
    widest = 2 * len(frequency) // N_BINS  # lines of the widest bin: the others are spread over the logarithm
    for sign, extremes in ((1, peaks), (-1, notches)):
        for line in extremes:
            window = (sign * curve)[max(line - widest, 0) : line + widest + 1]
            assert line in lines or window.max() > sign * curve[line]


def test_few_points_are_left_and_they_ascend():
    frequency, curve, *_ = lines_with_extremes(np.random.default_rng(2))
    lines = thin(frequency, [curve], N_BINS)
    assert N_BINS < len(lines) <= 2 * N_BINS + 2
    assert np.all(np.diff(lines) > 0)


def test_both_ends_are_kept():
    frequency = np.linspace(1, 2, 10_000)
    lines = thin(frequency, [np.random.default_rng(3).standard_normal(10_000)], N_BINS)
    assert lines[0] == 0
    assert lines[-1] == 9_999


def test_low_frequencies_keep_lines_for_a_logarithmic_axis():
    frequency = np.linspace(0.1, 10_000.0, 100_000)
    lines = thin(frequency, [np.sin(frequency)], N_BINS)
    assert np.count_nonzero(frequency[lines] < 10) > 0.05 * len(lines)


def test_values_that_are_not_known_count_as_none():
    frequency = np.linspace(1, 2, 10_000)
    curve = np.full(10_000, np.nan)
    curve[5_000] = 1.0
    assert 5_000 in thin(frequency, [curve], N_BINS)


def test_short_curves_stay_whole():
    assert len(thin(np.arange(1.0, 400.0), [np.zeros(399)], N_BINS)) == 399


@pytest.mark.parametrize("axis", [np.asarray, np.log])
def test_lines_between_the_points_that_are_left_stay_within_half_a_row_of_the_curve(axis):
    s = 2j * np.pi * np.linspace(5.0, 1000.0, 3_000)
    frf = sum(s**2 / (s**2 + 2 * 0.003 * w * s + w**2) for w in (300.0, 1_100.0, 4_000.0))
    curve, x = np.log10(np.abs(frf)), s.imag / (2 * np.pi)
    kept = straighten(x, [curve])
    assert len(kept) < len(x) / 6
    off = np.abs(np.interp(axis(x), axis(x[kept]), curve[kept]) - curve)
    assert off.max() <= np.ptp(curve) / ROWS / 2
    assert {int(np.argmax(curve)), 0, len(x) - 1} <= set(kept.tolist())
    assert len(kept) > FEWEST


def test_what_is_not_known_and_the_points_beside_it_stay():
    x = np.arange(1.0, 101.0)
    curve = np.where((x > 40) & (x < 50), np.nan, 1.0)
    assert set(range(40, 50)) <= set(straighten(x, [curve]).tolist())


def test_a_picture_says_how_many_lines_it_draws_of_how_many():
    x = np.linspace(1.0, 1000.0, 50_000)
    noise = np.random.default_rng(8).standard_normal(len(x))
    lines = [Line(name=name, colour=0, frf=frf, x=x, y=y) for frf, (name, y) in enumerate((("a", noise), ("b", 0 * x)))]
    picture = draw_picture(picture_of(*lines, x=Axis(title="Frequency, Hz", is_frequency=True)))
    drawn = sorted(len(trace["x"]) for trace in picture["data"])
    said = "A curve is drawn through {} to {} of 50000 lines: peaks and notches, and what a screen shows of the rest."
    assert picture["drawn"] == said.format(*drawn)
    assert drawn[0] < drawn[1] < 5_000
    assert "drawn" not in draw_picture(picture_of(Line(name="c", colour=0, x=x[:40], y=noise[:40])))


def picture_of(*layers, y=None, x=None):
    panel = Panel(y=y or Axis(title="y"), layers=layers)
    return Picture(name="p", title="a picture", alt="words", panels=(panel,), x=x or Axis(title="x"))


@pytest.mark.parametrize("n_frfs", [1, 9, 36])
def test_a_page_has_a_bounded_number_of_points(n_frfs):
    traces = draw_picture(describe_frfs(many_frfs(n_frfs, 20_000).frfs))["data"]
    magnitudes = [trace for trace in traces if "yaxis" not in trace and "fill" not in trace and "line" in trace]
    curves = [trace for trace in magnitudes if trace["line"]["width"]]
    assert len(curves) == n_frfs
    assert sum(len(trace["x"]) for trace in curves) <= max(POINTS, 2 * BINS[0] * n_frfs) + 2 * n_frfs


def test_curves_of_one_x_are_thinned_together_so_that_it_is_stored_once():
    x = np.linspace(1.0, 1000.0, 50_000)
    curves = np.random.default_rng(4).standard_normal((2, len(x)))
    first, second = (Line(name=name, colour=0, x=x, y=y) for name, y in zip("ab", curves, strict=True))
    band = Band(name="band", colour=0, opacity=0.3, x=x, low=curves[0] - 1, high=curves[0] + 1)
    drawn = draw_picture(picture_of(band, first, second))["data"]
    assert len({trace["x"].tobytes() for trace in drawn[1:]}) == 1
    assert max(drawn[1]["y"]) == curves[0].max()
    assert min(drawn[2]["y"]) == curves[1].min()
    n = len(drawn[1]["x"])
    lines = np.searchsorted(x, drawn[1]["x"])
    np.testing.assert_array_equal(drawn[0]["x"], [*drawn[1]["x"], *drawn[1]["x"][::-1]])
    np.testing.assert_array_equal(drawn[0]["y"][:n], curves[0][lines] - 1)


def test_points_that_are_no_curve_stay_all():
    values = np.random.default_rng(5).uniform(1, 2, 9_000)
    (trace,) = draw_picture(picture_of(Points(name="a", colour=0, x=values, y=values)))["data"]
    assert len(trace["x"]) == 9_000


def test_roles_and_numbers_are_names_of_colours():
    x = np.arange(3.0)
    drawn = draw_picture(
        picture_of(
            Line(name="a", colour=Role.UPDATED, x=x, y=x),
            Line(name="b", colour=8, opacity=0.5, x=x, y=x),
        )
    )["data"]
    assert [trace["line"]["color"] for trace in drawn] == ["@updated", "@c1/0.5"]


def test_names_are_text_and_no_tags_fields_or_entities():
    hostile = "<b>%{x}&amp;</b>"
    x = np.arange(3.0)
    line = Line(name=hostile, colour=0, x=x, y=x, hover=f"{{x:.3g}} {in_hover('{' + hostile)}", texts=[hostile] * 3)
    (trace,) = draw_picture(picture_of(line, y=Axis(title=hostile)))["data"]
    escaped = "&lt;b&gt;%{x}&amp;amp;&lt;/b&gt;"
    assert trace["name"] == escaped
    assert trace["text"] == [escaped] * 3
    assert trace["hovertemplate"] == "%{x:.3g} {&lt;b&gt;%&#123;x}&amp;amp;&lt;/b&gt;<extra>%{fullData.name}</extra>"


def test_what_belongs_to_an_frf_is_shown_and_hidden_with_it_and_named_once():
    traces = draw_picture(describe_frfs(many_frfs(4, 50).frfs))["data"]
    assert {trace["meta"]["frf"] for trace in traces} == {0, 1, 2, 3}
    named = [trace["name"] for trace in traces if trace.get("showlegend", True)]
    assert len(named) == len(set(named)) == 4
    assert len({trace["legendgroup"] for trace in traces}) == 4


def test_a_frequency_axis_states_hertz_and_a_logarithmic_one_their_logarithm():
    x = np.array([1.0, 10.0])
    frequency = Axis(scale="log", limits=(1.0, 100.0), is_frequency=True)
    layout = draw_picture(picture_of(Line(name="a", colour=0, x=x, y=x), x=frequency))["layout"]
    assert layout["xaxis"]["range"] == [1.0, 100.0]
    assert "type" not in layout["xaxis"]
    plain = draw_picture(picture_of(Line(name="a", colour=0, x=x, y=x), x=Axis(scale="log", limits=(1.0, 100.0))))
    assert (plain["layout"]["xaxis"]["type"], plain["layout"]["xaxis"]["range"]) == ("log", [0.0, 2.0])


def test_panels_lie_below_or_beside_each_other():
    x = np.arange(3.0)
    line = Line(name="a", colour=0, x=x, y=x)
    below = Picture(
        name="p", title="", alt="", panels=(Panel(y=Axis(), layers=(line,), share=3), Panel(y=Axis(), layers=(line,)))
    )
    drawn = draw_picture(below)
    assert [trace.get("yaxis", "y") for trace in drawn["data"]] == ["y", "y2"]
    upper, lower = drawn["layout"]["yaxis"]["domain"], drawn["layout"]["yaxis2"]["domain"]
    assert upper[0] > lower[1]
    assert upper[1] - upper[0] == pytest.approx(3 * (lower[1] - lower[0]))
    assert drawn["layout"]["xaxis"]["anchor"] == "y2"
    beside = Picture(
        name="p", title="", alt="", panels=tuple(Panel(x=Axis(), y=Axis(), layers=(line,)) for _ in range(2))
    )
    drawn = draw_picture(beside)
    assert [(trace.get("xaxis"), trace.get("yaxis")) for trace in drawn["data"]] == [(None, None), ("x2", None)]
    assert drawn["layout"]["xaxis"]["domain"][1] < drawn["layout"]["xaxis2"]["domain"][0]


def test_every_layer_draws_its_numbers():
    x, y = np.array([1.0, 2.0]), np.array([3.0, 4.0])
    square = np.array([[0.0, 1.0, 1.0, 0.0]])
    picture = picture_of(
        Points(name="points", colour=0, x=x, y=["a", "b"], values=y, hover="{y}: {value:.2f}", labels="below right"),
        Labels(name="labels", colour=0, x=x, y=y, texts=["A", "B"], side="above"),
        Areas(name="areas", colour=0, opacity=0.1, x=square, y=square.T.reshape(1, 4)),
        VerticalLines(name="lines", colour=Role.BAD, x=x, texts=["first", "second"]),
        Span(name="span", colour=Role.MUTED, opacity=0.3, low=1.0, high=2.0),
        Bars(name="bars", colour=0, labels=["a", "b"], sizes=y, is_horizontal=True, texts=["1", "2"]),
        HeatMap(
            name="map",
            colour=0,
            columns=["a", "b"],
            rows=["c"],
            values=np.array([[1.0, 100.0]]),
            texts=[["1", "100"]],
            highest=100.0,
            scale_title="times",
        ),
        y=Axis(limits=(0.0, 5.0)),
    )
    drawn = draw_picture(picture)
    points, labels, areas, lines, bars, heat = drawn["data"]
    assert (points["y"], points["customdata"].tolist(), points["textposition"]) == (
        ["a", "b"],
        [3.0, 4.0],
        "bottom right",
    )
    assert points["hovertemplate"].startswith("%{y}: %{customdata:.2f}")
    assert (labels["mode"], labels["text"], labels["textposition"]) == ("text", ["A", "B"], "top center")
    assert np.isnan(areas["x"][-1])
    np.testing.assert_array_equal(lines["y"], [0, 5, np.nan, 0, 5, np.nan])
    assert lines["text"][3] == "second"
    assert (bars["orientation"], bars["x"].tolist(), bars["y"]) == ("h", [3.0, 4.0], ["a", "b"])
    assert (heat["z"].tolist(), heat["zmax"]) == ([[0.0, 2.0]], 2.0)
    (shape,) = drawn["layout"]["shapes"]
    assert (shape["x0"], shape["x1"], shape["fillcolor"]) == (1.0, 2.0, "@muted/0.3")


def axis_of(low, high, **axis):
    line = Line(name="curve", colour=Role.UPDATED, x=np.array([1.0, 2.0, 3.0]), y=np.array([low, np.nan, high]))
    panel = Panel(y=Axis(title="size", scale="log", **axis), layers=(line,))
    return draw_picture(Picture(name="one", title="one", alt="one", panels=(panel,)))["layout"]["yaxis"]


@pytest.mark.parametrize(("low", "high", "n_ticks"), [(0.2, 2000.0, 12), (2.0, 5.0, 3)])
def test_sizes_that_people_can_read_are_labelled_20_50_100_200(low, high, n_ticks):
    axis = axis_of(low, high)
    assert axis["tickformat"] == ".10~g"
    assert axis["nticks"] == n_ticks
    assert "exponentformat" not in axis


@pytest.mark.parametrize(("low", "high"), [(1e-7, 1e-3), (1.0, 1e9)])
def test_others_are_labelled_by_powers_with_their_factors(low, high):
    axis = axis_of(low, high)
    assert (axis["exponentformat"], axis["minorloglabels"]) == ("power", "complete")
    assert "tickformat" not in axis


def test_what_an_axis_shows_decides_how_it_is_labelled():
    assert "tickformat" in axis_of(1e-9, 1e9, limits=(0.1, 100.0))


def test_a_map_without_logarithm_is_shaded_by_its_numbers():
    values = np.array([[0.1, 1.0], [0.5, 0.0]])
    names = {"columns": ["a", "b"], "rows": ["c", "d"], "texts": [["", ""]] * 2, "scale_title": "MAC"}
    heat = HeatMap(name="mac", colour=Role.INK, values=values, highest=1.0, is_linear=True, **names)
    panel = Panel(y=Axis(scale="category"), layers=(heat,))
    (trace,) = draw_picture(Picture(name="one", title="one", alt="one", panels=(panel,)))["data"]
    np.testing.assert_array_equal(trace["z"], values)
    assert (trace["zmin"], trace["zmax"]) == (0, 1.0)


def test_pictures_that_the_reader_chooses_among_share_what_one_would_have():
    x = np.linspace(1.0, 1000.0, 50_000)
    noise = np.random.default_rng(5).standard_normal((3, len(x)))
    layers = tuple(Line(name=str(place), colour=place, x=x, y=y) for place, y in enumerate(noise))
    picture = Picture(name="one", title="one", alt="one", panels=(Panel(y=Axis(), layers=layers),))
    alone, among_many = (len(draw_picture(picture, n_alike=n)["data"][0]["x"]) for n in (1, 40))
    assert among_many < 0.3 * alone


def test_a_band_is_not_drawn_where_it_is_not_known():
    """Not by lines across the gap either, which would close over all of the picture."""
    x = np.arange(8.0)
    low, high = x + 1.0, x + 2.0
    low[3:5] = np.nan
    (trace,) = draw_picture(
        Picture(
            name="band",
            title="",
            alt="",
            panels=(Panel(y=Axis(), layers=(Band(name="b", colour=0, x=x, low=low, high=high),)),),
            x=Axis(),
        )
    )["data"]
    assert trace["fill"] == "toself"
    nan = np.nan
    np.testing.assert_array_equal(trace["x"], [0, 1, 2, 2, 1, 0, nan, 5, 6, 7, 7, 6, 5])
    np.testing.assert_array_equal(trace["y"], [1, 2, 3, 4, 3, 2, nan, 6, 7, 8, 9, 8, 7])
