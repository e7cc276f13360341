"use strict";
// What the page is made of: numbers of a trace, unpacked. SI units; angles grow clockwise, y points down.

/** The page's data: base64 of zlib's deflate of JSON. */
async function unpack(text) {
  const bytes = Uint8Array.from(atob(text.trim()), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return JSON.parse(await new Response(stream).text());
}

/** Numbers out of differences of whole multiples of 1 / scale; null is what is not known. */
function numbers(packed, scale) {
  const values = new Float64Array(packed.length);
  let last = 0;
  for (let i = 0; i < packed.length; i++) {
    if (packed[i] === null) values[i] = NaN;
    else values[i] = (last += packed[i]) / scale;
  }
  return values;
}

/** Whole numbers out of runs [value, how often, value, how often, ...]. */
function runs(packed) {
  const values = [];
  for (let i = 0; i < packed.length; i += 2) for (let k = 0; k < packed[i + 1]; k++) values.push(packed[i]);
  return values;
}

class Polyline {
  constructor(x, y) {
    this.x = x; this.y = y; this.n = x.length;
    this.s = new Float64Array(this.n);
    for (let i = 1; i < this.n; i++) this.s[i] = this.s[i - 1] + Math.hypot(x[i] - x[i - 1], y[i] - y[i - 1]);
    this.length = this.s[this.n - 1];
  }

  /** Where on the line a point is: arc length, and offset to the right; beyond the ends it goes straight on. */
  project(px, py) {
    let best = Infinity, s = 0, offset = 0;
    for (let i = 0; i + 1 < this.n; i++) {
      const length = this.s[i + 1] - this.s[i];
      if (length === 0) continue;
      const ux = (this.x[i + 1] - this.x[i]) / length, uy = (this.y[i + 1] - this.y[i]) / length;
      const dx = px - this.x[i], dy = py - this.y[i];
      const along = dx * ux + dy * uy;
      const low = i === 0 ? -Infinity : 0, high = i + 2 === this.n ? Infinity : length;
      const foot = Math.min(Math.max(along, low), high);
      const distance = Math.hypot(dx - foot * ux, dy - foot * uy);
      if (distance < best) { best = distance; s = this.s[i] + foot; offset = ux * dy - uy * dx; }
    }
    return { s, offset, distance: best };
  }

  /** Point and direction at an arc length. */
  at(s) {
    let i = 0;
    while (i + 2 < this.n && this.s[i + 1] < s) i++;
    const length = this.s[i + 1] - this.s[i] || 1;
    const ux = (this.x[i + 1] - this.x[i]) / length, uy = (this.y[i + 1] - this.y[i]) / length;
    return { x: this.x[i] + (s - this.s[i]) * ux, y: this.y[i] + (s - this.s[i]) * uy, ux, uy };
  }
}

class User {
  constructor(packed, frames) {
    this.name = packed.name; this.kind = packed.kind;
    this.length = packed.length; this.width = packed.width;
    this.from = packed.from; // its first frame
    this.x = this.spread(numbers(packed.x, 100), frames);
    this.y = this.spread(numbers(packed.y, 100), frames);
    this.heading = this.spread(numbers(packed.heading, 1000), frames);
    this.speed = this.spread(numbers(packed.speed, 100), frames);
    this.crashedFrom = packed.crashed;
    this.ego = -1;
  }

  spread(values, frames) {
    const all = new Float64Array(frames).fill(NaN);
    all.set(values, this.from);
    return all;
  }

  /** Pose at a time between two frames, null where it is not there. */
  at(t) {
    const k = Math.floor(t), share = t - k;
    if (!(this.x[k] === this.x[k])) return null;
    if (share === 0 || !(this.x[k + 1] === this.x[k + 1])) {
      return { x: this.x[k], y: this.y[k], heading: this.heading[k], speed: this.speed[k] };
    }
    const mix = (a) => a[k] + share * (a[k + 1] - a[k]);
    const turn = Math.atan2(Math.sin(this.heading[k + 1] - this.heading[k]), Math.cos(this.heading[k + 1] - this.heading[k]));
    return { x: mix(this.x), y: mix(this.y), heading: this.heading[k] + share * turn, speed: mix(this.speed) };
  }
}

class Ego {
  constructor(packed, episode) {
    this.user = packed.user; this.shield = packed.shield;
    const side = (name, scale) => packed[name].map((column) => numbers(column, scale));
    this.gap = side("gap", 100); this.required = side("required", 100);
    this.neighbour = packed.neighbour.map(runs);
    this.changedBy = runs(packed.changed_by); this.response = runs(packed.response);
    this.partner = runs(packed.partner); this.dangerous = runs(packed.dangerous);
    this.plan = runs(packed.plan); this.path = runs(packed.path);
    this.pathS = numbers(packed.path_s, 100); this.planEnd = numbers(packed.plan_end, 100);
    this.areas = packed.areas; // per frame: [from, to, user, from, to, user, ...], repeated as null
    for (let k = 1; k < this.areas.length; k++) if (this.areas[k] === null) this.areas[k] = this.areas[k - 1];
    this.lane = runs(packed.lane);
    this.series = {};
    for (const [name, [scale, values]] of Object.entries(packed.series)) this.series[name] = numbers(values, scale);
    // the lane that it comes from, and the one that it goes on to
    const count = this.lane.length;
    this.next = new Array(count).fill(-1); this.previous = new Array(count).fill(-1);
    for (let k = count - 2; k >= 0; k--) this.next[k] = this.lane[k + 1] !== this.lane[k] ? this.lane[k + 1] : this.next[k + 1];
    for (let k = 1; k < count; k++) this.previous[k] = this.lane[k - 1] !== this.lane[k] ? this.lane[k - 1] : this.previous[k - 1];
    episode.users[this.user].ego = 0;
  }
}

class Episode {
  constructor(packed, number) {
    Object.assign(this, { number, label: packed.label, outcome: packed.outcome, dt: packed.dt, start: packed.start });
    this.frames = packed.frames;
    this.users = packed.users.map((user) => new User(user, this.frames));
    this.lanes = packed.lanes.map((lane) => ({
      line: new Polyline(numbers(lane.x, 100), numbers(lane.y, 100)), width: numbers(lane.width, 100),
      leftLine: lane.left, rightLine: lane.right, on: lane.on, before: [],
    }));
    this.lanes.forEach((lane, i) => lane.on.forEach((next) => this.lanes[next].before.push(i)));
    this.paths = packed.paths.map((path) => new Polyline(numbers(path.x, 100), numbers(path.y, 100)));
    this.lights = packed.lights.map((light) => ({ ...light, signal: runs(light.signal) }));
    this.egos = packed.egos.map((ego) => new Ego(ego, this));
    this.egos.forEach((ego, i) => { this.users[ego.user].ego = i; });
    this.events = packed.events;
    this.contacts = packed.contacts;
  }

  /** A motorway: the ego never turns, so that wide and low is enough. */
  get isFlat() {
    const ego = this.egos[0], user = this.users[ego ? ego.user : 0];
    return Boolean(user) && this.paths.length === 0 && user.heading.every((h) => !(h === h) || Math.cos(h) > 0.9);
  }

  get duration() { return (this.frames - 1) * this.dt; }

  /** Frame, with its fraction, at a time since the start; the episode stays at its last one. */
  frameAt(time) { return Math.min(Math.max(time / this.dt, 0), this.frames - 1); }

  /** Points of a strip's middle along the road, from `from` to `to` metres ahead of a pose. */
  along(ego, k, pose, from, to) {
    const step = 2, points = [];
    let lane = ego.lane[k];
    if (lane === undefined || lane < 0) {
      const ux = Math.cos(pose.heading), uy = Math.sin(pose.heading);
      for (const s of [from, to]) points.push({ x: pose.x + s * ux, y: pose.y + s * uy, ux, uy });
      return points;
    }
    const here = this.lanes[lane].line.project(pose.x, pose.y);
    const ahead = to > 0, sign = ahead ? 1 : -1;
    const direction = this.lanes[lane].line.at(here.s);
    const forth = direction.ux * Math.cos(pose.heading) + direction.uy * Math.sin(pose.heading) < 0 ? -1 : 1;
    let start = here.s;
    for (let d = Math.abs(from); ; d = Math.min(d + step, Math.abs(to))) {
      let s = start + forth * sign * d;
      // on to the next lane, or back to the one before; straight on where there is none
      for (let hops = 0; hops < 8; hops++) {
        const line = this.lanes[lane].line;
        if (s > line.length && this.lanes[lane].on.length) {
          const wanted = ego.next[k], next = this.lanes[lane].on.includes(wanted) ? wanted : this.lanes[lane].on[0];
          s -= line.length; start -= line.length; lane = next;
        } else if (s < 0 && this.lanes[lane].before.length) {
          const wanted = ego.previous[k], back = this.lanes[lane].before;
          lane = back.includes(wanted) ? wanted : back[0];
          s += this.lanes[lane].line.length; start += this.lanes[lane].line.length;
        } else break;
      }
      const at = this.lanes[lane].line.at(s);
      points.push({ x: at.x - here.offset * at.uy, y: at.y + here.offset * at.ux, ux: forth * at.ux, uy: forth * at.uy });
      if (d >= Math.abs(to)) return points;
    }
  }
}
