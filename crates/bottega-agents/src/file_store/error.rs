//! Errors of file stores.

/// An error in opening, reading or writing a file store.
#[derive(Debug, thiserror::Error)]
pub enum FileStoreError {
    /// The file cannot be read or written.
    #[error("cannot use the file of the store")]
    Io(#[from] std::io::Error),
    /// The file is not a store, or of another version.
    #[error("this is not the file of a store, or it has another version")]
    Magic,
    /// A limit on the size is exceeded.
    #[error("too large for the store")]
    TooLarge,
}
