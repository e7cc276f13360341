// The road from above, on a canvas.

const COLOURS = [
  ...["ink", "quiet", "card", "ground", "road", "marking", "border", "user", "user-edge", "glass", "wreck", "ego", "space"],
  ...["danger", "caution", "good", "area", "one", "two", "three", "four", "halo", "rule"],
];
let colour = {};
function readColours() {
  const style = getComputedStyle(document.documentElement);
  colour = Object.fromEntries(COLOURS.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}

const AHEAD = 0, BEHIND = 1, LEFT = 2, RIGHT = 3;

const tiles = new Map();

/** Strokes at 45 degrees in one colour, the same size on the screen whatever the zoom. */
function hatch(context, name, ratio, scale) {
  const key = `${colour[name]} ${ratio}`;
  if (!tiles.has(key)) {
    const tile = document.createElement("canvas"), size = Math.round(8 * ratio);
    tile.width = tile.height = size;
    const pen = tile.getContext("2d");
    pen.strokeStyle = colour[name]; pen.lineWidth = 2 * ratio;
    pen.beginPath();
    for (const shift of [-size, 0, size]) { pen.moveTo(shift, size); pen.lineTo(shift + size, 0); }
    pen.stroke();
    tiles.set(key, tile);
  }
  const pattern = context.createPattern(tiles.get(key), "repeat");
  pattern.setTransform(new DOMMatrix().scale(1 / scale));
  return pattern;
}

class View {
  constructor(canvas, episode, camera) {
    Object.assign(this, { canvas, episode, camera });
    this.context = canvas.getContext("2d");
    this.roads = [];
    for (const lane of episode.lanes) {
      const { line, width } = lane, surface = new Path2D(), left = new Path2D(), right = new Path2D();
      const edge = (i, side) => {
        const at = line.at(line.s[i] + (i + 1 < line.n ? 1e-6 : -1e-6));
        const before = line.at(Math.max(line.s[i] - 1e-3, 0));
        const ux = at.ux + before.ux, uy = at.uy + before.uy, norm = Math.hypot(ux, uy) || 1;
        return [line.x[i] - (side * width[i] / 2) * uy / norm, line.y[i] + (side * width[i] / 2) * ux / norm];
      };
      for (let i = 0; i < line.n; i++) {
        const [lx, ly] = edge(i, -1), [rx, ry] = edge(i, 1);
        surface[i ? "lineTo" : "moveTo"](lx, ly); left[i ? "lineTo" : "moveTo"](lx, ly); right[i ? "lineTo" : "moveTo"](rx, ry);
      }
      for (let i = line.n - 1; i >= 0; i--) surface.lineTo(...edge(i, 1));
      surface.closePath();
      this.roads.push({ surface, left: [left, lane.leftLine], right: [right, lane.rightLine] });
    }
  }

  /** The canvas has as many pixels as the screen shows. */
  fit() {
    const box = this.canvas.getBoundingClientRect(), ratio = window.devicePixelRatio || 1;
    this.ratio = ratio; this.wide = box.width; this.high = box.height;
    const width = Math.round(box.width * ratio), height = Math.round(box.height * ratio);
    if (this.canvas.width !== width || this.canvas.height !== height) { this.canvas.width = width; this.canvas.height = height; }
  }

  centre(t) {
    const ego = this.episode.egos[0];
    const user = this.episode.users[ego ? ego.user : 0];
    const pose = user && user.at(t);
    if (this.camera.follows && pose) {
      const { ahead } = this.camera;
      this.middle = { x: pose.x + ahead * Math.cos(pose.heading), y: pose.y + ahead * Math.sin(pose.heading) };
    }
    return this.middle || pose || { x: 0, y: 0 };
  }

  draw(t) {
    const { context, episode } = this, k = Math.floor(t + 1e-9);
    const scale = this.camera.scale * this.ratio; // [pixels of the screen / m]
    const middle = this.centre(t);
    this.pixel = 1 / this.camera.scale; // one CSS pixel [m]
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.fillStyle = colour.ground;
    context.fillRect(0, 0, this.canvas.width, this.canvas.height);
    const left = this.canvas.width / 2 - (middle.x + this.camera.x) * scale;
    const top = this.canvas.height / 2 - (middle.y + this.camera.y) * scale;
    context.setTransform(scale, 0, 0, scale, left, top);
    this.scale = scale;
    this.drawRoad();
    for (const ego of episode.egos) this.drawPlan(ego, k, t);
    for (const ego of episode.egos) this.drawSpace(ego, k, t);
    this.drawLights(k);
    const concerned = this.concerned(k);
    episode.users.forEach((user, i) => {
      const pose = user.at(t);
      if (pose) this.drawTrail(user, t, user.ego >= 0 ? colour.ego : colour.user);
    });
    episode.users.forEach((user, i) => {
      const pose = user.at(t);
      if (pose) this.drawUser(user, pose, k, concerned.get(i));
    });
    for (const ego of episode.egos) { this.drawPair(ego, k, t); this.drawCommands(ego, k, t); }
    this.drawContacts(k, t);
    episode.users.forEach((user, i) => {
      const pose = user.at(t), dangerous = concerned.get(i), isEgo = user.ego >= 0;
      if (!pose || !(isEgo || this.camera.scale > 5 || dangerous !== undefined)) return;
      const high = (Math.abs(Math.sin(pose.heading)) * user.length + Math.abs(Math.cos(pose.heading)) * user.width) / 2;
      this.label(user.name, pose.x, pose.y - high - 5 * this.pixel, isEgo ? colour.ego : dangerous ? colour.danger : colour.ink, isEgo || dangerous);
    });
    this.drawRuler();
  }

  drawRoad() {
    const { context } = this;
    context.fillStyle = colour.road;
    for (const road of this.roads) context.fill(road.surface);
    context.lineCap = "butt";
    for (const road of this.roads) {
      for (const [path, kind] of [road.left, road.right]) {
        if (kind === "none") continue;
        context.setLineDash(kind === "striped" ? [3, 4.5] : []);
        context.strokeStyle = kind === "unknown" ? colour.border : colour.marking;
        context.lineWidth = Math.max(0.15, (kind === "unknown" ? 0.7 : 1.2) * this.pixel);
        context.stroke(path);
      }
    }
    context.setLineDash([]);
  }

  strip(points, halfWidth) {
    const path = new Path2D();
    points.forEach((p, i) => path[i ? "lineTo" : "moveTo"](p.x + halfWidth * p.uy, p.y - halfWidth * p.ux));
    for (let i = points.length - 1; i >= 0; i--) path.lineTo(points[i].x - halfWidth * points[i].uy, points[i].y + halfWidth * points[i].ux);
    path.closePath();
    return path;
  }

  /** Required distances: plain where they are kept, hatched where somebody is inside. */
  drawSpace(ego, k, t) {
    const { context, episode } = this, user = episode.users[ego.user], pose = user.at(t);
    if (!pose) return;
    const paint = (path, short) => {
      context.globalAlpha = short ? 0.18 : 0.2;
      context.fillStyle = short ? colour.danger : colour.space;
      context.fill(path);
      context.globalAlpha = 1;
      if (short) { context.globalAlpha = 0.55; context.fillStyle = hatch(context, "danger", this.ratio, this.scale); context.fill(path); context.globalAlpha = 1; }
      context.strokeStyle = short ? colour.danger : colour.space;
      context.lineWidth = (short ? 2 : 1.2) * this.pixel;
      context.stroke(path);
    };
    for (const side of [AHEAD, BEHIND]) {
      const required = ego.required[side][k];
      if (!(required > 0.05)) continue;
      const from = user.length / 2, to = from + required, sign = side === AHEAD ? 1 : -1;
      paint(this.strip(episode.along(ego, k, pose, sign * from, sign * to), user.width / 2), ego.gap[side][k] < required);
    }
    for (const side of [LEFT, RIGHT]) {
      const required = ego.required[side][k];
      if (!(required > 0.02)) continue;
      const sign = side === RIGHT ? 1 : -1, ux = Math.cos(pose.heading), uy = Math.sin(pose.heading);
      const corner = (along, across) => [pose.x + along * ux - across * uy, pose.y + along * uy + across * ux];
      const path = new Path2D(), half = user.length / 2, near = sign * user.width / 2, far = sign * (user.width / 2 + required);
      [[-half, near], [half, near], [half, far], [-half, far]].forEach(([a, b], i) => path[i ? "lineTo" : "moveTo"](...corner(a, b)));
      path.closePath();
      paint(path, ego.gap[side][k] < required);
    }
  }

  /** The way through a junction: to where the plan comes to rest, and what others may be in the way of. */
  drawPlan(ego, k, t) {
    const { context, episode } = this, path = episode.paths[ego.path[k]];
    if (!path || !(ego.pathS[k] === ego.pathS[k])) return;
    const user = episode.users[ego.user], here = ego.pathS[k];
    const piece = (from, to) => {
      const points = [];
      for (let s = from; ; s = Math.min(s + 1, to)) { points.push(path.at(s)); if (s >= to) return points; }
    };
    const areas = ego.areas[k] || [];
    for (let i = 0; i < areas.length; i += 3) {
      const [from, to] = [Math.max(areas[i], here - 15), Math.min(areas[i + 1], here + 120)];
      if (!(to > from)) continue;
      const strip = this.strip(piece(from, to), user.width / 2 + 0.5);
      context.globalAlpha = 0.12; context.fillStyle = colour.area; context.fill(strip);
      context.globalAlpha = 0.5; context.fillStyle = hatch(context, "area", this.ratio, this.scale); context.fill(strip);
      context.globalAlpha = 1; context.strokeStyle = colour.area; context.lineWidth = 1.2 * this.pixel; context.stroke(strip);
    }
    const plan = PLAN_NAMES[ego.plan[k]];
    const end = Math.min(ego.planEnd[k] === ego.planEnd[k] ? ego.planEnd[k] : here + 40, here + 120);
    if (plan && end > here) {
      const points = piece(here, end);
      context.strokeStyle = colour.ego; context.lineWidth = 3 * this.pixel;
      context.setLineDash(plan === "go" ? [] : [8 * this.pixel, 5 * this.pixel]);
      context.beginPath();
      points.forEach((p, i) => context[i ? "lineTo" : "moveTo"](p.x, p.y));
      context.stroke(); context.setLineDash([]);
      const last = points[points.length - 1], half = user.width / 2 + 0.6;
      context.beginPath();
      if (plan === "stop") { // a bar where it stops
        context.lineWidth = 4 * this.pixel;
        context.moveTo(last.x + half * last.uy, last.y - half * last.ux); context.lineTo(last.x - half * last.uy, last.y + half * last.ux);
      } else { // the head of an arrow
        const back = 8 * this.pixel;
        context.moveTo(last.x - back * (last.ux - 0.6 * last.uy), last.y - back * (last.uy + 0.6 * last.ux));
        context.lineTo(last.x, last.y);
        context.lineTo(last.x - back * (last.ux + 0.6 * last.uy), last.y - back * (last.uy - 0.6 * last.ux));
      }
      context.stroke();
    }
  }

  drawLights(k) {
    const { context } = this;
    for (const light of this.episode.lights) {
      const signal = SIGNAL_NAMES[light.signal[k]], ux = Math.cos(light.heading), uy = Math.sin(light.heading);
      const fill = { green: colour.good, yellow: colour.caution, red: colour.danger }[signal] || colour.quiet;
      context.strokeStyle = fill; context.lineWidth = Math.max(0.6, 3 * this.pixel);
      context.beginPath();
      context.moveTo(light.x + 1.9 * uy, light.y - 1.9 * ux); context.lineTo(light.x - 1.9 * uy, light.y + 1.9 * ux);
      context.stroke();
      // a disc, a triangle, a square: green, yellow, red also without colour
      const x = light.x - 3.6 * uy, y = light.y + 3.6 * ux, r = Math.max(1.1, 6 * this.pixel);
      context.fillStyle = fill; context.strokeStyle = colour.ink; context.lineWidth = 1.2 * this.pixel;
      context.beginPath();
      if (signal === "green") context.arc(x, y, r, 0, 2 * Math.PI);
      else if (signal === "red") context.rect(x - r, y - r, 2 * r, 2 * r);
      else { context.moveTo(x, y - r); context.lineTo(x + r, y + r); context.lineTo(x - r, y + r); context.closePath(); }
      context.fill(); context.stroke();
    }
  }

  /** Whom the egos' shields are about: index of the user -> is it dangerous. */
  concerned(k) {
    const found = new Map();
    for (const ego of this.episode.egos) {
      const partner = ego.partner[k];
      if (partner >= 0) found.set(partner, Boolean(ego.dangerous[k]) || found.get(partner) === true);
    }
    return found;
  }

  drawTrail(user, t, ink) {
    const { context, episode } = this;
    context.fillStyle = ink;
    const every = Math.max(1, Math.round(0.25 / episode.dt)), r = Math.max(0.12, 1.1 * this.pixel);
    for (let k = Math.floor(t / every) * every, i = 0; k >= user.from && i < 9; k -= every, i++) {
      if (!(user.x[k] === user.x[k])) break;
      context.globalAlpha = 0.55 * (1 - i / 9);
      context.beginPath(); context.arc(user.x[k], user.y[k], r, 0, 2 * Math.PI); context.fill();
    }
    context.globalAlpha = 1;
  }

  drawUser(user, pose, k, dangerous) {
    const { context } = this, wreck = user.crashedFrom !== null && k >= user.crashedFrom;
    const isEgo = user.ego >= 0, half = user.length / 2, side = user.width / 2;
    context.save();
    context.translate(pose.x, pose.y); context.rotate(pose.heading);
    context.fillStyle = wreck ? colour.wreck : isEgo ? colour.ego : colour.user;
    context.strokeStyle = dangerous ? colour.danger : dangerous === false ? colour.caution : isEgo ? colour.ink : colour["user-edge"];
    context.lineWidth = (dangerous ? 3 : dangerous === false ? 2.4 : 1) * this.pixel;
    const body = new Path2D();
    if (user.kind === "pedestrian") body.ellipse(0, 0, half, side, 0, 0, 2 * Math.PI);
    else if (user.kind === "bicycle" || user.kind === "motorcycle") { body.moveTo(half, 0); body.lineTo(0, side); body.lineTo(-half, side * 0.5); body.lineTo(-half, -side * 0.5); body.lineTo(0, -side); body.closePath(); }
    else if (user.kind === "obstacle") body.rect(-half, -side, 2 * half, 2 * side);
    else body.roundRect(-half, -side, 2 * half, 2 * side, Math.min(0.35, side / 2));
    context.fill(body); context.stroke(body);
    if (user.kind === "obstacle" || wreck) { // a cross
      context.strokeStyle = colour.glass; context.lineWidth = 1.2 * this.pixel;
      context.beginPath(); context.moveTo(-half, -side); context.lineTo(half, side); context.moveTo(-half, side); context.lineTo(half, -side); context.stroke();
    } else if (user.kind === "car" || user.kind === "unknown") { // windscreen: where the front is
      context.fillStyle = colour.glass;
      context.beginPath(); context.moveTo(half * 0.62, -side * 0.72); context.lineTo(half * 0.62, side * 0.72); context.lineTo(half * 0.12, side * 0.82); context.lineTo(half * 0.12, -side * 0.82); context.closePath(); context.fill();
    } else if (user.kind === "truck" || user.kind === "bus") {
      context.strokeStyle = colour.glass; context.lineWidth = Math.max(0.25, 1.5 * this.pixel);
      context.beginPath(); context.moveTo(half - 1.6, -side); context.lineTo(half - 1.6, side); context.stroke();
    }
    context.restore();
  }

  /** Text in CSS pixels, with a halo that keeps it readable on anything. */
  label(text, x, y, ink, bold) {
    const { context } = this, size = 11.5 * this.pixel;
    context.font = `${bold ? 600 : 400} ${size}px system-ui, sans-serif`;
    context.textAlign = "center"; context.textBaseline = "alphabetic";
    context.lineJoin = "round"; context.strokeStyle = colour.halo; context.lineWidth = 3 * this.pixel;
    context.strokeText(text, x, y); context.fillStyle = ink; context.fillText(text, x, y);
  }

  /** A line from the ego to whom its shield is about, and what is missing between them. */
  drawPair(ego, k, t) {
    const { context, episode } = this, other = episode.users[ego.partner[k]];
    const a = episode.users[ego.user].at(t), b = other && other.at(t);
    if (!a || !b || !(ego.dangerous[k] || ego.changedBy[k])) return;
    const dangerous = ego.dangerous[k], ink = dangerous ? colour.danger : colour.caution;
    context.strokeStyle = ink; context.lineWidth = (dangerous ? 2.2 : 1.5) * this.pixel;
    context.setLineDash([5 * this.pixel, 4 * this.pixel]);
    context.beginPath(); context.moveTo(a.x, a.y); context.lineTo(b.x, b.y); context.stroke();
    context.setLineDash([]);
    const side = ego.neighbour.findIndex((column) => column[k] === ego.partner[k]);
    if (!dangerous || side < 0 || !(ego.required[side][k] === ego.required[side][k])) return;
    const missing = ego.required[side][k] - ego.gap[side][k];
    if (missing > 0) this.label(`${missing.toFixed(1)} m short`, (a.x + b.x) / 2, (a.y + b.y) / 2 + 22 * this.pixel, ink, true);
  }

  /** Arrows beside the ego: the acceleration that the agent wanted, hollow, and the one that was done, filled. */
  drawCommands(ego, k, t) {
    const { context, episode } = this, user = episode.users[ego.user], pose = user.at(t), long = 7 * this.pixel; // per m/s^2
    if (!pose) return;
    context.save();
    context.translate(pose.x, pose.y); context.rotate(pose.heading);
    for (const [name, row] of [["wanted", 0], ["acceleration", 1]]) {
      const a = ego.series[name] ? Math.min(Math.max(ego.series[name][k], -9), 9) : NaN;
      if (!(Math.abs(a) > 0.4)) continue;
      const y = user.width / 2 + (6 + 9 * row) * this.pixel, w = 2.6 * this.pixel, end = a * long, head = Math.sign(a) * Math.min(6 * this.pixel, Math.abs(end));
      context.beginPath();
      context.moveTo(0, y - w / 2); context.lineTo(end - head, y - w / 2); context.lineTo(end - head, y - 1.6 * w); context.lineTo(end, y);
      context.lineTo(end - head, y + 1.6 * w); context.lineTo(end - head, y + w / 2); context.lineTo(0, y + w / 2); context.closePath();
      context.lineWidth = 1.4 * this.pixel; context.lineJoin = "round"; context.strokeStyle = colour.ink;
      context.fillStyle = row ? colour.ink : colour.card; context.fill(); context.stroke();
    }
    context.restore();
  }

  drawContacts(k, t) {
    const { context } = this;
    for (const contact of this.episode.contacts) {
      if (k < contact.frame) continue;
      const a = this.episode.users[contact.user].at(Math.min(t, contact.frame)), other = this.episode.users[contact.partner];
      const b = other && other.at(Math.min(t, contact.frame));
      if (!a) continue;
      const x = b ? (a.x + b.x) / 2 : a.x, y = b ? (a.y + b.y) / 2 : a.y, r = Math.max(1.6, 12 * this.pixel);
      context.beginPath();
      for (let i = 0; i < 16; i++) {
        const angle = (i * Math.PI) / 8, far = i % 2 ? r * 0.45 : r;
        context[i ? "lineTo" : "moveTo"](x + far * Math.cos(angle), y + far * Math.sin(angle));
      }
      context.closePath();
      context.fillStyle = colour.caution; context.fill();
      context.strokeStyle = colour.danger; context.lineWidth = 2 * this.pixel; context.stroke();
    }
  }

  drawRuler() {
    const { context } = this;
    context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    const length = [1, 2, 5, 10, 20, 50, 100, 200].find((l) => l * this.camera.scale >= 48) || 500;
    const width = length * this.camera.scale, x = this.wide - width - 12, y = 16;
    context.strokeStyle = colour.ink; context.lineWidth = 1.5;
    context.beginPath(); context.moveTo(x, y - 5); context.lineTo(x, y); context.lineTo(x + width, y); context.lineTo(x + width, y - 5); context.stroke();
    context.font = "11px system-ui, sans-serif"; context.textAlign = "center"; context.textBaseline = "top";
    context.lineWidth = 3; context.strokeStyle = colour.halo; context.strokeText(`${length} m`, x + width / 2, y + 3);
    context.fillStyle = colour.ink; context.fillText(`${length} m`, x + width / 2, y + 3);
  }
}
