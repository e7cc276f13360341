"""Pictures that explain: the band, the outline and the words say what the shield saw and did."""

import numpy as np
import pytest

import rss_shield
from rss_shield import ExplainedRender
from rss_shield.envs.highway.around import around
from rss_shield.envs.highway.explained import LINE, line_of
from rss_shield.envs.highway.frames import Look
from rss_shield.shield.command import Command
from rss_shield.shield.lanes.responses import RESPONSE_BRAKE

CONFIG = {"vehicles_count": 15, "duration": 10}


def explained(mode="override", env_id="highway-fast-v0"):
    return ExplainedRender(rss_shield.make(env_id, mode, render_mode="rgb_array", config=CONFIG))


def look(**changes):
    nothing = Look(Command(1.0, 0.0), Command(1.0, 0.0), False, False, False, 0, -1, False)
    return nothing._replace(**changes)


def test_words_say_what_was_wanted_done_and_why():
    braked = look(command=Command(-5.0, 0.0), overridden=True, response=RESPONSE_BRAKE, dangerous=True)
    text = line_of(braked, 12.34, 20.0, "")
    assert text == "wants +1.0 m/s², gets -5.0, response: longitudinal | ahead 12.3 m, required 20.0 m"
    assert line_of(look(), np.nan, np.nan, "other") == "wants +1.0 m/s², gets +1.0 | CONTACT, to blame: the other"
    assert "owes: longitudinal" in line_of(look(dangerous=True, response=RESPONSE_BRAKE), np.nan, np.nan, "")
    assert line_of(None, np.nan, np.nan, "").startswith("the shield has not looked yet")


def test_the_band_is_red_exactly_where_the_gap_is_too_small():
    env = explained("monitor")
    env.reset(seed=1)
    seen = set()
    for _ in range(10):
        *_, terminated, truncated, _ = env.step(3)
        plain, drawn = env.env.render(), env.render()
        gap, required, _ = (values[0] for values in around(env.unwrapped.vehicle.act.__self__))
        change = drawn[: len(plain)].astype(int) - plain
        redder, bluer = (change[..., 0] > 10).sum(), (change[..., 2] > 10).sum()
        if np.isfinite(gap) and required > 2.0:
            seen.add(bool(gap < required))
            assert (redder > bluer) == (gap < required)
        if terminated or truncated:
            break
    assert True in seen
    assert drawn.shape == (plain.shape[0] + LINE, plain.shape[1], 3) and drawn.dtype == np.uint8
    env.close()


def test_every_frame_of_a_decision_can_be_recorded():
    env = explained()
    env.reset(seed=0)
    frames = []

    class Recorder:
        def _capture_frame(self):
            frames.append(env.render())

    env.render()
    env.unwrapped.set_record_video_wrapper(Recorder())
    env.step(3)
    config = env.unwrapped.config  # the last frame of a decision is the recorder's own
    assert len(frames) == config["simulation_frequency"] // config["policy_frequency"] - 1
    assert len({frame.shape for frame in frames}) == 1 and (frames[0] != frames[-1]).any()
    env.close()


def test_the_verdict_of_a_contact_stays_in_the_picture(monkeypatch):
    env = explained("monitor")
    env.reset(seed=1)
    said = []
    monkeypatch.setattr("rss_shield.envs.highway.explained.line_of", lambda *given: said.append(given[3]) or "")
    for _ in range(10):
        *_, terminated, truncated, info = env.step(3)
        env.render()
        if terminated or truncated:
            break
    assert info["blame"] and said[-1] == info["blame"] and said[0] == ""
    env.reset(seed=2)
    env.render()
    assert said[-1] == ""
    env.close()


def test_junctions_have_no_band_and_a_record_of_video_works(tmp_path):
    pytest.importorskip("moviepy")
    from gymnasium.wrappers import RecordVideo

    env = RecordVideo(explained(env_id="intersection-v0"), str(tmp_path))
    env.reset(seed=0)
    env.step(1)
    env.close()
    assert list(tmp_path.glob("*.mp4"))


def test_without_pictures_there_is_nothing_to_explain():
    with pytest.raises(ValueError, match="render_mode = None: expected 'rgb_array'"):
        ExplainedRender(rss_shield.make("highway-fast-v0"))
