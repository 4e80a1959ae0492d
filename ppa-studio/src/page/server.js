// Requests to the program.

export class Refused extends Error {
  constructor(message, status) {
    super(message);
    this.status = status;
  }
}

// The program or the connection to it, such as a forwarded port, may have ended.
const SILENT = "ppa studio does not answer. Check the connection, or start it again: this page continues when it answers. Your changes are saved.";
// Pause between attempts to reach a program that does not answer, ms.
const RETRY_MS = 1000;

// Start time of the answering program.
let started = null;
let retrying = false;
let answers = () => {};

// Calls `call` when the program answers again; the argument is true if it was restarted since its last answer.
export function onAnswer(call) {
  answers = call;
}

// Whether an answer is from a restarted program.
function isOther(response) {
  const now = response.headers.get("x-started");
  const other = now !== null && started !== null && now !== started;
  started = now ?? started;
  return other;
}

async function request(path, options) {
  try {
    const response = await fetch(`/api/${path}`, options);
    if (isOther(response)) answers(true);
    return response;
  } catch (error) {
    if (error.name === "AbortError") throw error;
    retry();
    throw new Refused(SILENT, 0);
  }
}

async function retry() {
  if (retrying) return;
  retrying = true;
  let response = null;
  while (!response) {
    await new Promise((done) => { setTimeout(done, RETRY_MS); });
    response = await fetch("/api/opened").catch(() => null);
  }
  retrying = false;
  answers(isOther(response));
}

async function answered(response) {
  if (response.ok) return response;
  const text = await response.text();
  let sentence = text;
  try { sentence = JSON.parse(text).error ?? text; } catch { /* plain text */ }
  throw new Refused(sentence, response.status);
}

export async function getJson(path) {
  return (await answered(await request(path))).json();
}

export async function getBytes(path) {
  return (await answered(await request(path))).arrayBuffer();
}

export async function post(path, body = {}, signal = undefined) {
  const response = await request(path, {
    method: "POST",
    headers: { "content-type": "application/json" },
    body: JSON.stringify(body),
    signal,
  });
  return answered(response);
}

export async function postJson(path, body) {
  return (await post(path, body)).json();
}

// Requests an image with its report.
export async function postPicture(path, body, signal) {
  const response = await post(path, body, signal);
  const report = JSON.parse(response.headers.get("x-report") ?? "{}");
  return { picture: await response.blob(), report };
}

// The same, from a path that may have no image yet: null in that case.
export async function getPicture(path, signal) {
  const response = await answered(await request(path, { signal }));
  if (response.status === 204) return null;
  return { picture: await response.blob(), report: JSON.parse(response.headers.get("x-report")) };
}

// Makes calls one after another, so that their answers arrive in the order of the calls.
export function inTurn(call) {
  let previous = Promise.resolve();
  return (...values) => {
    const next = () => call(...values);
    previous = previous.then(next, next);
    return previous;
  };
}

// Calls `make` for the newest value only: during a call, later values replace each other.
export function newest(make) {
  let waiting = null;
  let busy = false;
  return async function next(value) {
    waiting = { value };
    if (busy) return;
    busy = true;
    try {
      while (waiting) {
        const { value } = waiting;
        waiting = null;
        await make(value);
      }
    } finally {
      busy = false;
    }
  };
}
