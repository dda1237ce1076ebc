//! The form in which messages and entries of the store travel between processes of the same program: what each kind of agents
//! gives a network, so that the network need not know what they talk about.

/// The layout of messages and entries. A process of another layout reads none of them; it is refused with a reason when it joins.
pub const WIRE_VERSION: u8 = 3;

/// Writes and reads the contents of messages and the values of entries. Bytes that are read come from another process and are
/// checked.
pub trait Codec: Send + Sync + 'static {
    /// The content of messages.
    type Content: Send + 'static;
    /// The value of an entry of the store.
    type Value: Send + 'static;
    /// The reason why bytes are refused.
    type Error: std::error::Error + Send + Sync + 'static;

    /// All languages, ontologies and protocols of messages, the same in each version of the layout.
    fn words(&self) -> &'static [&'static str];

    /// Appends a content.
    fn write_content(&self, content: &Self::Content, bytes: &mut Vec<u8>);

    /// Reads what [`Self::write_content`] wrote, and nothing else.
    ///
    /// # Errors
    /// It is something else.
    fn read_content(&self, bytes: &[u8]) -> Result<Self::Content, Self::Error>;

    /// Appends a value.
    fn write_value(&self, value: &Self::Value, bytes: &mut Vec<u8>);

    /// Reads what [`Self::write_value`] wrote, and nothing else.
    ///
    /// # Errors
    /// It is something else.
    fn read_value(&self, bytes: &[u8]) -> Result<Self::Value, Self::Error>;
}
