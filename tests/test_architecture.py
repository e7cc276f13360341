"""The arrows of the dependency graph point one way."""

import ast
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
MAY_IMPORT = {
    "shield": {"numpy", "numba"},
    "envs": {"shield", "gymnasium", "highway_env", "llvmlite", "numba", "numpy", "pettingzoo"},
    "agents": {"gymnasium", "stable_baselines3", "torch", "numpy"},
    "eval": {"numpy", "scipy", "pandas", "matplotlib", "rich", "tqdm"},
}
MODULES = [path for package in MAY_IMPORT for path in sorted((ROOT / package).rglob("*.py"))]


def imported_packages(path: Path) -> set[str]:
    """Top-level packages that a module imports anywhere, the standard library left out."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add(path.relative_to(ROOT).parts[0] if node.level else (node.module or "").split(".")[0])
    return found - set(sys.stdlib_module_names)


def test_every_package_has_modules():
    assert {path.relative_to(ROOT).parts[0] for path in MODULES} == set(MAY_IMPORT)


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_module_imports_only_what_its_package_may(path):
    package = path.relative_to(ROOT).parts[0]
    assert imported_packages(path) <= MAY_IMPORT[package] | {package}


def test_nothing_in_the_shield_depends_on_the_measure_of_risk():
    assert not [path for path in (ROOT / "shield").glob("*.py") if "shield.risk" in path.read_text(encoding="utf-8")]


@pytest.mark.parametrize("path", sorted((ROOT / "tests").rglob("*.py")), ids=lambda path: path.name)
def test_nothing_imports_the_training_script(path):
    assert "train" not in imported_packages(path)
