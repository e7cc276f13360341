"""A control-barrier-function filter on the time headway (Ames, Grizzle, Tabuada, CDC 2014; Ames et al., IEEE TAC 2017).

The barrier is the time headway tau that their adaptive cruise control keeps, 1.8 s,

    h = gap - tau v,      h' = v_leader - v - tau a >= -gamma h

so the acceleration nearest to what the agent asks for (their quadratic programme, in one variable) is capped at

    a <= (v_leader - v + gamma h) / tau

and where that is more braking than the car has, it brakes as hard as it can: h may be lost then, because the barrier
knows nothing of the bounds of braking.
"""

from rss_shield.shield._numba.compiled import compiled

HEADWAY = 1.8  # tau where nobody says another [s]
GAMMA = 1.0  # rate at which the barrier may shrink [1/s]


@compiled
def acceleration_cap(v, leader, headway, ego_params):
    """Largest acceleration that keeps the barrier [m/s^2]; inf without a leader.

    Args:
      v: speed of the ego [m/s].
      leader: `Leader`.
      headway: tau [s].
      ego_params: `RSSParams` of the ego.
    """
    barrier = leader.gap - headway * v
    return max((leader.speed - v + GAMMA * barrier) / headway, -ego_params.a_max_brake)
