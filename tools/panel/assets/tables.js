// Tables of the page. What comes from a joint is set as text.

function cell(row, text, kind) {
  const made = row.insertCell();
  if (text instanceof Node) made.append(text); else made.textContent = text ?? "";
  if (kind) made.className = kind;
  return made;
}

function heads(body, names) {
  body.replaceChildren();
  const row = body.insertRow();
  for (const name of names) {
    const made = document.createElement("th");
    made.scope = "col";
    made.textContent = name;
    row.append(made);
  }
}

export function checklist(body, items) {
  heads(body, ["", "", "found", "to do"]);
  for (const { name, done, found, remedy } of items) {
    const row = body.insertRow();
    cell(row, done ? "✓" : "missing", done ? "good" : "bad");
    cell(row, name);
    cell(row, found);
    cell(row, remedy, "quiet");
  }
}

// `side`: joints that are shown beside this one.
export function joints(body, list, own, side) {
  heads(body, ["node", "", "name", "state", "faults", "supply", "winding", "bridge"]);
  for (const joint of list) {
    const row = body.insertRow(), link = document.createElement("a");
    link.href = `#node=${joint.node}`;
    link.target = "_blank";
    link.rel = "noopener";
    link.textContent = joint.node;
    cell(row, joint.node === own ? `${own} (this page)` : link, "number");
    cell(row, joint.node === own ? "" : beside(joint.node, side));
    if (joint.error) {
      cell(row, joint.error, "bad").colSpan = 6;
      continue;
    }
    cell(row, joint.name);
    cell(row, joint.state);
    cell(row, joint.faults, joint.faults === "none" ? "" : "bad");
    for (const key of ["supply", "winding", "bridge"]) cell(row, joint[key], "number");
  }
}

function beside(node, side) {
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = "beside";
  const show = () => button.setAttribute("aria-pressed", String(side.shows(node)));
  button.onclick = () => {
    side.toggle(node);
    show();
  };
  show();
  return button;
}

export function history(body, { signals, steps }) {
  heads(body, steps.length ? ["step", "state", "faults", ...signals.map(({ name, unit }) => `${name}, ${unit}`)] : []);
  for (const { step, state, faults, signals: values } of steps) {
    const row = body.insertRow();
    cell(row, step, "number");
    cell(row, state);
    cell(row, faults, faults ? "bad" : "");
    for (const value of values) cell(row, value === null ? "" : Number(value.toPrecision(5)), "number");
  }
}

// The same as a table of comma-separated values.
export function historyTable({ signals, steps }) {
  const names = signals.map(({ name, unit }) => `${name}_${unit}`.replaceAll(/[ /]/g, "_"));
  const rows = steps.map(({ step, state, faults, signals: values }) =>
    [step, state, `"${faults}"`, ...values.map((value) => value ?? "")].join(","));
  return [["step", "state", "faults", ...names].join(","), ...rows, ""].join("\n");
}

export function taken(body, settings) {
  heads(body, ["setting", "value", ""]);
  for (const { name, value, unit } of settings) {
    const row = body.insertRow();
    cell(row, name);
    cell(row, Number(value.toPrecision(6)), "number");
    cell(row, unit, "quiet");
  }
}

export function images(body, told) {
  const words = (image) => image
    ? `version ${image.version}, ${image.model}, CRC-32 ${image.checksum}, slot ${image.slot}` : "none";
  heads(body, ["", ""]);
  for (const [name, text] of [["life cycle", told.life], ["in use", words(told.active)],
    ["previous", words(told.previous)], ["acting model", told.acting], ["shadow RMS", told.shadow]]) {
    const row = body.insertRow();
    cell(row, name, "quiet");
    cell(row, text);
  }
}

// What is unexplained and how far the joint is from its reference, RMS, before and with the new image.
export function judged(body, { before, after }) {
  heads(body, ["on the joint, RMS", "before", "now"]);
  for (const [name, unit, scale, key] of [["unexplained torque", "Nm", 1, "residual"],
    ["distance from the reference", "mrad", 1000, "tracking"]]) {
    const row = body.insertRow();
    cell(row, name, "quiet");
    for (const on of [before, after]) cell(row, `${(scale * on[key]).toFixed(4)} ${unit}`, "number");
  }
}

// Objects with a field for each that can be written; `changes` holds what was typed, by name.
export class Objects {
  constructor(body, changed) {
    this.body = body;
    this.changed = changed;
    this.list = [];
    this.changes = new Map();
  }

  set(list) {
    this.list = list;
    this.changes.clear();
    this.changed();
  }

  // A value that is not the joint's yet.
  change(name, value) {
    this.changes.set(name, value);
    this.changed();
  }

  show(find, settingsAlone) {
    heads(this.body, ["name", "value", "", "unit", "range", "meaning"]);
    const wanted = find.toLowerCase();
    for (const object of this.list) {
      if (settingsAlone && !object.setting) continue;
      if (!`${object.name} ${object.object} ${object.text}`.toLowerCase().includes(wanted)) continue;
      const row = this.body.insertRow(), name = cell(row, object.name);
      name.title = object.object;
      cell(row, object.shown, "number");
      cell(row, object.writable ? this.field(object, row) : "");
      cell(row, object.unit);
      cell(row, object.limits ? object.limits.join(" to ") : "", "number");
      cell(row, object.text, "quiet");
      row.classList.toggle("changed", this.changes.has(object.name));
    }
  }

  field(object, row) {
    const field = document.createElement("input");
    field.setAttribute("aria-label", `new value of ${object.name}`);
    field.placeholder = "new value";
    field.value = this.changes.get(object.name) ?? "";
    field.oninput = () => {
      if (field.value.trim() === "") this.changes.delete(object.name);
      else this.changes.set(object.name, field.value);
      row.classList.toggle("changed", this.changes.has(object.name));
      this.changed();
    };
    return field;
  }
}
