// Live use: both cameras' newest frames, and the networks' prediction as advice for the operator.

import { getPicture } from "/page/server.js";
import { fixed } from "/page/geometry.js";

const byId = (id) => document.getElementById(id);

// Pause between an answer and the next request, ms; longer while the program does not answer.
const PAUSE_MS = 150;
const FAILED_MS = 2000;

// Interval of checks of the frames' age, and timeout of an answer, ms.
const AGE_MS = 250;
const PATIENCE_MS = 5000;

// Age above which frames no longer show the current pose, s.
const OLD_S = 3;

// Labels below this value are diagnostic.
const NON_DIAGNOSTIC = 2.5;

// Describes an answer: what to do, why, and the class that sets the colour.
export function verdict({ prediction, refused }) {
  if (refused !== undefined) return ["Not judged", refused, "none"];
  const { quality, interval, diagnostic, correction_deg } = prediction;
  const range = interval ? `, between ${fixed(interval[0], 2)} and ${fixed(interval[1], 2)}` : "";
  const why = `quality ${fixed(quality, 2)}${range} (1 ideal, 3 inadequate)`;
  const good = diagnostic ?? (quality < NON_DIAGNOSTIC ? "yes" : "no");
  if (good === "yes") return ["Good", why, "good"];
  if (good === "not_sure") return ["Not sure", why, "unsure"];
  if (correction_deg === undefined) return ["Not good", `${why}; these networks predict no direction`, "rotate"];
  const direction = correction_deg >= 0 ? "inwards" : "outwards";
  return [`Rotate ${direction} by about ${fixed(Math.abs(correction_deg), 0)}°`, why, "rotate"];
}

export class LivePanel {
  constructor(actions) {
    this.actions = actions;
    this.number = 0;
    // Number of the current display; polls of an earlier one end.
    this.display = 0;
  }

  show() {
    const folder = this.actions.folder();
    byId("live").hidden = !folder;
    if (!folder) return;
    byId("live-folder").textContent = folder;
    this.hide();
    this.put();
    this.clock = setInterval(() => this.put(), AGE_MS);
    this.poll(this.display);
  }

  // Called when the program was restarted: it counts pairs from 1 again.
  forget() {
    this.number = 0;
  }

  hide() {
    this.display += 1;
    clearInterval(this.clock);
  }

  async poll(display) {
    let pause = PAUSE_MS;
    try {
      if (!document.hidden) this.take(await getPicture(`live/${this.number}`, AbortSignal.timeout(PATIENCE_MS)));
      this.failure = null;
    } catch (error) {
      this.failure = error.name === "TimeoutError" ? "the program does not answer" : error.message;
      pause = FAILED_MS;
    }
    if (display === this.display) setTimeout(() => display === this.display && this.poll(display), pause);
  }

  // Takes a newer pair, if any.
  take(newest) {
    if (!newest) return;
    const { picture, report } = newest;
    this.number = report.number;
    this.written = performance.now() - 1000 * report.age_s;
    this.answer = verdict(report.answer);
    byId("live-facts").textContent = `${report.name}, pair ${report.number}, judged in ${fixed(report.latency_ms, 0)} ms`;
    const image = byId("live-image");
    if (image.src) URL.revokeObjectURL(image.src);
    image.hidden = picture.size === 0;
    if (picture.size > 0) image.src = URL.createObjectURL(picture);
    this.put();
  }

  // Shows the answer while it applies to the current pose.
  put() {
    if (this.failure) return this.say("No answer", this.failure, "none");
    if (!this.answer) return this.say("No frames yet", "", "none");
    const seconds = (performance.now() - this.written) / 1000;
    const [what, why, kind] = this.answer;
    if (seconds > OLD_S) this.say("No new frames", `the last ones are ${fixed(seconds, 0)} s old: ${what}, ${why}`, "none");
    else this.say(what, why, kind);
  }

  // Unchanged texts are not rewritten, for screen readers.
  say(what, why, kind) {
    for (const [id, text] of [["live-answer", what], ["live-why", why]]) {
      if (byId(id).textContent !== text) byId(id).textContent = text;
    }
    byId("live-answer").className = kind;
  }
}
