// Clock, buttons, keys, events; builds the page.

const KEYS = [
  ["Space", "play or pause"], ["← →", "one frame back or on"], ["Shift + ← →", "one second"],
  ["Home, End", "to the start, to the end"], ["N, P", "next event, previous event"], ["+ −", "zoom"],
  ["0", "view as at the start"], ["F", "keep the ego in the middle"], ["drag, wheel, pinch", "move and zoom the road; drag over a series to scrub"],
];
const SIGNS = {
  "danger begins": "▲", "danger ends": "△", "response begins": "■", "response ends": "□",
  "lane change refused": "⊘", contact: "✸", verdict: "§",
};
const byId = (id) => document.getElementById(id);
const plain = (v, digits) => (v === v ? v.toFixed(digits).replace(/^-(0\.?0*)$/, "$1").replace("-", "−") : "–");
const signed = (v, digits) => (v > 0 && Number(v.toFixed(digits)) > 0 ? "+" : "") + plain(v, digits);

class Player {
  constructor(data) {
    this.episodes = data.episodes.map((episode, i) => new Episode(episode, i));
    this.end = Math.max(...this.episodes.map((episode) => episode.duration));
    this.dt = Math.min(...this.episodes.map((episode) => episode.dt));
    this.time = 0; this.playing = false; this.rate = 1;
    this.camera = { scale: 4, x: 0, y: 0, ahead: 0, follows: true };
    byId("about").textContent = data.about;
    this.flat = this.episodes.every((episode) => episode.isFlat);
    byId("panels").className = this.flat ? "flat" : "";
    this.panels = this.episodes.map((episode) => this.panel(episode));
    this.charts = new Charts(byId("charts"), this.episodes, (time) => this.seek(time));
    this.listEvents(); this.help(); this.wire(); this.resize(true);
  }

  panel(episode) {
    const box = document.createElement("section"), heading = document.createElement("h2"), stage = document.createElement("div");
    const canvas = document.createElement("canvas"), verdict = document.createElement("div"), now = document.createElement("div");
    box.className = "panel"; stage.className = "stage"; verdict.className = "verdict"; now.className = "now"; verdict.hidden = true;
    canvas.tabIndex = 0; canvas.setAttribute("role", "img"); canvas.setAttribute("aria-label", `${episode.label}: the road from above`);
    const swatch = document.createElement("span"), label = document.createElement("span"), outcome = document.createElement("span");
    const count = this.episodes.length, dash = dashOf(episode.number, count);
    swatch.className = dash.length ? "swatch dashed" : "swatch"; swatch.style.borderTopColor = `var(--${inkOf(episode.number, count)})`;
    label.textContent = episode.label; outcome.className = "outcome"; outcome.textContent = episode.outcome;
    heading.append(swatch, label, outcome); stage.append(canvas, verdict); box.append(heading, stage, now);
    byId("panels").append(box);
    const view = new View(canvas, episode, this.camera);
    this.gestures(canvas);
    return { episode, view, verdict, now, shown: -1 };
  }

  /** Drag moves the road, wheel and two fingers zoom. */
  gestures(canvas) {
    const fingers = new Map();
    canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); fingers.set(event.pointerId, event); });
    for (const kind of ["pointerup", "pointercancel"]) canvas.addEventListener(kind, (event) => fingers.delete(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      const last = fingers.get(event.pointerId);
      if (!last) return;
      if (fingers.size === 1) {
        this.camera.x -= (event.clientX - last.clientX) / this.camera.scale; this.camera.y -= (event.clientY - last.clientY) / this.camera.scale;
      } else {
        const other = [...fingers.values()].find((f) => f.pointerId !== event.pointerId);
        const apart = (f) => Math.hypot(f.clientX - other.clientX, f.clientY - other.clientY) || 1;
        this.zoom(apart(event) / apart(last));
      }
      fingers.set(event.pointerId, event); this.draw();
    });
    canvas.addEventListener("wheel", (event) => { event.preventDefault(); this.zoom(Math.exp(-event.deltaY * 0.0015)); }, { passive: false });
    canvas.addEventListener("dblclick", () => this.home());
  }

  zoom(factor) { this.camera.scale = Math.min(Math.max(this.camera.scale * factor, 0.4), 60); this.draw(); }

  /** The view as at the start. */
  home() {
    const wide = this.panels[0].view.wide || 600;
    this.camera.scale = Math.min(Math.max(wide / (this.flat ? 125 : 95), 2.6), 9);
    this.camera.ahead = this.flat ? (0.2 * wide) / this.camera.scale : 12; // more of what is before the ego [m]
    this.camera.x = this.camera.y = 0; this.camera.follows = true;
    byId("follow").setAttribute("aria-pressed", "true");
    this.draw();
  }

  wire() {
    const press = (id, act) => byId(id).addEventListener("click", act);
    press("play", () => this.toggle());
    press("first", () => this.seek(0)); press("last", () => this.seek(this.end));
    press("back", () => this.step(-this.dt)); press("on", () => this.step(this.dt));
    press("closer", () => this.zoom(1.3)); press("farther", () => this.zoom(1 / 1.3));
    press("follow", () => this.toggleFollow());
    byId("rate").addEventListener("change", (event) => { this.rate = Number(event.target.value); });
    const scrub = byId("scrub");
    scrub.max = Math.round(this.end / this.dt);
    scrub.addEventListener("input", () => this.seek(scrub.value * this.dt));
    document.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => this.resize()).observe(byId("panels"));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.resize());
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const tag = event.target.tagName;
    if (tag === "SELECT" || ((tag === "BUTTON" || tag === "SUMMARY") && (event.key === " " || event.key === "Enter"))) return;
    const act = {
      " ": () => this.toggle(), Home: () => this.seek(0), End: () => this.seek(this.end),
      ArrowLeft: () => this.step(event.shiftKey ? -1 : -this.dt), ArrowRight: () => this.step(event.shiftKey ? 1 : this.dt),
      "+": () => this.zoom(1.3), "=": () => this.zoom(1.3), "-": () => this.zoom(1 / 1.3), "−": () => this.zoom(1 / 1.3), "0": () => this.home(),
      n: () => this.jump(1), p: () => this.jump(-1), f: () => this.toggleFollow(),
    }[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (act) { event.preventDefault(); act(); }
  }

  toggle() {
    this.playing = !this.playing;
    if (this.playing && this.time >= this.end - 1e-9) this.time = 0;
    this.last = undefined;
    const button = byId("play");
    button.textContent = this.playing ? "Pause" : "Play"; button.setAttribute("aria-label", this.playing ? "Pause" : "Play");
    if (this.playing) requestAnimationFrame((now) => this.tick(now));
  }

  toggleFollow() {
    this.camera.follows = !this.camera.follows;
    byId("follow").setAttribute("aria-pressed", String(this.camera.follows));
    this.camera.follows ? this.home() : this.draw();
  }

  tick(now) {
    if (!this.playing) return;
    if (this.last !== undefined) this.time = Math.min(this.time + (Math.min(now - this.last, 250) / 1000) * this.rate, this.end);
    this.last = now;
    this.draw();
    if (this.time >= this.end) this.toggle();
    else requestAnimationFrame((next) => this.tick(next));
  }

  /** To a frame: whoever stops looks at what was recorded, not between. */
  seek(time) {
    const frames = Math.round(Math.min(Math.max(time, 0), this.end) / this.dt);
    this.time = Math.min(frames * this.dt, this.end); this.draw();
  }

  step(seconds) { if (this.playing) this.toggle(); this.seek(this.time + seconds); }

  jump(direction) {
    const times = this.rows.map((row) => row.time), now = this.time;
    const next = direction > 0 ? times.find((t) => t > now + 1e-6) : times.filter((t) => t < now - 1e-6).pop();
    if (next !== undefined) { if (this.playing) this.toggle(); this.seek(next); }
  }

  resize(first) {
    readColours();
    for (const { view } of this.panels) view.fit();
    this.charts.draw(); this.drawMarks(); this.drawLegend();
    first ? this.home() : this.draw();
  }

  draw() {
    for (const panel of this.panels) {
      const t = panel.episode.frameAt(this.time), k = Math.floor(t + 1e-9);
      panel.view.draw(t);
      if (k !== panel.shown) { this.tell(panel, k); panel.shown = k; }
    }
    this.charts.move(this.time);
    const scrub = byId("scrub"), text = `${this.time.toFixed(2)} s of ${this.end.toFixed(2)} s`;
    scrub.value = Math.round(this.time / this.dt); scrub.setAttribute("aria-valuetext", text);
    byId("clock").textContent = text;
    let current = -1;
    this.rows.forEach((row, i) => { if (row.time <= this.time + 1e-6) current = i; });
    if (current !== this.current) {
      if (this.rows[this.current]) this.rows[this.current].button.removeAttribute("aria-current");
      if (this.rows[current]) this.rows[current].button.setAttribute("aria-current", "true");
      this.current = current;
    }
  }

  /** What is known of this frame in words. */
  tell({ episode, now, verdict }, k) {
    const cells = [];
    episode.egos.forEach((ego, i) => {
      const of = episode.egos.length > 1 || !ego.shield ? `${episode.users[ego.user].name}: ` : "", s = ego.series, at = (name) => (s[name] ? s[name][k] : NaN);
      const partner = episode.users[ego.partner[k]];
      cells.push([`${of}speed`, `${plain(at("speed"), 1)} m/s`]);
      if (!ego.shield) {
        cells.push([`${of}acceleration`, `${signed(at("acceleration"), 1)} m/s²`]);
      } else {
        cells.push([`${of}acceleration: wanted → done`, `${signed(at("wanted"), 1)} → ${signed(at("acceleration"), 1)} m/s²`, true]);
        cells.push([`${of}steering: wanted → done`, `${signed(at("wanted_steering"), 1)} → ${signed(at("steering"), 1)}°`, true]);
        cells.push([`${of}changed by`, CHANGED_NAMES[ego.changedBy[k]] || "nothing"]);
        cells.push([`${of}proper response`, RESPONSE_NAMES[ego.response[k]] || "none"]);
        cells.push([`${of}nearest to danger`, partner ? `${partner.name}${ego.dangerous[k] ? ", dangerous" : ""}` : "nobody"]);
        if (ego.required[AHEAD].some((v) => v === v)) cells.push([`${of}ahead: has / needs`, `${plain(ego.gap[AHEAD][k], 1)} / ${plain(ego.required[AHEAD][k], 1)} m`]);
        if (ego.plan.some((p) => p)) cells.push([`${of}plan`, PLAN_NAMES[ego.plan[k]] || "none"]);
      }
      if (s.rdsi) cells.push([`${of}RDSI, area`, `${plain(at("rdsi"), 2)} ${at("rdsi") > at("upper") ? "unsafe" : at("rdsi") >= at("lower") ? "unknown" : "safe"}`]);
    });
    now.replaceChildren(...cells.map(([name, value, wide]) => {
      const cell = document.createElement("div"), small = document.createElement("small"), span = document.createElement("span");
      if (wide) cell.className = "wide";
      small.textContent = name; span.textContent = value; cell.append(small, span);
      return cell;
    }));
    const contact = episode.contacts.filter((one) => one.frame <= k).pop();
    verdict.hidden = !contact;
    if (contact && verdict.dataset.frame !== String(contact.frame)) {
      verdict.dataset.frame = contact.frame;
      const title = document.createElement("b"), list = document.createElement("ul");
      title.textContent = contact.title;
      for (const ground of contact.evidence) { const item = document.createElement("li"); item.textContent = ground; list.append(item); }
      verdict.replaceChildren(title, list);
    }
  }

  listEvents() {
    this.rows = [];
    for (const episode of this.episodes) for (const event of episode.events) {
      this.rows.push({ time: event.frame * episode.dt, event, episode });
    }
    this.rows.sort((a, b) => a.time - b.time || a.episode.number - b.episode.number);
    const list = document.createElement("ol");
    for (const row of this.rows) {
      const item = document.createElement("li"), button = document.createElement("button");
      const sign = document.createElement("span"), when = document.createElement("span"), what = document.createElement("span");
      button.type = "button"; sign.textContent = SIGNS[row.event.kind] || "•"; when.textContent = `${row.time.toFixed(2)} s`; what.textContent = row.event.text;
      sign.setAttribute("aria-hidden", "true"); sign.style.color = `var(--${inkOf(row.episode.number, this.episodes.length)})`;
      if (this.episodes.length > 1) { const of = document.createElement("span"); of.className = "of"; of.textContent = row.episode.label; what.append(of); }
      button.append(sign, when, what);
      button.addEventListener("click", (event) => { if (this.playing) this.toggle(); this.seek(row.time); if (event.detail > 0) button.blur(); });
      item.append(button); list.append(item); row.button = button;
    }
    if (!this.rows.length) { const none = document.createElement("li"); none.textContent = "Nothing happened."; list.append(none); }
    byId("events").append(list);
  }

  drawMarks() {
    const canvas = byId("marks"), ratio = window.devicePixelRatio || 1, width = canvas.getBoundingClientRect().width;
    canvas.width = Math.round(width * ratio); canvas.height = Math.round(12 * ratio);
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    for (const row of this.rows) {
      const x = 8 + (row.time / this.end) * (width - 16), loud = row.event.kind === "contact";
      context.fillStyle = loud ? colour.danger : colour[inkOf(row.episode.number, this.episodes.length)];
      context.fillRect(x - (loud ? 2 : 0.75), loud ? 0 : 4, loud ? 4 : 1.5, loud ? 12 : 8);
    }
  }

  help() {
    for (const [key, text] of KEYS) {
      const dt = document.createElement("dt"), dd = document.createElement("dd");
      dt.textContent = key; dd.textContent = text; byId("keys").append(dt, dd);
    }
  }

  drawLegend() {
    const bar = (fill, edge, hatched) => (pen) => {
      pen.fillStyle = colour[fill]; pen.globalAlpha = 0.2; pen.fillRect(1, 2, 32, 12); pen.globalAlpha = 1;
      if (hatched) { pen.fillStyle = hatch(pen, fill, 1, 1); pen.fillRect(1, 2, 32, 12); }
      pen.strokeStyle = colour[edge]; pen.strokeRect(1.5, 2.5, 31, 11);
    };
    const car = (fill, edge, width) => (pen) => { pen.fillStyle = colour[fill]; pen.fillRect(8, 4, 18, 8); pen.lineWidth = width; pen.strokeStyle = colour[edge]; pen.strokeRect(8, 4, 18, 8); };
    const stroke = (ink, dash) => (pen) => { pen.strokeStyle = colour[ink]; pen.lineWidth = 3; pen.setLineDash(dash); pen.beginPath(); pen.moveTo(2, 8); pen.lineTo(32, 8); pen.stroke(); };
    const arrow = (fill) => (pen) => {
      pen.beginPath(); pen.moveTo(3, 7); pen.lineTo(23, 7); pen.lineTo(23, 3); pen.lineTo(31, 8); pen.lineTo(23, 13); pen.lineTo(23, 9); pen.lineTo(3, 9); pen.closePath();
      pen.fillStyle = colour[fill]; pen.fill(); pen.strokeStyle = colour.ink; pen.stroke();
    };
    const junction = this.episodes.some((e) => e.paths.length);
    const rows = [
      [this.episodes.some((e) => e.egos.some((ego) => ego.shield)) ? "the ego" : "who is looked at", car("ego", "ink", 1)], ["whom its shield is about", car("user", "caution", 2)], ["in danger with the ego", car("user", "danger", 3)],
      ["acceleration that the agent wanted", arrow("card")], ["acceleration that was done", arrow("ink")],
      ["required distance, kept", bar("space", "space")], ["required distance, somebody inside", bar("danger", "danger", true)],
      ...(junction ? [["others' way across", bar("area", "area", true)], ["plan: stop, with a bar where", stroke("ego", [6, 3])], ["plan: go", stroke("ego", [])]] : []),
    ];
    byId("legend").replaceChildren(...rows.map(([text, paint]) => {
      const item = document.createElement("li"), canvas = document.createElement("canvas");
      canvas.width = 34; canvas.height = 16; paint(canvas.getContext("2d"));
      item.append(canvas, text);
      return item;
    }));
  }
}

unpack(byId("data").textContent).then((data) => { window.player = new Player(data); }).catch((error) => {
  const failed = document.createElement("p");
  failed.className = "failed"; failed.textContent = `This page cannot be shown: ${error.message}`;
  document.querySelector("main").prepend(failed);
  throw error;
});
