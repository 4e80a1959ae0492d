// Requests to the program.

export class Refused extends Error {
  constructor(message, status) {
    super(message);
    this.status = status;
  }
}

// The program may have ended, or the way to it, such as a forwarded port.
const SILENT = "ppa studio does not answer. Check the connection, or start it again and open the address that it prints: what was changed is saved.";

async function request(path, options) {
  try {
    return await fetch(`/api/${path}`, options);
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Refused(SILENT, 0);
  }
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

// An image with its report.
export async function postPicture(path, body, signal) {
  const response = await post(path, body, signal);
  const report = JSON.parse(response.headers.get("x-report") ?? "{}");
  return { picture: await response.blob(), report };
}

// The same from an address that may have no image yet: null then.
export async function getPicture(path, signal) {
  const response = await answered(await request(path, { signal }));
  if (response.status === 204) return null;
  return { picture: await response.blob(), report: JSON.parse(response.headers.get("x-report")) };
}

// Calls `make` for the newest value only: while one call is under way, later values replace each other.
export function newest(make) {
  let waiting = null;
  let busy = false;
  return async function next(value) {
    waiting = { value };
    if (busy) return;
    busy = true;
    while (waiting) {
      const { value } = waiting;
      waiting = null;
      await make(value);
    }
    busy = false;
  };
}
