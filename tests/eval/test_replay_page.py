"""The page on which episodes play: what is in it, and what a browser makes of it."""

import base64
import json
import re
import shutil
import zlib
from dataclasses import replace

import numpy as np
import pytest
from played import DT, crossing, cut_in

from rss_shield.cli import main
from rss_shield.eval.viewer.page import replay_page, write_replay_page
from rss_shield.eval.viewer.payload import packed, runs
from rss_shield.shield.trace import save

BROWSER = next(
    (path for name in ("chromium", "google-chrome", "chromium-browser") if (path := shutil.which(name))), None
)


def data_of(page: str) -> dict:
    """What a page was given, read back without its own scripts."""
    text = re.search(r'<script id="data"[^>]*>([^<]*)<', page)
    assert text is not None
    return json.loads(zlib.decompress(base64.b64decode(text[1])))


def unpacked(values: list, scale: float) -> np.ndarray:
    known = np.array([value is not None for value in values])
    found = np.full(len(values), np.nan)
    found[known] = np.cumsum([value for value in values if value is not None]) / scale
    return found


# ---------------------------------------------------------------- numbers


def test_numbers_survive_packing_to_half_a_step():
    values = [1.234, np.nan, -5.0, 1e4, np.inf, 0.005]
    again = unpacked(packed(values, 100), 100)
    assert np.isnan(again[[1, 4]]).all()
    np.testing.assert_allclose(again[[0, 2, 3, 5]], [1.234, -5.0, 1e4, 0.005], atol=0.005 + 1e-9)


def test_equal_values_become_runs():
    assert runs([2, 2, 2, -1, 0, 0]) == [2, 3, -1, 1, 0, 2]
    assert runs([]) == []


def test_a_page_has_every_position_of_a_trace_to_half_a_centimetre():
    trace = cut_in(brakes=False)
    episode = data_of(replay_page([trace]))["episodes"][0]
    for i, user in enumerate(episode["users"]):
        there = trace.users.present[:, i]
        for name, scale in (("x", 100), ("y", 100), ("heading", 1000), ("speed", 100)):
            expected = getattr(trace.users, name)[there, i]
            np.testing.assert_allclose(unpacked(user[name], scale), expected, atol=0.5 / scale + 1e-9)
        assert user["from"] == np.argmax(there)


def test_a_page_says_who_is_to_blame_and_why():
    episode = data_of(replay_page([cut_in(brakes=False)]))["episodes"][0]
    (contact,) = episode["contacts"]
    assert contact["title"] == "Contact of ego and 1: ego is to blame"
    assert contact["evidence"] == [
        f"danger: longitudinal, for {cut_in(False).contacts[0].evidence['seconds_since_threshold']:.1f} s",
        "ego braked less than the proper response asks, by 4.00 m/s²",
        "1 kept its duty",
    ]
    # centres come together at 10 m/s from 25 m, bumpers touch at 5 m
    assert contact["frame"] == round(2.0 / DT)
    assert [event["kind"] for event in episode["events"]] == ["danger begins", "contact", "verdict"]


def test_who_is_too_fast_for_the_field_is_shown_without_it():
    trace = cut_in(True)
    fast = trace.replaced(users=replace(trace.users, speed=trace.users.speed + 20.0))  # 45 m/s, the wave is as slow
    (ego,) = data_of(replay_page([fast]))["episodes"][0]["egos"]
    assert "speed" in ego["series"] and "rdsi" not in ego["series"]


def test_a_page_asks_for_nothing_from_elsewhere():
    page = replay_page([cut_in(True)], title="<b>&")
    assert not re.search(r"""(src|href|url)\s*[=(]|@import|https?:""", page.split('<script id="data"')[0])
    assert not re.search(r"fetch\(|XMLHttpRequest|import\(|https?://", page.split("</script>")[1])
    assert "<title>&lt;b&gt;&amp;</title>" in page


def test_what_cannot_be_shown_is_refused():
    trace = cut_in(True)
    with pytest.raises(ValueError, match="0 traces: expected 1 to 4"):
        replay_page([])
    with pytest.raises(ValueError, match="1 labels: expected 2"):
        replay_page([trace, trace], ["one"])
    users = replace(trace.users, **dict.fromkeys(("x", "y", "heading", "speed"), trace.users.x * np.nan))
    with pytest.raises(ValueError, match="nobody is on the road"):
        replay_page([trace.replaced(users=users, contacts=(), events=())])


def test_a_minute_with_fifty_cars_is_small(tmp_path):
    rng = np.random.default_rng(0)
    trace = cut_in(True, 60.0)
    count = 50
    speed = 25.0 + np.cumsum(rng.normal(0.0, 0.1, (len(trace.time), count)), axis=0)
    x = rng.uniform(0.0, 400.0, count) + np.cumsum(speed, axis=0) * DT
    crowd = replace(
        trace.users,
        ids=tuple(map(str, range(count))),
        kinds=("car",) * count,
        length=np.full(count, 5.0),
        width=np.full(count, 2.0),
        x=x,
        y=np.cumsum(rng.normal(0.0, 0.01, x.shape), axis=0),
        heading=rng.normal(0.0, 0.01, x.shape),
        speed=speed,
        acceleration=np.full(x.shape, np.nan),
        steering=np.full(x.shape, np.nan),
        crashed=np.zeros(x.shape, bool),
        lane=np.zeros(x.shape, int),
    )
    write_replay_page([trace.replaced(users=crowd)], tmp_path / "page.html")
    assert (tmp_path / "page.html").stat().st_size < 1.5e6


def test_the_command_writes_a_page_and_says_what_it_cannot_read(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("rss_shield.cli.stop_on_interrupt", lambda message: None)
    for brakes in (False, True):
        save(cut_in(brakes), tmp_path / f"{brakes}.npz")
    out = tmp_path / "page.html"
    main(
        [
            "replay",
            f"{tmp_path / 'False.npz'}",
            f"{tmp_path / 'True.npz'}",
            "--out",
            str(out),
            "--label",
            "a",
            "--label",
            "b",
        ]
    )
    assert "2 episodes side by side" in capsys.readouterr().out
    assert [episode["label"] for episode in data_of(out.read_text())["episodes"]] == ["a", "b"]
    main(["replay", str(tmp_path / "True.npz"), "--out", str(tmp_path / "new" / "page.html")])
    assert (tmp_path / "new" / "page.html").exists()
    (tmp_path / "text.npz").write_text("no trace")
    for arguments, message in (
        ([str(tmp_path / "nobody.npz")], "nobody.npz: no such file"),
        ([str(tmp_path / "text.npz")], "text.npz: expected a file with a trace"),
        ([str(tmp_path / "True.npz"), "--out", str(tmp_path)], f"--out {tmp_path}: expected a file"),
    ):
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            main(["replay", *arguments])
        assert end.value.code == 2 and message in capsys.readouterr().err


# ---------------------------------------------------------------- in a browser


@pytest.fixture(scope="module")
def chromium():
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed: pip install playwright")
    if BROWSER is None:
        pytest.skip("no chromium on this machine: apt-get install chromium")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture
def open_page(chromium, tmp_path):
    """Opens traces; fails if the page complains or asks for anything beside itself."""
    said, asked, pages = [], [], []

    def show(traces, **view):
        write_replay_page(traces, tmp_path / "page.html")
        page = chromium.new_page(**view)
        page.on("console", lambda message: said.append(message.text) if message.type in ("error", "warning") else None)
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(f"file://{tmp_path / 'page.html'}")
        page.wait_for_function("window.player !== undefined")
        pages.append(page)
        return page

    yield show
    for page in pages:
        page.close()
    assert said == []
    assert len(asked) == len(pages)


def clock(page) -> float:
    return float(page.text_content("#clock").split(" s of ")[0])


def test_it_plays_and_stops_at_the_end(open_page):
    page = open_page([cut_in(False, seconds=3.0)])
    assert clock(page) == 0.0
    page.select_option("#rate", "4")
    page.click("#play")
    assert page.text_content("#play") == "Pause"
    page.wait_for_function("document.getElementById('play').textContent === 'Play'")  # by itself
    assert clock(page) == 3.0
    page.keyboard.press("Space")  # the button has the focus: it is pressed once
    assert page.text_content("#play") == "Pause"


def test_it_scrubs_by_slider_and_by_series(open_page):
    page = open_page([cut_in(False), cut_in(True)])
    page.fill("#scrub", "25")
    assert clock(page) == 2.5
    box = page.locator("#charts canvas").first.bounding_box()
    left, right = box["x"] + 40, box["x"] + box["width"] - 6
    page.mouse.move(left + 0.25 * (right - left), box["y"] + 20)
    page.mouse.down()
    page.mouse.move(left + 0.5 * (right - left), box["y"] + 20)
    page.mouse.up()
    assert clock(page) == pytest.approx(3.0, abs=DT)
    cursors = page.eval_on_selector_all(".cursor", "all => all.map(c => c.getBoundingClientRect().x)")
    assert np.ptp(cursors) < 1.0  # all series share it


def test_it_jumps_to_events_and_shows_the_verdict_there(open_page):
    page = open_page([cut_in(False)])
    assert not page.is_visible(".verdict")
    page.click("#events button:has-text('is to blame')")
    assert clock(page) == 2.0
    assert page.is_visible(".verdict")
    assert "ego braked less than the proper response asks, by 4.00 m/s²" in page.text_content(".verdict")
    page.keyboard.press("p")
    begins = cut_in(False).events[0].time
    assert clock(page) == pytest.approx(begins, abs=0.01)
    assert not page.is_visible(".verdict")
    page.keyboard.press("n")
    assert clock(page) == 2.0


def test_it_listens_to_keys(open_page):
    page = open_page([cut_in(True)])
    for key, expected in (
        ("ArrowRight", DT),
        ("ArrowRight", 2 * DT),
        ("Shift+ArrowRight", 1.2),
        ("ArrowLeft", 1.1),
        ("End", 6.0),
        ("Home", 0.0),
    ):
        page.keyboard.press(key)
        assert clock(page) == pytest.approx(expected, abs=1e-6)
    scale = page.evaluate("player.camera.scale")
    page.keyboard.press("+")
    assert page.evaluate("player.camera.scale") > scale
    page.keyboard.press("-")
    assert page.evaluate("player.camera.scale") == pytest.approx(scale)
    page.keyboard.press("Space")
    page.wait_for_function("player.time > 0.1")
    page.keyboard.press("Space")
    here = clock(page)
    page.wait_for_timeout(60)
    assert clock(page) == here


def test_its_numbers_are_those_of_the_trace(open_page):
    trace = cut_in(True)
    page = open_page([trace])
    for i in range(3):
        x = np.array(page.evaluate(f"[...player.episodes[0].users[{i}].x].map(v => isNaN(v) ? null : v)"), float)
        np.testing.assert_allclose(x, trace.users.x[:, i], atol=0.0051)
    required = np.array(page.evaluate("[...player.episodes[0].egos[0].required[0]]"))
    np.testing.assert_allclose(required, trace.egos[0].required[:, 0], atol=0.0051)


PICTURE = """(() => {
  const shown = player.panels[0].view.canvas, copy = new OffscreenCanvas(shown.width, shown.height);
  const pen = copy.getContext("2d", { willReadFrequently: true });
  pen.drawImage(shown, 0, 0);
  return pen.getImageData(0, 0, copy.width, copy.height);
})()"""
INK_AT = f"""([user, t]) => {{
  const picture = {PICTURE}, view = player.panels[0].view, pose = view.episode.users[user].at(t), s = view.scale;
  const x = Math.round(picture.width / 2 + (pose.x - 1.2 - view.middle.x - player.camera.x) * s);
  const y = Math.round(picture.height / 2 + (pose.y - view.middle.y) * s);
  return [...picture.data.slice(4 * (y * picture.width + x), 4 * (y * picture.width + x) + 3)];
}}"""
INKS = f"""() => {{
  const {{ data }} = {PICTURE}, count = {{}};
  for (let i = 0; i < data.length; i += 4) {{
    const ink = [data[i], data[i + 1], data[i + 2]].join();
    count[ink] = (count[ink] || 0) + 1;
  }}
  return count;
}}"""


def test_the_ego_is_drawn_where_it_is_and_moves_on(open_page):
    page = open_page([cut_in(True)], color_scheme="light")
    for frame in (0, 10, 50):
        page.fill("#scrub", str(frame))
        red, green, blue = page.evaluate(INK_AT, [0, frame])
        assert (red, green, blue) == (0x00, 0x72, 0xB2)


def test_where_roads_cross_plan_ways_and_lights_are_drawn(open_page):
    page = open_page([crossing()], color_scheme="light")
    assert "stop" in page.text_content(".now")
    inks = page.evaluate(INKS)
    red, green, blue = "213,94,0", "0,158,115", "0,114,178"
    assert inks.get(red, 0) > 20 and inks.get(green, 0) == 0  # the light
    assert inks.get(blue, 0) > 100
    page.keyboard.press("End")
    inks = page.evaluate(INKS)
    assert inks.get(green, 0) > 20 and inks.get(red, 0) == 0
    assert "go" in page.text_content(".now")


def test_a_recording_without_any_shield_shows_who_touched_whom(open_page):
    trace = cut_in(False).replaced(egos=(), meta={})
    page = open_page([trace])
    page.keyboard.press("End")
    assert page.text_content(".panel h2 .outcome") == "contact after 2.0 s: 0 is to blame"
    assert "0: speed" in page.text_content(".now") and "proper response" not in page.text_content(".now")
    headings = page.text_content("#charts")
    assert "RDSI" in headings and "Duties" not in headings
    speed = page.evaluate("[...player.episodes[0].egos[0].series.acceleration]")
    assert max(map(abs, speed[:-1])) == 0.0  # derived from speeds, which never change


@pytest.mark.parametrize("width", [360, 1280])
def test_nothing_is_wider_than_the_screen(open_page, width):
    page = open_page([cut_in(False), cut_in(True)], viewport={"width": width, "height": 740})
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.locator(".panel").count() == 2
    tops = [page.locator(".panel").nth(k).bounding_box()["y"] for k in range(2)]
    assert (tops[0] == tops[1]) == (width > 760)  # side by side where there is room
