"""Filmstrips show the moments that matter, and the margins that the trace holds."""

import numpy as np
import pytest
from played import cut_in

from rss_shield.eval.viewer import filmstrip
from rss_shield.eval.viewer.filmstrip import RESPONSE, draw, key_moments, longest_response, margins_of, write_filmstrip
from rss_shield.shield.trace import CHANGED_BY


def test_the_contact_is_among_the_moments_and_they_are_in_order():
    trace = cut_in(brakes=False)
    moments = key_moments(trace, trace.egos[0])
    assert len(moments) == len(set(moments)) == 5 and moments == sorted(moments)
    assert round(trace.contacts[0].time / trace.dt) in moments


def test_the_smallest_margin_is_among_the_moments():
    trace = cut_in(brakes=True)
    ego = trace.egos[0]
    least = int(np.nanargmin(np.nanmin(ego.gap - ego.required, axis=1)))
    assert least in key_moments(trace, ego)


def test_the_longest_response_begins_where_it_begins():
    ego = cut_in(brakes=True).egos[0]
    ego.changed_by[:] = CHANGED_BY.index("")
    assert longest_response(ego) is None
    ego.changed_by[[3, 4, 10, 11, 12, 20]] = RESPONSE
    ego.changed_by[30:40] = CHANGED_BY.index("anticipation")
    assert longest_response(ego) == (10, 13)


def test_margins_are_gaps_less_what_is_required():
    ego = cut_in(brakes=True).egos[0]
    k = filmstrip.AHEAD
    # at the start 20 m between the bumpers at 25 against 15 m/s: 15 + 10^2 / 8 are required
    assert margins_of(ego)[0, k] == pytest.approx(20.0 - (15.0 + 100.0 / 8.0))


def test_names_with_dots_are_told_apart(tmp_path):
    for penalty in ("0.1", "0.25"):
        write_filmstrip([cut_in(brakes=True)], ["on"], tmp_path / f"penalty-{penalty}-typical.html", "a cut-in")
    names = [f"penalty-{penalty}-typical.{kind}" for penalty in ("0.1", "0.25") for kind in ("pdf", "png")]
    assert sorted(path.name for path in tmp_path.iterdir()) == names


def test_a_strip_per_trace_is_drawn_and_written(tmp_path):
    traces = [cut_in(brakes=False), cut_in(brakes=True)]
    figure = draw(traces, ["shield off", "shield on"], "a cut-in")
    assert len(figure.axes) == 2 * (5 + 1)
    titles = [axes.get_title() for axes in figure.axes]
    assert any("contact: " in title for title in titles)
    write_filmstrip(traces, ["shield off", "shield on"], tmp_path / "strip.html", "a cut-in")
    assert (tmp_path / "strip.png").stat().st_size > 10_000 and (tmp_path / "strip.pdf").exists()
