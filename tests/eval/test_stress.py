"""A campaign counts every episode once, whenever it is stopped, and keeps what charges the ego."""

import json

import pytest

from rss_shield.cli import main
from rss_shield.eval.suite import stress
from rss_shield.eval.suite.judge.judgement import judge_trace
from rss_shield.shield.trace import load

FEW = ["--envs", "highway-fast-v0", "--policies", "random", "--block", "8"]


def files(folder):
    return {path.name: path.read_bytes() for path in folder.glob("*.json")}


def test_a_campaign_that_was_stopped_goes_on(tmp_path, capsys, monkeypatch):
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    main(["stress", *FEW, "--episodes", "24", "--out", str(whole)])
    said = capsys.readouterr().out.splitlines()[-4:]
    assert said[0].startswith("24 episodes") and said[1].startswith("ego at fault: 0, upper end")
    play, played = stress.play, []

    def interrupted(block, threads=1):
        played.append(block.first)
        if played.count(8) == 1 and block.first == 8:
            raise KeyboardInterrupt
        return play(block, threads)

    monkeypatch.setattr(stress, "play", interrupted)
    with pytest.raises(KeyboardInterrupt):
        stress.run([*FEW, "--episodes", "24", "--out", str(parts)])
    assert len(files(parts)) == 1
    stress.run([*FEW, "--episodes", "24", "--out", str(parts)])
    assert played == [0, 8, 8, 16]
    assert files(parts) == files(whole)
    assert capsys.readouterr().out.splitlines()[-4:] == said
    (first, *_) = sorted(parts.glob("*.json"))
    record = json.loads(first.read_text())
    first.write_text(json.dumps({**record, "versions": {**record["versions"], "git_commit": "0" * 40}}))
    stress.run([*FEW, "--episodes", "24", "--out", str(parts)])
    assert "1 of 3 blocks were played by other code than this" in capsys.readouterr().err
    stress.run(["--out", str(parts), "--write", str(tmp_path)])
    assert "Code 000000000000" in (tmp_path / "stress.md").read_text()


def test_without_the_shield_it_stops_at_the_first_ego_at_fault(tmp_path, capsys):
    with pytest.raises(SystemExit, match=r"ends with blame '(ego|both)'"):
        main(["stress", *FEW, "--episodes", "8", "--shield", "monitor", "--out", str(tmp_path)])
    (path,) = tmp_path.glob("*.npz")
    trace = load(path)
    (result,) = (json.loads(content) for content in files(tmp_path).values())
    worst = next(one for one in result["bad"] if str(one["seed"]) in path.name)
    assert trace.meta["blame"] == worst["blame"]  # highway-env says what the engine said, with the same actions
    assert judge_trace(trace, users=[0]).verdict_of(0) == worst["blame"]
    assert sum(result["verdicts"].values()) == result["episodes"] == 8


def test_blocks_cover_every_seed_once():
    blocks = stress.blocks_of(["a", "b"], ["random"], [""], "override", 5, 25, 10)
    for env_id in "ab":
        seeds = [s for one in blocks if one.env_id == env_id for s in range(one.first, one.first + one.episodes)]
        assert seeds == list(range(5, 30))
    assert len({one.name for one in blocks}) == len(blocks) == 6


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--policies", "careful"], "policy = 'careful': expected one of random"),
        (["--params", "carlo"], "preset = 'carlo'"),
        (["--episodes", "0"], "--episodes 0: expected a whole number >= 1"),
        (["--seed", "-1"], "--seed -1: expected a whole number >= 0"),
        (["--traffic", "stock,kind"], "traffic = 'kind': expected one of stock"),
        (["--out", __file__], f"--out {__file__}: expected a folder"),
    ],
)
def test_what_can_not_be_played_is_said(tmp_path, arguments, message, capsys):
    with pytest.raises(SystemExit) as end:
        main(["stress", *FEW, "--out", str(tmp_path), *arguments])
    said = capsys.readouterr()
    assert end.value.code == 2 and message in said.err and not said.out


def test_another_state_of_a_table_is_another_block(tmp_path):
    path, names = tmp_path / "mine.yaml", set()
    for time in (0.5, 0.6):
        path.write_text(f"ego: {{response_time: {time}}}")
        block = stress.Block("highway-fast-v0", "random", str(path), "override", 0, 8)
        names.add(block.name)
        assert block.table.ego.response_time == time
    assert len(names) == 2 and all(name.startswith("highway-fast-v0_random_stock_mine_override_0_") for name in names)
