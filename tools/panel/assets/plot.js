// Curves over time: strokes with minimum and maximum, so that no peak between two pixels is lost. Zoom, pause, a cursor
// with values, marks at events.

// Strokes that are kept: more than a minute at 4 ms.
const KEPT = 16384;
// Time between two readings of the numbers beside names, ms: nobody reads faster.
const READ = 100;
// Mean time between two frames, ms: more of them would leave STOP less of the machine. Time for which the axis moves on
// after a message, ms.
const PERIOD = 25, GOES_ON = 200;
const LEFT = 58, RIGHT = 8, TOP = 6, BOTTOM = 18;
const COLOURS = ["--c0", "--c1", "--c2", "--c3", "--c4", "--c5"];
// Smallest span of an axis, in the unit of the curve: noise of a joint at rest does not fill the plot.
const SPAN = { rad: 0.01, "rad/s": 0.1, Nm: 0.5, V: 1 };

// A step of 1, 2 or 5 times a power of ten that divides `span` into some `count` parts.
function step(span, count) {
  const raw = span / count, power = 10 ** Math.floor(Math.log10(raw)), part = raw / power;
  return power * (part < 1.5 ? 1 : part < 3.5 ? 2 : part < 7.5 ? 5 : 10);
}

function digits(value, by) {
  return value.toFixed(Math.max(0, Math.min(7, -Math.floor(Math.log10(by)))));
}

export class Plots {
  constructor(place) {
    this.place = place;
    this.groups = [];
    this.marks = [];
    this.span = 10;
    this.end = null; // Right end, s; null: now.
    this.cursor = null;
    this.frames = 0;
    this.strokes = 0;
    this.due = false;
    this.colours = new Map();
    // Times of the next frame, of the last numbers beside names, and of the last strokes, ms.
    [this.frameDue, this.read, this.arrived] = [0, 0, 0];
    this.begin([]);
    new ResizeObserver(() => this.draw()).observe(place);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.colours.clear();
      this.draw();
    });
  }

  // Signals with name and unit. Those of a unit share a plot.
  begin(signals) {
    this.signals = signals;
    this.size = 0;
    this.next = 0;
    this.time = new Float64Array(KEPT);
    this.low = signals.map(() => new Float32Array(KEPT));
    this.high = signals.map(() => new Float32Array(KEPT));
    this.marks = [];
    this.end = null;
    this.place.replaceChildren();
    const groups = new Map();
    signals.forEach((signal, number) => {
      // The external torque's bound is the whole rated torque where nothing is known: it has a plot of its own.
      const key = signal.name.startsWith("external") ? "external" : signal.unit || signal.name;
      if (!groups.has(key)) groups.set(key, { unit: signal.unit, numbers: [] });
      groups.get(key).numbers.push(number);
    });
    this.groups = [...groups.values()].map((group) => this.group(group));
    this.draw();
  }

  group({ unit, numbers }) {
    const figure = document.createElement("figure"), legend = document.createElement("figcaption");
    const canvas = document.createElement("canvas");
    figure.className = "plot";
    legend.className = "legend";
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${numbers.map((n) => this.signals[n].name).join(", ")} over time`);
    const curves = numbers.map((number, place) => {
      const button = document.createElement("button"), colour = document.createElement("i");
      const value = document.createElement("span");
      const curve = { number, colour: COLOURS[place % COLOURS.length], shown: true, value };
      colour.style.background = `var(${curve.colour})`;
      value.className = "number";
      button.type = "button";
      button.setAttribute("aria-pressed", "true");
      button.append(colour, `${this.signals[number].name} `, value);
      button.onclick = () => {
        curve.shown = !curve.shown;
        button.setAttribute("aria-pressed", String(curve.shown));
        this.draw();
      };
      legend.append(button);
      return curve;
    });
    figure.append(legend, canvas);
    this.place.append(figure);
    this.listen(canvas);
    return { unit, curves, canvas };
  }

  listen(canvas) {
    let from = null;
    const at = (event) => {
      const box = canvas.getBoundingClientRect();
      return (event.clientX - box.left - LEFT) / Math.max(1, box.width - LEFT - RIGHT);
    };
    canvas.onpointerdown = (event) => {
      if (this.end === null) return;
      from = { part: at(event), end: this.end };
      canvas.setPointerCapture(event.pointerId);
    };
    canvas.onpointermove = (event) => {
      if (from) this.end = from.end - (at(event) - from.part) * this.span;
      this.cursor = at(event);
      this.draw();
    };
    canvas.onpointerup = canvas.onpointercancel = () => { from = null; };
    canvas.onpointerleave = () => {
      this.cursor = null;
      this.draw();
    };
    canvas.ondblclick = () => this.live();
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const part = Math.min(1, Math.max(0, at(event))), before = this.right() - (1 - part) * this.span;
      this.span = Math.min(60, Math.max(0.05, this.span * 1.2 ** Math.sign(event.deltaY)));
      this.end = before + (1 - part) * this.span;
      this.changed?.();
      this.draw();
    }, { passive: false });
  }

  // Takes strokes: their times, and minimum and maximum of each signal.
  push({ t, low, high }) {
    t.forEach((time, n) => {
      this.time[this.next] = time;
      low[n].forEach((value, signal) => { this.low[signal][this.next] = value ?? NaN; });
      high[n].forEach((value, signal) => { this.high[signal][this.next] = value ?? NaN; });
      this.next = (this.next + 1) % KEPT;
      this.size = Math.min(KEPT, this.size + 1);
    });
    this.strokes += t.length;
    this.arrived = performance.now();
    if (this.end === null) this.draw();
  }

  mark({ t, kind, text }) {
    this.marks.push({ t, kind, text });
    if (this.marks.length > 500) this.marks.shift();
  }

  // Newest value of a signal.
  latest(name) {
    const number = this.signals.findIndex((signal) => signal.name === name);
    return number < 0 || this.size === 0 ? NaN : this.high[number][(this.next + KEPT - 1) % KEPT];
  }

  pause() {
    this.end = this.right();
    this.draw();
  }

  live() {
    this.end = null;
    this.changed?.();
    this.draw();
  }

  right() {
    if (this.end !== null) return this.end;
    if (!this.size) return this.span;
    const since = Math.max(0, Math.min(GOES_ON, performance.now() - this.arrived));
    return this.time[(this.next + KEPT - 1) % KEPT] + since / 1e3;
  }

  // Places in the rings whose times are shown, the oldest first.
  range() {
    const right = this.right(), left = right - this.span, oldest = this.next + KEPT - this.size;
    const place = (n) => (oldest + n) % KEPT;
    let first = 0, last = this.size;
    while (first < last) {
      const middle = (first + last) >> 1;
      if (this.time[place(middle)] < left) first = middle + 1; else last = middle;
    }
    let after = first;
    while (after < this.size && this.time[place(after)] <= right) after += 1;
    return { left, right, first: Math.max(0, first - 1), after, place };
  }

  draw() {
    if (this.due) return;
    this.due = true;
    requestAnimationFrame((now) => this.frame(now));
  }

  frame(now) {
    if (now < this.frameDue) {
      requestAnimationFrame((later) => this.frame(later));
      return;
    }
    this.frameDue = Math.max(this.frameDue + PERIOD, now);
    this.due = false;
    this.frames += 1;
    const range = this.range(), reads = this.cursor !== null || now - this.read >= READ;
    if (reads) this.read = now;
    this.groups.forEach((group, n) => {
      this.paint(group, range, (name) => this.colour(name), n === 0);
      if (reads) this.values(group.curves, group.unit, range);
    });
    // Between two messages time goes on.
    if (this.end === null && now - this.arrived < GOES_ON) this.draw();
  }

  // A colour of the style sheet; asking for it has the browser compute styles.
  colour(name) {
    if (!this.colours.has(name)) {
      this.colours.set(name, getComputedStyle(document.documentElement).getPropertyValue(name));
    }
    return this.colours.get(name);
  }

  paint({ unit, curves, canvas }, { left, right, first, after, place }, colour, isFirst) {
    const scale = devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * scale) || canvas.height !== Math.round(height * scale)) {
      canvas.width = Math.round(width * scale);
      canvas.height = Math.round(height * scale);
    }
    const to = canvas.getContext("2d");
    to.setTransform(scale, 0, 0, scale, 0, 0);
    to.clearRect(0, 0, width, height);
    let bottom = Infinity, top = -Infinity;
    for (const { number } of curves.filter((curve) => curve.shown)) {
      for (let n = first; n < after; n += 1) {
        const low = this.low[number][place(n)], high = this.high[number][place(n)];
        if (low < bottom) bottom = low;
        if (high > top) top = high;
      }
    }
    if (!(top >= bottom)) [bottom, top] = [0, 0];
    const least = SPAN[unit] ?? 0.1, missing = Math.max(0, least - (top - bottom)) / 2;
    const pad = 0.06 * (top - bottom);
    [bottom, top] = [bottom - missing - pad, top + missing + pad];
    const x = (time) => LEFT + (time - left) / (right - left) * (width - LEFT - RIGHT);
    const y = (value) => TOP + (top - value) / (top - bottom) * (height - TOP - BOTTOM);
    this.axes(to, { left, right, bottom, top, width, height, x, y, unit }, colour);
    to.save();
    to.beginPath();
    to.rect(LEFT, 0, width - LEFT - RIGHT, height - BOTTOM);
    to.clip();
    this.paintMarks(to, { left, right, x, height }, colour, isFirst);
    for (const curve of curves.filter((curve) => curve.shown)) {
      to.strokeStyle = colour(curve.colour);
      to.lineWidth = 1.4;
      to.lineJoin = "bevel";
      to.beginPath();
      let pen = false, n = first;
      while (n < after) {
        let low = this.low[curve.number][place(n)], high = this.high[curve.number][place(n)];
        const at = x(this.time[place(n)]);
        n += 1;
        if (Number.isNaN(low)) { pen = false; continue; }
        // Strokes of one pixel are one: its minimum and maximum are theirs.
        while (n < after && x(this.time[place(n)]) < at + 1 / scale) {
          const less = this.low[curve.number][place(n)], more = this.high[curve.number][place(n)];
          if (Number.isNaN(less)) break;
          if (less < low) low = less;
          if (more > high) high = more;
          n += 1;
        }
        if (pen) to.lineTo(at, y(high)); else to.moveTo(at, y(high));
        if (low !== high) to.lineTo(at, y(low));
        pen = true;
      }
      to.stroke();
    }
    if (this.cursor !== null) {
      to.strokeStyle = colour("--quiet");
      to.lineWidth = 1;
      to.beginPath();
      to.moveTo(LEFT + this.cursor * (width - LEFT - RIGHT), 0);
      to.lineTo(LEFT + this.cursor * (width - LEFT - RIGHT), height);
      to.stroke();
    }
    to.restore();
  }

  axes(to, { left, right, bottom, top, width, height, x, y, unit }, colour) {
    to.font = "11px system-ui, sans-serif";
    to.lineWidth = 1;
    to.strokeStyle = colour("--line");
    to.fillStyle = colour("--quiet");
    to.textAlign = "right";
    to.textBaseline = "middle";
    const rows = step(top - bottom, 4), columns = step(right - left, Math.max(2, width / 120));
    to.beginPath();
    for (let value = Math.ceil(bottom / rows) * rows; value <= top; value += rows) {
      to.moveTo(LEFT, Math.round(y(value)) + 0.5);
      to.lineTo(width - RIGHT, Math.round(y(value)) + 0.5);
      if (y(value) > TOP + 12) to.fillText(digits(value, rows), LEFT - 5, y(value));
    }
    to.textAlign = "center";
    to.textBaseline = "bottom";
    for (let time = Math.ceil(left / columns) * columns; time <= right; time += columns) {
      to.moveTo(Math.round(x(time)) + 0.5, TOP);
      to.lineTo(Math.round(x(time)) + 0.5, height - BOTTOM);
      if (x(time) < width - 30) to.fillText(digits(time, columns), x(time), height - 2);
    }
    to.stroke();
    to.textAlign = "right";
    to.fillText("s", width - RIGHT, height - 2);
    to.textBaseline = "top";
    to.fillText(unit, LEFT - 5, 0);
  }

  paintMarks(to, { left, right, x, height }, colour, isFirst) {
    to.textAlign = "left";
    to.textBaseline = "top";
    to.setLineDash([3, 3]);
    let free = -Infinity; // From here on there is room for a word.
    for (const mark of this.marks.filter((mark) => mark.t >= left && mark.t <= right)) {
      const bad = mark.kind === "emcy" || (mark.kind === "faults" && mark.text !== "none");
      to.strokeStyle = to.fillStyle = colour(bad ? "--bad" : "--quiet");
      to.beginPath();
      to.moveTo(x(mark.t), 0);
      to.lineTo(x(mark.t), height);
      to.stroke();
      const worded = mark.kind === "state" || bad;
      const text = mark.text.split(" (")[0].slice(0, 24);
      if (isFirst && worded && x(mark.t) >= free) {
        to.fillText(text, x(mark.t) + 3, TOP);
        free = x(mark.t) + 8 + to.measureText(text).width;
      }
    }
    to.setLineDash([]);
  }

  // Values under the cursor, or the newest ones, beside the names.
  values(curves, unit, { left, right, first, after, place }) {
    let at = after - 1;
    if (this.cursor !== null) {
      const time = left + this.cursor * (right - left);
      at = first;
      while (at < after - 1 && this.time[place(at + 1)] <= time) at += 1;
    }
    for (const { number, value } of curves) {
      const mean = at < first ? NaN : (this.low[number][place(at)] + this.high[number][place(at)]) / 2;
      value.textContent = Number.isFinite(mean) ? `${mean.toFixed(this.signals[number].worded ? 0 : 3)} ${unit}` : "–";
    }
  }
}
