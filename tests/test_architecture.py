"""The arrows of the dependency graph point one way."""

import ast
import sys
import tomllib
from pathlib import Path

import pytest
from places import ROOT

LIBRARIES = {
    "shield": {"numpy", "numba"},
    "envs": {"gymnasium", "highway_env", "llvmlite", "numba", "numpy", "pettingzoo", "matplotlib", "PIL"},
    "agents": {"gymnasium", "sb3_contrib", "stable_baselines3", "torch", "numpy"},
    "eval": {
        "numpy",
        "scipy",
        "pandas",
        "matplotlib",
        "rich",
        "tqdm",
        "gymnasium",
        "llvmlite",
        "tyro",
        "yaml",
        "statsmodels",
        "optuna",
        "ray",
    },
}
SUITE = {"gymnasium", "highway_env", "commonroad"}  # what the suite of evaluations may import, too
# part -> parts that it may import, itself left out; a part is a folder, or the modules that lie in it directly
LAWS = {"shield.definitions", "shield.params", "shield._numba"}
OWES = {
    "shield.sampling",
    "shield.table",
    "shield.verdicts",
    "shield.geometry",
    "shield.ground",
    "shield.command",
    "shield.chosen",
    "shield.anything",
    "shield.comfort",
}
KEEPERS = {"shield.lanes", "shield.junctions", "shield.open_space", "shield.people", "shield.filters"}
BELOW = LAWS | OWES | KEEPERS | {"shield.tally", "shield.trace"}
ROADS = {"envs._numpy", "envs.compiled", "envs.roads"}
ENTRY = {"envs.options", "envs.arguments", "envs.stock", "envs.sensing", "envs.conditions", "envs.worlds"}
MAY_IMPORT = {
    "shield._numba": set(),
    "shield.params": set(),
    "shield.trace": set(),
    "shield.definitions": LAWS | {"shield.anything", "shield.geometry"},
    "shield.risk": LAWS | OWES,
    "shield.lanes": LAWS | OWES,
    "shield.junctions": LAWS | OWES | {"shield.lanes"},  # a verdict is one on either kind of road
    "shield.people": LAWS | OWES | {"shield.junctions"},  # pedestrians are threats to the same plans
    "shield.open_space": LAWS | OWES | {"shield.lanes"},
    "shield.filters": LAWS | OWES | {"shield.lanes"},
    "envs._numpy": {"envs.compiled", "shield._numba"},
    "envs.compiled": {"envs._numpy", "shield._numba"},
    "envs.roads": ROADS | BELOW,
    "envs.conditions": {"envs.arguments", "envs.sensing", "shield._numba", "shield.ground", "shield.params"},
    "envs.sensing": {"envs.arguments", "shield._numba", "shield.lanes", "shield.sampling"},
    "envs.worlds": {"envs.stock"} | ROADS | BELOW,
    "envs.decisions": ROADS | BELOW,
    "envs.semantic": ROADS | BELOW | {"envs.worlds"},
    "envs.highway": ROADS | ENTRY | BELOW | {"envs.decisions", "envs.semantic", "envs.make", "shield.risk"},
    "envs.fast": ROADS | ENTRY | BELOW | {"envs.decisions", "envs.semantic", "shield.risk"},
    "eval.stats": set(),
    "eval.runs": {"eval.stats", "eval.metrics", "eval.plots", "eval.table", "eval.files"}
    | {"eval.config_option", "eval.interrupt", "eval.own"},
    "eval.trace_risk": {"shield.geometry", "shield.lanes", "shield.params", "shield.risk", "shield.trace"},
    "eval.viewer": {"eval.files", "eval.plots", "eval.trace_risk", "shield.geometry", "shield.risk", "shield.trace"},
}
# what a package may import besides itself; one part of eval knows simulators and agents
BELOW_PACKAGE = {
    "envs": {"rss_shield.shield"},
    "eval.suite": {
        "rss_shield",
        "rss_shield.shield",
        "rss_shield.envs",
        "rss_shield.agents",
        "rss_shield.command_line",
    },
    "eval.trace_risk": {"rss_shield.shield"},  # these two read traces
    "eval.viewer": {"rss_shield.shield"},
}
MODULES = [path for package in LIBRARIES for path in sorted((ROOT / package).rglob("*.py"))]
PARTED = [path for path in MODULES if path.name != "__init__.py" or len(path.relative_to(ROOT).parts) > 2]


def names_imported(path: Path) -> set[str]:
    """Modules that a module imports anywhere."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute here"
            found.add(node.module or "")
    return found


def part_of(name: str) -> str:
    """ "shield.lanes" of "shield.lanes.pair" """
    return ".".join(name.split(".")[:2])


def own_part(path: Path) -> str:
    return part_of(".".join(path.relative_to(ROOT).with_suffix("").parts))


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_package_imports_its_libraries_and_what_is_below_it(path):
    package = path.relative_to(ROOT).parts[0]
    below = BELOW_PACKAGE.get(own_part(path), BELOW_PACKAGE.get(package, set()))
    words = {"rss_shield.shield.verdicts"} if package == "eval" else set()  # what verdicts are called
    for name in names_imported(path):
        top = name.split(".")[0]
        if name in words:
            continue
        if top == "rss_shield":
            assert ".".join(name.split(".")[:2]) in below | {f"rss_shield.{package}"}
        else:
            assert top in LIBRARIES[package] | (SUITE if own_part(path) == "eval.suite" else set()) | set(
                sys.stdlib_module_names
            )


@pytest.mark.parametrize("path", PARTED, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_part_imports_what_is_below_it(path):
    part = own_part(path)
    imported = {part_of(name.removeprefix("rss_shield.")) for name in names_imported(path) if "rss_shield." in name}
    if part in MAY_IMPORT:
        assert imported - {part, "shield"} <= MAY_IMPORT[part]


def test_what_is_evaluated_does_not_import_the_suite():
    for path in MODULES:
        if path.relative_to(ROOT).parts[:2] != ("eval", "suite"):
            assert not any(name.startswith("rss_shield.eval.suite") for name in names_imported(path))


def test_the_two_simulators_are_siblings():
    assert not MAY_IMPORT["envs.fast"] & {"envs.highway", "envs.make", "envs.make_vec"}
    assert not MAY_IMPORT["envs.highway"] & {"envs.fast", "envs.make_vec"}


def test_every_package_is_installed():
    setuptools = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    folders = {path.parent.relative_to(ROOT).as_posix() for path in MODULES}
    expected = {f"rss_shield.{folder.replace('/', '.')}": folder for folder in folders} | {"rss_shield": "rss_shield"}
    assert setuptools["package-dir"] == expected
    assert set(setuptools["packages"]) == set(expected)


def test_the_links_of_the_checkout_lead_to_the_folders():
    for package in LIBRARIES:
        assert (ROOT / "rss_shield" / package).resolve() == ROOT / package


@pytest.mark.parametrize("path", sorted((ROOT / "tests").rglob("*.py")), ids=lambda path: path.name)
def test_nothing_imports_the_training_script(path):
    assert not names_imported(path) & {"train", "rss_shield.train"}
