"""Risk in the engine is that of highway-env, and costs nothing where nobody asks for it."""

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from rss_shield import make_vec
from rss_shield.shield.risk import RiskSettings

ENVS = 3
EPISODE = (
    *("max_rdsi", "max_total_rdsi", "time_known_safe", "time_unknown", "time_known_unsafe"),
    *("band_risk", "min_thw", "max_drac"),
)
STEP = ("rdsi", "lower", "upper", "partner", "largest", "total", "ttc", "thw", "drac")


def both(env_id, shield, risk=True, **options):
    """The engine and highway-env, with the same environments."""
    more = {"autoreset_mode": AutoresetMode.SAME_STEP, "risk": risk, **options}
    return [make_vec(env_id, ENVS, shield, backend=backend, **more) for backend in ("fast", "highway-env")]


def assert_same_risk(fast, slow, where=slice(None)):
    for name in STEP:
        np.testing.assert_allclose(
            fast["risk"][name][where], slow["risk"][name][where], rtol=1e-9, atol=1e-9, err_msg=name
        )
    for name in ("state", "state_of_total"):
        assert list(fast["risk"][name][where]) == list(slow["risk"][name][where])
    for name in EPISODE:
        np.testing.assert_allclose(fast[name][where], slow[name][where], rtol=1e-9, atol=1e-9, err_msg=name)


@pytest.mark.parametrize(
    ("env_id", "shield", "steps", "config"),
    [
        ("highway-fast-v0", "monitor", 30, {}),
        ("highway-fast-v0", "override", 30, {}),
        ("merge-v0", "override", 15, {}),
        ("intersection-v0", "monitor", 13, {}),
    ],
)
def test_risk_is_that_of_highway_env(env_id, shield, steps, config):
    fast, slow = both(env_id, shield, config=config)
    rng = np.random.default_rng(5)
    _, infos = fast.reset(seed=20)
    _, expected = slow.reset(seed=20)
    assert_same_risk(infos, expected)
    states, ended = set(), 0
    for _ in range(steps):
        actions = rng.integers(fast.single_action_space.n, size=ENVS)
        *_, infos = fast.step(actions)
        *_, expected = slow.step(actions)
        assert_same_risk(infos, expected)
        states |= set(infos["risk"]["state"])
        if "final_info" in infos:
            where = infos["_final_info"]
            assert (where == expected["_final_info"]).all()
            assert_same_risk(infos["final_info"], expected["final_info"], where)
            ended += where.sum()
    assert len(states) > 1 and ended > 0
    fast.close()
    slow.close()


def test_settings_reach_the_engine():
    settings = RiskSettings.validated(mode="radial", farthest=60.0, least_stay=0.5)
    fast, slow = both("highway-fast-v0", "monitor", settings)
    fast.reset(seed=7)
    slow.reset(seed=7)
    for _ in range(8):
        *_, infos = fast.step(np.full(ENVS, 3))
        *_, expected = slow.step(np.full(ENVS, 3))
        assert_same_risk(infos, expected)
    fast.close()
    slow.close()


def test_risk_changes_nothing_else():
    plain, measured = (make_vec("highway-fast-v0", 8, "override", risk=risk) for risk in (False, True))
    rng = np.random.default_rng(1)
    seen, also = plain.reset(seed=0)[0], measured.reset(seed=0)[0]
    for _ in range(40):
        assert (seen == also).all()
        actions = rng.integers(5, size=8)
        seen, rewards, *_, infos = plain.step(actions)
        also, same, *_, more = measured.step(actions)
        assert (rewards == same).all()
        for name in ("time", "cost", "min_ttc"):
            assert (infos[name] == more[name]).all()
        assert "risk" not in infos and "max_rdsi" not in infos
    assert plain.engine.batch.risks is None
    plain.close()
    measured.close()


def test_what_the_engine_cannot_measure_is_refused():
    with pytest.raises(ValueError, match="risk = 'yes': expected True, False or RiskSettings"):
        make_vec("highway-fast-v0", 1, risk="yes")
    with pytest.raises(ValueError, match="risk = True: expected False without a shield"):
        make_vec("highway-fast-v0", 1, None, risk=True)
    with pytest.raises(ValueError, match="wave_speed = 30: expected > 40 m/s"):
        make_vec("highway-fast-v0", 1, risk=RiskSettings.validated(wave_speed=30.0))
