"""The campaign: killed in the midst and begun again, nothing is lost and nothing done twice; what is shipped of it."""

import json
import os
import signal
import subprocess
import sys
import time

from places import ROOT

from bench.campaign import PARTS, SCRIPTED, ship
from rss_shield.eval.arms import ARMS

COMMAND = [sys.executable, str(ROOT / "bench" / "campaign.py"), "--parts", "highway-main", "--divide", "10000"]
TINY = ["--", "--n-envs", "2", "--replay-episodes", "0", "--workers", "1", "--removal-episodes", "2"]


def test_every_arm_is_in_the_campaign():
    on_highway = {arm for part in PARTS for arm in part.arms if part.env_id == "highway-fast-v0"}
    assert on_highway == set(ARMS)
    assert set(SCRIPTED) >= {"lazy", "slower", "random", "idm"}
    assert len({part.name for part in PARTS}) == len(PARTS)


def test_a_killed_campaign_goes_on_where_it_was(tmp_path):
    command = [*COMMAND, "--runs-dir", str(tmp_path), *TINY]
    folder = tmp_path / "campaign-highway-main"
    process = subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    )
    while len(list(folder.glob("*/model.zip"))) < 2:
        assert process.poll() is None, process.communicate()[0]
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
    before = {path: path.stat().st_mtime_ns for path in folder.glob("*/model.zip")}
    assert 2 <= len(before) < 6
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert len(list(folder.glob("*/model.zip"))) == len(list(folder.glob("*/card.md"))) == 6
    assert (folder / "frontier.png").exists()
    results = (folder / "results.json").stat().st_mtime_ns
    again = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert "train.py" not in again.stdout  # nothing is left to do but the figure
    assert (folder / "results.json").stat().st_mtime_ns == results
    listed = subprocess.run([*COMMAND, "--runs-dir", str(tmp_path), "--list"], cwd=ROOT, capture_output=True, text=True)
    listed_whole = [word for word in COMMAND if word not in ("--divide", "10000")]
    whole = subprocess.run(
        [*listed_whole, "--runs-dir", str(tmp_path), "--list"], cwd=ROOT, capture_output=True, text=True
    )
    assert whole.stdout.startswith("highway-main: to do;")  # a trial is not the real thing
    assert listed.stdout.startswith("highway-main: done; 1000000 decisions, 10 seeds, unshielded, shielded,")
    ship(PARTS[0]._replace(arms=("maskable",)), tmp_path, tmp_path / "models")
    shipped, whole = tmp_path / "models" / "highway-fast-v0" / "maskable", folder / "maskable-seed0"
    assert (shipped / "model.zip").stat().st_size < 0.35 * (whole / "model.zip").stat().st_size
    cards = [json.loads((where / "card.json").read_text()) for where in (shipped, whole)]
    assert cards[0].pop("results").keys() == cards[1].pop("results").keys()  # tested anew
    assert cards[0] == cards[1]
    assert "# maskable, seed 0" in (shipped / "card.md").read_text()
