//! Errors of decoding a picture.

/// An error in a picture file, as a clause about "it".
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum PictureError {
    /// The picture has more pixels than [`LoadOptions::max_image_pixels`](crate::LoadOptions::max_image_pixels).
    #[error("the picture has {width} × {height} pixels, more than the limit of {max}")]
    TooManyPixels { width: u64, height: u64, max: u64 },
    /// The bytes are not a picture in a supported format.
    #[error("{found}")]
    UnknownFormat { found: &'static str },
    #[error("it has {width} × {height} pixels")]
    NoPixels { width: u32, height: u32 },
    /// The length of the file contradicts its header.
    #[error("{0}")]
    TooShort(String),
    #[error("it is damaged or of an unknown kind ({0})")]
    Damaged(String),
    #[error("it uses a feature of {format} that is not read ({detail}); save it again with common settings")]
    UnsupportedFeature { format: &'static str, detail: String },
    #[error("it has no channels R, G and B, or Y, but {found}")]
    NoColor { found: String },
    /// Another error of a picture of floats.
    #[error("{0}")]
    Float(String),
    #[error("it changed while it was read")]
    Changed,
    #[error("its texels are of the unknown kind {0}")]
    UnknownTexels(String),
    #[error("its size contradicts its kind")]
    WrongSize,
    #[error("there is no memory for {0}")]
    NoMemory(String),

    #[error("its header has no size")]
    PfmWithoutSize,
    #[error("its header has no scale")]
    PfmWithoutScale,
    #[error("it announces {width} × {height} pixels, but has only {bytes} bytes for them")]
    PfmTooShort { width: u32, height: u32, bytes: usize },

    #[error("its KTX2 container is cut off")]
    Ktx2CutOff,
    #[error("its KTX2 texture is not one flat picture")]
    Ktx2NotFlat,
    #[error("it has {width} × {height} pixels, too many for a KTX2 texture")]
    Ktx2TooManyPixels { width: u32, height: u32 },
    #[error("its KTX2 data is compressed by scheme {0}, which is not supported")]
    Ktx2Scheme(u32),
    #[error("its KTX2 colour model {0} is not supported")]
    Ktx2ColorModel(u8),
    #[error("its KTX2 format {0} is not supported")]
    Ktx2Format(u32),
    #[error("it announces {width} × {height} pixels, but its level has only {bytes} bytes")]
    Ktx2TooShort { width: u32, height: u32, bytes: usize },
    #[error("it is too large")]
    Ktx2TooLarge,
    #[error("it is not stored in blocks")]
    Ktx2WithoutBlocks,
    #[error("its KTX2 data cannot be unpacked ({0})")]
    Ktx2Packed(String),
    #[error("its Basis Universal data is damaged ({0})")]
    BasisUniversal(String),

    /// The file cannot be read; see [`unreadable`](super::pictures::unreadable).
    #[error("{0}")]
    UnreadableFile(String),
    #[error("it has neither a URI nor a buffer view")]
    NoSource,
    #[error("it has no use")]
    NoUse,
}
