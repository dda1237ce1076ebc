//! Why a file is no store.

/// Why a file is no store.
#[derive(Debug, thiserror::Error)]
pub enum FileStoreError {
    /// The file cannot be read or written.
    #[error("cannot use the file of the store")]
    Io(#[from] std::io::Error),
    /// It is something else.
    #[error("this is no file of a store, or one of another version")]
    Magic,
    /// There is no room for it.
    #[error("too large for the store")]
    TooLarge,
}
