// Time series under the road, one under the other, with one cursor.

const INKS = ["one", "two", "three", "four"];
const DASHES = [[7, 3], [], [2, 2.5], [9, 3, 2, 3]]; // of the first episode, the second, ...
const dashOf = (number, count) => (count === 1 ? [] : DASHES[number % DASHES.length]);
const inkOf = (number, count) => (count === 1 ? "two" : INKS[number % INKS.length]);

// name of the series, heading, unit, what is drawn, limits of the axis where a few samples would squeeze the rest
const CHARTS = [
  { title: "Speed", unit: "m/s", series: ["speed"], digits: 1 },
  { title: "Acceleration", unit: "m/s²", more: "dotted: wanted", series: ["acceleration", "wanted"], digits: 1, zero: true, least: -9, most: 9 },
  { title: "Jerk", unit: "m/s³", series: ["jerk"], digits: 0, zero: true, least: -40, most: 40 },
  { title: "Margin ahead", unit: "m", more: "beyond what is required", series: ["margin_ahead"], digits: 1, zero: true, below: true, least: -30, most: 60 },
  { title: "Margin beside", unit: "m", more: "beyond what is required", series: ["margin_beside"], digits: 2, zero: true, below: true, least: -2, most: 6 },
  { title: "RDSI", unit: "1", more: "dotted: where unknown, known unsafe begin", series: ["rdsi", "lower", "upper"], digits: 2, least: -0.2, most: 2.5 },
  { title: "1 / TTC", unit: "1/s", series: ["inverse_ttc"], digits: 2, least: 0, most: 1.5 },
];
const TOP = 4, BOTTOM = 4, MARGIN = 40;

class Charts {
  constructor(root, episodes, seek) {
    Object.assign(this, { root, episodes, seek, charts: [] });
    this.end = Math.max(...episodes.map((episode) => episode.duration), 1e-9);
    for (const chart of CHARTS) if (chart.series.slice(0, 1).some((name) => this.known(name))) this.add(chart, 74);
    if (episodes.some((e) => e.egos.some((ego) => ego.shield))) this.add({ title: "Duties", more: "what changed the command; the proper response owed", strips: true }, 22 * episodes.reduce((n, e) => n + e.egos.length, 0) * 2 + 4);
    const axis = document.createElement("canvas");
    axis.style.height = "18px"; root.append(axis); this.axis = axis;
  }

  known(name) { return this.episodes.some((e) => e.egos.some((ego) => ego.series[name] && ego.series[name].some((v) => v === v))); }

  add(chart, height) {
    const box = document.createElement("div"), heading = document.createElement("h3"), canvas = document.createElement("canvas");
    const cursor = document.createElement("div"), stage = document.createElement("div");
    box.className = "chart"; cursor.className = "cursor"; stage.style.position = "relative";
    heading.textContent = chart.title;
    const unit = document.createElement("span");
    unit.className = "unit"; unit.textContent = [chart.unit ? `[${chart.unit}]` : "", chart.more || ""].join(" ").trim(); heading.append(unit);
    const keys = [];
    if (!chart.strips) for (const [episode, ego] of this.pairs()) {
      if (!ego.series[chart.series[0]]) continue;
      const key = document.createElement("span"), line = document.createElement("i"), value = document.createElement("b");
      key.className = "key"; line.style.borderTopColor = `var(--${inkOf(this.order(episode, ego), this.count())})`;
      if (dashOf(this.order(episode, ego), this.count()).length) line.className = "dashed";
      key.append(line, value); heading.append(key); keys.push({ episode, ego, value });
    }
    canvas.style.height = `${height}px`; canvas.setAttribute("role", "img"); canvas.setAttribute("aria-label", `${chart.title} against time`);
    stage.append(canvas, cursor); box.append(heading, stage); this.root.append(box);
    const at = (event) => { const r = canvas.getBoundingClientRect(); this.seek(((event.clientX - r.left - MARGIN) / (r.width - MARGIN - 6)) * this.end); };
    canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); at(event); });
    canvas.addEventListener("pointermove", (event) => { if (event.buttons) at(event); });
    this.charts.push({ chart, canvas, cursor, keys, height });
  }

  *pairs() { for (const episode of this.episodes) for (const ego of episode.egos) yield [episode, ego]; }
  count() { return this.episodes.reduce((n, episode) => n + episode.egos.length, 0); }
  order(episode, ego) { let n = 0; for (const [e, g] of this.pairs()) { if (e === episode && g === ego) return n; n++; } return 0; }

  pen(canvas, height) {
    const ratio = window.devicePixelRatio || 1, width = canvas.getBoundingClientRect().width;
    canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio);
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0); context.clearRect(0, 0, width, height);
    return [context, width];
  }

  toX(time, width) { return MARGIN + (time / this.end) * (width - MARGIN - 6); }

  draw() {
    for (const one of this.charts) one.chart.strips ? this.drawStrips(one) : this.drawLines(one);
    const [context, width] = this.pen(this.axis, 18);
    context.font = "11px system-ui, sans-serif"; context.fillStyle = colour.quiet; context.textAlign = "center"; context.textBaseline = "top";
    for (const time of this.ticks(width)) context.fillText(`${+time.toFixed(2)} s`, this.toX(time, width), 2);
  }

  ticks(width) {
    const step = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100].find((s) => (s / this.end) * width > 52) || 200, found = [];
    for (let i = 0; i * step <= this.end + 1e-9; i++) found.push(i * step);
    return found;
  }

  drawLines({ chart, canvas, height }) {
    const [context, width] = this.pen(canvas, height);
    let low = chart.zero ? 0 : Infinity, high = chart.zero ? 0 : -Infinity;
    for (const [, ego] of this.pairs()) for (const name of chart.series) for (const v of ego.series[name] || []) {
      if (v === v) { low = Math.min(low, v); high = Math.max(high, v); }
    }
    if (chart.least !== undefined) { low = Math.max(low, chart.least); high = Math.min(high, chart.most); }
    if (!(high > low)) { low -= 1; high += 1; }
    const pad = 0.06 * (high - low); low -= pad; high += pad;
    const toY = (v) => TOP + ((high - Math.min(Math.max(v, low), high)) / (high - low)) * (height - TOP - BOTTOM);
    const step = niceStep((high - low) / 4);
    context.font = "11px system-ui, sans-serif"; context.textBaseline = "middle"; context.textAlign = "right";
    for (let v = Math.ceil(low / step) * step; v <= high; v += step) {
      context.strokeStyle = colour.rule; context.lineWidth = Math.abs(v) < step / 1e6 && chart.zero ? 1.6 : 0.8;
      context.beginPath(); context.moveTo(MARGIN, toY(v)); context.lineTo(width - 6, toY(v)); context.stroke();
      context.fillStyle = colour.quiet; context.fillText(`${+v.toFixed(3)}`, MARGIN - 5, toY(v));
    }
    for (const time of this.ticks(width)) {
      context.strokeStyle = colour.rule; context.lineWidth = 0.5;
      context.beginPath(); context.moveTo(this.toX(time, width), TOP); context.lineTo(this.toX(time, width), height - BOTTOM); context.stroke();
    }
    if (chart.below && low < 0) { // not kept
      context.globalAlpha = 0.1; context.fillStyle = colour.danger; context.fillRect(MARGIN, toY(0), width - MARGIN - 6, height - BOTTOM - toY(0)); context.globalAlpha = 1;
    }
    for (const [episode, ego] of this.pairs()) {
      const order = this.order(episode, ego), ink = colour[inkOf(order, this.count())];
      chart.series.forEach((name, i) => {
        const values = ego.series[name];
        if (!values) return;
        context.strokeStyle = ink; context.lineWidth = i ? 1.2 : 2; context.globalAlpha = i ? 0.75 : 1;
        context.setLineDash(i ? [1.5, 3] : dashOf(order, this.count()));
        context.beginPath();
        let down = false;
        values.forEach((v, k) => {
          if (!(v === v)) { down = false; return; }
          const x = this.toX(k * episode.dt, width), y = toY(v);
          context[down ? "lineTo" : "moveTo"](x, y); down = true;
        });
        context.stroke();
      });
    }
    context.setLineDash([]); context.globalAlpha = 1;
    this.drawContacts(context, width, height);
  }

  drawContacts(context, width, height) {
    for (const episode of this.episodes) for (const contact of episode.contacts) {
      const x = this.toX(contact.frame * episode.dt, width);
      context.strokeStyle = colour.danger; context.lineWidth = 1.5; context.setLineDash([2, 2]);
      context.beginPath(); context.moveTo(x, 0); context.lineTo(x, height); context.stroke(); context.setLineDash([]);
    }
  }

  /** For each ego a strip of who drives, and one of what is owed. */
  drawStrips({ canvas, height }) {
    const [context, width] = this.pen(canvas, height);
    let y = 2;
    for (const [episode, ego] of this.pairs()) {
      const ink = colour[inkOf(this.order(episode, ego), this.count())];
      for (const [values, names, fills] of [
        [ego.changedBy, CHANGED_NAMES, [null, "quiet", "caution", "danger"]],
        [ego.response.map((r, k) => (r ? r : ego.dangerous[k] ? -1 : 0)), RESPONSE_NAMES, [null, "danger", "danger", "danger", "good"]],
      ]) {
        context.fillStyle = colour.rule; context.globalAlpha = 0.45; context.fillRect(MARGIN, y, this.toX(episode.duration, width) - MARGIN, 18); context.globalAlpha = 1;
        context.fillStyle = ink; context.fillRect(MARGIN - 8, y, 4, 18);
        for (let k = 0; k < values.length; ) {
          let end = k;
          while (end < values.length && values[end] === values[k]) end++;
          if (values[k]) {
            const x = this.toX(k * episode.dt, width), x1 = this.toX(Math.min(end, episode.frames - 1) * episode.dt, width);
            const name = values[k] < 0 ? "danger" : names[values[k]], fill = values[k] < 0 ? "caution" : fills[values[k]];
            context.globalAlpha = 0.85; context.fillStyle = colour[fill]; context.fillRect(x, y, Math.max(x1 - x, 1.2), 18); context.globalAlpha = 1;
            context.font = "11px system-ui, sans-serif"; context.textAlign = "left"; context.textBaseline = "middle";
            if (context.measureText(name).width + 6 < x1 - x) { context.fillStyle = "#101214"; context.fillText(name, x + 3, y + 9.5); }
          }
          k = end;
        }
        y += 22;
      }
    }
    this.drawContacts(context, width, height);
  }

  move(time) {
    for (const { chart, canvas, cursor, keys } of this.charts) {
      cursor.style.left = `${this.toX(Math.min(time, this.end), canvas.clientWidth)}px`;
      for (const { episode, ego, value } of keys) {
        const v = ego.series[chart.series[0]][Math.floor(episode.frameAt(time) + 1e-9)];
        value.textContent = plain(v, chart.digits);
      }
    }
  }
}

function niceStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((m) => m * power).find((step) => step >= least * 0.999);
}
