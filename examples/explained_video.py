"""Pictures of an episode with what the shield saw and did drawn over them, as an animation that any browser shows."""

import tempfile
from pathlib import Path

from PIL import Image

import rss_shield

FASTER, DECISIONS = 3, 12
file = Path(tempfile.mkdtemp()) / "explained.webp"

env = rss_shield.ExplainedRender(
    rss_shield.make("highway-fast-v0", render_mode="rgb_array", config={"vehicles_count": 15})
)
env.reset(seed=1)
pictures = []
for _ in range(DECISIONS):
    env.step(FASTER)
    pictures.append(Image.fromarray(env.render()))
env.close()

pictures[0].save(file, save_all=True, append_images=pictures[1:], duration=500, loop=0)
print(f"{file}: {len(pictures)} pictures")
