// Other joints of the bus beside the page's own: a card for each, which looks at it and may stop it.

import { Joint } from "./joint.js";
import { Plots } from "./plot.js";

// What a card draws.
const DRAWN = ["position-actual-value", "velocity-actual-value", "torque-actual-value"];

function make(kind, text, name) {
  const made = document.createElement(kind);
  made.textContent = text;
  if (name) made.className = name;
  return made;
}

class Card {
  constructor(node, close) {
    this.element = make("article", "", "move");
    this.state = make("span", "not connected", "badge");
    this.faults = make("span", "", "badge bad");
    this.faults.hidden = true;
    const head = make("h3", `Joint ${node} `), place = document.createElement("div"), end = make("button", "Close");
    end.type = "button";
    end.onclick = close;
    head.append(this.state, " ", this.faults);
    this.element.append(head, place, end);
    this.plots = new Plots(place);
    this.places = [];
    this.joint = new Joint(`${node}/look`, (kind, value) => this[kind]?.(value));
  }

  connection(state) {
    if (state === "closed") this.tell("not connected", true);
  }

  hello({ signals }) {
    this.places = DRAWN.map((name) => signals.findIndex((signal) => signal.name === name)).filter((n) => n >= 0);
    this.plots.begin(this.places.map((place) => signals[place]));
  }

  live({ t, low, high }) {
    const drawn = (rows) => rows.map((row) => this.places.map((place) => row[place]));
    this.plots.push({ t, low: drawn(low), high: drawn(high) });
  }

  event(event) {
    this.plots.mark(event);
    if (event.kind === "state") this.tell(event.text, event.text.includes("fault"));
    if (event.kind !== "faults") return;
    this.faults.textContent = event.text;
    this.faults.hidden = event.text === "none";
  }

  failure(text) {
    this.tell(text, true);
  }

  tell(text, bad) {
    this.state.textContent = text;
    this.state.classList.toggle("bad", bad);
  }
}

export class Side {
  constructor(place) {
    this.place = place;
    this.cards = new Map();
  }

  shows(node) {
    return this.cards.has(node);
  }

  // Shows a joint, where the user looks for it, or no longer.
  toggle(node, seen = true) {
    const card = this.cards.get(node);
    if (card) {
      card.joint.socket.close();
      card.element.remove();
      this.cards.delete(node);
      return;
    }
    const opened = new Card(node, () => this.toggle(node));
    this.cards.set(node, opened);
    this.place.append(opened.element);
    if (seen) opened.element.scrollIntoView({ block: "nearest" });
  }

  // Newest value of a joint's signal; not a number where it shows none.
  latest(node, name) {
    return this.cards.get(node)?.plots.latest(name) ?? NaN;
  }

  stop() {
    for (const { joint } of this.cards.values()) joint.stop();
  }
}
