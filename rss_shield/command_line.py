"""What the console commands have in common: options from a dataclass, and mistakes that end in one line."""

import contextlib
import io
import json
import re
import sys
from dataclasses import asdict, dataclass
from typing import Annotated, Any, NoReturn, TypeVar

import tyro

from rss_shield.eval.config_option import read_config

T = TypeVar("T")
# a file is read where the command line is
ConfigFile = Annotated[
    dict[str, Any],
    tyro.constructors.PrimitiveConstructorSpec(
        nargs=1,
        metavar="FILE",
        instance_from_str=lambda texts: read_config(texts[0]),
        is_instance=lambda value: isinstance(value, dict),
        str_from_instance=lambda value: [json.dumps(value)],
    ),
]


@dataclass(frozen=True)
class Overrides:
    """RSS parameters by name; None keeps the preset's value."""

    response_time: float | None = None  # rho [s], > 0: delay before the driver must have reacted
    a_max_accel: float | None = None  # [m/s^2], >= 0: strongest forward acceleration
    a_min_brake: float | None = None  # [m/s^2], > 0: weakest braking that may be relied on
    a_max_brake: float | None = None  # [m/s^2], >= a_min_brake: hardest braking of a leader
    a_min_brake_correct: float | None = None  # [m/s^2], > 0, <= a_min_brake: in one's own lane
    a_lat_max_accel: float | None = None  # [m/s^2], >= 0: strongest lateral acceleration
    a_lat_min_brake: float | None = None  # [m/s^2], > 0: weakest lateral braking
    mu: float | None = None  # [m], >= 0: width of the lateral wobble
    standstill_gap: float | None = None  # lambda [m], >= 0: gap left when both stand
    v_cap: float | None = None  # [m/s], > 0: speed above which nobody accelerates

    @property
    def given(self) -> dict[str, float]:
        """Those that replace something."""
        return {name: value for name, value in asdict(self).items() if value is not None}


NO_OVERRIDES = Overrides()
_NUMBERS = {  # how Python refuses what is none
    "invalid literal for int() with base 10": "a whole number",
    "could not convert string to float": "a number",
}


def parsed(kind: type[T], prog: str, description: str, arguments: list[str], default: T | None = None) -> T:
    """Read a command line. What cannot be read ends in one line and exit code 2."""
    printed = io.StringIO()
    given: dict[str, Any] = {} if default is None else {"default": default}
    try:
        with contextlib.redirect_stderr(printed):
            return tyro.cli(kind, prog=prog, description=description, args=arguments, **given)
    except SystemExit as stop:
        if not stop.code:  # --help
            raise
        _, *box = (line.strip("│| ") for line in printed.getvalue().splitlines() if line.strip())
        message = " ".join(line for line in box if line.strip("─-╰╯+"))
        message = re.split("Argument helptext|For full helptext", message)[0].strip()
        fail(prog, f"{_of_a_number(message) or message} (see {prog} --help)")


def _of_a_number(message: str) -> str | None:
    """What is said of what was to be a number, in our words; None of all else."""
    option = re.search(r"--[\w.-]+", message)
    for sign, expected in _NUMBERS.items():
        value = re.search(rf"{re.escape(sign)}: '(.*?)'", message)
        if option and value:
            return f"{option[0].rstrip('.:')} {value[1]}: expected {expected}"
    return None


def fail(prog: str, message: str) -> NoReturn:
    print(f"{prog}: error: {' '.join(message.split())}", file=sys.stderr)
    raise SystemExit(2)


def shown(value: Any, separator: str = " ") -> str:
    """A value as on a command line."""
    if value is None:
        return "(not given)"
    return separator.join(map(str, value)) if isinstance(value, list | tuple) else str(value)
