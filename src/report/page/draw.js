// Draws the pictures of a page with plotly.js: a picture is data (see plot.rs), its looks are here and in style.css.
(() => {
  "use strict";
  const root = document.documentElement;
  root.classList.add("js");

  // Colour (a variable of style.css), width and dashes of a line.
  const STYLES = {
    recorded: ["recorded", 4], simulation: ["simulation", 1.5, "7px,3px"], parameters: ["parameters", 1.5, "2px,3px"],
    augmented: ["found", 1.7], before: ["simulation", 1.1], between: ["parameters", 1.1, "2px,3px"], after: ["found", 1.1],
    learned: ["ink", 2], truth: ["simulation", 2], runs: ["floor", 0.7],
    first: ["found", 2], second: ["parameters", 2, "7px,3px"], third: ["good", 2, "2px,3px"], fourth: ["window", 2, "9px,3px,2px,3px"],
    input: ["parameters", 1.1], output: ["found", 1.1], outline: ["found", 1.2], outline_wide: ["found", 1, "2px,3px"],
    zeros: ["simulation", 1.6], chosen: ["found", 2], plain: ["soft", 1.5],
  };
  ["found", "ink", "simulation", "window", "parameters", "recorded", "good", "floor", "fresh"].forEach((colour, k) => { STYLES[`bar-${k + 1}`] = [colour, 1.5]; });
  // Opacity of the bands around a line, narrowest last.
  const BANDS = [[0.22], [0.13, 0.2]];

  const colour = (name, alpha = 1) => {
    const hex = getComputedStyle(root).getPropertyValue(`--${name}`).trim();
    if (alpha === 1) return hex;
    const [r, g, b] = [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
    return `rgba(${r},${g},${b},${alpha})`;
  };
  // plotly.js reads a few HTML tags in texts; names from files are to stand as they are.
  const plain = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
  const labelled = (axis) => plain(axis.unit ? `${axis.label} [${axis.unit}]` : axis.label);
  const touch = matchMedia("(pointer: coarse)").matches;
  const CONFIG = {
    displaylogo: false, responsive: false, displayModeBar: touch ? true : "hover", scrollZoom: false, doubleClick: "reset", showTips: false,
    modeBarButtons: [["zoomIn2d", "zoomOut2d", "resetScale2d"], ["toImage"]],
  };

  // The number of a date as the page or plotly.js writes it; numbers stay.
  const moment = (v) => (typeof v !== "string" ? v : Date.parse(`${v.replace(" UTC", "").replace(" ", "T").replace(/(\.\d{3})\d*$/, "$1")}Z`));

  class Picture {
    constructor(element) {
      this.element = element;
      this.box = element.querySelector(".drawing");
      this.spec = JSON.parse(element.querySelector("script").textContent);
      this.hidden = new Set();
      this.range = null;
      this.fit = null;
      this.dated();
      this.legend();
    }

    // Seconds since a date become milliseconds since 1970, which plotly.js shows as dates.
    dated() {
      const { x, series } = this.spec;
      if (!x.since) return;
      const zero = moment(x.since);
      const date = (v) => (v === null ? null : zero + 1000 * v);
      for (const s of series) {
        s.x = s.x.map(date);
        for (const band of s.bands || []) band.x = band.x.map(date);
      }
      if (x.range) x.range = x.range.map(date);
    }

    legend() {
      const list = this.element.querySelector(".legend");
      const key = (name, swatch, press) => {
        const item = list.appendChild(document.createElement("li"));
        const inner = item.appendChild(document.createElement(press ? "button" : "span"));
        inner.className = "key";
        inner.append(swatch, name);
        if (!press) return;
        inner.type = "button";
        inner.title = "Show or hide";
        inner.setAttribute("aria-pressed", "true");
        inner.addEventListener("click", () => inner.setAttribute("aria-pressed", press()));
      };
      const mark = (style, kind) => {
        const [name, width, dash] = STYLES[style];
        const swatch = document.createElement("span");
        swatch.className = `swatch ${kind}`;
        swatch.style.setProperty("--c", `var(--${name})`);
        swatch.style.setProperty("--w", `${Math.max(1.5, width)}px`);
        if (style === "zeros") swatch.classList.add("open");
        if (dash && kind === "line") swatch.classList.add("dashed");
        return swatch;
      };
      const { series, stripe, strips } = this.spec;
      const named = series.filter((s) => s.name);
      const bands = new Map();
      series.forEach((s) => s.bands?.forEach((band, k) => !band.name || bands.has(band.name) || bands.set(band.name, [s, BANDS[s.bands.length - 1][k]])));
      if (named.length + bands.size + (stripe ? 1 : 0) + (strips ? 1 : 0) < 2) return;
      series.forEach((s, k) => s.name && key(s.name, mark(s.style, s.kind), named.length < 2 ? null : () => {
        const on = this.hidden.has(k);
        if (on) this.hidden.delete(k); else this.hidden.add(k);
        this.draw();
        return on;
      }));
      for (const [name, [s, alpha]] of bands) {
        const swatch = mark(s.style, "box");
        swatch.style.opacity = alpha === 0.13 ? 0.18 : 0.42;
        key(name, swatch);
      }
      const box = (name, kind, text) => {
        const swatch = document.createElement("span");
        swatch.className = `swatch ${kind}`;
        swatch.style.setProperty("--c", `var(--${name})`);
        key(text, swatch);
      };
      if (stripe) box("noise", "box faint", stripe.name);
      if (strips) box("ink", "strip", "never fitted");
    }

    traces() {
      const { x, y } = this.spec;
      const unit = y.unit ? ` ${plain(y.unit)}` : "";
      return this.spec.series.flatMap((s, k) => {
        const [name, width, dash] = STYLES[s.style];
        const visible = !this.hidden.has(k);
        const bands = (s.bands || []).flatMap((band, j) => {
          const edge = { x: band.x, mode: "lines", line: { width: 0 }, hoverinfo: "skip", visible };
          return [{ ...edge, y: band.lower }, { ...edge, y: band.upper, fill: "tonexty", fillcolor: colour(name, BANDS[s.bands.length - 1][j]) }];
        });
        const text = s.says?.map(plain);
        const quiet = s.quiet ? { hoverinfo: "skip" }
          : { hovertemplate: text ? `%{text}<extra>${plain(s.name)}</extra>` : `%{y}${unit}<extra>${plain(s.name)}</extra>` };
        const trace = { x: s.x, y: s.y, name: plain(s.name), visible, hovertext: text, text, textposition: "none", ...quiet };
        if (s.kind === "bars") {
          const labels = s.labels?.length ? { text: s.labels.map(plain), textposition: "outside", textangle: -90, cliponaxis: false,
            hovertemplate: `%{customdata}<extra>${plain(s.name)}</extra>`, customdata: text } : {};
          return [...bands, { ...trace, type: "bar", marker: { color: colour(name) }, ...labels }];
        }
        if (s.kind === "line") return [...bands, { ...trace, mode: "lines", line: { color: colour(name), width, dash, simplify: false } }];
        const symbol = s.kind === "crosses" ? "x-thin" : s.style === "zeros" ? "circle-open" : "circle";
        const size = s.kind === "crosses" ? 9 : s.style === "zeros" ? 9 : 6;
        return [...bands, { ...trace, mode: "markers", marker: { color: colour(name), size, symbol, line: { color: colour(name), width: s.kind === "crosses" || s.style === "zeros" ? 1.8 : 0 } } }];
      });
    }

    shapes() {
      const { spec } = this;
      const rect = { type: "rect", xref: "x", yref: "paper", y0: 0, y1: 1, layer: "below" };
      const found = (spec.shades || []).map((s) => ({ ...rect, x0: s.from, x1: s.to, fillcolor: colour("window", 0.14),
        line: { color: colour("window", 0.7), width: 1, dash: "3px,3px" },
        label: { text: plain(s.label), textposition: "top center", padding: 3, font: { size: 11, color: colour("ink") } } }));
      for (const s of spec.strips || []) found.push({ ...rect, x0: s.from, x1: s.to, y0: 1, y1: 1, yref: "paper", line: { width: 4, color: colour("ink", 0.55) }, type: "line", layer: "above" });
      if (spec.stripe) found.push({ type: "rect", xref: "paper", x0: 0, x1: 1, yref: "y", y0: -spec.stripe.half, y1: spec.stripe.half, fillcolor: colour("noise", 0.28), line: { width: 0 }, layer: "below" });
      if (spec.level !== undefined) found.push({ type: "line", xref: "paper", x0: 0, x1: 1, yref: "y", y0: spec.level, y1: spec.level, line: { color: colour("ink"), width: 1, dash: "4px,3px" } });
      if (spec.unit_circle) found.push({ type: "circle", xref: "x", yref: "y", x0: -1, x1: 1, y0: -1, y1: 1, line: { color: colour("soft"), width: 1 } });
      return found;
    }

    axis(of, range) {
      const names = of.names ? { tickmode: "array", tickvals: of.names.map((_, k) => k), ticktext: of.names.map(plain), range: [-0.5, of.names.length - 0.5] } : {};
      const log = (v) => (of.logarithmic ? Math.log10(v) : v);
      return {
        type: of.since ? "date" : of.logarithmic ? "log" : "linear", gridcolor: colour("grid"), zerolinecolor: colour("hair"), linecolor: colour("soft"),
        tickfont: { size: 11.5, color: colour("soft") }, exponentformat: "power", minexponent: 4, hoverformat: of.since ? "%Y-%m-%d %H:%M:%S.%3f" : ".5~g", automargin: true,
        ...(of.logarithmic ? this.decades(of) : {}), ...(of.whole ? { tickformat: "d" } : {}),
        ...(of.names ? { zeroline: false, showgrid: false } : {}), ...names,
        ...(range ? { range: [...range] } : of.range ? { range: of.range.map(log) } : {}),
      };
    }
    // Numbers where they are short, powers of ten elsewhere; 2 and 5 too within few decades.
    decades(of) {
      const [from, to] = (of.range || [0.1, 10]).map(Math.log10);
      const short = from >= -4.2 && to < 5;
      return { exponentformat: short ? "none" : "power", dtick: to - from < 1.3 ? "D2" : to - from > 8 ? 2 : 1,
        minor: { dtick: "D1", showgrid: true, gridcolor: colour("grid"), griddash: "1px,3px" } };
    }

    layout() {
      const { x, y, unit_circle: circle } = this.spec;
      const across = this.spec.series.some((s) => s.kind === "bars" && s.says) || circle;
      const height = this.box.clientHeight, width = this.box.clientWidth;
      const named = x.names && width / x.names.length < 30 ? { tickangle: -60 } : {};
      return {
        width, height, margin: { l: 44, r: 12, t: 26, b: 40 }, showlegend: false, separators: ".\u202f",
        paper_bgcolor: colour("paper"), plot_bgcolor: colour("paper"),
        font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: colour("ink") },
        hovermode: across ? "closest" : "x unified", hoverdistance: circle ? 25 : -1, dragmode: touch ? false : "zoom",
        hoverlabel: { bgcolor: colour("paper"), bordercolor: colour("hair"), font: { color: colour("ink"), size: 12 }, namelength: 40 },
        modebar: { bgcolor: "rgba(0,0,0,0)", color: colour("soft"), activecolor: colour("ink"), orientation: "h" },
        xaxis: { ...this.axis(x, this.range), title: { text: labelled(x), font: { size: 12 }, standoff: 8 }, showline: true, ...named,
          ...(circle ? { constrain: "domain" } : {}) },
        yaxis: { ...this.axis(y, this.fit), fixedrange: this.linked, zeroline: !y.logarithmic, ...(circle ? { scaleanchor: "x", constrain: "domain" } : {}) },
        annotations: [{ text: labelled(y), showarrow: false, xref: "paper", yref: "paper", x: 0, y: 1, xanchor: "left", yanchor: "bottom", yshift: 4, font: { size: 12 } }],
        shapes: this.shapes(), barmode: x.names ? "group" : "overlay", bargap: x.names ? 0.25 : 0.5,
      };
    }

    draw() {
      if (!this.box.clientWidth) return;
      if (this.spec.least_width && !root.classList.contains("on-paper")) this.box.style.minWidth = `${this.spec.least_width}px`;
      Plotly.react(this.box, this.traces(), this.layout(), CONFIG);
      if (this.drawn) return;
      this.drawn = true;
      this.box.on("plotly_relayout", (change) => this.moved?.(change));
    }

    // Lowest and highest value of what is shown between two places.
    heights([from, to]) {
      let low = Infinity, high = -Infinity;
      this.spec.series.forEach((s, k) => {
        if (this.hidden.has(k)) return;
        s.x.forEach((at, j) => {
          const v = s.y[j];
          if (at >= from && at <= to && v !== null) { low = Math.min(low, v); high = Math.max(high, v); }
        });
      });
      return [low, high];
    }
  }

  const pictures = [];
  for (const group of document.querySelectorAll(".group")) {
    const members = [...group.querySelectorAll("[data-plot]")].map((element) => new Picture(element));
    pictures.push(...members);
    if (!("linked" in group.dataset)) continue;
    // Zooming one zooms all; the vertical axis follows what is shown.
    const show = (range) => {
      members.forEach((m) => { m.range = range; m.fit = null; });
      if (range) {
        const seen = members.map((m) => m.heights(range));
        members.forEach((m, k) => {
          const same = [k, m.spec.follows ? k - 1 : k, members[k + 1]?.spec.follows ? k + 1 : k].map((j) => seen[j]);
          const low = Math.min(...same.map((h) => h[0])), high = Math.max(...same.map((h) => h[1]));
          const room = 0.06 * (high - low) || 1;
          if (low <= high) m.fit = [low - room, high + room];
        });
      }
      members.forEach((m) => m.drawn && m.draw());
    };
    members.forEach((m) => {
      m.linked = true;
      m.moved = (change) => {
        const ends = [change["xaxis.range[0]"], change["xaxis.range[1]"]];
        const range = (change["xaxis.range"] || (ends[0] === undefined ? null : ends))?.map(moment);
        if (range && !m.spec.x.logarithmic) show(range);
        else if (change["xaxis.autorange"] || m.range) show(null);
      };
    });
  }

  // What is in sight first; the rest when the browser has time.
  const later = self.requestIdleCallback || ((run) => setTimeout(run, 1));
  const waiting = () => pictures.filter((p) => !p.drawn && p.box.clientWidth);
  const inSight = (p) => { const b = p.box.getBoundingClientRect(); return b.bottom > 0 && b.top < innerHeight; };
  function next() {
    const [first] = waiting().sort((a, b) => inSight(b) - inSight(a));
    if (!first) return;
    first.draw();
    later(next);
  }
  waiting().filter(inSight).forEach((p) => p.draw());
  later(next);
  document.querySelectorAll("details").forEach((d) => d.addEventListener("toggle", next));

  const redraw = () => pictures.forEach((p) => p.drawn && p.draw());
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  let width = innerWidth, soon = 0;
  addEventListener("resize", () => {
    if (innerWidth === width) return;
    width = innerWidth;
    clearTimeout(soon);
    soon = setTimeout(redraw, 120);
  });
  // On paper: light, as wide as the paper, everything open.
  addEventListener("beforeprint", () => {
    document.querySelectorAll("details").forEach((d) => { d.open = true; });
    root.classList.add("on-paper");
    pictures.forEach((p) => p.draw());
  });
  addEventListener("afterprint", () => { root.classList.remove("on-paper"); redraw(); });
})();
