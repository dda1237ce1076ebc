// The files in a zip archive. The browser inflates them; what an archive says of itself is believed only as far as it holds.

/** Files and bytes that are taken at most: an archive with more is refused before anything is inflated. */
export const FILES_MAX = 10_000;
export const BYTES_MAX = 2 ** 31;

const END = 0x06054b50, END_BYTES = 22, COMMENT_MAX = 0xffff;
const ENTRY = 0x02014b50, ENTRY_BYTES = 46;
const LOCAL = 0x04034b50, LOCAL_BYTES = 30;
const STORED = 0, DEFLATED = 8;

/** Names and contents of the files in an archive: `[[name, Blob]]`. Throws an error with a readable message if it is not an archive, or too large. */
export async function unzipped(archive, limits = { files: FILES_MAX, bytes: BYTES_MAX }) {
  let entries;
  try {
    entries = await entriesOf(archive, limits);
  } catch (error) {
    // Numbers that point beyond the end.
    throw error instanceof RangeError ? new Error("This is not a complete zip archive: it was cut off, or is damaged.") : error;
  }
  const files = [];
  for (const entry of entries) files.push([entry.name, await contentOf(archive, entry)]);
  return files;
}

const viewOf = async (archive, start, end) => new DataView(await archive.slice(start, end).arrayBuffer());

/** What the directory at the end says of the files. */
async function entriesOf(archive, limits) {
  const tail = await viewOf(archive, Math.max(0, archive.size - END_BYTES - COMMENT_MAX), archive.size);
  let end = tail.byteLength - END_BYTES;
  while (end >= 0 && tail.getUint32(end, true) !== END) end -= 1;
  if (end < 0) throw new RangeError("no end");
  const [count, length, start] = [tail.getUint16(end + 10, true), tail.getUint32(end + 12, true), tail.getUint32(end + 16, true)];
  if (count === 0xffff || start === 0xffffffff) throw new Error("The archive is of the kind zip64: unpack it, and drop the folder.");
  if (count > limits.files) throw new Error(`The archive holds ${count} files; at most ${limits.files} are allowed.`);
  const directory = await viewOf(archive, start, start + length);
  const entries = [];
  let [at, bytes] = [0, 0];
  for (let number = 0; number < count; number += 1) {
    const entry = entryAt(directory, at);
    at += entry.length;
    // Folders, and what one system adds to its archives.
    if (entry.name.endsWith("/") || entry.name.startsWith("__MACOSX/")) continue;
    bytes += entry.size;
    if (bytes > limits.bytes) throw new Error(`The archive holds more than ${Math.round(limits.bytes / 1e6)} MB.`);
    entries.push(entry);
  }
  return entries;
}

function entryAt(directory, at) {
  if (directory.getUint32(at, true) !== ENTRY) throw new RangeError("no entry");
  const u16 = offset => directory.getUint16(at + offset, true);
  const u32 = offset => directory.getUint32(at + offset, true);
  const letters = new Uint8Array(directory.buffer, directory.byteOffset + at + ENTRY_BYTES, u16(28));
  const name = new TextDecoder().decode(letters).replaceAll("\\", "/");
  if (u16(8) & 1) throw new Error(`\`${name}\` in the archive is encrypted.`);
  if (![STORED, DEFLATED].includes(u16(10))) throw new Error(`\`${name}\` is packed in a way that browsers do not unpack.`);
  if (name.startsWith("/") || /^[a-z]:/i.test(name) || name.split("/").includes("..")) {
    throw new Error(`\`${name}\` in the archive lies outside its folder.`);
  }
  return {
    name, method: u16(10), packed: u32(20), size: u32(24), start: u32(42),
    length: ENTRY_BYTES + u16(28) + u16(30) + u16(32),
  };
}

/** The content of a file; never more bytes than its entry says. */
async function contentOf(archive, { name, method, packed, size, start }) {
  const damaged = () => new Error(`\`${name}\` in the archive is damaged.`);
  const local = await viewOf(archive, start, start + LOCAL_BYTES);
  if (local.byteLength < LOCAL_BYTES || local.getUint32(0, true) !== LOCAL) throw damaged();
  const from = start + LOCAL_BYTES + local.getUint16(26, true) + local.getUint16(28, true);
  const data = archive.slice(from, from + packed);
  if (data.size !== packed) throw damaged();
  const content = method === STORED ? data : await inflated(data, size).catch(() => null);
  if (content?.size !== size) throw damaged();
  return content;
}

async function inflated(data, size) {
  const reader = data.stream().pipeThrough(new DecompressionStream("deflate-raw")).getReader();
  const chunks = [];
  for (let bytes = 0; ;) {
    const { done, value } = await reader.read();
    if (done) return new Blob(chunks);
    bytes += value.length;
    if (bytes > size) {
      await reader.cancel();
      return null;
    }
    chunks.push(value);
  }
}
