"""highway-env's own pictures with what the shield sees and does drawn over them."""

from pathlib import Path
from typing import Any, SupportsFloat

import gymnasium as gym
import matplotlib
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from rss_shield.envs.highway.around import around
from rss_shield.envs.highway.ego import ShieldedEgo
from rss_shield.envs.highway.frames import Look
from rss_shield.envs.highway.junction_ego import JunctionEgo
from rss_shield.envs.highway.step import shield_on
from rss_shield.shield.lanes.responses import response_name
from rss_shield.shield.trace import SIDES

FONT = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
AHEAD = SIDES.index("ahead")
ENOUGH, TOO_LITTLE, PARTNER = (0, 114, 178), (213, 94, 0), (213, 94, 0)
LINE = 15  # height of a line of text [pixels]
BLAMES = {"ego": "the ego", "both": "both", "other": "the other", "inherited": "inherited", "none": "nobody's duty"}


class ExplainedRender(gym.Wrapper):
    """Draws over every picture: required distance ahead, who it is about, what was wanted, what was done, the verdict.

    The band ahead of an ego is the distance that it has to keep (Defs. 1, 2): blue where it has it, red where not. Red
    lines are around whom the shield is concerned with. Under the picture stand, per ego, the wanted and the executed
    acceleration, why it was changed, gap and required gap, and who is to blame once somebody was touched.

    `gymnasium.wrappers.RecordVideo` around this one records all frames of a decision, as around highway-env itself.

    Args:
      env: as `rss_shield.make(..., render_mode="rgb_array")` returns it.

    Raises:
      ValueError: the render mode is not "rgb_array".
    """

    def __init__(self, env: gym.Env) -> None:
        super().__init__(env)
        if env.render_mode != "rgb_array":
            raise ValueError(f"render_mode = {env.render_mode!r}: expected 'rgb_array', to draw over pictures")
        self._blame = ""

    def reset(self, **kwargs: Any) -> tuple[Any, dict[str, Any]]:
        self._blame = ""
        return self.env.reset(**kwargs)

    def step(self, action: Any) -> tuple[Any, SupportsFloat, bool, bool, dict[str, Any]]:
        result = self.env.step(action)
        self._blame = str(result[4].get("blame", "")) or self._blame
        return result

    def render(self) -> Any:
        """`[height + text, width, 3]` uint8."""
        inner: Any = self.env.unwrapped
        picture = self.env.render()
        shields = [shield for vehicle in inner.controlled_vehicles if (shield := shield_on(vehicle)) is not None]
        return explain(np.asarray(picture), inner.viewer.sim_surface, shields, self._blame)


def explain(picture: np.ndarray, surface: Any, shields: list[ShieldedEgo], blame: str) -> np.ndarray:
    """A picture with its explanation.

    Args:
      picture: `[H, W, 3]` uint8 of highway-env.
      surface: highway-env's `WorldSurface`, which knows where in the picture a place is.
      shields: of the egos.
      blame: verdict of a contact; "" = none so far.
    """
    height, width, _ = picture.shape
    image = Image.new("RGB", (width, height + LINE * (len(shields) or 1)), "white")
    image.paste(Image.fromarray(picture), (0, 0))
    shade = Image.new("RGBA", image.size, (0, 0, 0, 0))
    draw, lines = ImageDraw.Draw(shade), []
    for shield in shields:
        look = shield.look
        gap = required = np.nan
        if look is not None and not isinstance(shield, JunctionEgo):
            gaps, needs, _ = around(shield)
            gap, required = gaps[AHEAD], needs[AHEAD]
            if np.isfinite(required) and required > 0.0:
                colour = ENOUGH if gap >= required else TOO_LITTLE
                draw.polygon(_box(shield.vehicle, surface, float(required)), fill=(*colour, 90))
        if look is not None and look.partner >= 0:
            draw.polygon(_box(shield.others[look.partner], surface), outline=(*PARTNER, 255), width=2)
        lines.append(line_of(look, float(gap), float(required), blame))
    image.paste(shade, (0, 0), shade)
    text, font = ImageDraw.Draw(image), ImageFont.truetype(str(FONT), 11)
    for i, line in enumerate(lines or ["no shield"]):
        text.text((4, height + LINE * i + 1), line, fill="black", font=font)
    return np.asarray(image)


def line_of(look: Look | None, gap: float, required: float, blame: str) -> str:
    """What is said of one ego."""
    verdict = f" | CONTACT, to blame: {BLAMES.get(blame, blame)}" if blame else ""
    if look is None:
        return f"the shield has not looked yet{verdict}"
    wanted, done = f"wants {look.wish.acceleration:+.1f} m/s²", f"gets {look.command.acceleration:+.1f}"
    reason = ""
    if look.overridden:
        reason = f", response: {response_name(look.response)}"
    elif look.anticipated:
        reason = ", anticipation"
    elif look.limited:
        reason = ", limits"
    elif look.dangerous:
        reason = f", owes: {response_name(look.response)}"
    room = f" | ahead {gap:.1f} m, required {required:.1f} m" if np.isfinite(gap) else ""
    return f"{wanted}, {done}{reason}{room}{verdict}"


def _box(vehicle: Any, surface: Any, ahead: float = 0.0) -> list[tuple[float, float]]:
    """Corners in the picture of a vehicle, or of a band of some length ahead of it [pixels]."""
    half = 0.5 * vehicle.LENGTH
    ends = (half, half + ahead) if ahead else (-half, half)
    cos, sin = np.cos(vehicle.heading), np.sin(vehicle.heading)
    x, y = vehicle.position
    corners = ((ends[0], -1), (ends[1], -1), (ends[1], 1), (ends[0], 1))
    side = 0.5 * vehicle.WIDTH
    return [surface.vec2pix((x + s * cos - d * side * sin, y + s * sin + d * side * cos)) for s, d in corners]
