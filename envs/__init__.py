"""Everything that knows a simulator."""

from importlib.util import find_spec

if find_spec("gymnasium") is not None:
    from rss_shield.envs.registration import register_all

    register_all()
