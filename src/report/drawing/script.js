// Zoom and readout. The pictures are complete without this; values are read back from the lines' paths.
(() => {
  "use strict";
  const SIZE = 100000;
  document.documentElement.classList.add("js");

  const pair = (text) => text.split(" ").map(Number);
  const clamp = (v, low, high) => Math.min(high, Math.max(low, v));

  // Points of a path in whole picture coordinates: M and L absolute, l by differences.
  function points(path) {
    const found = [];
    let letter = "", x = 0, y = 0, first = null;
    for (const token of path.match(/[MLlhZ]|-?\d+/g) || []) {
      if (/[A-Za-z]/.test(token)) { letter = token; first = null; continue; }
      if (letter === "h") continue;
      if (first === null) { first = +token; continue; }
      if (letter === "l") { x += first; y += +token; } else { x = first; y = +token; }
      found.push([x, y]);
      first = null;
    }
    return found;
  }

  const text = (v, decimals) => {
    const t = v.toFixed(decimals);
    return /^-[0.]*$/.test(t) ? t.slice(1) : t.replace("-", "−");
  };

  function roundStep(step) {
    const power = 10 ** Math.floor(Math.log10(step));
    return ([1, 2, 5].find((m) => step / power <= m) || 10) * power;
  }

  // Ticks of a linear range: [value, label].
  function linear(from, to, count) {
    const step = roundStep((to - from) / count);
    const decimals = clamp(-Math.floor(Math.log10(step * 1.000001)), 0, 12);
    const ticks = [];
    for (let k = Math.ceil(from / step); k <= Math.floor(to / step) && ticks.length < 30; k += 1) {
      ticks.push([k * step, text(k * step, decimals)]);
    }
    return ticks;
  }

  class Plot {
    constructor(element) {
      const data = element.dataset;
      this.element = element;
      this.area = element.querySelector(".area");
      this.svg = this.area.querySelector("svg");
      [this.x, this.y] = [pair(data.x), pair(data.y)];
      [this.xScale, this.yScale] = pair(data.exponents).map((e) => 10 ** e);
      this.units = data.units.split("|");
      this.log = "log" in data;
      this.logY = "logY" in data;
      this.same = "same" in data;
      const keys = element.querySelectorAll("button.key:not(.own)");
      this.series = [...element.querySelectorAll(".series")].map((line, k) => {
        const place = (p) => [this.toX(p[0]), this.toY(p[1])];
        const read = (part) => points(part.getAttribute("d")).map(place);
        return { line, key: keys[k], on: true, quiet: "quiet" in line.dataset, points: read(line.querySelector(".line")),
          around: [...line.querySelectorAll(".around")].flatMap(read) };
      });
    }
    toX(a) { return this.x[0] + (a / SIZE) * (this.x[1] - this.x[0]); }
    toY(b) { return this.y[1] - (b / SIZE) * (this.y[1] - this.y[0]); }

    // Heights of what is shown between two places.
    heights(view) {
      let [low, high] = [Infinity, -Infinity];
      for (const s of this.series.filter((s) => s.on)) {
        for (const [x, y] of [...s.points, ...s.around]) {
          if (x >= view[0] && x <= view[1]) { low = Math.min(low, y); high = Math.max(high, y); }
        }
      }
      if (this.same) { low = Math.min(low, 0); high = Math.max(high, 0); }
      return [low, high];
    }

    draw(x, y) {
      [this.viewX, this.viewY] = [x, y];
      const a = ((x[0] - this.x[0]) / (this.x[1] - this.x[0])) * SIZE;
      const w = ((x[1] - x[0]) / (this.x[1] - this.x[0])) * SIZE;
      const b = ((this.y[1] - y[1]) / (this.y[1] - this.y[0])) * SIZE;
      const h = ((y[1] - y[0]) / (this.y[1] - this.y[0])) * SIZE;
      this.svg.setAttribute("viewBox", `${a} ${b} ${w} ${h}`);
      for (const shade of this.svg.querySelectorAll(".shade")) { shade.setAttribute("y", b); shade.setAttribute("height", h); }
      const rows = [];
      for (const mark of this.area.querySelectorAll(".mark, .strip-bar")) {
        const from = clamp((+mark.dataset.from - a) / w, 0, 1);
        const to = clamp((+mark.dataset.from + +mark.dataset.width - a) / w, 0, 1);
        mark.hidden = from >= to;
        const bar = mark.classList.contains("strip-bar");
        mark.style.left = `${100 * (bar ? from : (from + to) / 2)}%`;
        if (bar) mark.style.width = `${100 * (to - from)}%`;
        if (bar || mark.hidden) continue;
        // Labels that would lie over each other move down a row.
        const box = mark.getBoundingClientRect();
        let row = rows.findIndex((taken) => taken.every(([l, r]) => box.right + 3 < l || box.left - 3 > r));
        if (row < 0) row = rows.push([]) - 1;
        rows[row].push([box.left, box.right]);
        mark.style.top = `${0.25 + 1.45 * row}rem`;
      }
      const { width, height } = this.area.getBoundingClientRect();
      const up = this.ticksOf(y, Math.max(4, height / 46), this.logY, this.yScale);
      this.ticks(".ticks.y", up, "top", (v) => 1 - (v - y[0]) / (y[1] - y[0]));
      const across = this.ticksOf(x, Math.max(4, width / 95), this.log, this.xScale);
      this.ticks(".ticks.x", across, "left", (v) => (v - x[0]) / (x[1] - x[0]));
    }
    // Ticks of an axis: [place, label].
    ticksOf(range, count, log, scale) {
      if (!log) return linear(range[0] / scale, range[1] / scale, count).map(([v, t]) => [v * scale, t]);
      const raised = (d) => `10${[...`${d}`].map((c) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(c)]).join("")}`;
      const label = (m, d) => {
        if (d >= -3 && d < 5) return text(m * 10 ** d, Math.max(0, -d));
        return m === 1 ? raised(d) : `${m} × ${raised(d)}`;
      };
      const decades = range[1] - range[0];
      if (decades < 0.8) return linear(10 ** range[0], 10 ** range[1], count).filter(([v]) => v > 0).map(([v, t]) => [Math.log10(v), t]);
      const steps = decades * 3 > 1.6 * count ? [1] : [1, 2, 5];
      const every = steps.length > 1 ? 1 : Math.max(1, Math.ceil(decades / count));
      const ticks = [];
      for (let d = Math.floor(range[0]); d <= range[1]; d += 1) {
        if (d % every) continue;
        for (const m of steps) {
          const at = d + Math.log10(m);
          if (at >= range[0] && at <= range[1]) ticks.push([at, label(m, d)]);
        }
      }
      return ticks;
    }
    ticks(where, ticks, side, place) {
      this.element.querySelector(where).replaceChildren(...ticks.map(([v, t]) => {
        const tick = document.createElement("span");
        tick.style[side] = `${100 * place(v)}%`;
        tick.appendChild(document.createElement("i")).textContent = t;
        return tick;
      }));
    }

    // Values at the sample nearest to a place.
    read(at) {
      const cursor = this.area.querySelector(".cursor"), readout = this.area.querySelector(".readout");
      const near = this.series.filter((s) => s.on && !s.quiet && s.points.length).map((s) => {
        const best = s.points.reduce((p, q) => (Math.abs(q[0] - at) < Math.abs(p[0] - at) ? q : p));
        return [s.key.textContent.trim(), best];
      });
      cursor.hidden = readout.hidden = at === null || !near.length;
      if (cursor.hidden) return;
      const x = near[0][1][0];
      const share = clamp((x - this.viewX[0]) / (this.viewX[1] - this.viewX[0]), 0, 1);
      const digits = (range, scale) => clamp(Math.ceil(-Math.log10((range[1] - range[0]) / scale)) + 3, 0, 12);
      const place = this.log ? (10 ** x).toPrecision(4) : text(x / this.xScale, digits(this.viewX, this.xScale));
      const lines = [[`${place} ${this.units[0]}`, ""], ...near.map(([name, p]) =>
        [name, `${this.logY ? (10 ** p[1]).toPrecision(3) : text(p[1] / this.yScale, digits(this.viewY, this.yScale))} ${this.units[1]}`])];
      readout.replaceChildren(...lines.map(([name, value]) => {
        const row = document.createElement("span");
        row.append(Object.assign(document.createElement("span"), { textContent: name }),
          Object.assign(document.createElement("b"), { textContent: value }));
        return row;
      }));
      cursor.style.left = `${100 * share}%`;
      readout.style.left = share < 0.5 ? `calc(${100 * share}% + 10px)` : "auto";
      readout.style.right = share < 0.5 ? "auto" : `calc(${100 * (1 - share)}% + 10px)`;
    }
  }

  function group(element) {
    const plots = [...element.querySelectorAll("[data-plot]")].map((p) => new Plot(p));
    const all = plots[0].x;
    let view = [...all], at = null;
    const spread = ([low, high]) => {
      const room = 0.06 * (high - low) || Math.abs(high) * 0.05 || 1;
      return [low - room, high + room];
    };
    function draw() {
      const whole = view[0] <= all[0] && view[1] >= all[1];
      const shared = plots.filter((p) => p.same).map((p) => p.heights(view));
      const together = [Math.min(...shared.map((h) => h[0])), Math.max(...shared.map((h) => h[1]))];
      for (const p of plots) {
        const h = p.same ? together : p.heights(view);
        const untouched = whole && !p.alone && (p.same ? plots : [p]).every((q) => q.series.every((s) => s.on));
        p.draw(view, untouched || !(h[0] <= h[1]) ? p.y : spread(h));
      }
      read(at);
    }
    function read(where) { at = where; plots.forEach((p) => p.read(at)); }
    function show(from, to) {
      const least = (all[1] - all[0]) / 500;
      const width = clamp(to - from, least, all[1] - all[0]);
      const start = clamp((from + to - width) / 2, all[0], all[1] - width);
      view = [start, start + width];
      draw();
    }
    function zoom(factor, middle) {
      const about = middle ?? at ?? (view[0] + view[1]) / 2;
      show(about - (about - view[0]) * factor, about + (view[1] - about) * factor);
    }
    const actions = { in: () => zoom(0.5), out: () => zoom(2), all: () => show(...all) };
    for (const b of element.querySelectorAll("[data-zoom]")) b.addEventListener("click", actions[b.dataset.zoom]);
    for (const p of plots) {
      const own = p.element.querySelector(".own");
      if (own) own.addEventListener("click", () => {
        own.setAttribute("aria-pressed", p.same);
        [p.same, p.alone] = [!p.same, p.same];
        draw();
      });
      for (const s of p.series) s.key.addEventListener("click", () => {
        s.on = !s.on;
        s.key.setAttribute("aria-pressed", s.on);
        s.line.style.display = s.on ? "" : "none";
        draw();
      });
      const place = (event) => {
        const box = p.area.getBoundingClientRect();
        return view[0] + clamp((event.clientX - box.left) / box.width, 0, 1) * (view[1] - view[0]);
      };
      const selection = p.area.querySelector(".selection");
      let from = null;
      const percent = (v) => (100 * (v - view[0])) / (view[1] - view[0]);
      p.area.addEventListener("pointerdown", (e) => {
        if (e.button === 0 && e.pointerType !== "touch") { from = place(e); p.area.setPointerCapture(e.pointerId); }
        read(place(e));
      });
      p.area.addEventListener("pointermove", (e) => {
        const here = place(e);
        read(here);
        selection.hidden = from === null;
        if (from === null) return;
        selection.style.left = `${percent(Math.min(from, here))}%`;
        selection.style.width = `${percent(view[0] + Math.abs(here - from))}%`;
      });
      p.area.addEventListener("pointerup", (e) => {
        const here = place(e), start = from;
        from = null;
        selection.hidden = true;
        if (start !== null && Math.abs(here - start) > 0.01 * (view[1] - view[0])) show(Math.min(start, here), Math.max(start, here));
      });
      p.area.addEventListener("pointercancel", () => { from = null; selection.hidden = true; read(null); });
      p.area.addEventListener("pointerleave", (e) => { if (from === null && e.pointerType !== "touch") read(null); });
      p.area.addEventListener("dblclick", actions.all);
      p.area.addEventListener("wheel", (e) => {
        if (!e.ctrlKey) return;
        e.preventDefault();
        zoom(e.deltaY > 0 ? 1.25 : 0.8, place(e));
      }, { passive: false });
      p.area.addEventListener("keydown", (e) => {
        const step = (view[1] - view[0]) / 60;
        const move = (by) => read(clamp((at ?? (view[0] + view[1]) / 2) + by, view[0], view[1]));
        const keys = { ArrowLeft: () => move(-step), ArrowRight: () => move(step), Escape: () => read(null),
          "+": actions.in, "-": actions.out, 0: actions.all };
        if (keys[e.key]) { e.preventDefault(); keys[e.key](); }
      });
      p.area.addEventListener("blur", () => read(null));
    }
    draw();
    new ResizeObserver(draw).observe(element);
  }

  document.querySelectorAll("[data-group]").forEach(group);
  addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((d) => { d.open = true; }));
})();
