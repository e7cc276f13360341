"""What an installation puts where, and what it needs."""

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from places import ROOT

from rss_shield.cli import COMMANDS

TRAINING = (
    "torch",
    "stable_baselines3",
    "sb3_contrib",
    "tensorboard",
    "tyro",
    "rich",
    "tqdm",
    "yaml",
)  # not needed otherwise
FOREIGN = ("envs", "agents", "eval", "shield", "train")
USE = """
import importlib.abc, sys

class Missing(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {missing!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Missing())
{code}
"""
LIGHT = """
import envs, agents, eval, shield, train
assert all(module.FOREIGN for module in (envs, agents, eval, shield, train))
import rss_shield
from rss_shield import PRESETS, ShieldWrapper, d_min_same_direction, make, make_vec
env = make("highway-fast-v0")
env.reset(seed=0)
env.step(3)
table = PRESETS["simulator"]
print(rss_shield.__file__, float(d_min_same_direction(20.0, 15.0, table.ego, table.other)))
"""
NUMBERS = """
import rss_shield.shield
print(sorted({name.split(".")[0] for name in sys.modules} & {"gymnasium", "highway_env", "torch", "pandas"}))
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder into which the wheel is installed, without what it needs."""
    folder = tmp_path_factory.mktemp("site")
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    wheels, source = tmp_path_factory.mktemp("wheels"), tmp_path_factory.mktemp("copy") / "source"
    everywhere = shutil.ignore_patterns(".*", "__pycache__", "build", "*.egg-info")

    def left_out(folder, names):
        return {*everywhere(folder, names), *({"runs", "tests"} if Path(folder) == ROOT else ())}

    shutil.copytree(ROOT, source, symlinks=True, ignore=left_out)  # what is built would stay in the checkout
    subprocess.run([*pip, "wheel", "--no-deps", "--no-build-isolation", "-w", wheels, source], check=True)
    (wheel,) = wheels.glob("rss_shield-*.whl")
    subprocess.run([*pip, "install", "--no-deps", "--target", folder, wheel], check=True)
    return folder


def python(folder, code, site, missing=()):
    """Run code in a folder with packages of the names that ours have in the checkout."""
    for name in FOREIGN:
        (folder / f"{name}.py").write_text("FOREIGN = True\n")
    (folder / "use.py").write_text(USE.format(missing=set(missing), code=code))
    return subprocess.run(
        [sys.executable, "use.py"],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(site), "NUMBA_CACHE_DIR": str(folder)},
        capture_output=True,
        text=True,
    )


def test_nothing_but_one_package_is_at_the_top_level(site):
    names = {path.name for path in site.iterdir() if not path.name.endswith(".dist-info")}
    assert names - {"bin", "__pycache__"} == {"rss_shield"}
    assert (site / "rss_shield" / "py.typed").exists()
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert (site / f"rss_shield-{version}.dist-info").exists()


def test_it_works_beside_foreign_packages_and_without_what_training_needs(site, tmp_path):
    done = python(tmp_path, LIGHT, site, TRAINING)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(str(site))


def test_the_shield_alone_needs_numpy_and_numba(site, tmp_path):
    done = python(tmp_path, NUMBERS, site, ["gymnasium", "highway_env"])
    assert done.stdout.strip() == "[]", done.stderr


def test_the_page_that_plays_traces_brings_its_files_along(site):
    written = {path.name for path in (ROOT / "eval" / "viewer").glob("*.*") if path.suffix != ".py"}
    assert written and written <= {path.name for path in (site / "rss_shield" / "eval" / "viewer").iterdir()}


def test_a_missing_extra_is_named(site, tmp_path):
    code = "from rss_shield.cli import main; main(['train'])"
    done = python(tmp_path, code, site, ["torch"])
    assert done.returncode == 1
    assert (
        done.stderr.strip().splitlines()[-1]
        == "rss-shield train needs the package 'torch': pip install 'rss-shield[train]'"
    )


def test_the_command_is_the_script(site, tmp_path):
    command = python(tmp_path, "from rss_shield.cli import main; main(['train', '--help'])", site)
    script = subprocess.run([sys.executable, ROOT / "train.py", "--help"], capture_output=True, text=True, cwd=tmp_path)
    assert command.stdout.startswith("usage: rss-shield train ") and script.stdout.startswith("usage: train.py ")
    options = [text.split("\n", 1)[1] for text in (command.stdout, script.stdout)]  # each by the name it was called by
    assert options[0] == options[1] != "", command.stderr
    unknown = python(tmp_path, "from rss_shield.cli import main; main(['trian'])", site)
    assert unknown.stderr.strip() == f"rss-shield: unknown command 'trian'; expected one of {', '.join(COMMANDS)}"


def test_this_environment_has_it_under_its_one_name(tmp_path):
    """`make test` installs the checkout in place: links and a finder, not copies."""
    done = python(tmp_path, "import envs; assert envs.FOREIGN; import rss_shield.envs.make; print('ok')", "")
    assert done.stdout == "ok\n", done.stderr
