// Figures: their data lie in the page as JSON; hover values, zoom, linked cursors, series that can be hidden, the data as CSV.
tacdata.figures = (() => {
  const {make} = tacdata;
  const color = name => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
  const plain = v => v === null || v === undefined || !Number.isFinite(v) ? "–" : String(+v.toPrecision(4));
  const finite = values => values.filter(Number.isFinite);
  const quoted = v => v === null || v === undefined ? "" : /[",\n]/.test(v) ? `"${String(v).replaceAll('"', '""')}"` : String(v);

  function link(figure, title, csv) {
    const tools = make("span", null, {class: "tools"}), data = make("button", "data", {type: "button", class: "data", title: "the figure's data as CSV"});
    data.onclick = () => {
      const address = URL.createObjectURL(new Blob([csv().map(row => row.map(quoted).join(",")).join("\n") + "\n"], {type: "text/csv"}));
      const anchor = make("a", null, {href: address, download: title().replace(/[^\w.-]+/g, "_").slice(0, 80) + ".csv"});
      anchor.click();
      setTimeout(() => URL.revokeObjectURL(address), 10000);
    };
    tools.append(data);
    const caption = make("figcaption");
    const words = make("span");
    caption.append(words, tools);
    figure.prepend(caption);
    return {words, tools};
  }

  class Plot {
    constructor(figure, frames) {
      Object.assign(this, {figure, frames, frame: frames[0], hidden: new Set(), chart: null});
      Object.assign(this, link(figure, () => this.frame.title, () => this.csv()));
      this.whole = make("button", "whole", {type: "button", title: "undo the zoom; drag in the figure to zoom"});
      this.whole.onclick = () => this.chart && this.chart.setData(this.chart.data);
      this.whole.style.visibility = "hidden";
      this.tools.prepend(this.whole);
      this.area = make("div", null, {class: "area", tabindex: 0, role: "img"});
      this.read = make("div", null, {class: "read"});
      this.dot = make("span", null, {class: "dot"});
      figure.append(this.area, this.read);
      this.area.onkeydown = event => this.key(event);
      new ResizeObserver(() => this.fit()).observe(this.area);
      this.show(0);
    }
    show(k) {
      this.frame = this.frames[k];
      this.words.textContent = this.frame.title;
      this.area.setAttribute("aria-label", `${this.frame.title}: ${this.frame.y} over ${this.frame.x.label}`);
      this.at = make("span", "", {class: "at"});
      this.buttons = this.frame.series.map((s, i) => {
        const button = make("button", null, {type: "button", "aria-pressed": !this.hidden.has(s.name), title: "hide or show"});
        const mark = make("i");
        mark.style.setProperty("--c", `var(--${s.color})`);
        button.append(mark, s.name, make("b", ""));
        button.onclick = () => this.toggle(i);
        return button;
      });
      const bands = this.frame.bands.map(b => make("span", `grey: ${b.name}`, {class: "dim"}));
      this.read.replaceChildren(...(this.frame.series.length > 12 ? [] : this.buttons), ...bands, this.at);
      if (this.chart) this.build();
    }
    update(frames) { this.frames = frames; this.show(0); }
    get own() { return this.frame.x.values === null || this.frame.series.some(s => s.x); }
    places(s) { return s.x || this.frame.x.values; }
    fit() {
      const width = this.area.clientWidth, height = this.area.clientHeight;
      if (!width || matchMedia("print").matches) return;
      if (!this.chart) this.build(); else this.chart.setSize({width, height});
    }
    range(low, high) {
      const extra = this.frame.bands.flatMap(b => [b.low, b.high]);
      if (this.frame.least !== null) extra.push(this.frame.least);
      for (const s of this.frame.series) if (!this.hidden.has(s.name)) extra.push(...finite(s.low || []), ...finite(s.high || []));
      const all = finite([low, high, ...extra]);
      if (!all.length) return [0, 1];
      const [a, b] = [Math.min(...all), Math.max(...all)], room = 0.06 * (b - a || Math.abs(b) || 1);
      return [this.frame.least !== null && a >= this.frame.least ? this.frame.least : a - room, b + room];
    }
    build() {
      if (this.chart) this.chart.destroy();
      const f = this.frame, free = this.own, names = f.names.length;
      let data, series;
      if (free) {
        const xs = finite(f.series.flatMap(s => this.places(s))), ys = finite(f.series.flatMap(s => s.values));
        const ends = v => v.length ? [Math.min(...v), Math.max(...v)] : [0, 1];
        data = [ends(xs), ends(ys)];
        series = [{}, {show: true, paths: () => null, points: {show: false}, width: 0}];
      } else {
        data = [f.x.values, ...f.series.map(s => s.values)];
        series = [{}, ...f.series.map(s => ({
          label: s.name, show: !this.hidden.has(s.name), stroke: () => color(s.color), width: s.style === "points" ? 0 : s.width,
          fill: s.style === "bars" ? () => color(s.color) : undefined, spanGaps: false,
          paths: s.style === "bars" ? uPlot.paths.bars({size: [0.85, 60]}) : undefined,
          points: {show: s.style === "both" || s.style === "points", size: 6, fill: () => color(s.color), stroke: () => color(s.color)},
        }))];
      }
      const axis = {stroke: () => color("dim"), grid: {stroke: () => color("line"), width: .5}, ticks: {stroke: () => color("line"), width: .5}, font: "12px system-ui, sans-serif", labelFont: "12px system-ui, sans-serif", labelSize: 20, labelGap: 2};
      const place = free ? (u, a, b) => { const room = 0.04 * (b - a || 1); return [a - room, b + room]; } : names ? () => [-0.4, names - 0.6]
        : f.series.some(s => s.style === "bars") ? (u, a, b) => { const step = (b - a) / Math.max(f.x.values.length - 1, 1) || 1; return [a - .6 * step, b + .6 * step]; } : (u, a, b) => a === b ? [a - .5, b + .5] : [a, b];
      const key = f.link || undefined;
      this.chart = new uPlot({
        width: this.area.clientWidth, height: this.area.clientHeight, legend: {show: false}, series,
        scales: {x: {time: false, range: place}, y: {range: (u, a, b) => this.range(a, b)}},
        axes: [
          {...axis, label: f.x.label, size: 30, ...(names ? {splits: () => f.names.map((_, i) => i), values: () => f.names} : {values: (u, v) => v.map(plain)})},
          {...axis, label: f.y, values: (u, v) => v.map(plain), size: (u, v) => v ? 22 + 7 * Math.max(...v.map(w => String(w).length)) : 50},
        ],
        cursor: {drag: {x: !names, y: free, uni: 20}, points: free ? {show: false} : {size: 7}, sync: key && !free ? {key, scales: ["x", null]} : undefined},
        hooks: {
          drawClear: [u => this.bands(u)], draw: [u => this.marks(u)], setCursor: [u => this.hover(u)],
          setScale: [(u, k) => { if (k === "x" && !names) this.whole.style.visibility = this.zoomed(u) ? "visible" : "hidden"; }],
        },
      }, data, this.area);
      this.chart.over.append(this.dot);
    }
    zoomed(u) {
      const x = finite(u.data[0]);
      return x.length > 1 && (u.scales.x.min > Math.min(...x) + 1e-9 || u.scales.x.max < Math.max(...x) - 1e-9);
    }
    clipped(u, draw) {
      const c = u.ctx, {left, top, width, height} = u.bbox;
      c.save(); c.beginPath(); c.rect(left, top, width, height); c.clip(); draw(c); c.restore();
    }
    bands(u) {
      this.clipped(u, c => {
        c.fillStyle = color("band");
        for (const b of this.frame.bands) {
          const top = u.valToPos(b.high, "y", true), bottom = u.valToPos(b.low, "y", true);
          c.fillRect(u.bbox.left, top, u.bbox.width, Math.max(bottom - top, 1));
        }
      });
    }
    marks(u) {
      // Intervals of every figure; curves and points of those whose series have places of their own.
      const ratio = devicePixelRatio || 1;
      this.clipped(u, c => this.frame.series.forEach(s => {
        if (this.hidden.has(s.name)) return;
        const x = this.places(s).map(v => v === null ? NaN : u.valToPos(v, "x", true)), at = v => v === null ? NaN : u.valToPos(v, "y", true);
        c.strokeStyle = c.fillStyle = color(s.color);
        c.lineWidth = 1.5 * ratio;
        if (s.low) s.low.forEach((low, i) => { if (low !== null && s.high[i] !== null) { c.beginPath(); c.moveTo(x[i], at(low)); c.lineTo(x[i], at(s.high[i])); c.stroke(); } });
        if (!this.own) return;
        c.lineWidth = s.width * ratio;
        if (s.style !== "points") {
          c.beginPath();
          let open = false;
          s.values.forEach((v, i) => { const y = at(v); if (Number.isNaN(x[i] + y)) { open = false; return; } open ? c.lineTo(x[i], y) : c.moveTo(x[i], y); open = true; });
          c.stroke();
        }
        if (s.style !== "line") s.values.forEach((v, i) => { c.beginPath(); c.arc(x[i], at(v), 3 * ratio, 0, 7); c.fill(); });
      }));
    }
    hover(u) {
      const {left, top, idx} = u.cursor, f = this.frame;
      const say = (k, words) => { this.buttons[k].lastChild.textContent = words ? " " + words : ""; };
      this.dot.style.display = "none";
      if (left < 0 || idx === null || idx === undefined) { f.series.forEach((_, k) => say(k, "")); this.at.textContent = ""; return; }
      if (!this.own) {
        f.series.forEach((s, k) => say(k, plain(s.values[idx]) + (s.low && s.low[idx] !== null ? ` (${plain(s.low[idx])} to ${plain(s.high[idx])})` : "")));
        const where = f.names[f.x.values[idx]] || `${f.x.label} ${plain(f.x.values[idx])}`;
        const near = f.series.length > 12 ? this.nearest(u, left, top) : null;
        this.at.textContent = near ? `${near.s.name}: ${plain(near.s.values[near.i])}; ${where}` : where;
        return;
      }
      const near = this.nearest(u, left, top);
      f.series.forEach((s, k) => say(k, near && s === near.s ? plain(s.values[near.i]) : ""));
      if (!near) return;
      Object.assign(this.dot.style, {display: "block", left: near.x + "px", top: near.y + "px"});
      this.at.textContent = `${f.x.label} ${plain(this.places(near.s)[near.i])}, ${f.y} ${plain(near.s.values[near.i])}` + (near.s.labels ? `: ${near.s.labels[near.i]}` : "");
    }
    nearest(u, left, top) {
      let best = null;
      for (const s of this.frame.series) if (!this.hidden.has(s.name)) this.places(s).forEach((v, i) => {
        if (v === null || s.values[i] === null) return;
        const x = u.valToPos(v, "x"), y = u.valToPos(s.values[i], "y"), d = (x - left) ** 2 + (y - top) ** 2;
        if (!best || d < best.d) best = {s, i, x, y, d};
      });
      return best;
    }
    toggle(i) {
      const s = this.frame.series[i], hide = !this.hidden.has(s.name);
      hide ? this.hidden.add(s.name) : this.hidden.delete(s.name);
      this.buttons[i].setAttribute("aria-pressed", !hide);
      if (this.chart && !this.own) this.chart.setSeries(i + 1, {show: !hide}); else if (this.chart) this.build();
    }
    key(event) {
      const step = {ArrowLeft: -1, ArrowRight: 1}[event.key], u = this.chart;
      if (!step || !u || this.own) return;
      const k = Math.max(0, Math.min(u.data[0].length - 1, (u.cursor.idx ?? (step > 0 ? -1 : u.data[0].length)) + step));
      u.setCursor({left: u.valToPos(u.data[0][k], "x"), top: u.bbox.height / devicePixelRatio / 2});
      event.preventDefault();
    }
    csv() {
      const f = this.frame;
      const columns = s => s.low ? [s.name, s.name + " low", s.name + " high"] : [s.name];
      const cells = (s, i) => s.low ? [s.values[i], s.low[i], s.high[i]] : [s.values[i]];
      if (!this.own) return [[f.x.label, ...f.series.flatMap(columns)], ...f.x.values.map((x, i) => [f.names[x] || x, ...f.series.flatMap(s => cells(s, i))])];
      return [["series", f.x.label, f.y], ...f.series.flatMap(s => s.values.map((v, i) => [s.name, this.places(s)[i], v]))];
    }
    redraw() { if (this.chart) this.chart.redraw(false, true); }
  }

  const PALETTES = {
    depth: [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]],
    diverging: [[178, 24, 43], [244, 165, 130], [247, 247, 247], [146, 197, 222], [33, 102, 172]],
  };
  const tint = (palette, t) => {
    const stops = PALETTES[palette], at = Math.max(0, Math.min(1, t)) * (stops.length - 1), k = Math.min(Math.floor(at), stops.length - 2);
    return stops[k].map((v, i) => Math.round(v + (at - k) * (stops[k + 1][i] - v)));
  };
  const linkedMaps = new Map();

  class PixelMap {
    constructor(figure, [f]) {
      Object.assign(this, {figure, f, rows: f.values.length, columns: f.values[0].length});
      Object.assign(this, link(figure, () => f.title, () => f.values));
      this.words.textContent = f.title;
      this.area = make("div", null, {class: "area"});
      this.canvas = make("canvas", null, {role: "img", "aria-label": f.title});
      this.read = make("div", `${f.unit}: ${plain(f.low)} to ${plain(f.high)}`, {class: "read"});
      const scale = make("div", null, {class: "scale"}), bar = make("i");
      bar.style.background = `linear-gradient(90deg, ${PALETTES[f.palette].map(c => `rgb(${c})`).join(", ")})`;
      scale.append(plain(f.low), bar, `${plain(f.high)} ${f.unit}`);
      this.area.append(this.canvas);
      figure.append(this.area, scale, this.read);
      this.draw();
      if (!linkedMaps.has(f.link)) linkedMaps.set(f.link, []);
      if (f.link) linkedMaps.get(f.link).push(this);
      const all = () => f.link ? linkedMaps.get(f.link) : [this];
      this.canvas.onmousemove = event => {
        const box = this.canvas.getBoundingClientRect();
        const i = Math.min(this.columns - 1, Math.floor(this.columns * (event.clientX - box.left) / box.width));
        const j = Math.min(this.rows - 1, this.rows - 1 - Math.floor(this.rows * (event.clientY - box.top) / box.height));
        if (i >= 0 && j >= 0) all().forEach(map => map.hover(i, j));
      };
      this.canvas.onmouseleave = () => all().forEach(map => { map.draw(); map.read.textContent = ""; });
    }
    place(i, j) {
      const e = this.f.extent;
      return e ? `x ${plain(e[0] + (i + .5) * (e[1] - e[0]) / this.columns)} mm, y ${plain(e[2] + (j + .5) * (e[3] - e[2]) / this.rows)} mm` : (this.f.labels[j] || [])[i] || `${i}, ${j}`;
    }
    draw() {
      const {f, rows, columns, canvas} = this, size = Math.max(1, Math.floor(420 / columns)), high = Math.max(1, Math.round(size * f.aspect));
      Object.assign(canvas, {width: columns * size, height: rows * high});
      const c = canvas.getContext("2d");
      f.values.forEach((row, j) => row.forEach((v, i) => {
        c.fillStyle = v === null ? color("soft") : `rgb(${tint(f.palette, (v - f.low) / (f.high - f.low || 1))})`;
        c.fillRect(i * size, (rows - 1 - j) * high, size, high);
        const words = (f.labels[j] || [])[i];
        if (words) { c.fillStyle = v === null ? color("ink") : "#111"; c.font = "15px system-ui, sans-serif"; c.textAlign = "center"; c.fillText(words, (i + .5) * size, (rows - .5 - j) * high + 5); }
      }));
      c.strokeStyle = "#fff"; c.lineWidth = 2;
      for (const [x, y] of f.marks) {
        const [a, b, low, top] = f.extent, px = (x - a) / (b - a) * canvas.width, py = (top - y) / (top - low) * canvas.height;
        c.beginPath(); c.moveTo(px - 7, py); c.lineTo(px + 7, py); c.moveTo(px, py - 7); c.lineTo(px, py + 7); c.stroke();
      }
      this.size = [size, high];
    }
    hover(i, j) {
      this.draw();
      const c = this.canvas.getContext("2d"), [w, h] = this.size;
      c.strokeStyle = "#fff"; c.lineWidth = 3; c.strokeRect(i * w, (this.rows - 1 - j) * h, w, h);
      c.strokeStyle = "#000"; c.lineWidth = 1; c.strokeRect(i * w, (this.rows - 1 - j) * h, w, h);
      this.read.textContent = `${this.place(i, j)}: ${plain(this.f.values[j][i])} ${this.f.unit}`;
    }
    redraw() { this.draw(); }
  }

  const drawn = new Map();
  document.querySelectorAll("figure.plot, figure.map").forEach(figure => {
    const frames = JSON.parse(figure.querySelector("script").textContent);
    drawn.set(figure, figure.classList.contains("map") ? new PixelMap(figure, frames) : new Plot(figure, frames));
  });
  document.querySelectorAll(".slider").forEach(slider => {
    const range = slider.querySelector("input"), choice = slider.querySelector("select");
    const panels = [...slider.querySelectorAll("figure")].map(figure => drawn.get(figure));
    const show = k => { range.value = choice.value = k; panels.forEach(panel => panel.show(Number(k))); };
    range.oninput = () => show(range.value);
    choice.onchange = () => show(choice.value);
  });
  const redraw = () => drawn.forEach(one => one.redraw());
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  matchMedia("print").addEventListener("change", redraw);
  return {Plot, PixelMap, drawn};
})();
