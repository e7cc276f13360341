"""Who was to blame? Put a log of two cars in one lane into a trace, and ask the judge.

    python examples/judge_a_log.py

The log has positions [m] and speeds [m/s] of frames of 0.5 s. Both cars are 5 m long. What comes from a file is judged
by `rss-shield judge FILE`.
"""

import numpy as np

from rss_shield.eval.suite.judge.findings import text_of
from rss_shield.eval.suite.judge.judgement import judge_trace
from rss_shield.shield.trace import Trace, ego_of, straight_lane, users_of

DT = 0.5
EGO = ([0, 12.5, 25, 37.5, 50, 62.5, 75, 87.5, 100, 112.5, 125, 137.5, 150], [25] * 13)  # it drives on ...
OTHER = ([125, 135, 143, 149, 153, 155, *[155] * 7], [20, 16, 12, 8, 4, *[0] * 8])  # ... while the other brakes to rest

places, speeds = (np.array(values, float).T for values in zip(EGO, OTHER, strict=True))
still, braking = np.zeros_like(places), np.vstack([np.diff(speeds, axis=0) / DT, [[np.nan, np.nan]]])
users = users_of(["ego", "other"], ["car", "car"], 5.0, 2.0, places, still, still, speeds, braking, still)
lane = straight_lane("lane", (-100.0, 0.0), (400.0, 0.0))
trace = Trace(DT, np.arange(13) * DT, users, (lane,), egos=(ego_of(0, 13),))
judgement = judge_trace(trace, "slides")  # the ego has another response time than the other

frames = judgement.seen[0].frames[:, 1]  # what the ego sees of the other
for t, frame in zip(judgement.trace.time, frames, strict=True):
    if frame["present"]:
        print(f"{t:.1f} s: gap {frame['gap_lon']:5.1f} m, {frame['required_lon']:5.1f} m are needed")
print(text_of(judgement, "two cars"))
