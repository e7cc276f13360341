"""An unprotected left turn: what the ego is told of others' routes, and whom it expects to give way.

python examples/intersection.py
"""

from rss_shield import make

FASTER = 2  # SLOWER, IDLE, FASTER

for intent in ("known", "any"):  # routes are announced, or whatever the road allows is expected
    env = make("intersection-v0", intent=intent, entry="cautious", waiting="line", config={"duration": 20})
    arrived, faults, episodes = 0, 0, 2
    for seed in range(episodes):
        env.reset(seed=seed)
        done = False
        while not done:
            *_, terminated, truncated, info = env.step(FASTER)
            done = terminated or truncated
        arrived += bool(info["is_success"])
        faults += info["blame"] in ("ego", "both")
    print(f"routes {intent}: {arrived} of {episodes} arrived, the ego at fault in {faults}")
    env.close()
