// BLAKE3 by its official test vectors: byte `i` of the input is `i % 251`.

import assert from "node:assert/strict";
import { test } from "node:test";
import { Blake3 } from "../../assets/blake3.js";

const VECTORS = [
  [0, "af1349b9f5f9a1a6a0404dea36dcc9499bcb25c9adc112b7cc9a93cae41f3262"],
  [1, "2d3adedff11b61f14c886e35afa036736dcd87a74d27b5c1510225d0f592e213"],
  [63, "e9bc37a594daad83be9470df7f7b3798297c3d834ce80ba85d6e207627b7db7b"],
  [64, "4eed7141ea4a5cd4b788606bd23f46e212af9cacebacdc7d1f4c6dc7f2511b98"],
  [65, "de1e5fa0be70df6d2be8fffd0e99ceaa8eb6e8c93a63f2d8d1c30ecb6b263dee"],
  [1023, "10108970eeda3eb932baac1428c7a2163b0e924c9a9e25b35bba72b28f70bd11"],
  [1024, "42214739f095a406f3fc83deb889744ac00df831c10daa55189b5d121c855af7"],
  [1025, "d00278ae47eb27b34faecf67b4fe263f82d5412916c1ffd97c8cb7fb814b8444"],
  [2048, "e776b6028c7cd22a4d0ba182a8bf62205d2ef576467e838ed6f2529b85fba24a"],
  [2049, "5f4d72f40d7a5f82b15ca2b2e44b1de3c2ef86c426c95c1af0b6879522563030"],
  [3072, "b98cb0ff3623be03326b373de6b9095218513e64f1ee2edd2525c7ad1e5cffd2"],
  [5121, "628bd2cb2004694adaab7bbd778a25df25c47b9d4155a55f8fbd79f2fe154cff"],
  [8192, "aae792484c8efe4f19e2ca7d371d8c467ffb10748d8a5a1ae579948f718a2a63"],
  [102400, "bc3e3d41a1146b069abffad3c0d44860cf664390afce4d9661f7902e7943e085"],
];
const input = length => Uint8Array.from({ length }, (_, i) => i % 251);

test("digests are those of the test vectors", () => {
  for (const [length, digest] of VECTORS) assert.equal(new Blake3().update(input(length)).digest(), digest, `${length} bytes`);
});

test("pieces of any size give the digest of the whole", () => {
  for (const piece of [1, 7, 64, 100, 1024, 1500]) {
    const hasher = new Blake3();
    const bytes = input(5121);
    for (let at = 0; at < bytes.length; at += piece) hasher.update(bytes.subarray(at, at + piece));
    assert.equal(hasher.digest(), VECTORS[11][1], `pieces of ${piece}`);
  }
});

test("a digest in between changes nothing", () => {
  const hasher = new Blake3().update(input(1025));
  assert.equal(hasher.digest(), VECTORS[7][1]);
  const rest = input(2049).subarray(1025);
  assert.equal(hasher.update(rest).digest(), VECTORS[9][1]);
});
