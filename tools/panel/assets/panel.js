// The page: messages of the joint to its parts, buttons to questions.

import { Commissioning } from "./commissioning.js";
import { Joint } from "./joint.js";
import { Plots } from "./plot.js";
import { Retraining } from "./retraining.js";
import { Robot } from "./robot.js";
import { Side } from "./side.js";
import * as tables from "./tables.js";

const by = (id) => document.getElementById(id);
const number = (id) => {
  const value = by(id).valueAsNumber;
  if (!Number.isFinite(value)) throw new Error(`${id.replace("-", ", ")}: a number is wanted`);
  return value;
};
const plots = new Plots(by("plots"));
const objects = new tables.Objects(by("objects"), () => { by("set").disabled = objects.changes.size === 0; });
const slow = new Map();
const side = new Side(by("side"));
// Every joint that this page shows.
const stop = () => {
  joint.stop();
  side.stop();
};
const POSITION = "position-actual-value";
const robot = new Robot(by("robot"), (at) => (at === node ? plots.latest(POSITION) : side.latest(at, POSITION)));
const panel = { plots, side, robot, problems: [], latest: (name) => plots.latest(name), isHeld: () => joint.held };
let node = null;
window.panel = panel;
window.addEventListener("error", (event) => panel.problems.push(event.message));

function log(text, bad) {
  const line = document.createElement("li"), list = by("log");
  line.textContent = `${new Date().toLocaleTimeString()}  ${text}`;
  if (bad) line.className = "bad";
  list.prepend(line);
  while (list.childElementCount > 300) list.lastElementChild.remove();
}

function alert(text) {
  by("alert").textContent = text ?? "";
  by("alert").hidden = !text;
  if (text) log(text, true);
}

function badge(id, text, kind) {
  by(id).textContent = text;
  by(id).className = `badge ${kind ?? ""}`;
  by(id).hidden = text === "";
}

const take = {
  connection(state) {
    if (state === "open") return;
    badge("state", "not connected", "bad");
    alert("The connection to the server is gone: the server has stopped the joint. Load this page anew.");
    by("moves").disabled = true;
  },
  hello(hello) {
    node = hello.node;
    document.title = `Joint ${node}`;
    by("title").textContent = `Joint ${node}`;
    plots.begin(hello.signals);
    by("by-part").setAttribute("aria-pressed", String(hello.signals.some(({ name }) => name === "physical-torque")));
    by("new-board").replaceChildren(...["", ...hello.boards].map((name) => {
      const option = document.createElement("option");
      option.value = name;
      option.textContent = name ? `a new ${name}` : "–";
      return option;
    }));
    if (hello.robot) {
      robot.begin(hello.robot, node);
      for (const { node: other } of hello.robot) if (other !== node && !side.shows(other)) side.toggle(other, false);
    }
    alert(null);
  },
  commission(told) {
    commissioning.take(told);
  },
  retrain(told) {
    retraining.take(told);
  },
  role(role) {
    for (const led of [commissioning, retraining]) led.commands(role === "commands");
    badge("role", role === "commands" ? "this page commands" : "this page looks on", "quiet");
    by("moves").disabled = role !== "commands";
  },
  live(live) {
    plots.push(live);
    by("lost").textContent = live.lost ? `${live.lost} ${live.lost === 1 ? "sample" : "samples"} lost` : "";
  },
  event(event) {
    plots.mark(event);
    if (event.kind === "state") badge("state", event.text, event.text.includes("fault") ? "bad" : "");
    if (event.kind === "faults") badge("faults", event.text === "none" ? "" : event.text, "bad");
    log(`${event.t.toFixed(3)} s  ${event.kind}: ${event.text}`, event.kind === "emcy");
  },
  slow({ title: text, name, shown }) {
    if (!slow.has(name)) {
      const entry = document.createElement("div"), title = document.createElement("dt");
      slow.set(name, document.createElement("dd"));
      title.textContent = text;
      entry.append(title, slow.get(name));
      by("values").append(entry);
    }
    slow.get(name).textContent = shown;
  },
  motion({ moving, reason, state }) {
    if (moving) {
      log("moving");
      return;
    }
    joint.release();
    lift();
    log(`stopped: ${reason}; ${state}`);
  },
  stopped({ state, error }) {
    log(error ? `STOP: ${error}` : `STOP: ${state}`, Boolean(error));
  },
  silent(silent) {
    alert(silent ? "No live values: the joint is not OPERATIONAL. Look again starts it." : null);
  },
  failure: alert,
  error: alert,
};

const wanted = /^#node=(\d{1,3})$/.exec(location.hash);
const joint = new Joint(wanted ? wanted[1] : "default", (kind, value) => take[kind]?.(value));
const commissioning = new Commissioning(joint, by);
const retraining = new Retraining(joint, by, (files) => offer("learned", files));
panel.isLed = () => commissioning.running || retraining.running;
addEventListener("hashchange", () => location.reload());

// A button's question; an error goes where it is seen.
function on(id, act, event = "click") {
  by(id).addEventListener(event, async () => {
    try {
      await act();
      alert(null);
    } catch (error) {
      alert(error.message);
    }
  });
}

function save(name, content) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([content]));
  link.download = name;
  link.click();
  URL.revokeObjectURL(link.href);
}

function button(text, act) {
  const made = document.createElement("button");
  made.type = "button";
  made.textContent = text;
  made.onclick = act;
  return made;
}

// Buttons for each file, whose content is text or bytes; one with a path is a report, shown in the frame below.
function offer(id, files) {
  const frame = by(`${id}-frame`);
  frame.hidden = true;
  by(id).replaceChildren(...files.flatMap(({ name, text, bytes, path }) => {
    const saves = button(`Save ${name}`, () => save(name, text ?? new Uint8Array(bytes)));
    if (!path) return [saves];
    const shows = button(`Show ${name}`, () => {
      frame.hidden = !frame.hidden;
      if (!frame.hidden) frame.src = path;
    });
    return [saves, shows];
  }));
}

// Motions, each for as long as its button or key is held.
const MOTIONS = {
  "jog-back": () => ({ jog: { velocity: -number("jog-velocity") } }),
  "jog-forward": () => ({ jog: { velocity: number("jog-velocity") } }),
  sine: () => ({ sine: { amplitude: number("sine-amplitude"), frequency: number("sine-frequency") } }),
  steps: () => ({ steps: { step: number("steps-step"), dwell: number("steps-dwell") } }),
  impedance: () => ({ impedance: {
    offset: number("impedance-offset"), stiffness: number("impedance-stiffness"), damping: number("impedance-damping"),
  } }),
};
const KEYS = { ArrowLeft: "jog-back", ArrowRight: "jog-forward" };

function lift() {
  for (const button of document.querySelectorAll(".held")) button.classList.remove("held");
}

function letGo() {
  joint.release();
  lift();
}

async function press(id) {
  if (by("moves").disabled) return;
  try {
    const asked = joint.press(MOTIONS[id](), by("reset").checked);
    by(id).classList.add("held");
    await asked;
    alert(null);
  } catch (error) {
    letGo();
    alert(error.message);
  }
}

for (const id of Object.keys(MOTIONS)) {
  const button = by(id);
  button.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    button.setPointerCapture(event.pointerId);
    press(id);
  });
  for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) button.addEventListener(end, letGo);
  button.addEventListener("contextmenu", (event) => event.preventDefault());
}

const types = (target) => target instanceof Element && target.closest("input:not([type=checkbox]), select, textarea");
addEventListener("keydown", (event) => {
  // STOP, whatever has the focus.
  if (event.code === "Space") {
    event.preventDefault();
    stop();
    lift();
    return;
  }
  const id = KEYS[event.code];
  if (!id || event.repeat || event.ctrlKey || event.altKey || event.metaKey || types(event.target)) return;
  event.preventDefault();
  press(id);
}, true);
addEventListener("keyup", (event) => {
  if (KEYS[event.code]) letGo();
});
addEventListener("blur", letGo);
addEventListener("pagehide", letGo);
document.addEventListener("visibilitychange", letGo);
by("stop").addEventListener("pointerdown", () => {
  stop();
  lift();
});
// Without a pointer: by the keyboard, or by what reads the page aloud.
by("stop").addEventListener("click", (event) => {
  if (event.detail === 0) stop();
});

plots.changed = () => {
  by("pause").setAttribute("aria-pressed", String(plots.end !== null));
};
by("pause").onclick = () => {
  if (plots.end === null) plots.pause(); else plots.live();
  plots.changed();
};
by("window").onchange = () => {
  plots.span = Number(by("window").value);
  plots.draw();
};
on("csv", async () => save(`joint-${node}.csv`, await joint.ask("csv")));
on("look", () => joint.ask("look"));
on("by-part", () => joint.ask({ draw: { by_part: by("by-part").getAttribute("aria-pressed") === "false" } }));

on("load-checklist", async () => tables.checklist(by("checklist"), await joint.ask("checklist")));
let history = null;
on("load-history", async () => {
  history = await joint.ask("history");
  by("save-history").disabled = history.steps.length === 0;
  tables.history(by("history"), history);
  if (history.steps.length === 0) log("no fault is latched: there are no steps before one");
});
on("save-history", () => save(`joint-${node}-fault.csv`, tables.historyTable(history)));
on("address", async () => {
  const given = await joint.ask({ address: { first: number("address-first") } });
  for (const { node: id, address } of given) log(`node ${id}: ${address}`);
  if (given.length === 0) log("no joint without a node id answers");
  await scan();
});
const scan = async () => tables.joints(by("joints"), await joint.ask("scan"), node, side);
on("load-scan", scan);

on("commission", async () => finished(await commissioning.begin(false)));
on("find-index", async () => finished(await commissioning.begin(true)));
for (const led of [commissioning, retraining]) {
  on(`${led.part}-yes`, () => led.answer(true));
  on(`${led.part}-no`, () => led.answer(false));
}
on("retrain", async () => {
  const learned = await retraining.begin();
  tables.judged(by("judged"), learned);
  for (const difference of learned.load) retraining.line(difference, "found");
  log(`version ${learned.version} is stored and in use where compensation is requested`);
  told(await joint.ask("images"));
});
function finished(found) {
  log(found ? "commissioned" : "the encoder knows its zero until its next loss of power");
  if (!found) return;
  if (found.error) throw new Error(`commissioned; no report: ${found.error}`);
  tables.taken(by("taken"), found.settings);
  offer("reports", found.files);
  if (found.index) log("the encoder's index is to be found after each power-up");
}

const show = () => objects.show(by("find").value, by("only-settings").checked);
const stored = async () => { by("stored").textContent = `What is in use: ${await joint.ask("stored")}.`; };
const read = async () => {
  objects.set(await joint.ask("objects"));
  show();
  await stored();
};
by("find").oninput = show;
by("only-settings").onchange = show;
on("load-objects", read);
on("set", async () => {
  const done = await joint.ask({ set: { values: [...objects.changes] } });
  for (const { name, shown } of done) log(`${name} is ${shown}`);
  await read();
});
on("store", async () => {
  await joint.ask("store");
  log("stored");
  await stored();
});
on("export", async () => save(`joint-${node}.toml`, await joint.ask("export")));
on("import", async () => {
  const [file] = by("import").files;
  by("import").value = "";
  const done = file ? await joint.ask({ import: { text: await file.text() } }) : [];
  const changed = done.map(({ name, shown }) => `${name} ${shown}`).join(", ");
  log(changed ? `${file.name}: ${changed}` : "nothing differs");
  await read();
}, "change");

// What differs becomes changed values, which nothing has set yet.
async function compare(other) {
  const differences = await joint.ask({ compare: { with: other } });
  await read();
  for (const { name, value } of differences) objects.change(name, String(value));
  log(`${differences.length} settings differ`);
  show();
}
on("new-board", async () => {
  const board = by("new-board").value;
  if (board !== "") await compare({ board });
}, "change");
on("compare", async () => {
  const [file] = by("compare").files;
  by("compare").value = "";
  if (file) await compare({ file: await file.text() });
}, "change");

const told = (state) => {
  tables.images(by("images"), state);
  by("requested").value = String(state.requested);
};
const usage = (name) => (name === "shadow" || name === "trial" ? { [name]: number("image-time") } : name);
let uploaded = null;
on("load-images", async () => told(await joint.ask("images")));
on("requested", async () => {
  if (by("requested").value === "") return;
  await joint.ask({ set: { values: [["requested-model", by("requested").value]] } });
  told(await joint.ask("images"));
}, "change");
by("image").onchange = () => { uploaded = null; };
for (const name of ["verify", "shadow", "trial", "commit"]) {
  on(name, async () => {
    const [file] = by("image").files;
    if (!file) throw new Error("choose an image file first");
    // The same file again is taken a step further without being sent.
    if (uploaded === file && name !== "verify") {
      told(await joint.ask({ use: { usage: usage(name) } }));
    } else {
      const image = [...new Uint8Array(await file.arrayBuffer())];
      told(await joint.ask({ upload: { image, usage: usage(name) } }));
      uploaded = file;
    }
    log(`${file.name}: ${name}`);
  });
}
on("discard", async () => {
  uploaded = null;
  told(await joint.ask("discard"));
});
on("roll-back", async () => told(await joint.ask("roll-back")));
panel.plots.count = () => plots.strokes;
panel.plots.drawn = () => plots.frames;
