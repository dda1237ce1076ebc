// Hashes a file beside the page: all of it, and each of its pieces.

import { Blake3 } from "./blake3.js";

addEventListener("message", async ({ data: { file, pieceBytes } }) => {
  try {
    const whole = new Blake3();
    const chunks = [];
    for (let at = 0; at < file.size; at += pieceBytes) {
      const piece = new Uint8Array(await file.slice(at, at + pieceBytes).arrayBuffer());
      whole.update(piece);
      chunks.push(new Blake3().update(piece).digest());
      postMessage({ hashed: at + piece.length });
    }
    postMessage({ digest: whole.digest(), chunks });
  } catch (error) {
    postMessage({ problem: error.message });
  }
});
