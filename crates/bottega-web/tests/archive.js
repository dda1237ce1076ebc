// Zip archives for the tests.

import { deflateRawSync } from "node:zlib";

/** An archive; `change` falsifies what it says of a file. */
export function zip(files, change = () => ({})) {
  const [parts, directory] = [[], []];
  let at = 0;
  for (const [name, content, isStored] of files) {
    const [letters, plain] = [Buffer.from(name), Buffer.from(content)];
    const packed = isStored ? plain : deflateRawSync(plain);
    const entryFields = { flags: 0x800, method: isStored ? 0 : 8, packed: packed.length, size: plain.length, start: at, ...change(name) };
    const local = Buffer.alloc(30);
    local.writeUInt32LE(0x04034b50, 0);
    local.writeUInt16LE(letters.length, 26);
    const entry = Buffer.alloc(46);
    entry.writeUInt32LE(0x02014b50, 0);
    entry.writeUInt16LE(entryFields.flags, 8);
    entry.writeUInt16LE(entryFields.method, 10);
    entry.writeUInt32LE(entryFields.packed, 20);
    entry.writeUInt32LE(entryFields.size, 24);
    entry.writeUInt16LE(letters.length, 28);
    entry.writeUInt32LE(entryFields.start, 42);
    parts.push(local, letters, packed);
    directory.push(entry, letters);
    at += 30 + letters.length + packed.length;
  }
  const end = Buffer.alloc(22);
  end.writeUInt32LE(0x06054b50, 0);
  end.writeUInt16LE(files.length, 10);
  end.writeUInt32LE(Buffer.concat(directory).length, 12);
  end.writeUInt32LE(at, 16);
  return new Blob([...parts, ...directory, end]);
}
