"""The folder of a run is named by what differs from the defaults."""

from rss_shield.command_line import shown
from rss_shield.eval.files import valid_name
from rss_shield.eval.run_folder import changes
from rss_shield.eval.suite.comparison.options import Config
from rss_shield.eval.suite.comparison.record import options_of


def run_name(config: Config) -> str:
    """The environment, then every option that differs from its default."""
    chosen_options = changes(options_of(config), options_of(Config()))
    parts = [f"{name}={shown(value, '-')}" for name, value, _ in chosen_options if name != "env_id"]
    return valid_name(",".join([config.env_id, *parts]))
