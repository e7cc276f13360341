"""The observations that the engine's own kernel makes."""

from rss_shield.envs.fast.views.kinematics import observe_kinematics
from rss_shield.envs.fast.views.record import KINEMATICS, TIME_TO_COLLISION
from rss_shield.envs.fast.views.times import observe_times
from rss_shield.shield._numba.compiled import inner


@inner
def observe(cars, episode, net, sight, view, target_speeds, period, out):
    """What a view asks for; nothing if it is made elsewhere.

    Args:
      cars: `[N]` CAR.
      episode: EPISODE; a shuffled view advances its generator.
      net: the network.
      sight: this frame's.
      view: `View`.
      target_speeds: `[K]` of meta-actions [m/s].
      period: of a decision [s].
      out: `[size]` float32, overwritten.
    """
    if view.record[0].kind == TIME_TO_COLLISION:
        observe_times(cars, episode, net, sight, view, target_speeds, period, out)
    elif view.record[0].kind == KINEMATICS:
        observe_kinematics(cars, episode, net, sight, view, out)
