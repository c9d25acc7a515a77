// Connection to one joint: questions with answers, and the dead man's switch.

// Between two held-messages, ms. The server counts a hold as over after 200 ms.
const HELD = 50;

export class Joint {
  // `node`: 1 to 127, or "default", with "/look" behind it for a page that does not want to command; `tell(kind, value)`:
  // every message that is no answer.
  constructor(node, tell) {
    this.tell = tell;
    this.ids = 0;
    this.holds = 0;
    this.timer = null;
    this.open = new Map();
    this.socket = new WebSocket(`ws://${location.host}/joint/${node}`);
    this.socket.onopen = () => tell("connection", "open");
    this.socket.onclose = () => this.closed();
    this.socket.onmessage = (event) => this.take(JSON.parse(event.data));
  }

  closed() {
    this.release();
    for (const { reject } of this.open.values()) reject(new Error("the connection to the server is gone"));
    this.open.clear();
    this.tell("connection", "closed");
  }

  take(message) {
    if (!("answer" in message)) {
      for (const [kind, value] of Object.entries(message)) this.tell(kind, value);
      return;
    }
    const asked = this.open.get(message.answer);
    this.open.delete(message.answer);
    if (!asked) return;
    if ("error" in message) asked.reject(new Error(message.error));
    else asked.resolve(message.done);
  }

  // A message without an answer.
  say(ask) {
    this.ids += 1;
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify({ id: this.ids, ask }));
    return this.ids;
  }

  // The answer, or an error in words.
  ask(ask) {
    return new Promise((resolve, reject) => {
      if (this.socket.readyState !== WebSocket.OPEN) {
        reject(new Error("there is no connection to the server"));
        return;
      }
      this.open.set(this.say(ask), { resolve, reject });
    });
  }

  stop() {
    this.release();
    this.say("stop");
  }

  get held() {
    return this.timer !== null;
  }

  // Begins a hold, until `release`; its number. One that ended, for whatever reason, is not taken up again.
  hold() {
    this.release();
    this.holds += 1;
    const hold = this.holds;
    this.say({ held: { hold } });
    this.timer = setInterval(() => this.say({ held: { hold } }), HELD);
    return hold;
  }

  // Moves the joint until `release`.
  press(motion, reset) {
    return this.ask({ move: { hold: this.hold(), motion, reset } });
  }

  release() {
    if (this.timer === null) return;
    clearInterval(this.timer);
    this.timer = null;
    this.say("release");
  }
}
