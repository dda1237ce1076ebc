//! GLB, the binary container: glTF 2.0, section 4.4.

use super::error::GltfError;

/// The JSON and binary parts of a file.
#[derive(Debug, PartialEq)]
pub(super) struct Parts<'a> {
    pub(super) json: &'a [u8],
    /// The BIN chunk, which is the first buffer; `None` if the file is not a GLB or has none.
    pub(super) bin: Option<&'a [u8]>,
}

/// The first bytes of a GLB file.
pub(super) const MAGIC: &[u8; 4] = b"glTF";
const JSON: u32 = u32::from_le_bytes(*b"JSON");
const BIN: u32 = u32::from_le_bytes(*b"BIN\0");

/// Splits a file into its parts; a file without the magic of GLB is all JSON.
pub(super) fn split(file: &[u8]) -> Result<Parts<'_>, GltfError> {
    let Some(after_magic) = file.strip_prefix(MAGIC) else {
        return Ok(Parts { json: file, bin: None });
    };
    let (version, rest) = take_u32(after_magic).ok_or(GltfError::GlbHeader)?;
    if version != 2 {
        return Err(GltfError::GlbVersion(version));
    }
    let (length, _) = take_u32(rest).ok_or(GltfError::GlbHeader)?;
    let length = length as usize;
    if length > file.len() {
        return Err(GltfError::GlbTooShort { announced: length, bytes: file.len() });
    }
    // Ignore bytes beyond the announced length.
    let Some(mut chunks) = file.get(12..length) else {
        return Err(GltfError::GlbLength(length));
    };
    let mut parts = Parts { json: &[], bin: None };
    for index in 0.. {
        if chunks.is_empty() {
            break;
        }
        let (kind, data, rest) =
            take_chunk(chunks).map_err(|error| GltfError::GlbChunk { index, error: Box::new(error) })?;
        match (index, kind) {
            (0, JSON) => parts.json = data,
            (0, _) => return Err(GltfError::GlbWithoutJson),
            (1, BIN) => parts.bin = Some(data),
            // Chunks of other types are ignored.
            _ => {}
        }
        chunks = rest;
    }
    if parts.json.is_empty() { Err(GltfError::GlbEmptyJson) } else { Ok(parts) }
}

fn take_chunk(bytes: &[u8]) -> Result<(u32, &[u8], &[u8]), GltfError> {
    let (length, rest) = take_u32(bytes).ok_or(GltfError::ChunkHeader)?;
    let (kind, rest) = take_u32(rest).ok_or(GltfError::ChunkHeader)?;
    let (data, rest) = rest
        .split_at_checked(length as usize)
        .ok_or(GltfError::ChunkTooShort { announced: length, bytes: rest.len() })?;
    Ok((kind, data, rest))
}

fn take_u32(bytes: &[u8]) -> Option<(u32, &[u8])> {
    bytes.split_first_chunk().map(|(head, rest)| (u32::from_le_bytes(*head), rest))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Returns a GLB container around these parts.
    pub(in crate::gltf) fn glb(json: &str, bin: &[u8]) -> Vec<u8> {
        let mut chunks = Vec::new();
        for (kind, data, pad) in [(JSON, json.as_bytes(), b' '), (BIN, bin, 0)] {
            let length = data.len().next_multiple_of(4);
            chunks.extend((length as u32).to_le_bytes());
            chunks.extend(kind.to_le_bytes());
            chunks.extend(data);
            chunks.resize(chunks.len() + length - data.len(), pad);
        }
        let mut file = MAGIC.to_vec();
        file.extend(2u32.to_le_bytes());
        file.extend((chunks.len() as u32 + 12).to_le_bytes());
        file.extend(chunks);
        file
    }

    #[test]
    fn a_container_is_split_into_its_chunks() {
        let file = glb("{}", &[1, 2, 3]);
        assert_eq!(split(&file), Ok(Parts { json: b"{}  ", bin: Some(&[1, 2, 3, 0]) }));
        assert_eq!(split(b"{ }"), Ok(Parts { json: b"{ }", bin: None }));
    }

    #[test]
    fn a_container_cut_anywhere_is_an_error() {
        let file = glb("{\"asset\":{}}", &[1, 2, 3]);
        for length in 4..file.len() {
            assert!(split(&file[..length]).is_err(), "{length}");
        }
    }

    #[test]
    fn a_length_shorter_than_the_header_is_an_error() {
        for length in 0u32..12 {
            let mut file = glb("{}", &[]);
            file[8..12].copy_from_slice(&length.to_le_bytes());
            assert!(split(&file).is_err());
        }
    }
}
