"""The site: MyST pages, and the API read from the sources without importing them."""

import re
import shutil
import tomllib
from pathlib import Path

DOCS = Path(__file__).parent
ROOT = DOCS.parent
REPLAYS = DOCS / "_build" / "replays"  # pages of their own, which the site shows
SOURCES = DOCS / "_build" / "sources"  # the package without the links in it, which are not followed


def stage() -> None:
    """Copy the Python files to where their import names are their paths."""
    shutil.rmtree(SOURCES, ignore_errors=True)
    shutil.copytree(ROOT / "rss_shield", SOURCES / "rss_shield", ignore=shutil.ignore_patterns("__pycache__"))


stage()


def record() -> None:
    """Play the episodes that the site shows, and write the pages on which they play."""
    from rss_shield import make
    from rss_shield.envs.highway.recorder import record_trace
    from rss_shield.eval.viewer.page import write_replay_page

    shutil.rmtree(REPLAYS, ignore_errors=True)
    REPLAYS.mkdir(parents=True)
    for name, env_id, faster in (("motorway", "highway-fast-v0", 3), ("junction", "intersection-v0", 2)):
        traces = [
            record_trace(make(env_id, shield), lambda _, action=faster: action, seed=0)
            for shield in ("monitor", "override")
        ]
        write_replay_page(traces, REPLAYS / f"replay-{name}.html")


record()

# ---------------------------------------------------------------- project

_project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
project, release = _project["name"], _project["version"]
author = _project["authors"][0]["name"]
copyright = author

extensions = ["myst_parser", "sphinx.ext.napoleon", "autoapi.extension", "sphinx_copybutton"]
exclude_patterns = ["_build", "README.md"]
html_theme = "furo"
html_extra_path = [str(REPLAYS)]
html_title = f"{project} {release}"

# ---------------------------------------------------------------- pages

myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3
default_role = "code"  # docstrings quote names `like this`
copybutton_exclude = ".linenos, .gp, .go"
linkcheck_ignore = [r"https?://.*"]  # local links only

# ---------------------------------------------------------------- API

autoapi_dirs = [str(SOURCES / "rss_shield")]
autoapi_root = "api"
autoapi_options = ["members", "undoc-members", "show-module-summary"]
autoapi_member_order = "bysource"
autoapi_add_toctree_entry = False
autoapi_python_class_content = "both"
# names in docstrings are words first: many fields are called `x`
suppress_warnings = ["autoapi.python_import_resolution", "ref.python"]
napoleon_google_docstring = True
napoleon_numpy_docstring = False


def _plain(text: str) -> str:
    """Text of a docstring as reStructuredText: stars, bars and trailing underscores are no markup."""
    parts = re.split(r"(`[^`]*`)", text)
    parts[::2] = [re.sub(r"([*|\\]|(?<=\w)_(?=\W|$))", r"\\\1", part) for part in parts[::2]]
    return "".join(parts)


def tidy(app, what, name, obj, options, lines):
    """Lines that hang below an item become one with it; items that stand below a blank line become a list."""
    tidied: list[str] = []
    items = -1  # indentation of the block that the last line is in; -1 = in none
    is_list = False
    for line in lines:
        indent = len(line) - len(line.lstrip())
        after_heading = bool(tidied) and tidied[-1].endswith(":")
        if not line.strip():
            items = -1
            tidied.append("")
        elif indent > items >= 0 and not (items == 0 and after_heading):
            tidied[-1] += " " + _plain(line.strip())
        else:
            if items < 0 or indent != items:
                items, is_list = indent, indent > 0 and not after_heading
            columns = indent == 0 and re.match(r"\S+  +\S", line)  # a name, and what it means
            tidied.append(" " * indent + ("- " if is_list or columns else "") + _plain(line.strip()))
    lines[:] = tidied


def setup(app):
    app.connect("autodoc-process-docstring", tidy, priority=100)  # before napoleon
