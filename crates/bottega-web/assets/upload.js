// Sends files piece by piece. What has come stays: called again, only what is missing is sent.

import { ask } from "./api.js";

export const PIECE_BYTES = 4 << 20;
const TRIES = 6;
const PIECES_AT_ONCE = 2;

const pause = seconds => new Promise(done => setTimeout(done, 1000 * seconds));

/** The digests of a file and of its pieces. `onProgress(bytes)` is called with the bytes read so far. */
function hash(file, onProgress) {
  const worker = new Worker("/hash_worker.js", { type: "module" });
  return new Promise((resolve, reject) => {
    worker.onmessage = ({ data }) => {
      if (data.hashed !== undefined) onProgress(data.hashed);
      else if (data.problem) reject(new Error(`cannot read ${file.name}: ${data.problem}`));
      else resolve(data);
    };
    worker.onerror = event => reject(new Error(event.message || "the hashing script does not start"));
    worker.postMessage({ file, pieceBytes: PIECE_BYTES });
  }).finally(() => worker.terminate());
}

/** Does something that asks the farm, again after a while where it does not answer. */
export async function persist(work, wait = pause) {
  for (let attempt = 1; ; attempt++) {
    try {
      return await work();
    } catch (error) {
      const mayPass = error.status === undefined || error.status === 429 || error.status === 503 || error.status === 408;
      if (!mayPass || attempt === TRIES) throw error;
      await wait(2 ** (attempt - 1));
    }
  }
}

/**
 * Sends a file. `onProgress(step, share)` is called with the progress of a step.
 *
 * Returns its digest.
 */
export async function sendFile(name, file, onProgress) {
  const { digest, chunks } = await hash(file, bytes => onProgress("reading", bytes / file.size));
  const offer = { name, size: file.size, digest, chunks };
  const { missing } = await persist(() => ask("POST", "/uploads", offer));
  let sent = 0;
  const left = [...missing];
  const send = async () => {
    for (let piece = left.shift(); piece !== undefined; piece = left.shift()) {
      const at = chunks.indexOf(piece) * PIECE_BYTES;
      await persist(() => ask("PUT", `/uploads/chunks/${piece}`, file.slice(at, at + PIECE_BYTES)));
      onProgress("sending", ++sent / missing.length);
    }
  };
  await Promise.all(Array.from({ length: PIECES_AT_ONCE }, send));
  onProgress("sent", 1);
  return digest;
}
