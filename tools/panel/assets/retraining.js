// A round of learning: how long it moves, what it finds, and the files that it leaves.

import { Led } from "./led.js";

export class Retraining extends Led {
  // `offer(files)`: files to save, which come before the new image is judged.
  constructor(joint, by, offer) {
    super(joint, by, "retrain", ["retrain"]);
    this.offer = offer;
  }

  wanted() {
    const number = (name) => {
      const value = this.by(`retrain-${name}`).valueAsNumber;
      if (!Number.isFinite(value)) throw new Error(`${name}: a number is wanted`);
      return value;
    };
    return { excitation: number("excitation"), validation: number("validation"), restarts: number("restarts"),
      acknowledge: this.by("retrain-acknowledge").checked };
  }

  begin() {
    const wanted = this.wanted();
    for (const id of ["judged", "learned"]) this.by(id).replaceChildren();
    return this.lead({ retrain: { wanted } });
  }

  take(told) {
    super.take(told);
    if (told.files) this.offer(told.files);
  }
}
