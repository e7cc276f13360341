"""The ego's command during one frame."""

from typing import NamedTuple


class Command(NamedTuple):
    """What the ego does during one frame."""

    acceleration: float  # [m/s^2]
    slip: float  # angle between heading and motion, positive turns right [rad]
