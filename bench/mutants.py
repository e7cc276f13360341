"""Mutation testing of the shield: small alterations of its source, and how many of them its tests notice.

    python bench/mutants.py --per-package 60           # alter, test, keep what came out in runs/mutants.json
    python bench/mutants.py --again                    # try the survivors once more, after tests were added
    python bench/mutants.py --write                    # docs/results/mutation.md from that file

cosmic-ray finds the mutants and makes them, in a copy of the sources; a seeded sample of each package is tested, each
with the tests that `mutants.toml` names for its module.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from rss_shield.eval.files import write_json, write_text
from rss_shield.eval.pages import markdown
from rss_shield.eval.stats import clopper_pearson

ROOT = Path(__file__).resolve().parents[1]
CONFIG = Path(__file__).with_suffix(".toml")
PAGE = ROOT / "docs" / "results" / "mutation.md"
_TIMEOUT = 120.0  # of the tests of a mutant: one that never ends is noticed, too [s]
_NOT_MADE = "core/RemoveDecorator"  # functions run uncompiled anyway


def tests_of(module: str, config: dict[str, Any]) -> list[str]:
    """Files of tests that exist for a module."""
    (names,) = (modules[module] for modules in config["packages"].values() if module in modules)
    paths = [f"tests/shield/{name}.py" for name in names.split()]
    return [path for path in paths if (ROOT / path).exists()]


@contextmanager
def copy_of_the_sources() -> Iterator[Path]:
    """A folder with everything that git knows, links as links; the working folder meanwhile."""
    here = Path.cwd()
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        listed = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
        names = subprocess.run(listed, cwd=ROOT, capture_output=True, check=True).stdout.decode().split("\0")
        for name in filter(None, names):
            target = Path(folder, name)
            target.parent.mkdir(parents=True, exist_ok=True)
            if (ROOT / name).exists():
                shutil.copy2(ROOT / name, target, follow_symlinks=False)
        os.environ.update(NUMBA_DISABLE_JIT="1", PYTHONPATH=folder)
        os.chdir(folder)
        try:
            yield Path(folder)
        finally:
            os.chdir(here)


def all_mutants(modules: list[str]) -> list[Any]:
    """Every mutation that cosmic-ray knows of some modules, in a fixed order."""
    from cosmic_ray.commands import init
    from cosmic_ray.work_db import WorkDB, use_db

    with use_db("mutants.sqlite", WorkDB.Mode.create) as database:
        init([Path(module) for module in modules], database, {})
        found = [mutation for item in database.work_items for mutation in item.mutations]
    found = [one for one in found if one.operator_name != _NOT_MADE]
    return sorted(found, key=lambda one: (str(one.module_path), one.operator_name, one.occurrence))


def tried(mutation: Any, config: dict[str, Any]) -> dict[str, Any]:
    """What became of one mutant."""
    from cosmic_ray.mutating import mutate_and_test

    module = str(mutation.module_path)
    flags = "-x -q --noconftest -p no:cacheprovider -p no:xdist"
    if not tests_of(module, config):
        return described(mutation, "", "survived")
    command = f"{sys.executable} -m pytest {flags} {' '.join(tests_of(module, config))}"
    result = mutate_and_test([mutation], command, _TIMEOUT)
    return described(mutation, result.diff or "", result.test_outcome.value if result.test_outcome else "not made")


def described(mutation: Any, diff: str, outcome: str) -> dict[str, Any]:
    """A mutant and what became of it, as JSON."""
    lines = [line for line in diff.splitlines() if line[:1] in "+-" and line[:3] not in ("---", "+++")]
    return {
        "module": str(mutation.module_path),
        "operator": mutation.operator_name,
        "occurrence": mutation.occurrence,
        "line": mutation.start_pos[0],
        "was": " ".join(line[1:].strip() for line in lines if line[0] == "-"),
        "is": " ".join(line[1:].strip() for line in lines if line[0] == "+"),
        "outcome": outcome,
    }


def sample(config: dict[str, Any], count: int, seed: int, out: Path) -> None:
    """Draw mutants of each package and test them; what was tested before is not tested again."""
    results = json.loads(out.read_text(encoding="utf-8")) if out.exists() else {}
    with copy_of_the_sources():
        for package, modules in config["packages"].items():
            mutants = all_mutants(list(modules))
            drawn = np.random.default_rng(seed).permutation(len(mutants))[:count]
            kept = results.setdefault(package, {"of": len(mutants), "seed": seed, "mutants": []})
            for k in drawn[len(kept["mutants"]) :]:
                kept["mutants"].append(tried(mutants[k], config))
                write_json(out, results)
                print(package, *kept["mutants"][-1].values(), sep=" | ", flush=True)


def again(config: dict[str, Any], out: Path) -> None:
    """Test the survivors once more."""
    results = json.loads(out.read_text(encoding="utf-8"))
    with copy_of_the_sources():
        for package, kept in results.items():
            mutants = {
                (str(m.module_path), m.operator_name, m.occurrence): m
                for m in all_mutants([*config["packages"][package]])
            }
            for one in kept["mutants"]:
                if one["outcome"] == "survived" and one.get("now") != "killed":
                    found = tried(mutants[one["module"], one["operator"], one["occurrence"]], config)
                    if (found["was"], found["is"]) != (one["was"], one["is"]):
                        sys.exit(f"{one['module']} is not what it was: sample anew, with another --out")
                    one["now"] = found["outcome"]
                    write_json(out, results)
                    print(package, *one.values(), sep=" | ", flush=True)


_ABOUT = """\
Written by `make mutants`. [cosmic-ray](https://cosmic-ray.readthedocs.io) alters one operator, comparison, number or
branch at a time; a mutant that no test notices *survives*. Functions run uncompiled for that, and each module has a
small selection of tests of its own (`bench/mutants.toml`). A random sample of each package is tested, seed {seed}.
*Before* is without the tests that were written for survivors, *now* with them."""
_MODULES = """\
Modules: {tested}.

What is not in the table has not been sampled. Much of `shield/lanes` and `shield/junctions` shows in simulations of
many frames only, which take minutes uncompiled: that is left to `test_theorems.py` and `test_mutations.py`."""


def _noticed(mutants: list[dict[str, Any]], key: str) -> int:
    return sum(one.get(key, one["outcome"]) != "survived" for one in mutants)


def score(mutants: list[dict[str, Any]], key: str) -> str:
    """Share of mutants noticed, with the exact 95 % interval."""
    made = [one for one in mutants if one["outcome"] != "not made"]
    k, n = _noticed(made, key), len(made)
    _, low, high, *_ = clopper_pearson(k, n)
    return f"{k / n:.0%} [{low:.0%}, {high:.0%}]"


def page(config: dict[str, Any], results: dict[str, Any]) -> str:
    """The page of results."""
    rows = [("package", "mutants", "sample", "noticed before [95 %]", "noticed now [95 %]", "survivors, explained")]
    everybody = []
    for package, kept in results.items():
        mutants = kept["mutants"]
        everybody += mutants
        left = [one for one in mutants if one.get("now", one["outcome"]) == "survived"]
        known = sum(one["was"] + " -> " + one["is"] in config["survivors"] for one in left)
        rows.append(
            (
                f"`shield/{package}`",
                kept["of"],
                len(mutants),
                score(mutants, "outcome"),
                score(mutants, "now"),
                f"{len(left)}, {known}",
            )
        )
    left = [one for one in everybody if one.get("now", one["outcome"]) == "survived"]
    survivors = [("module", "was", "became", "why no test tells")]
    for one in left:
        why = config["survivors"].get(one["was"] + " -> " + one["is"], "not yet explained")
        survivors.append((f"`{one['module']}`", f"`{one['was']}`", f"`{one['is']}`", why))
    killed = [("module", "was", "became")]
    killed += [
        (f"`{one['module']}`", f"`{one['was']}`", f"`{one['is']}`")
        for one in everybody
        if one["outcome"] == "survived" and one.get("now") == "killed"
    ]
    tested = ", ".join(f"`{module}`" for package in results for module in config["packages"][package])
    about = _ABOUT.format(seed=next(iter(results.values()))["seed"])
    parts = ["# Mutation testing", about, markdown(rows), _MODULES.format(tested=tested)]
    return "\n\n".join([*parts, "## Survivors", markdown(survivors), "## Noticed since", markdown(killed)]) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--per-package", type=int, default=60, help="mutants of each package")
    parser.add_argument("--seed", type=int, default=0, help="of the sample")
    parser.add_argument("--out", type=Path, default=ROOT / "runs" / "mutants.json", help="what came out")
    parser.add_argument("--again", action="store_true", help="try the survivors once more")
    parser.add_argument("--write", action="store_true", help="write the page")
    options = parser.parse_args()
    config, out = tomllib.loads(CONFIG.read_text(encoding="utf-8")), options.out.resolve()
    if options.write:
        write_text(PAGE, page(config, json.loads(out.read_text(encoding="utf-8"))))
    elif options.again:
        again(config, out)
    else:
        out.parent.mkdir(parents=True, exist_ok=True)
        sample(config, options.per_package, options.seed, out)


if __name__ == "__main__":
    main()
