"""Extra evasive effort on single frames (Def. 13), with numbers worked by hand."""

import numpy as np
import pytest

from rss_shield.shield.command import Command
from rss_shield.shield.definitions.evasion import Motion, follow
from rss_shield.shield.definitions.response import FRONT, LON
from rss_shield.shield.ground import CLASSES, of_class
from rss_shield.shield.lanes.evasion import FAMILY, HORIZON, Room, evade, manoeuvre
from rss_shield.shield.lanes.limits import always_on
from rss_shield.shield.lanes.memory import MEMORY
from rss_shield.shield.lanes.pair import ROAD_USER
from rss_shield.shield.lanes.restriction import Body
from rss_shield.shield.params import PRESETS, Rules
from rss_shield.shield.table import table_for
from rss_shield.shield.verdicts import KEPT, TOO_SHORT

DT = 1 / 15
TABLE = table_for(PRESETS["simulator"], Rules(), DT)  # b_min 5, b_max 6, a 3, across 1 m/s^2
WISH = Command(0.5, 0.01)
WIDE = Room(10.0, 10.0)
BODY = Body(2.5, 0.7, 0.0)


def user(s, y, v, u=0.0):
    one = np.zeros(1, ROAD_USER)[0]
    one["s"], one["y"], one["speed"], one["u"], one["along"] = s, y, v, u, v
    one["cos"], one["around"], one["half_length"], one["half_width"] = 1.0, np.inf, 2.5, 1.0
    one["in_own_lane"] = True
    return one


def remembered(since, broke=KEPT, a=0.0, v=20.0):
    one = np.zeros(1, MEMORY)[0]
    one["age"], one["since"], one["axes"], one["ego_is_rear"] = 10, since, LON, True
    one["other_broke"], one["acceleration_other"], one["v_ego"], one["v_other"] = broke, a, v, v
    return one


def effort(others, room=WIDE, ego=None, evading=False, wish=WISH, table=TABLE):
    """others: (`ROAD_USER`, `MEMORY`) pairs."""
    ego = user(0.0, 0.0, 20.0) if ego is None else ego
    users, memory = (np.array([pair[k] for pair in others], kind) for k, kind in ((0, ROAD_USER), (1, MEMORY)))
    bounds = always_on(ego, TABLE.ego, TABLE.rules, TABLE.dt)
    return evade(wish, evading, ego, users, memory, room, BODY, bounds, table, None)


def test_without_danger_the_drivers_wish_stays():
    assert effort([(user(30.0, 0.0, 10.0), remembered(0))]) == (WISH, False, False)


def test_where_the_basic_response_is_enough_the_drivers_wish_stays():
    # 25 m behind who brakes with 1 m/s^2: 20 m/s are gone in 4 s with 5 m/s^2, after 40 m; the other is 72 m on by then
    assert effort([(user(30.0, 0.0, 20.0), remembered(3, TOO_SHORT, -1.0))]) == (WISH, False, False)
    # with 10 m/s^2 it stops after 20 m: 45 m are enough for 5 m/s^2 (40 m), 38 m only for more
    assert not effort([(user(30.0, 0.0, 20.0), remembered(3, TOO_SHORT, -10.0))]).changed
    wish, evading, changed = effort([(user(23.0, 0.0, 20.0), remembered(3, TOO_SHORT, -10.0))])
    assert changed and not evading  # nobody has moved over
    assert wish == pytest.approx((-5.5, WISH.slip))  # 36.4 m; the driver goes on steering


def ahead_and_aside(y):
    """25 m ahead, nearly at rest, and 0.3 m in the way: the hardest braking needs 33 m. 1 m aside takes 2 s, of which
    0.5 t^2 = 0.3 m are done after 0.8 s, 16 m on."""
    return user(30.0, y, 1.0), remembered(3, TOO_SHORT)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_it_moves_over_to_the_free_side(side):
    wish, evading, changed = effort([ahead_and_aside(1.7 * side)])
    assert evading and changed
    assert wish.acceleration == 0.0
    assert wish.slip * 20.0 == pytest.approx(-side * 1.0 * DT, rel=1e-3)  # 1 m/s^2 across


def test_it_does_not_squeeze_who_is_there():
    beside = user(0.0, -3.0, 20.0), remembered(0)
    assert not effort([ahead_and_aside(1.7), beside]).changed
    assert effort([ahead_and_aside(1.7), (user(0.0, 3.0, 20.0), remembered(0))]).changed  # on the other side


def test_it_does_not_swerve_in_front_of_who_comes_the_other_way():
    # one lane to the left, 60 m ahead, at 20 m/s: he needs that side, and within the lane there is no way out
    coming = user(60.0, -3.0, 20.0)
    coming["cos"], coming["along"] = -1.0, -20.0
    assert not effort([ahead_and_aside(1.7), (coming, remembered(0))]).changed
    coming["y"] = -6.0
    assert effort([ahead_and_aside(1.7), (coming, remembered(0))]).changed


def test_it_does_not_leave_the_road():
    assert not effort([ahead_and_aside(1.7)], Room(0.9, 10.0)).changed
    assert effort([ahead_and_aside(1.7)], Room(1.1, 0.0)).changed


def test_where_nothing_ends_the_danger_it_stays_as_far_away_as_it_can():
    # at 30 m/s behind somebody at 6 m/s: with 6 m/s^2 it has got 72 m in 4 s, he 24 m, and 0.5 m are left
    wish, _, changed = effort([(user(53.5, 0.0, 6.0), remembered(3, TOO_SHORT))], Room(0.0, 0.0), user(0.0, 0.0, 30.0))
    assert changed and wish.acceleration == -6.0


def test_nobody_can_do_anything_about_who_is_too_close():
    assert not effort([(user(15.0, 0.0, 0.0), remembered(3, TOO_SHORT))]).changed


def test_hard_braking_is_not_tried_on_who_follows_closely():
    # alone 6 m/s^2 are the way out; with somebody 20 m behind (he needs 57 m) nothing is
    ahead = user(40.0, 0.0, 5.0), remembered(3, TOO_SHORT, -6.0)
    alone = effort([ahead], Room(0.0, 0.0))
    assert alone.changed and alone.wish.acceleration < -5.0
    followed = effort([ahead, (user(-25.0, 0.0, 20.0), remembered(0))], Room(0.0, 0.0))
    assert not followed.changed


def test_a_truck_behind_needs_more_room_than_a_car():
    # the car gets 23 + 23^2 / 10 m further, and 8 m less than an ego that brakes with 6 m/s^2 from 20 m/s leaves it
    rows = np.array([TABLE.other, of_class(TABLE.other, CLASSES["truck"], DT)])
    ahead, follower = (user(40.0, 0.0, 5.0), remembered(3, TOO_SHORT, -6.0)), user(-60.0, 0.0, 20.0)
    changed = []
    for kind in (0, 1):
        follower["kind"] = kind
        pair = follower.copy(), remembered(0)
        changed.append(effort([ahead, pair], Room(0.0, 0.0), table=TABLE._replace(others=rows)).changed)
    assert changed == [True, False]


def test_it_finds_who_is_in_danger_among_many_who_are_not():
    far = user(500.0, 20.0, 20.0), remembered(0)
    alone, among = effort([ahead_and_aside(1.7)]), effort([far] * 70 + [ahead_and_aside(1.7)])
    assert alone == among and among.changed


def test_once_it_has_moved_over_it_goes_straight_on_while_danger_lasts():
    ego = user(0.0, 0.0, 20.0)
    ego["heading"] = ego["sin"] = 0.02
    beside = user(0.0, 3.0, 20.0), remembered(3)
    assert not effort([beside], ego=ego).changed
    wish, evading, changed = effort([beside], ego=ego, evading=True)
    assert evading and changed
    assert wish.acceleration == WISH.acceleration and wish.slip < 0.0  # turns back along the lane


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_after_it_has_moved_over_the_driver_may_go_on_away_from_who_is_there(side):
    memory = remembered(3)
    memory["ego_is_rear"], memory["role_now"] = False, FRONT  # or it would brake
    beside = user(0.0, 3.0 * side, 20.0), memory
    away = Command(0.5, -0.02 * side)
    assert effort([beside], evading=True, wish=away) == (away, True, False)
    assert effort([beside], evading=True, wish=Command(0.5, 0.02 * side)).changed


def test_where_going_straight_on_ends_in_a_contact_too_the_driver_decides():
    # 15 m behind somebody who stands, with somebody beside: nothing helps
    ahead, beside = (user(15.0, 0.0, 0.0), remembered(3, TOO_SHORT)), (user(0.0, 3.0, 20.0), remembered(3))
    wish = Command(0.5, 0.02)
    assert effort([ahead, beside], evading=True, wish=wish) == (wish, True, False)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_of_two_ways_out_the_one_to_the_drivers_side_comes_first(side):
    # 0.2 m wide, 30 m ahead: braking needs 33 m, and 1.1 m aside are done after 1.5 s
    narrow, memory = user(35.0, 0.0, 1.0), remembered(3, TOO_SHORT)
    narrow["half_width"] = 0.1
    wish, evading, changed = effort([(narrow, memory)], wish=Command(0.0, 0.001 * side))
    assert evading and changed
    assert side * wish.slip > 0.0


def test_the_family_moves_over_by_one_two_and_four_metres():
    plans = [manoeuvre(k, TABLE.ego) for k in range(FAMILY)]
    assert len(set(plans)) == FAMILY == 28
    assert {plan.a for plan in plans} == {-5.0, -5.5, -6.0, 3.0, 0.0}
    me = (0.0, 30.0, 0.0, 0.0, 0.0, 0.0, 2.5, 1.0)
    aside = {round(follow(Motion(*me), plan, HORIZON)[2], 6) for plan in plans}
    assert aside == {-4.0, -2.0, -1.0, 0.0, 1.0, 2.0, 4.0}
    assert all(-TABLE.ego.a_max_brake <= plan.a <= TABLE.ego.a_max_accel for plan in plans)
    assert {abs(plan.a_lat) for plan in plans} == {0.0, TABLE.ego.a_lat_max_accel}  # the published table's


def test_it_does_not_stop_in_front_of_who_comes_up_from_behind():
    # at 30 m/s 100 m behind an ego at 20 m/s: at rest after 4 s of braking it would be touched soon after
    follower, memory = user(-105.0, 0.0, 30.0), remembered(3, TOO_SHORT)
    memory["ego_is_rear"] = False
    wish = effort([(follower, memory)]).wish
    assert wish.acceleration >= 0.0
