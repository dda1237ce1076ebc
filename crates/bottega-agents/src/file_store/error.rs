//! Errors of file stores.

/// An error in opening, reading or writing a file store.
#[derive(Debug, thiserror::Error)]
pub enum FileStoreError {
    /// The file cannot be read or written.
    #[error("cannot use the file of the store")]
    Io(#[from] std::io::Error),
    /// The file is not a store, or is one of another version.
    #[error("this is not the file of a store, or it has another version")]
    Magic,
    /// The key, the value or all entries together exceed the store's limit in bytes, or the key is empty.
    #[error("too large for the store")]
    TooLarge,
}
