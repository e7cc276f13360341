"""The console command `rss-shield`."""

import importlib
import sys

from rss_shield.eval.here import look_here
from rss_shield.eval.interrupt import stop_on_interrupt
from rss_shield.experiment import expanded

COMMANDS = {
    "train": ("rss_shield.train", "train", "train with and without the shield, test, compare"),
    "test": ("rss_shield.test", "train", "test a model or a policy with the shield and without"),
    "record": ("rss_shield.eval.suite.record", "train", "play one episode and write down everything"),
    "scenarios": ("rss_shield.eval.suite.scenarios.page", "train", "scripted situations, each derived by hand"),
    "stress": ("rss_shield.eval.suite.stress", "train", "very many episodes, until an ego is at fault"),
    "judge": ("rss_shield.eval.suite.judge.command", "train", "who was to blame in any log"),
    "replay": ("rss_shield.eval.viewer.command", "train", "a page on which recorded episodes play"),
    "sweep": ("rss_shield.eval.suite.sweep", "train", "run every task of an experiment file, here or on a cluster"),
    "report": ("rss_shield.eval.paper.command", "train", "one page of what came out of runs and sweeps"),
    "warm-up": ("rss_shield.warm_up", "train", "compile the engine now, so that the first run need not wait"),
}
_USAGE = "usage: rss-shield COMMAND [options]; rss-shield COMMAND --help lists the options\n\ncommands:\n"


def main(argv: list[str] | None = None) -> None:
    """Run one command; what it needs to be installed is looked for only then."""
    arguments = sys.argv[1:] if argv is None else argv
    if not arguments or arguments[0] in ("-h", "--help"):
        print(_USAGE + "\n".join(f"  {name:10s} {text}" for name, (_, _, text) in COMMANDS.items()))
        return
    name, *rest = arguments
    if name not in COMMANDS:
        sys.exit(f"rss-shield: unknown command {name!r}; expected one of {', '.join(COMMANDS)}")
    look_here()
    module, extra, _ = COMMANDS[name]
    # before all that takes its time
    resumes = "; nothing that is finished is lost, --resume goes on" if name == "train" else ""
    stop_on_interrupt(f"rss-shield {name}: stopping{resumes}")
    try:
        command = importlib.import_module(module)
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("rss_shield"):
            raise
        sys.exit(f"rss-shield {name} needs the package {error.name!r}: pip install 'rss-shield[{extra}]'")
    try:
        lines = expanded(name, rest)
    except (ValueError, OSError) as error:
        print(f"rss-shield {name}: error: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    for line in lines:
        command.run(line)
