"""What pages say is there: examples run as printed, files and tests that they name exist, codes have a legend."""

import contextlib
import io
import re
import runpy

import pytest
from places import ROOT

PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
PAGES = [path for path in PAGES if not {"_build", "api"} & set(path.relative_to(ROOT).parts)]
README = (ROOT / "README.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"```python\n(.*?)```\n\n```text\n(.*?)```", README, re.DOTALL)
BLOCKS = [
    block
    for page in ("start", "filters")
    for block in re.findall(
        r"```python\n(.*?)```", (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8"), re.DOTALL
    )
]
CODE = re.compile(r"\b[HCWMJ]\d+y?\b")
SOURCES = [path for folder in ("shield", "envs", "agents", "eval") for path in sorted((ROOT / folder).rglob("*.py"))]

# what each script prints, among other things
SCRIPTS = {
    "wrap_and_train": "nobody was touched; the shield overrode",
    "own_algorithm": "broken duties and faults 0",
    "own_simulator": "with the shield: smallest gap",
    "intersection": "routes known: 2 of 2 arrived, the ego at fault in 0",
    "own_road": "override: blame nobody, nobody, nobody, nobody",
    "parameters_and_rules": "an ablation, judged in full: blame ego",
    "judge_a_log": "5.50 s: contact of ego and other, at fault: ego; ego braked less than the proper response asks",
    "baseline": "the shield: at fault in 0 of 5",
    "explained_video": "explained.webp: 12 pictures",
    "drive_and_test": "drive_and_test:drive on highway-fast-v0, RSS preset simulator, 20",
    "sb3_vector": "with it: ",
    "vector_wrappers": "observations (32, 25), ",
    "torchrl_cost": "cost of 5 random episodes: ",
    "cost_key": "multiplier ",
    "public_settings": "rl-agents DQN: ",
    "own_comparison": "report/index.html: ",
}
LIBRARIES = {"torchrl_cost": "torchrl"}  # that a script needs beyond ours


@pytest.mark.parametrize(("code", "printed"), EXAMPLES, ids=["one minute", "without highway-env"])
def test_an_example_of_the_readme_prints_what_stands_below_it(code, printed):
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(compile(code, "README.md", "exec"), {})
    assert out.getvalue() == printed


@pytest.mark.parametrize("code", BLOCKS, ids=[block.splitlines()[0][:40] for block in BLOCKS])
def test_a_block_of_a_page_runs(code, capsys):
    exec(compile(code.replace("1_000", "256"), "page.md", "exec"), {})


def test_the_readme_is_one_page_and_says_how_to_begin():
    assert len(README.encode()) <= 6 * 1024
    assert "make compare" in README and "make test" in README and "pip install" in README
    assert len(EXAMPLES) == README.count("```python") == 2


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_how_to_runs(name, capsys):
    if name in LIBRARIES:
        pytest.importorskip(LIBRARIES[name])
    runpy.run_path(str(ROOT / "examples" / f"{name}.py"), run_name="__main__")
    assert SCRIPTS[name] in capsys.readouterr().out


def test_every_how_to_is_tested_and_on_the_page():
    scripts = {path.stem: path for path in (ROOT / "examples").glob("*.py")}
    assert set(scripts) == set(SCRIPTS)
    page = (ROOT / "docs" / "howtos.md").read_text(encoding="utf-8")
    for name, path in scripts.items():
        assert len(path.read_text(encoding="utf-8").splitlines()) < 60
        assert f"{{literalinclude}} ../examples/{name}.py" in page


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_files_and_tests_that_a_page_names_exist(page):
    text = page.read_text(encoding="utf-8")
    for name in re.findall(r"`((?:shield|envs|agents|eval|bench|tests|examples|docs)/[\w/.-]*)`", text):
        assert (ROOT / name).exists(), name
    for name in re.findall(r"`(test_(?!risk_\*)\w+\.py)`", text):
        assert name == "test_defNN_name.py" or list((ROOT / "tests").rglob(name)), name


def test_every_code_in_the_sources_is_in_the_register():
    register = set(CODE.findall((ROOT / "docs" / "holes.md").read_text(encoding="utf-8")))
    used = {code for path in SOURCES for code in CODE.findall(path.read_text(encoding="utf-8"))}
    assert used - register == set()
