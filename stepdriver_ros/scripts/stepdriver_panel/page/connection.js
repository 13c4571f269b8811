// The connection to the panel's server. It comes back by itself, but never repeats a command: what is
// clicked without a connection does nothing.

const SILENCE = 3000; // [ms] without an update: the connection is lost
const FIRST_PAUSE = 500; // [ms] before the next try; it doubles
const LONGEST_PAUSE = 5000;
const WRONG_TOKEN = 4403;

// The link has the token behind its #, which browsers don't send to anyone. It is kept for this tab only.
function tokenOfLink() {
  const inLink = location.hash.slice(1);
  if (inLink) {
    sessionStorage.setItem("token", inLink);
    history.replaceState(null, "", location.pathname);
  }
  return sessionStorage.getItem("token") ?? "";
}

export class Connection {
  #socket = null;
  #token = tokenOfLink();
  #pause = FIRST_PAUSE;
  #calls = new Map();
  #last = 0;
  #heard = 0;
  #update;
  #say;
  #shutOut = false;

  // update: called with each update of the server, and with null if the connection is lost.
  // say: called with (whether it is good news, a text).
  constructor(update, say) {
    this.#update = update;
    this.#say = say;
    this.tick = 0; // the number of the newest update
    this.number = null; // the server's number for this page
    this.key = "";
    this.#open();
    setInterval(() => this.#watch(), 250);
  }

  get token() {
    return this.#token;
  }

  get isOpen() {
    return this.#socket?.readyState === WebSocket.OPEN && this.number !== null;
  }

  get isShutOut() {
    return this.#shutOut;
  }

  // Headers of further requests of this page.
  get headers() {
    return { Authorization: `Bearer ${this.#token}`, "X-Page": this.key };
  }

  // Sends a command. Returns whether it was sent. done: called with its answer.
  send(what, fields = {}, done = null) {
    if (!this.isOpen) {
      this.#say(false, `${what.replace("_", " ")}: nothing was sent, because there is no connection`);
      return false;
    }
    const id = ++this.#last;
    this.#calls.set(id, { what, done });
    this.#socket.send(JSON.stringify({ id, do: what, ...fields }));
    return true;
  }

  // Sends a message that gets no answer unless it is refused.
  repeat(what, fields) {
    if (this.isOpen) this.#socket.send(JSON.stringify({ id: 0, do: what, ...fields }));
  }

  #open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/socket`);
    this.#socket = socket;
    this.#heard = performance.now();
    socket.addEventListener("open", () => socket.send(JSON.stringify({ token: this.#token, was: this.key })));
    socket.addEventListener("message", (event) => {
      if (socket === this.#socket) this.#take(JSON.parse(event.data));
    });
    socket.addEventListener("close", (event) => {
      if (socket === this.#socket) this.#lose(event.code);
    });
  }

  #take(update) {
    this.#heard = performance.now();
    this.tick = update.tick;
    for (const answer of update.answers ?? []) {
      if (answer.welcome) {
        this.number = answer.welcome.number;
        this.key = answer.welcome.key;
        this.#pause = FIRST_PAUSE;
      } else {
        const call = this.#calls.get(answer.id);
        this.#calls.delete(answer.id);
        this.#say(answer.ok, answer.text, answer);
        call?.done?.(answer);
      }
    }
    this.#update(update);
  }

  #lose(code) {
    this.#socket = null;
    this.number = null;
    this.#shutOut = code === WRONG_TOKEN;
    for (const call of this.#calls.values()) {
      this.#say(false, `${call.what.replace("_", " ")}: the connection was lost before the answer, so it may or may not have been carried out`);
    }
    this.#calls.clear();
    this.#update(null);
    if (this.#shutOut) return;
    setTimeout(() => this.#open(), this.#pause);
    this.#pause = Math.min(2 * this.#pause, LONGEST_PAUSE);
  }

  // A network that is gone closes nothing.
  #watch() {
    if (this.#socket === null || performance.now() - this.#heard < SILENCE) return;
    const socket = this.#socket;
    socket.close();
    this.#lose(0);
  }
}
