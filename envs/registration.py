"""The names under which `gymnasium.make` and `gymnasium.make_vec` find shielded environments.

`rss_shield/highway-fast-v0` is highway-env's `highway-fast-v0` with a shield around its ego, and in the compiled engine
where that is asked for a batch. highway-env's own names keep their meaning. To import `rss_shield.envs` registers
them; so does the prefix in `gymnasium.make_vec("rss_shield.envs:rss_shield/highway-fast-v0", 64)`.
"""

from gymnasium import register, registry

NAMESPACE = "rss_shield"
IN_ENGINE = (
    "highway-v0",
    "highway-fast-v0",
    "merge-v0",
    "merge-v1",
    "merge-generic-v0",
    "merge-generic-v1",
    "two-way-v0",
    "exit-v0",
    "exit-v1",
    "u-turn-v0",
    "u-turn-v1",
    "roundabout-v0",
    "roundabout-v1",
    "intersection-v0",
    "intersection-v2",
    "intersection-multi-agent-v0",
    "intersection-multi-agent-v1",
    "intersection-multi-agent-v2",
)
ELSEWHERE = ("intersection-v1", "signalised-intersection-v0")


def register_all() -> None:
    """Register every environment that `rss_shield.make` shields; those of the engine for batches, too."""
    for env_id in IN_ENGINE + ELSEWHERE:
        name = f"{NAMESPACE}/{env_id}"
        if name not in registry:
            batches = "rss_shield.envs.make_vec:make_vec" if env_id in IN_ENGINE else None
            register(
                name,
                entry_point="rss_shield.envs.make:make",
                vector_entry_point=batches,
                kwargs={"env_id": env_id},
                order_enforce=False,
                disable_env_checker=True,
            )
