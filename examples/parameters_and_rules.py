"""Other parameters, rules switched off, and a judge with a table of its own.

python examples/parameters_and_rules.py
"""

from rss_shield import PRESETS, Rules, make

FASTER = 3
BARE = Rules(longitudinal=False, present_duties=False, anticipation=0.0)
ARMS = {
    "the default": {},
    "a preset": {"params": "slides"},
    "one parameter": {"params": {"ego": {"response_time": 0.6}}},
    "no anticipation": {"rules": {"anticipation": 0.0}},  # or Rules(anticipation=0.0)
    "an ablation, judged in full": {"rules": BARE, "judge_rules": Rules()},
}
print(f"slides: {PRESETS['slides'].source}")
for name, options in ARMS.items():
    env = make("highway-fast-v0", **options)
    env.reset(seed=1)
    done = False
    while not done:
        *_, terminated, truncated, info = env.step(FASTER)
        done = terminated or truncated
    broken, jerk = info["episode_broken_duties"], info["rms_jerk"]
    print(f"{name}: blame {info['blame'] or '-'}, {broken} broken duties, rms jerk {jerk:.1f} m/s^3")
    env.close()
