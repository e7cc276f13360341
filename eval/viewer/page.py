"""One self-contained HTML file on which episodes play: the road from above, time series, events."""

import base64
import html
import json
import zlib
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

from rss_shield.eval.files import write_text
from rss_shield.eval.viewer.payload import NAMES, payload
from rss_shield.shield.risk import RiskSettings
from rss_shield.shield.trace import Trace

SCRIPTS = ("scene.js", "view.js", "charts.js", "player.js")  # one after the other
MOST = 4  # episodes side by side
_MODES = {"off": "no shield", "monitor": "shield off, watching", "override": "shield on"}


def write_replay_page(
    traces: Sequence[Trace],
    path: str | Path,
    labels: Sequence[str] | None = None,
    title: str = "",
    settings: RiskSettings = RiskSettings(),
) -> None:
    """Write a page that plays episodes side by side.

    Args:
      traces: one to four, for instance of the same seed with the shield off and on.
      path: of the HTML file.
      labels: what each is called; by default what the traces say of themselves.
      title: of the page; by default environment and seed of the first trace.
      settings: of the risk that is drawn.

    Raises:
      ValueError: no trace, too many, one with nobody in it, or not as many labels as traces.
    """
    write_text(Path(path), replay_page(traces, labels, title, settings))


def replay_page(
    traces: Sequence[Trace],
    labels: Sequence[str] | None = None,
    title: str = "",
    settings: RiskSettings = RiskSettings(),
) -> str:
    """The text of such a page; see `write_replay_page`."""
    if not 1 <= len(traces) <= MOST:
        raise ValueError(f"{len(traces)} traces: expected 1 to {MOST} on a page")
    labels = [label_of(trace) for trace in traces] if labels is None else list(labels)
    if len(labels) != len(traces):
        raise ValueError(f"{len(labels)} labels: expected {len(traces)}, one per trace")
    for trace, label in zip(traces, labels, strict=True):
        if not trace.users.present.any():
            raise ValueError(f"trace {label!r}: nobody is on the road; expected at least one road user")
    data = {
        "about": about(traces[0]),
        "episodes": [payload(trace, label, settings) for trace, label in zip(traces, labels, strict=True)],
    }
    names = "".join(f"const {name} = {json.dumps(values)};\n" for name, values in NAMES.items())
    first, *rest = (_text(name) for name in SCRIPTS)
    return Template(_text("page.html")).substitute(
        title=html.escape(title or title_of(traces[0])),
        style=_text("style.css").strip(),
        script="\n".join([first.strip(), names.strip(), *(text.strip() for text in rest)]),
        data=_packed(data),
    )


def title_of(trace: Trace) -> str:
    """Environment and seed, as far as a trace says."""
    meta = trace.meta
    seed = "" if meta.get("seed") is None else f", seed {meta['seed']}"
    return f"{meta.get('env_id', 'Replay')}{seed}"


def label_of(trace: Trace) -> str:
    """What the shield did in a trace, as far as it says."""
    return _MODES.get(trace.meta.get("mode", ""), str(trace.meta.get("source", "recording")))


def about(trace: Trace) -> str:
    """One line on what was recorded."""
    people = trace.users.present.any(axis=0).sum()
    parts = [f"{people} road users", f"{1.0 / trace.dt:.3g} frames a second"]
    if "traffic" in trace.meta:
        parts.append(f"{trace.meta['traffic']} traffic")
    return ", ".join(parts)


def _packed(data: dict[str, Any]) -> str:
    """Strict JSON, deflated, as base64."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return base64.b64encode(zlib.compress(text.encode(), 9)).decode()


def _text(name: str) -> str:
    return (files("rss_shield.eval.viewer") / name).read_text(encoding="utf-8")
