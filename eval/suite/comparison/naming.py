"""The folder of a run is named by what differs from the defaults."""

import hashlib
import re

from rss_shield.command_line import shown
from rss_shield.eval.run_folder import changes
from rss_shield.eval.suite.comparison.options import Config
from rss_shield.eval.suite.comparison.record import options_of

NAMES = "letters, digits and . , = + - _"
LONGEST_NAME = 120
DEVICES = {"CON", "PRN", "AUX", "NUL", *(f"{port}{i}" for port in ("COM", "LPT") for i in range(10))}  # on Windows


def run_name(config: Config) -> str:
    """The environment, then every option that differs from its default."""
    chosen_options = changes(options_of(config), options_of(Config()))
    parts = [f"{name}={shown(value, '-')}" for name, value, _ in chosen_options if name != "env_id"]
    return valid_name(",".join([config.env_id, *parts]))


def valid_name(text: str) -> str:
    """A name of a folder that every system takes: no / \\ : * ? " < > |, no dot at an end, no device, not too long."""
    name = re.sub(r"[^\w=.,+-]+", "-", text).strip("-.")
    if name.split(".")[0].upper() in DEVICES:
        name = f"_{name}"
    if len(name) > LONGEST_NAME:
        name = f"{name[: LONGEST_NAME - 9]}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"
    return name
