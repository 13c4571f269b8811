// Jogging by press and hold. The axis moves only while a button is held and messages arrive at the server:
// each names the newest update that has reached this page.

const PERIOD = 40; // [ms] between messages

export class HeldButton {
  #connection;
  #timer = null;
  #button = null;
  #pointer = null;
  #press = 0; // counts them: a jog that has ended doesn't begin again with the same one

  constructor(connection) {
    this.#connection = connection;
    // Whatever takes the page or the pointer away ends the jog.
    window.addEventListener("blur", () => this.end());
    window.addEventListener("pagehide", () => this.end());
    document.addEventListener("visibilitychange", () => this.end());
    document.addEventListener("contextmenu", (event) => {
      if (this.#button) event.preventDefault();
    });
  }

  // velocity: a function that returns that of the axis [mm/s|deg/s].
  watch(button, axis, velocity) {
    button.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      event.preventDefault();
      button.focus();
      button.setPointerCapture(event.pointerId);
      this.#pointer = event.pointerId;
      this.#begin(button, axis, velocity());
    });
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) {
      button.addEventListener(name, (event) => {
        if (event.pointerId === this.#pointer) this.end();
      });
    }
    button.addEventListener("keydown", (event) => {
      if (event.key !== "Enter") return;
      event.preventDefault();
      if (!event.repeat) this.#begin(button, axis, velocity());
    });
    button.addEventListener("keyup", (event) => {
      if (event.key === "Enter") this.end();
    });
    button.addEventListener("blur", () => this.end());
  }

  end() {
    if (this.#button === null) return;
    clearInterval(this.#timer);
    this.#button.classList.remove("held");
    this.#button = null;
    this.#pointer = null;
    this.#connection.repeat("jog_end", {});
  }

  #begin(button, axis, velocity) {
    this.end();
    this.#press += 1;
    const message = () => ({ axis, velocity, press: this.#press, tick: this.#connection.tick });
    // The first one is a command like any other: without a connection, it says so.
    if (!this.#connection.isOpen) {
      this.#connection.send("jog", message());
      return;
    }
    this.#button = button;
    button.classList.add("held");
    this.#connection.repeat("jog", message());
    this.#timer = setInterval(() => this.#connection.repeat("jog", message()), PERIOD);
  }
}
