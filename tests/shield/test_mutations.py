"""Every piece of the shield is needed: without it, the same adversaries get through.

Each mutation drops one condition of the sampled proof (C1 to C8), the heading bound or the no-credit
distance, and plays the world of `test_theorems.py`, where nothing at all happens otherwise. What gives it
away is a contact, or where room to spare still prevents one, a duty of the ego that is broken. The reasons
why a mutation need not end in a contact:

  one axis      the axis that is answered alone suffices to stay apart; the ego owed both
  overlap       mu and the box inflation cover it; the ego uses room that the table does not grant
  heading       the box that is assumed to be 1.24 m wide at most turns broadside; nothing but the bound says no
"""

import numpy as np
import pytest
from adversary import play, world

from rss_shield.shield.definitions.longitudinal import d_min_same_direction
from rss_shield.shield.params import PRESETS

SLOW = 1 / 15  # [s]
FAST = 1 / 5

# the duties of the situation now (H23) would make up for a lost duty of the threshold: off, to see that one alone
LETTER = dict(present_duties=False)

MUTATIONS = {
    "C1 acceleration unlimited outside duties": (dict(free_throttle=True), FAST, 1, "contact"),
    "C1y lateral speed may jump outside duties": (dict(free_wheel=True), FAST, 2, "contact"),
    "C1 and C1y no always-on limits": (dict(rules=dict(limits=False)), FAST, 1, "contact"),
    "C2 one frame of latency": (dict(latency=1), FAST, 1, "contact"),
    "C3 a P controller for a brake": (dict(soft_brake=True), FAST, 1, "contact"),
    "C5 no margins for frames": (dict(published=dict(discretisation_margin=False)), FAST, 1, "contact"),
    "C6 started in danger": (dict(start_safe=False), FAST, 1, "contact"),
    "C7 which axis was safe is forgotten": (dict(rules=dict(memory=False, **LETTER)), SLOW, 1, "contact"),
    "C7 memory wiped on every frame": (dict(forgetful=True), SLOW, 1, "contact"),
    "C7 only one of two lost axes answered": (dict(one_axis=True, rules=LETTER), FAST, 1, "broken"),
    "C8 no room for predicted contact": (dict(rules=dict(overlap_margin=0.0)), FAST, 1, "broken"),
    "heading bound off": (dict(steering=dict(heading_bound=1.0)), FAST, 1, "heading"),
    "credit for receding, three cars": (dict(rules=dict(no_credit=False)), FAST, 2, "contact"),
    "backs up whoever is behind": (dict(backs_up=True, backs_into=True), FAST, 1, "contact"),
    "no lateral duty": (dict(rules=dict(lateral=False, **LETTER)), FAST, 1, "contact"),
    "no longitudinal duty": (dict(rules=dict(longitudinal=False, **LETTER)), FAST, 1, "contact"),
}


@pytest.mark.parametrize(("change", "dt", "others", "symptom"), MUTATIONS.values(), ids=MUTATIONS.keys())
def test_without_it_the_adversaries_get_through(change, dt, others, symptom):
    w = world(dt=dt, frames=150, bare=dt == FAST, others=others, **change)
    episodes = play(3000 if "no_credit" in str(change) else 1000, w, seed=1)
    seen = {
        "contact": (episodes["contact"] >= 0).sum(),
        "broken": (episodes["broken"] > 0).sum(),
        "heading": (episodes["heading"] > 2 * np.arcsin(w.published.heading_bound)).sum(),
    }
    assert seen[symptom] > 0


def test_c4_a_follower_that_brakes_harder_than_its_leader_needs_more_than_lemma_2():
    # 30 m/s behind 20 m/s, brakes 8 behind 4: closest while both still roll
    base = PRESETS["slides"].ego._replace(response_time=0.01, a_max_accel=0.0, standstill_gap=0.0)
    rear, front = base._replace(a_min_brake=8.0, a_max_brake=8.0), base._replace(a_max_brake=4.0)

    def smallest_gap(gap):
        dt, smallest, v_rear, v_front = 0.001, gap, 30.0, 20.0
        for step in range(10_000):
            gap += (v_front - v_rear) * dt
            v_front = max(v_front - 4.0 * dt, 0.0)
            v_rear = max(v_rear - (8.0 * dt if step * dt >= 0.01 else 0.0), 0.0)
            smallest = min(smallest, gap)
        return smallest

    assert smallest_gap(d_min_same_direction(30.0, 20.0, rear, front, "lemma2")) < -5.0
    assert smallest_gap(d_min_same_direction(30.0, 20.0, rear, front)) > -0.02  # the step of this simulation
