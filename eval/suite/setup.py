"""Options of an experiment by their dotted names, as arguments of `rss_shield.make` and `make_vec`."""

from collections.abc import Mapping
from typing import Any

from rss_shield.envs.arguments import rules_of
from rss_shield.envs.configuration import check_config
from rss_shield.envs.highway.drivers import RECKLESS
from rss_shield.envs.highway.hostile import HOSTILE
from rss_shield.envs.make_vec import BACKENDS
from rss_shield.envs.options import MODES, Options
from rss_shield.eval.config_option import read_config
from rss_shield.eval.own import function_named
from rss_shield.eval.runs.names import check_names, nested
from rss_shield.eval.suite.own_table import preset_in, usual_preset
from rss_shield.shield.params import Preset, RSSParams, Rules, with_parameters

OTHERS = {"reckless": RECKLESS, **HOSTILE}  # who else is on the road, by name
_SHIELD = (
    *("entry", "intent", "waiting", "examine", "traffic", "risk", "measures"),
    *("filter", "filter_at", "correction", "evasion", "replace", "intervention_penalty", "penalty_on"),
)
_TABLE = ("preset", "ego", "other")
KNOWN = ("shield", "backend", "others", "config", "rules", "judge", "reward", *_TABLE, *_SHIELD)


def setup_of(environment: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """Keyword arguments of `rss_shield.make`, and `shield`, `backend` and, where one is asked for, `reward`.

    Args:
      environment: its id.
      options: dotted names -> values: shield (override, monitor), backend (fast, highway-env), preset (or a file),
        ego.NAME and other.NAME (`RSSParams`), rules.NAME (`Rules`), judge.preset, judge.ego.NAME, judge.other.NAME,
        judge.rules.NAME (one judge for all settings; on highway-env only), the other options of `ShieldWrapper` by
        their names, others (stock, or who in `OTHERS`), config.NAME (of the environment; or config, a file), reward
        (module:function; in the engine only).

    Raises:
      ValueError: an unknown name, with the nearest known one, or a value out of range.
    """
    given = nested(dict(options))
    check_names(given, KNOWN, "options")
    backend = given.get("backend", "fast")
    for name, value, known in (
        ("shield", given.get("shield", "override"), MODES),
        ("backend", backend, BACKENDS),
        ("others", given.get("others", "stock"), ("stock", *OTHERS)),
    ):
        if value not in known:
            raise ValueError(f"{name} = {value!r}: expected one of {', '.join(known)}")
    arguments: dict[str, Any] = {name: given[name] for name in _SHIELD if name in given}
    table = _table(environment, given, "")
    if table is not None:
        arguments["params"] = table
    if "rules" in given:
        arguments["rules"] = _rules(given["rules"], "rules")
    if "judge" in given:
        judge = given["judge"]
        check_names(judge, (*_TABLE, "rules"), "judge")
        arguments["judge_params"] = _table(environment, judge, "judge.")
        arguments["judge_rules"] = _rules(judge.get("rules", {}), "judge.rules")
    Options.of(arguments)
    config = given.get("config", {})
    config = read_config(config) if isinstance(config, str) else dict(config)
    if given.get("others", "stock") != "stock":
        config["other_vehicles_type"] = OTHERS[given["others"]]
    if config:
        check_config(environment, config)
        arguments["config"] = config
    if given.get("reward"):
        function_named(given["reward"])
        if backend != "fast":
            raise ValueError(f"reward = {given['reward']!r}: expected backend: fast, which sums it up")
        arguments["reward"] = given["reward"]
    return {"shield": given.get("shield", "override"), "backend": backend, **arguments}


def _rules(given: Any, name: str) -> Rules:
    check_names(given, Rules._fields, name)
    return rules_of(given, name)


def _table(environment: str, given: Mapping[str, Any], prefix: str) -> Preset | None:
    """The preset with single parameters put in; None = the default of the environment."""
    asked = {side: given.get(side, {}) for side in ("ego", "other")}
    if "preset" not in given and not any(asked.values()) and not prefix:
        return None
    try:
        preset = preset_in(given["preset"] if "preset" in given else usual_preset(environment))
    except ValueError as error:
        raise ValueError(f"{prefix}{error}") from None
    for side, values in asked.items():
        check_names(values, RSSParams._fields, f"{prefix}{side}")
    try:
        return with_parameters(preset, asked["ego"], asked["other"])
    except ValueError as error:
        raise ValueError(f"{prefix}{error}") from None
