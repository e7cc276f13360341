"""The report: what it says is in its tables, it needs no network, and a browser shows it."""

import json
import re
import shutil
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pandas as pd
import pytest
from PIL import Image
from result_tables import episodes_of

from rss_shield.eval.metrics import summarise
from rss_shield.eval.paper.command import run, write
from rss_shield.eval.paper.compared import as_texts, comparisons
from rss_shield.eval.paper.read import file_of, scores_of, sweep_command
from rss_shield.eval.paper.render import escaped
from rss_shield.eval.run_folder import versions

BLAMES = {("off", "off"): ["ego"] * 12 + [""] * 8, ("off", "on"): ["other"] + [""] * 19, ("on", "on"): [""] * 20}


def episodes() -> pd.DataFrame:
    frames = []
    for seed in range(3):
        for (train, test), blames in BLAMES.items():
            frame = episodes_of(blames, train, test).assign(train_seed=seed)
            shift = seed + 5.0 * (train == "on")
            frames.append(frame.assign(**{"return": frame["return"] + shift}))
    return pd.concat(frames, ignore_index=True)


@pytest.fixture
def folder(tmp_path):
    """A run as `rss-shield train` leaves it, as far as a report reads it."""
    path = tmp_path / "a-run"
    path.mkdir()
    config = {
        "env_id": "highway-fast-v0",
        "arms": ["unshielded", "shielded"],
        "rules": {"memory": False},
        "seeds": [0, 1, 2],
        "total_timesteps": 1000,
        "parameters": {},
        "intervention_penalty": 0.0,
    }
    (path / "config.json").write_text(json.dumps({"config": config, **versions()}))
    episodes().to_csv(path / "episodes.csv", index=False)
    rng = np.random.default_rng(0)
    for arm in config["arms"]:
        for seed in config["seeds"]:
            (path / f"{arm}-seed{seed}").mkdir()
            started = np.arange(0, 1000, 20)
            curve = {"timesteps": started + 20, "started": started, "cut": 0, "return": rng.normal(20, 2, 50)}
            curve |= {"length": 20, "crashed": 0, "blame": "no contact", "override_share": 0.1, "cost": 0.0}
            pd.DataFrame(curve).to_csv(path / f"{arm}-seed{seed}" / "learning_curve.csv", index=False)
            rows = [
                {"timesteps": t, "test": test, "n": 20, "crash": 0.5, "at_fault": 0.5, "return": 10.0, "return_sd": 2.0}
                | {"change": 1.0}
                for t in (500, 1000)
                for test in ("off", "on")
            ]
            pd.DataFrame(rows).to_csv(path / f"{arm}-seed{seed}" / "removal_curve.csv", index=False)
    return path


def test_differences_are_paired_tested_and_corrected():
    compared = comparisons(episodes()).set_index(["train", "test", "metric"])
    crash = compared.loc["off", "on", "crash"]
    # 12 of 20 against 1 of 20 that crashed in both: per seed 11 more in the first cell
    assert crash["value"] == pytest.approx(-11 / 20) and crash["over"] == "seeds and episodes"
    assert (crash["only_here"], crash["only_first"]) == (0, 33)
    assert crash["p"] == pytest.approx(2 / 2**33)
    # four tests, and this has the largest p: Holm multiplies it by 1, the smallest by 4
    assert crash["p_holm"] == crash["p"]
    assert compared.loc["off", "on", "at_fault"]["p_holm"] == pytest.approx(4 * 2 / 2**36)
    assert compared.loc["on", "on", "return"]["value"] == pytest.approx(5.0)
    assert np.isnan(compared.loc["on", "on", "return"]["p"])
    assert "-55.0 [" in as_texts(comparisons(episodes()))["value [low, high]"][0]


def test_equal_outcomes_differ_by_equal_intervals():
    blames = {"off": ["ego"] * 12 + [""] * 8, "on": ["ego"] * 3 + [""] * 17}
    frames = [episodes_of(blame, test, "on").assign(train_seed=k) for test, blame in blames.items() for k in range(3)]
    rows = comparisons(pd.concat(frames, ignore_index=True)).set_index("metric")
    assert rows.loc["crash", ["low", "high"]].equals(rows.loc["at_fault", ["low", "high"]])


def test_who_learns_nothing_is_compared_with_every_seed():
    frame = episodes()
    scripted = episodes_of([""] * 20, "lazy", "on")
    compared = comparisons(pd.concat([frame, scripted], ignore_index=True)).set_index(["train", "test", "metric"])
    assert compared.loc["lazy", "on", "crash"]["only_first"] == 36
    turned = comparisons(pd.concat([scripted, frame], ignore_index=True)).set_index(["train", "test", "metric"])
    there, back = (one.loc[cell, "on", "return"] for one, cell in ((turned, "off"), (compared, "lazy")))
    assert there["over"] == "seeds and episodes"
    assert there["value"] == pytest.approx(1.0)  # of its three seeds they are 0, 1 and 2
    assert there["low"] < there["value"] < there["high"]
    assert np.isfinite(back["value"])


def test_differences_to_a_car_that_stands_are_those_of_returns_and_not_of_rates():
    moving = pd.concat([episodes_of([""] * 20, "on", "on").assign(train_seed=k, **{"return": 4.0 + k}) for k in (0, 1)])
    standing = episodes_of([""] * 20, "slower", "on").assign(**{"return": 0.0})
    row = comparisons(pd.concat([moving, standing])).set_index(["train", "metric"]).loc["slower", "return"]
    assert row["value"] == pytest.approx(-4.5)
    assert row["low"] <= row["value"] <= row["high"]


def test_the_report_says_what_came_out_and_needs_no_network(folder, tmp_path):
    page = write((folder,), tmp_path / "report", "A title & more").read_text()
    assert "<h1>A title &amp; more</h1>" in page
    assert "Tested with the shield off: 36 contacts in 60 episodes, 36 of them the ego&#x27;s fault (60 %" in page
    assert "Tested with the shield on: 3 contacts in 120 episodes, 0 of them the ego&#x27;s fault" in page
    summary = summarise(episodes()).set_index(["train", "test", "metric"])["value"]
    best = summary.xs("return", level="metric").max()
    assert f"Highest return: trained with the shield, tested with it on, {best:.1f} per episode." in page
    assert "PPO on highway-fast-v0, RSS preset auto (rules.memory False), 1000 timesteps per arm, no interv" in page
    assert "rss-shield train --env-id highway-fast-v0 --total-timesteps 1000 --seeds 0 1 2" in page
    assert not re.search(r"(src|href)=\"(?!data:|#)", page)
    assert page.count("<img ") == page.count("data:image/png;base64,") == 4
    markdown = (tmp_path / "report" / "report.md").read_text()
    for link in re.findall(r"\]\((.*?)\)", markdown):
        assert (tmp_path / "report" / link).exists() and (tmp_path / "report" / link).with_suffix(".pdf").exists()
    latex = (tmp_path / "report" / "report.tex").read_text()
    for name in re.findall(r"\\includegraphics\[.*?\]\{(.*?)\}", latex):
        assert (tmp_path / "report" / name).exists()
    assert latex.count(r"\begin{tabular}") == latex.count(r"\end{tabular}") == 4


def test_links_are_valid_whatever_folders_are_called(folder, tmp_path, monkeypatch):
    runs = [tmp_path / "mein versuch (ä_1)", tmp_path / "b" / "mein versuch (ä_1)", tmp_path / "roads"]
    for copy in runs:
        shutil.copytree(folder, copy)
        (copy / "pages").mkdir()
        (copy / "pages" / "my drive-worst.html").write_text("")
    monkeypatch.chdir(runs[0])
    out = tmp_path / "a report"
    page = write((Path("."), *runs[1:]), out, "Odd names").read_text()
    markdown, latex = (out / "report.md").read_text(), (out / "report.tex").read_text()
    links = re.findall(r"\]\((.*?)\)", markdown)
    assert all(re.fullmatch(r"[\w.%/-]+", link, re.ASCII) and (out / unquote(link)).exists() for link in links)
    assert len(links) == len(set(links)) == 3 * (4 + 1)
    assert all((out / unquote(link)).exists() for link in re.findall(r'<a href="([^#].*?)"', page))
    paths = re.findall(r"\\includegraphics\[.*?\]\{(.*?)\}", latex)
    assert len(paths) == 12 and all((out / path).exists() for path in paths)
    labels = re.findall(r"\\label\{(.*?)\}", latex)
    assert len(labels) == len(set(labels)) and all(re.fullmatch(r"[\w:./-]+", label, re.ASCII) for label in labels)
    assert "## highway-fast-v0 (mein versuch (ä_1))" in markdown


def test_code_without_a_commit_is_said_so(folder, tmp_path):
    record = json.loads((folder / "config.json").read_text())
    (folder / "config.json").write_text(json.dumps({**record, "git_commit": None, "git_changes": None}))
    page = write((folder,), tmp_path / "report", "Installed").read_text()
    assert "a-run: code without a commit; Python" in page and "None" not in page.split("<footer>")[1]


def test_where_nobody_learns_there_are_no_training_seeds(folder, tmp_path):
    record = json.loads((folder / "config.json").read_text())
    record["config"] |= {"arms": ["lazy"], "rules": {}}
    (folder / "config.json").write_text(json.dumps(record))
    episodes_of(["ego"] * 3 + [""] * 17, "lazy", "on").to_csv(folder / "episodes.csv", index=False)
    page = write((folder,), tmp_path / "report", "Scripted").read_text()
    assert "<p>Drivers on highway-fast-v0, RSS preset auto, nobody learns.</p>" in page
    assert "<p>1 cell (an arm, tested one way), 20 test episodes.</p>" in page


def test_a_test_has_its_tables_and_its_blame_and_no_curves(folder, tmp_path):
    tested = tmp_path / "tested"
    tested.mkdir()
    record = {
        "config": {"policy": "my_driver:drive", "env_id": "merge-v0"},
        "command": "rss-shield test my_driver:drive",
    }
    (tested / "config.json").write_text(json.dumps({**record, **versions()}))
    (tested / "table.md").write_text("my_driver:drive on merge-v0, RSS preset slides, 20 episodes\n\n| |\n")
    rows = [
        episodes_of(["ego"] * 20, "my_driver:drive", "off"),
        episodes_of([""] * 20, "my_driver:drive", "on"),
    ]
    pd.concat(rows, ignore_index=True).assign(train_seed=0).to_csv(tested / "episodes.csv", index=False)
    page = write((folder, tested), tmp_path / "report", "Both").read_text()
    assert "merge-v0 (tested)" in page and "my_driver:drive on merge-v0, RSS preset slides, 20 episodes." in page
    assert "rss-shield test my_driver:drive</" in page
    assert "20 of them the ego&#x27;s fault (100 %, 95 % interval 83 to 100 %" in page
    drawn = {path.name for path in (tmp_path / "report" / "figures" / "tested").glob("*.png")}
    assert "blame.png" in drawn and "learning_curve.png" not in drawn
    latex = (tmp_path / "report" / "report.tex").read_text()
    assert "tested-safety" in latex and "tested-compared" in latex


def test_nothing_is_written_where_one_folder_is_none(folder, tmp_path):
    another, unread = tmp_path / "another", tmp_path / "unread"
    for path, record in ((another, '{"config": {"env_id": "merge-v0"}}'), (unread, "{")):
        path.mkdir()
        (path / "config.json").write_text(record)
        shutil.copy(folder / "episodes.csv", path)
    for bad, said in (
        (another, "expected a finished run of rss-shield train or test"),
        (unread, "cannot be read"),
        (tmp_path / "nowhere", "expected a finished run of rss-shield train or test"),
    ):
        with pytest.raises(ValueError, match=said) as error:
            write((folder, bad), tmp_path / "report", "Half")
        assert str(bad) in str(error.value) and not (tmp_path / "report").exists()


def test_roads_together_have_profiles(folder, tmp_path):
    same, another = tmp_path / "same", tmp_path / "another"
    shutil.copytree(folder, same)
    assert "All roads together" not in write((folder, same), tmp_path / "report", "One road, twice").read_text()
    shutil.copytree(folder, another)
    record = json.loads((another / "config.json").read_text())
    record["config"]["env_id"] = "merge-v0"
    (another / "config.json").write_text(json.dumps(record))
    rows = pd.read_csv(another / "episodes.csv", keep_default_na=False)
    rows[rows["train_seed"] < 2].to_csv(another / "episodes.csv", index=False)
    page = write((folder, another), tmp_path / "report", "Two").read_text()
    assert "2 roads: highway-fast-v0, merge-v0." in page and "interquartile mean" in page
    assert (tmp_path / "report" / "figures" / "roads" / "profiles.pdf").exists()


def test_what_arms_do_on_several_roads_is_over_the_seeds_that_all_have(folder, tmp_path):
    roads = {}
    for road, seeds, scale in (("highway-fast-v0", [0, 1, 2], 1.0), ("merge-v0", [0, 1], 10.0)):
        index = pd.MultiIndex.from_product([["a", "b"], ["on"], seeds], names=["train", "test", "train_seed"])
        roads[road] = pd.Series(scale * np.array([*(1.0 for _ in seeds), *(3.0 for _ in seeds)]), index)
    scores = scores_of(roads)
    assert {name: table.tolist() for name, table in scores.items()} == {"a / on": [[0, 0]] * 2, "b / on": [[1, 1]] * 2}
    flat = {road: 0.0 * returns for road, returns in roads.items()}
    assert all(not table.any() for table in scores_of(flat).values())  # nothing tells them apart


def test_what_is_no_run_is_refused_in_one_line(folder, tmp_path, capsys):
    with pytest.raises(SystemExit) as stop:
        run([str(tmp_path)])
    assert stop.value.code == 2
    assert (
        "expected a finished run of rss-shield train or test (config.json, episodes.csv) or sweep"
        in capsys.readouterr().err
    )
    for arguments, message in (
        ([], "name a run or sweep folder"),
        ([str(folder), "--out", __file__], f"--out {__file__}: expected a folder"),
    ):
        with pytest.raises(SystemExit) as stop:
            run(arguments)
        assert stop.value.code == 2 and message in capsys.readouterr().err


def test_the_file_of_a_sweep_is_that_which_was_called(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    record = {"experiment": {"name": "pol"}}
    assert file_of(record) == "pol.yaml" and file_of({**record, "file": "mine/pol.toml"}) == "mine/pol.toml"
    asked = {**record, "file": "mein versuch.yaml", "options": ["--episodes", "20"]}
    assert sweep_command(asked) == "rss-shield sweep 'mein versuch.yaml' --episodes 20"


def test_latex_takes_every_sign():
    assert escaped("50 % of a_b & c – ★ m/s²") == r"50 \% of a\_b \& c -- $\star$ m/s$^2$"
    assert escaped("~/a^b") == r"\textasciitilde{}/a\textasciicircum{}b"


BROWSER = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None
)


@pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed")
def test_a_browser_shows_the_page(folder, tmp_path):
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed: pip install playwright")
    shown, picture = write((folder,), tmp_path / "report", "Seen"), tmp_path / "page.png"
    asked: list[str] = []
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1200, "height": 900})
        page.on("request", lambda request: asked.append(request.url))
        page.goto(shown.as_uri())
        page.screenshot(path=picture, full_page=True)
        wide = page.evaluate("document.documentElement.scrollWidth")
        cut = page.evaluate("[...document.querySelectorAll('pre')].some(one => one.scrollWidth > one.clientWidth)")
        browser.close()
    assert [url for url in asked if not url.startswith("data:")] == [shown.as_uri()]  # it is complete in itself
    assert wide <= 1200 and not cut  # nothing is beyond the edge
    pixels = np.asarray(Image.open(picture).convert("RGB")).reshape(-1, 3)
    seen = {tuple(colour) for colour in np.unique(pixels, axis=0)}
    # the ego's blame, the shielded arm's curve: figures are drawn, not only named
    assert {(0xD5, 0x5E, 0x00), (0x00, 0x72, 0xB2)} <= seen
    assert 0.01 < (pixels.sum(axis=1) < 300).mean() < 0.5
