// A robot as a stick figure, drawn from what its joints say of their positions.

// Elevation of the view, rad; drag turns it about the vertical.
const ELEVATION = 0.35;

const turned = (m, [x, y, z]) => [0, 3, 6].map((row) => m[row] * x + m[row + 1] * y + m[row + 2] * z);
const added = (a, b) => a.map((value, place) => value + b[place]);

// Product of two matrices, row by row.
function times(a, b) {
  const at = (row, column) => a[row] * b[column] + a[row + 1] * b[3 + column] + a[row + 2] * b[6 + column];
  return [0, 3, 6].flatMap((row) => [0, 1, 2].map((column) => at(row, column)));
}

// Rotation by an angle about an axis of length 1 (Rodrigues).
function about([x, y, z], angle) {
  const c = Math.cos(angle), s = Math.sin(angle), d = 1 - c;
  return [c + x * x * d, x * y * d - z * s, x * z * d + y * s,
    y * x * d + z * s, c + y * y * d, y * z * d - x * s,
    z * x * d - y * s, z * y * d + x * s, c + z * z * d];
}

export class Robot {
  // `position(node)`: the joint's position, rad; not a number where it says none.
  constructor(place, position) {
    this.place = place;
    this.canvas = place.querySelector("canvas");
    this.position = position;
    this.joints = [];
    this.azimuth = 0.6;
    this.frames = 0;
    let from = null;
    this.canvas.onpointerdown = (event) => {
      from = event.clientX;
      this.canvas.setPointerCapture(event.pointerId);
    };
    this.canvas.onpointermove = (event) => {
      if (from === null) return;
      this.azimuth += (event.clientX - from) / 120;
      from = event.clientX;
    };
    this.canvas.onpointerup = this.canvas.onpointercancel = () => { from = null; };
  }

  // Joints as the server tells them, with a link to each one's own page.
  begin(joints, own) {
    const first = this.joints.length === 0;
    this.joints = joints;
    this.place.hidden = false;
    this.place.querySelector("figcaption").replaceChildren(...joints.map(({ name, node }) => {
      const link = document.createElement("a");
      link.href = `#node=${node}`;
      link.textContent = `${name} (node ${node})`;
      if (node === own) link.setAttribute("aria-current", "page");
      return link;
    }));
    const length = (v) => Math.hypot(...v);
    // The first joint is in the middle: the base is on one side of it, the rest of the arm anywhere around.
    this.middle = joints[0].origin;
    const arm = joints.slice(1).reduce((sum, { origin }) => sum + length(origin), 0);
    this.reach = Math.max(length(this.middle), arm + Math.max(...joints.map(({ tip }) => length(tip))));
    if (first) this.draw();
  }

  // Ends of each link, m in the frame of the base: the joint's origin, and those of the next joints or the link's centre.
  lines() {
    const frames = [];
    for (const { parent, origin, rotation, axis, node } of this.joints) {
      const before = parent === null ? { at: [0, 0, 0], turn: [1, 0, 0, 0, 1, 0, 0, 0, 1] } : frames[parent];
      const angle = this.position(node);
      const moved = Number.isFinite(angle) ? times(rotation, about(axis, angle)) : rotation;
      frames.push({ at: added(before.at, turned(before.turn, origin)), turn: times(before.turn, moved) });
    }
    const lines = this.joints.map(({ parent }, place) =>
      [parent === null ? [0, 0, 0] : frames[parent].at, frames[place].at]);
    const isLast = (place) => !this.joints.some(({ parent }) => parent === place);
    const tips = frames.map(({ at, turn }, place) => [at, added(at, turned(turn, this.joints[place].tip))]);
    return [...lines, ...tips.filter((_, place) => isLast(place))];
  }

  draw() {
    requestAnimationFrame(() => this.draw());
    const { canvas } = this, width = canvas.clientWidth, height = canvas.clientHeight;
    if (width === 0 || height === 0) return;
    const scale = devicePixelRatio;
    if (canvas.width !== Math.round(width * scale) || canvas.height !== Math.round(height * scale)) {
      [canvas.width, canvas.height] = [Math.round(width * scale), Math.round(height * scale)];
    }
    const context = canvas.getContext("2d"), style = getComputedStyle(canvas);
    const size = 0.45 * Math.min(width, height) / this.reach;
    const seen = (point) => {
      const [x, y, z] = added(point, this.middle.map((value) => -value));
      const across = -x * Math.sin(this.azimuth) + y * Math.cos(this.azimuth);
      const towards = x * Math.cos(this.azimuth) + y * Math.sin(this.azimuth);
      return [width / 2 + size * across,
        height / 2 - size * (z * Math.cos(ELEVATION) - towards * Math.sin(ELEVATION))];
    };
    context.setTransform(scale, 0, 0, scale, 0, 0);
    context.clearRect(0, 0, width, height);
    context.lineCap = "round";
    context.lineWidth = 5;
    context.strokeStyle = style.getPropertyValue("--c0");
    context.fillStyle = style.getPropertyValue("--c1");
    for (const [from, to] of this.lines()) {
      context.beginPath();
      context.moveTo(...seen(from));
      context.lineTo(...seen(to));
      context.stroke();
    }
    for (const [from] of this.lines()) {
      context.beginPath();
      context.arc(...seen(from), 6, 0, 2 * Math.PI);
      context.fill();
    }
    this.frames += 1;
  }
}
