//! The encoding of messages and store entries between processes of the same program. Each kind of agents gives the
//! network a codec, so that the network does not depend on their contents.

/// Version of the encoding, the first byte of each message and entry. A process rejects those of another version.
pub const WIRE_VERSION: u8 = 3;

/// An encoder and decoder of the contents of messages and the values of entries. The bytes to decode come from other
/// processes and are validated.
pub trait Codec: Send + Sync + 'static {
    /// The content of messages.
    type Content: Send + 'static;
    /// The value of an entry of the store.
    type Value: Send + 'static;
    /// The error for invalid bytes.
    type Error: std::error::Error + Send + Sync + 'static;

    /// Returns all languages, ontologies and protocols of messages, at most 255; the same in the same order in every
    /// process with this version, because messages refer to them by index.
    fn words(&self) -> &'static [&'static str];

    /// Encodes a content and appends it to `bytes`.
    fn write_content(&self, content: &Self::Content, bytes: &mut Vec<u8>);

    /// Returns a content written by [`Self::write_content`].
    ///
    /// # Errors
    /// The bytes are invalid.
    fn read_content(&self, bytes: &[u8]) -> Result<Self::Content, Self::Error>;

    /// Encodes a value and appends it to `bytes`.
    fn write_value(&self, value: &Self::Value, bytes: &mut Vec<u8>);

    /// Returns a value written by [`Self::write_value`].
    ///
    /// # Errors
    /// The bytes are invalid.
    fn read_value(&self, bytes: &[u8]) -> Result<Self::Value, Self::Error>;
}
