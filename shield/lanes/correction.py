"""What a duty makes of a command that it does not permit: the nearest permitted one, or the proper response in full.

The nearest is the default (`shield.lanes.restriction.restrict`): the least change of the acceleration, and of the slip
angles that are permitted with that, the least change of the slip angle. It is the projection of the command onto what
is permitted, axis by axis; what is permitted of the slip angle depends on the acceleration by way of the speed after
the frame.
"""

from rss_shield.shield._numba.compiled import apart
from rss_shield.shield.command import Command
from rss_shield.shield.lanes.controller import Response
from rss_shield.shield.lanes.restriction import restrict, straighten

NEAREST, RESPONSE = range(2)
CORRECTIONS = ("nearest", "response")


@apart
def in_full(response, danger, ego, body, rules, dt):
    """`Response` with the whole proper response where a duty has changed the command.

    The car brakes at what the duty asks for, neither less nor harder, where one is to brake, and ends its sideways
    motion whatever the agent steers.

    Args:
      response: `Response` with the nearest command.
      danger, ego, body, rules, dt: as in `shield.lanes.controller.respond`.
    """
    if not response.overridden:
        return response
    a = response.command.acceleration
    if danger.bounds.a_upper < danger.free.a_upper:
        a = danger.bounds.a_upper
    straight = Command(a, straighten(ego, a, danger.bounds, body, dt))
    command = restrict(straight, danger.bounds, ego, body, rules, dt)
    return Response(command, True, False, False)
