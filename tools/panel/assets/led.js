// A sequence that the page leads: its stages, what it finds, and the questions to which the user says yes or no.

export class Led {
  // `part`: the prefix of its elements' ids; `buttons`: the ids of those that begin it.
  constructor(joint, by, part, buttons) {
    this.joint = joint;
    this.by = by;
    this.part = part;
    this.buttons = buttons;
    this.question = null;
    this.commanding = false;
    this.running = false;
  }

  // Until its end; what the joint answers, or an error in words.
  async lead(ask) {
    this.by(`${this.part}-log`).replaceChildren();
    this.running = true;
    this.enable();
    try {
      return await this.joint.ask(ask);
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
    for (const id of this.buttons) this.by(id).disabled = !this.commanding || this.running;
    for (const id of ["yes", "no"]) this.by(`${this.part}-${id}`).disabled = !this.commanding;
  }

  show(question) {
    this.question = question?.number ?? null;
    this.by(`${this.part}-question`).hidden = !question;
    if (!question) return;
    // Nothing flows while it is open.
    this.joint.release();
    this.by(`${this.part}-text`).textContent = question.text;
    this.by(`${this.part}-question`).scrollIntoView({ block: "nearest" });
  }

  line(text, kind) {
    const line = document.createElement("li"), log = this.by(`${this.part}-log`);
    line.textContent = text;
    line.className = kind;
    log.append(line);
    log.scrollTop = log.scrollHeight;
  }
}
