// BLAKE3 (https://github.com/BLAKE3-team/BLAKE3-specs), hashing alone: the digests by which files are sent.

const IV = [0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a, 0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19];
const PERMUTATION = [2, 6, 3, 10, 7, 0, 4, 13, 1, 11, 12, 5, 9, 14, 15, 8];
const ROUNDS = 7;
const [CHUNK_START, CHUNK_END, PARENT, ROOT] = [1, 2, 4, 8];
const BLOCK_BYTES = 64;
const CHUNK_BYTES = 1024;
const BLOCKS_OF_CHUNK = CHUNK_BYTES / BLOCK_BYTES;

/** Which word of the message each step of each round takes: 16 a round. */
const SCHEDULE = (() => {
  const all = [];
  let order = PERMUTATION.map((_, i) => i);
  for (let round = 0; round < ROUNDS; round++) {
    all.push(...order);
    order = PERMUTATION.map(i => order[i]);
  }
  return Uint8Array.from(all);
})();

const state = new Int32Array(16);

function mix(a, b, c, d, x, y) {
  let [va, vb, vc, vd] = [state[a], state[b], state[c], state[d]];
  va = (va + vb + x) | 0;
  vd ^= va; vd = (vd >>> 16) | (vd << 16);
  vc = (vc + vd) | 0;
  vb ^= vc; vb = (vb >>> 12) | (vb << 20);
  va = (va + vb + y) | 0;
  vd ^= va; vd = (vd >>> 8) | (vd << 24);
  vc = (vc + vd) | 0;
  vb ^= vc; vb = (vb >>> 7) | (vb << 25);
  state[a] = va; state[b] = vb; state[c] = vc; state[d] = vd;
}

/** Compresses a block of 16 words into the chaining value `cv`, in place. */
function compress(cv, block, counter, length, flags) {
  for (let i = 0; i < 8; i++) state[i] = cv[i];
  for (let i = 0; i < 4; i++) state[8 + i] = IV[i];
  state[12] = counter | 0;
  state[13] = Math.floor(counter / 0x100000000);
  state[14] = length;
  state[15] = flags;
  for (let at = 0; at < 16 * ROUNDS; at += 16) {
    mix(0, 4, 8, 12, block[SCHEDULE[at]], block[SCHEDULE[at + 1]]);
    mix(1, 5, 9, 13, block[SCHEDULE[at + 2]], block[SCHEDULE[at + 3]]);
    mix(2, 6, 10, 14, block[SCHEDULE[at + 4]], block[SCHEDULE[at + 5]]);
    mix(3, 7, 11, 15, block[SCHEDULE[at + 6]], block[SCHEDULE[at + 7]]);
    mix(0, 5, 10, 15, block[SCHEDULE[at + 8]], block[SCHEDULE[at + 9]]);
    mix(1, 6, 11, 12, block[SCHEDULE[at + 10]], block[SCHEDULE[at + 11]]);
    mix(2, 7, 8, 13, block[SCHEDULE[at + 12]], block[SCHEDULE[at + 13]]);
    mix(3, 4, 9, 14, block[SCHEDULE[at + 14]], block[SCHEDULE[at + 15]]);
  }
  for (let i = 0; i < 8; i++) cv[i] = state[i] ^ state[i + 8];
}

/** Takes bytes piece by piece. */
export class Blake3 {
  #buffer = new Uint8Array(BLOCK_BYTES);
  #words = new Int32Array(16);
  #buffered = 0;
  #cv = Int32Array.from(IV);
  #blocks = 0;
  #chunk = 0;
  /** Roots of complete subtrees, the largest first. */
  #stack = [];

  update(bytes) {
    for (let at = 0; at < bytes.length;) {
      // The last block of all is kept back: it is compressed otherwise.
      if (this.#buffered === BLOCK_BYTES) this.#takeBlock();
      const taken = Math.min(BLOCK_BYTES - this.#buffered, bytes.length - at);
      this.#buffer.set(bytes.subarray(at, at + taken), this.#buffered);
      this.#buffered += taken;
      at += taken;
    }
    return this;
  }

  /** The digest, as 64 hexadecimal digits. More may be taken afterwards. */
  digest() {
    this.#buffer.fill(0, this.#buffered);
    this.#readWords();
    let [cv, block, length] = [this.#cv.slice(), this.#words, this.#buffered];
    let [counter, flags] = [this.#chunk, this.#chunkFlags(CHUNK_END)];
    for (let i = this.#stack.length - 1; i >= 0; i--) {
      compress(cv, block, counter, length, flags);
      block = Int32Array.of(...this.#stack[i], ...cv);
      [cv, counter, length, flags] = [Int32Array.from(IV), 0, BLOCK_BYTES, PARENT];
    }
    compress(cv, block, counter, length, flags | ROOT);
    const view = new DataView(new ArrayBuffer(32));
    cv.forEach((word, i) => view.setInt32(4 * i, word, true));
    return [...new Uint8Array(view.buffer)].map(byte => byte.toString(16).padStart(2, "0")).join("");
  }

  #chunkFlags(end) {
    return (this.#blocks === 0 ? CHUNK_START : 0) | end;
  }

  #readWords() {
    const bytes = this.#buffer;
    for (let i = 0; i < 16; i++) {
      this.#words[i] = bytes[4 * i] | (bytes[4 * i + 1] << 8) | (bytes[4 * i + 2] << 16) | (bytes[4 * i + 3] << 24);
    }
  }

  #takeBlock() {
    this.#readWords();
    const isLast = this.#blocks === BLOCKS_OF_CHUNK - 1;
    compress(this.#cv, this.#words, this.#chunk, BLOCK_BYTES, this.#chunkFlags(isLast ? CHUNK_END : 0));
    this.#buffered = 0;
    this.#blocks++;
    if (isLast) this.#takeChunk();
  }

  /** Joins subtrees of equal size, as many as the number of chunks ends in zero bits. */
  #takeChunk() {
    let node = this.#cv;
    this.#chunk++;
    for (let chunks = this.#chunk; chunks % 2 === 0; chunks /= 2) {
      const block = Int32Array.of(...this.#stack.pop(), ...node);
      node = Int32Array.from(IV);
      compress(node, block, 0, BLOCK_BYTES, PARENT);
    }
    this.#stack.push(node);
    this.#cv = Int32Array.from(IV);
    this.#blocks = 0;
  }
}
