"""The arms of a comparison, as data: who learns what behind which shield, and what it is tested behind.

A new arm is one row here, and one short file in `agents/baselines/` if it needs a learner of its own.

`python -m rss_shield.eval.pages --arms` puts the table on the page docs/arms.md.
"""

import difflib
import zlib
from collections.abc import Mapping
from typing import Any, NamedTuple

OFF, ON = "off", "on"
# what the shield does in a test: options of `rss_shield.make_vec`. A monitor assigns blame and changes nothing.
UNSHIELDED: Mapping[str, Any] = {"shield": "monitor"}
SHIELDED: Mapping[str, Any] = {"shield": "override"}
BEFORE: Mapping[str, Any] = {**SHIELDED, "replace": "decision"}  # replaces actions before a decision, too
IN_FULL: Mapping[str, Any] = {**SHIELDED, "correction": "response"}  # replaces commands by the proper response
OFF_AND_ON: Mapping[str, Mapping[str, Any]] = {OFF: UNSHIELDED, ON: SHIELDED}
SCRIPTED = "scripted"
# settings that the command line gives: name of the setting -> of its option
FROM_OPTIONS = "from options"
WANTED_CHANGE: Mapping[str, Any] = {"penalty_on": "change", FROM_OPTIONS: {"target": "target_intervention"}}
WANTED_SHARE: Mapping[str, Any] = {"penalty_on": "response", FROM_OPTIONS: {"target": "target_share"}}
WANTED_COST: Mapping[str, Any] = {FROM_OPTIONS: {"cost_limit": "cost_limit"}}
EXPLORING: Mapping[str, Any] = {FROM_OPTIONS: {"explore_for": "explore_for"}}
CONTINUOUS: Mapping[str, Any] = {"action": {"type": "ContinuousAction"}}
SEMANTIC: Mapping[str, Any] = {"semantic_actions": {"features": True}}


class Arm(NamedTuple):
    """One row of the table."""

    name: str  # on the command line, and of folders
    label: str  # what it is, in figures and tables
    colour: str  # told apart with every common colour blindness, as far as so many can be
    learner: str  # name in `agents.learner.LEARNERS`, or SCRIPTED
    training: Mapping[str, Any] = UNSHIELDED  # options of the shield while training
    settings: Mapping[str, Any] = {}  # of the learner
    tests: Mapping[str, Mapping[str, Any]] = OFF_AND_ON  # name of the test -> options of the shield
    config: Mapping[str, Any] = {}  # of the environment, beside what is asked for
    train: str = ""  # how tables call the arm; "": its name
    masked: bool = False  # it chooses among permitted actions, where a shield is on
    backend: str = ""  # the only one that can play it
    chooses: Mapping[str, Any] = {}  # options of `rss_shield.make` that say among what; none: as the environment has it

    @property
    def scripted(self) -> bool:
        """Nothing is trained."""
        return self.learner == SCRIPTED

    @property
    def called(self) -> str:
        return self.train or self.name

    @property
    def own(self) -> bool:
        """Is it a function of the user's?"""
        return ":" in self.name

    @property
    def file(self) -> str:
        """Name of its files, as every system takes it."""
        return self.name.replace(":", "-")

    @property
    def continuous(self) -> bool:
        return self.config.get("action", {}).get("type") == "ContinuousAction"


def paying(penalty: float = 0.0, penalty_on: str = "response") -> Mapping[str, Any]:
    """A shield whose interventions cost, whatever the command line says.

    Args:
      penalty: taken off the training reward, times what `penalty_on` names.
      penalty_on: "response", the share of frames that a proper response overrides, or "change", the mean change of
        acceleration [m/s^2].
    """
    return {**SHIELDED, "intervention_penalty": penalty, "penalty_on": penalty_on}


def own(shield: Mapping[str, Any]) -> Mapping[str, Mapping[str, Any]]:
    """Tests without a shield, and with the variant of ours that the agent was trained behind."""
    return {OFF: UNSHIELDED, ON: shield}


def rival(name: str, label: str, colour: str) -> Arm:
    """PPO behind another filter, tested also behind that one."""
    shield = {**SHIELDED, "filter": name}
    return Arm(name, f"PPO behind {label}", colour, "ppo", shield, tests={**OFF_AND_ON, name: shield})


# Okabe & Ito's colours first, then Tol's; the penalties are two ramps
_BLUES = ("#9ECAE1", "#6BAED6", "#4292C6", "#2171B5", "#084594")
_GREENS = ("#A1D99B", "#74C476", "#41AB5D", "#006D2C")
_BY_RESPONSE, _BY_CHANGE = "PPO behind the shield, penalty {:g}", "PPO behind the shield, penalty {:g} per m/s²"
_BY_WANTED = "PPO behind the shield, penalty toward a wanted "
ROWS = (
    Arm("unshielded", "PPO without a shield", "#D55E00", "ppo", train=OFF),
    Arm("shielded", "PPO behind the shield", "#0072B2", "ppo", SHIELDED, train=ON),
    Arm("lazy", "always FASTER", "#000000", SCRIPTED, settings={"driver": "FASTER"}),
    Arm("slower", "always SLOWER", "#999999", SCRIPTED, settings={"driver": "SLOWER"}),
    Arm("random", "random actions", "#BBBBBB", SCRIPTED, settings={"driver": "random"}),
    Arm("idm", "highway-env's IDM and MOBIL", "#F0E442", SCRIPTED, settings={"driver": "idm"}, backend="highway-env"),
    Arm("reward-shaping", "PPO, crashes and short times to collision cost", "#E69F00", "shaped-ppo"),
    *(
        Arm(f"penalty-{x:g}", _BY_RESPONSE.format(x), colour, "ppo", paying(x))
        for x, colour in zip((0.05, 0.1, 0.2, 0.5, 1.0), _BLUES, strict=True)
    ),
    *(
        Arm(f"change-penalty-{x:g}", _BY_CHANGE.format(x), colour, "ppo", paying(x, "change"))
        for x, colour in zip((0.02, 0.05, 0.1, 0.2), _GREENS, strict=True)
    ),
    Arm("adaptive-penalty", _BY_WANTED + "change of acceleration", "#009E73", "adaptive-ppo", paying(), WANTED_CHANGE),
    Arm("adaptive-share", _BY_WANTED + "share of frames", "#56B4E9", "adaptive-ppo", paying(), WANTED_SHARE),
    Arm("maskable", "MaskablePPO, the shield behind the masks", "#D6B4FC", "maskable-ppo", SHIELDED, masked=True),
    Arm("proactive", "PPO, actions replaced before a decision", "#A6761D", "ppo", BEFORE, tests=own(BEFORE)),
    Arm(
        "executed-action", "PPO, replaced and learnt as executed", "#7570B3", "executed-ppo", BEFORE, tests=own(BEFORE)
    ),
    Arm("sailr", "PPO, an intervention ends the episode", "#CC79A7", "sailr-ppo", paying()),
    Arm("ppo-lagrangian", "PPO-Lagrangian without a shield", "#882255", "lagrangian-ppo", settings=WANTED_COST),
    Arm("dqn", "DQN without a shield", "#AA4499", "dqn", settings=EXPLORING),
    Arm("dqn-shielded", "DQN behind the shield", "#332288", "dqn", SHIELDED, EXPLORING),
    Arm(
        "executed-action-dqn",
        "DQN, replaced and learnt as executed",
        "#1B9E77",
        "executed-dqn",
        BEFORE,
        EXPLORING,
        tests=own(BEFORE),
    ),
    Arm("qr-dqn", "QR-DQN without a shield", "#DDCC77", "qr-dqn", settings=EXPLORING),
    Arm("qr-dqn-shielded", "QR-DQN behind the shield", "#117733", "qr-dqn", SHIELDED, EXPLORING),
    Arm("sac", "SAC without a shield", "#CC6677", "sac", config=CONTINUOUS),
    Arm("sac-replaced", "SAC, commands replaced", "#44AA99", "sac", IN_FULL, tests=own(IN_FULL), config=CONTINUOUS),
    Arm("sac-projected", "SAC, commands corrected as little as may be", "#999933", "sac", SHIELDED, config=CONTINUOUS),
    rival("ttc", "a limit of the time to collision", "#661100"),
    rival("distance-45m", "a distance of 45 m", "#6699CC"),
    rival("cbf", "a control barrier function", "#888888"),
    rival("limits", "the always-on limits alone", "#AA4466"),
    rival("literal-def10", "Def. 10 as printed, once per decision", "#4477AA"),
    Arm(
        "semantic-planner",
        "the best semantic action by value",
        "#DDAA33",
        SCRIPTED,
        settings={"driver": "semantic"},
        chooses=SEMANTIC,
    ),
    Arm(
        "semantic-random",
        "random semantic actions",
        "#777711",
        SCRIPTED,
        settings={"driver": "any semantic"},
        chooses=SEMANTIC,
    ),
    Arm(
        "semantic-dqn",
        "DQN on semantic actions behind the shield",
        "#BB5566",
        "semantic-dqn",
        SHIELDED,
        chooses=SEMANTIC,
    ),
)
ARMS = {arm.name: arm for arm in ROWS}


OWN_COLOURS = ("#009988", "#EE3377", "#33BBEE", "#CC3311", "#0077BB", "#AA7744")


def arm_named(name: str) -> Arm:
    """An arm of the table, or a policy of one's own, `module:function`: from many observations to as many actions.

    Raises:
      ValueError: there is none of this name; the message has the nearest.
    """
    if ":" in name:
        colour = OWN_COLOURS[zlib.crc32(name.encode()) % len(OWN_COLOURS)]
        return Arm(name, f"own policy {name}", colour, SCRIPTED, settings={"driver": name})
    if name not in ARMS:
        nearest = difflib.get_close_matches(name, ARMS, n=1, cutoff=0.0)[0]
        raise ValueError(
            f"{name!r} is no arm; the nearest is {nearest}, --list-arms shows all; a policy of your own is "
            "module:function"
        )
    return ARMS[name]


def arm_called(train: str) -> Arm | None:
    """The arm that tables call so; None where it is none."""
    if ":" in train:
        return arm_named(train)
    return next((arm for arm in ROWS if arm.called == train), None)


def table() -> list[list[str]]:
    """All arms as texts, a row each; the first row is the heading."""
    rows = [["arm", "what it is", "learner", "shield in training", "tested with"]]
    for arm in ROWS:
        learner = arm.settings["driver"] if arm.scripted else arm.learner
        training = "–" if arm.scripted else _shield(arm.training)
        rows.append([arm.name, arm.label, f"{arm.learner if arm.scripted else ''} {learner}".strip(), training])
        rows[-1].append(", ".join(arm.tests))
    return rows


def _shield(options: Mapping[str, Any]) -> str:
    if options["shield"] == "monitor":
        return "off"
    charged = options.get("intervention_penalty")
    others = {name.replace("intervention_", ""): value for name, value in options.items() if name != "shield" and value}
    if not charged:
        others.pop("penalty_on", None)
    return ", ".join(["on", *(f"{name} {value}" for name, value in others.items())])
