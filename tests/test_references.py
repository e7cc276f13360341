"""What docstrings and pages refer to by its dotted name or path is there."""

import ast
import re
from collections.abc import Callable

import pytest
from places import ROOT

FOLDERS = ("shield", "envs", "agents", "eval", "bench", "tests")
PACKAGES = "shield|envs|agents|eval"
DOTTED = re.compile(rf"`(?:rss_shield\.)?((?:{PACKAGES})(?:\.\w+)+)(?:\([^`]*\))?`")
PATH = re.compile(r"(?<![\w/.])tests/[\w/]+\.py\b")
CODE = [ROOT / "train.py", *(path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py")))]
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]


def names_in(body: list[ast.stmt]) -> dict[str, ast.stmt]:
    """What a module or a class binds, whichever way: name -> statement."""
    found: dict[str, ast.stmt] = {}
    for statement in body:
        if isinstance(statement, ast.FunctionDef | ast.ClassDef):
            found[statement.name] = statement
        elif isinstance(statement, ast.Import | ast.ImportFrom):
            found |= {alias.asname or alias.name: statement for alias in statement.names}
        elif isinstance(statement, ast.Assign | ast.AnnAssign):
            targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
            names = (node.id for target in targets for node in ast.walk(target) if isinstance(node, ast.Name))
            found |= dict.fromkeys(names, statement)
        for part in ("body", "orelse", "handlers"):  # of if, try and with
            if not isinstance(statement, ast.FunctionDef | ast.ClassDef):
                found |= names_in(getattr(statement, part, []))
    return found


def exists(dotted: str) -> bool:
    """Is there a package, a module, or what a module or a class defines, by that name?"""
    first, *rest = dotted.split(".")
    place = ROOT / first
    while rest and ((place / rest[0]).is_dir() or (place / f"{rest[0]}.py").is_file()):
        place = place / rest.pop(0)
    if not rest:
        return True
    module = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
    names = names_in(ast.parse(module.read_text(encoding="utf-8")).body)
    for name in rest:
        if name not in names:
            return False
        statement = names[name]
        names = names_in(statement.body) if isinstance(statement, ast.ClassDef) else {}
    return True


def missing(pattern: re.Pattern[str], is_there: Callable[[str], bool]) -> list[str]:
    """What code, its comments included, or a page refers to in vain: "file: name"."""
    texts = {path.relative_to(ROOT): path.read_text(encoding="utf-8") for path in CODE + PAGES}
    return [f"{path}: {name}" for path, text in texts.items() for name in pattern.findall(text) if not is_there(name)]


@pytest.mark.parametrize(
    ("name", "is_there"),
    [
        ("shield.lanes", True),
        ("shield.lanes.memory.catch_up", True),
        ("eval.metrics.Metric.less_is_better", True),
        ("shield.lanes.response.catch_up", False),
        ("shield.lanes.pair.least_margin", False),
        ("eval.metrics.Metric.more", False),
    ],
)
def test_what_is_there_is_told_from_what_is_not(name, is_there):
    assert exists(name) is is_there


def test_dotted_names_lead_somewhere():
    assert not missing(DOTTED, exists)


def test_named_tests_are_there():
    assert not missing(PATH, lambda name: (ROOT / name).is_file())
