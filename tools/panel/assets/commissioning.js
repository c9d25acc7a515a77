// Commissioning: a plan to the joint, its questions to the user, and what it finds.

const NUMBERS = ["current", "current-limit", "pole-pairs", "counts", "torque-constant", "gear", "zero", "travel", "load",
  "inertia"];

export class Commissioning {
  constructor(joint, by) {
    this.joint = joint;
    this.by = by;
    this.question = null;
    this.commanding = false;
    this.running = false;
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

  // Until its end; what was found, or an error in words.
  async begin(indexOnly) {
    const plan = this.plan();
    for (const id of ["commission-log", "taken", "reports"]) this.by(id).replaceChildren();
    this.running = true;
    this.enable();
    try {
      return await this.joint.ask({ commission: { plan, index_only: indexOnly } });
    } finally {
      this.joint.release();
      this.running = false;
      this.enable();
      this.show(null);
    }
  }

  // A yes begins a hold that lasts until the next question.
  answer(yes) {
    const question = this.question;
    if (question === null) return null;
    // Answered once: another hold would end this one.
    this.show(null);
    return this.joint.ask({ agree: { question, hold: yes ? this.joint.hold() : null } });
  }

  take({ stage, found, question }) {
    if (stage) this.line(stage, "");
    if (found) this.line(found, "found");
    if (question !== undefined) this.show(question);
  }

  commands(commands) {
    this.commanding = commands;
    this.enable();
  }

  enable() {
    for (const id of ["commission", "find-index"]) this.by(id).disabled = !this.commanding || this.running;
    for (const id of ["question-yes", "question-no"]) this.by(id).disabled = !this.commanding;
  }

  show(question) {
    this.question = question?.number ?? null;
    this.by("question").hidden = !question;
    if (!question) return;
    // Nothing flows while it is open.
    this.joint.release();
    this.by("question-text").textContent = question.text;
    this.by("question").scrollIntoView({ block: "nearest" });
  }

  line(text, kind) {
    const line = document.createElement("li");
    line.textContent = text;
    line.className = kind;
    this.by("commission-log").append(line);
    this.by("commission-log").scrollTop = this.by("commission-log").scrollHeight;
  }
}
