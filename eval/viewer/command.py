"""`rss-shield replay`: traces to a page."""

import argparse
from pathlib import Path

from rss_shield.eval.files import file_for, refuse
from rss_shield.eval.viewer.page import MOST, write_replay_page
from rss_shield.shield.trace import load


def run(arguments: list[str]) -> None:
    """Write the page that the arguments ask for and say where it is."""
    parser = argparse.ArgumentParser(
        prog="rss-shield replay",
        description="Write one HTML file on which recorded episodes play; it needs no network.",
    )
    parser.add_argument("traces", nargs="+", type=Path, metavar="TRACE", help=f"trace files, 1 to {MOST} side by side")
    parser.add_argument("--out", type=Path, default=Path("replay.html"), metavar="FILE", help="default: replay.html")
    parser.add_argument("--label", action="append", dest="labels", metavar="TEXT", help="of each trace, in order")
    parser.add_argument("--title", default="", metavar="TEXT", help="default: environment and seed")
    options = parser.parse_args(arguments)
    try:
        traces = [load(path) for path in options.traces]
        write_replay_page(traces, file_for(options.out), options.labels, options.title)
    except (OSError, ValueError) as error:
        refuse("rss-shield replay", error)
    episodes = "one episode" if len(options.traces) == 1 else f"{len(options.traces)} episodes side by side"
    print(f"{options.out}: {episodes}, {options.out.stat().st_size / 1e3:.0f} kB")
