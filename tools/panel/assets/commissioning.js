// Commissioning: what the user says of the joint, and what is asked for with it.

import { Led } from "./led.js";

const NUMBERS = ["current", "current-limit", "pole-pairs", "counts", "torque-constant", "gear", "zero", "travel", "load",
  "inertia"];

export class Commissioning extends Led {
  constructor(joint, by) {
    super(joint, by, "commission", ["commission", "find-index"]);
  }

  // What the user says; an empty field says nothing.
  plan() {
    const plan = { turn: this.by("plan-turn").checked, acknowledge: this.by("plan-acknowledge").checked };
    for (const name of NUMBERS) {
      const input = this.by(`plan-${name}`);
      if (input.validity.badInput) throw new Error(`${name}: a number is wanted`);
      if (input.value !== "") plan[name] = input.valueAsNumber;
    }
    for (const name of ["current", "travel"]) {
      if (!(name in plan)) throw new Error(`${name}: a number is wanted`);
    }
    return plan;
  }

  begin(indexOnly) {
    const plan = this.plan();
    for (const id of ["taken", "reports"]) this.by(id).replaceChildren();
    return this.lead({ commission: { plan, index_only: indexOnly } });
  }
}
