//! A helper's samples on the wire: a frame in bands of rows, with means of half precision.

use bottega::viewport::ViewportSamples;
use bottega_agents::driver::nats::LIVE_BYTES_MAX;
use bottega_image::Rect;
use half::f16;
use serde::{Deserialize, Serialize};

use super::call::HelperNotice;

/// Largest number of bytes of the pixels of a band.
const BAND_BYTES: usize = LIVE_BYTES_MAX / 2;
/// Largest number of bytes of the head of a band.
const HEAD_BYTES_MAX: usize = 4 << 10;
/// Largest value that is stored; larger ones are scaled. Half precision ends at 65504.
const VALUE_MAX: f32 = 32_768.0;

/// A message of a helper to the owner of a viewport.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum HelperMessage {
    /// A notice about itself.
    Notice(HelperNotice),
    /// A band of a frame.
    Band(FrameBand),
}

/// Some rows of the samples that a helper has rendered in one step.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FrameBand {
    /// The name of the helper.
    pub(crate) name: String,
    /// True if it is the last band of its frame.
    pub(crate) is_last: bool,
    /// The samples.
    pub(crate) samples: ViewportSamples,
}

#[derive(Serialize, Deserialize)]
enum Head {
    Notice(HelperNotice),
    Band(BandHead),
}

#[derive(Serialize, Deserialize)]
struct BandHead {
    name: String,
    is_last: bool,
    look: u64,
    rect: [u32; 4],
    samples: u32,
    /// Factor of all values.
    scale: f32,
    /// False: alpha is 1 everywhere, and is not sent.
    has_alpha: bool,
}

/// Returns the number of bytes of a frame, without its heads.
pub(crate) fn frame_bytes(rect: &Rect) -> u64 {
    8 * rect.area()
}

/// Encodes a notice.
pub(crate) fn encode_notice(notice: &HelperNotice) -> Vec<u8> {
    with_head(&Head::Notice(notice.clone()), 0)
}

/// Encodes the samples of a step as bands.
pub(crate) fn encode_frame<'a>(name: &'a str, samples: &'a ViewportSamples) -> impl Iterator<Item = Vec<u8>> + 'a {
    let rect = samples.rect;
    let width = rect.width() as usize;
    let rows = (BAND_BYTES / (8 * width.max(1))).max(1);
    samples.means.chunks((rows * width).max(1)).enumerate().map(move |(band, means)| {
        let y0 = rect.y0 + (band * rows) as u32;
        let y1 = y0 + (means.len() / width) as u32;
        let largest = means.iter().flatten().fold(0.0_f32, |largest, value| largest.max(value.abs()));
        let head = BandHead {
            name: name.to_owned(),
            is_last: y1 == rect.y1,
            look: samples.look,
            rect: [rect.x0, y0, rect.x1, y1],
            samples: samples.samples,
            scale: if largest > VALUE_MAX && largest.is_finite() { largest / VALUE_MAX } else { 1.0 },
            has_alpha: means.iter().any(|mean| mean[3].to_bits() != 1.0_f32.to_bits()),
        };
        let channels = if head.has_alpha { 4 } else { 3 };
        let scale = head.scale;
        let mut bytes = with_head(&Head::Band(head), 2 * channels * means.len());
        for mean in means {
            // Alpha is never scaled.
            let scaled = [mean[0] / scale, mean[1] / scale, mean[2] / scale, mean[3]];
            bytes.extend(scaled[..channels].iter().flat_map(|&value| f16::from_f32(value).to_le_bytes()));
        }
        bytes
    })
}

/// Returns the length of a head and the head.
fn with_head(head: &Head, more: usize) -> Vec<u8> {
    let head = serde_json::to_vec(head).unwrap_or_default();
    let mut bytes = Vec::with_capacity(4 + head.len() + more);
    bytes.extend((head.len() as u32).to_le_bytes());
    bytes.extend(head);
    bytes
}

/// Reads a message of a helper; `None`: it is damaged.
pub(crate) fn decode(bytes: &[u8]) -> Option<HelperMessage> {
    let (length, bytes) = bytes.split_first_chunk::<4>()?;
    let length = u32::from_le_bytes(*length) as usize;
    if length > HEAD_BYTES_MAX {
        return None;
    }
    let (head, pixels) = bytes.split_at_checked(length)?;
    let head = match serde_json::from_slice(head).ok()? {
        Head::Notice(notice) => return pixels.is_empty().then_some(HelperMessage::Notice(notice)),
        Head::Band(head) => head,
    };
    let [x0, y0, x1, y1] = head.rect;
    if x0 >= x1 || y0 >= y1 || head.samples == 0 || !(head.scale.is_finite() && head.scale > 0.0) {
        return None;
    }
    let rect = Rect::new(x0, y0, x1, y1);
    let channels = if head.has_alpha { 4 } else { 3 };
    // Check the length before allocating
    if pixels.len() as u64 != rect.area().checked_mul(2 * channels as u64)? {
        return None;
    }
    let values = |pixel: &[u8]| {
        let mut mean = [0.0, 0.0, 0.0, 1.0];
        for (channel, value) in pixel.as_chunks::<2>().0.iter().enumerate() {
            let value = f16::from_le_bytes(*value).to_f32();
            // What is not a number is black, as everywhere.
            mean[channel] = if !value.is_finite() {
                0.0
            } else if channel < 3 {
                value * head.scale
            } else {
                value
            };
        }
        mean
    };
    let means = pixels.chunks_exact(2 * channels).map(values).collect();
    let samples = ViewportSamples { look: head.look, rect, samples: head.samples, means };
    Some(HelperMessage::Band(FrameBand { name: head.name, is_last: head.is_last, samples }))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn bands(samples: &ViewportSamples) -> Vec<FrameBand> {
        let read = |bytes: Vec<u8>| match decode(&bytes) {
            Some(HelperMessage::Band(band)) => band,
            other => panic!("{other:?}"),
        };
        encode_frame("vm-1", samples).map(read).collect()
    }

    #[test]
    fn a_frame_comes_back_in_bands_of_whole_rows_within_half_precision() {
        let rect = Rect::new(10, 5, 910, 205);
        let value = |i: usize| (i % 977) as f32 * 0.37;
        let means: Vec<[f32; 4]> = (0..rect.area() as usize).map(|i| [value(i), 1e6, 0.0, 1.0]).collect();
        let samples = ViewportSamples { look: 7, rect, samples: 12, means };
        let bands = bands(&samples);
        assert!(bands.len() > 3, "{} bands", bands.len());
        assert!(bands.iter().rev().skip(1).all(|band| !band.is_last) && bands.last().unwrap().is_last);
        let rows: u32 = bands.iter().map(|band| band.samples.rect.height()).sum();
        assert_eq!((rows, bands[0].samples.rect.y0), (rect.height(), rect.y0));
        let read: Vec<[f32; 4]> = bands.iter().flat_map(|band| band.samples.means.clone()).collect();
        for (read, mean) in read.iter().zip(&samples.means) {
            for (read, mean) in read.iter().zip(mean) {
                assert!((read - mean).abs() <= 6e-4 * mean.abs() + 2e-3, "{read} for {mean}");
            }
        }
    }

    #[test]
    fn alpha_and_notices_come_back() {
        let rect = Rect::new(0, 0, 2, 1);
        let samples = ViewportSamples { look: 0, rect, samples: 1, means: vec![[0.5, 0.25, 2.0, 0.5], [0.0; 4]] };
        assert_eq!(bands(&samples)[0].samples, samples);
        let notice =
            HelperNotice { name: "vm-Ünï".to_owned(), refuses: Some("no room".to_owned()), ..Default::default() };
        assert_eq!(decode(&encode_notice(&notice)), Some(HelperMessage::Notice(notice)));
    }

    proptest! {
        #[test]
        fn no_damaged_message_makes_a_reader_panic(
            at in 0_usize..200,
            byte in any::<u8>(),
            end in 0_usize..200,
        ) {
            let rect = Rect::new(0, 0, 4, 2);
            let samples = ViewportSamples { look: 3, rect, samples: 2, means: vec![[0.5; 4]; 8] };
            let mut bytes = encode_frame("a", &samples).next().unwrap();
            let at = at % bytes.len();
            bytes[at] = byte;
            bytes.truncate(end.max(1));
            if let Some(HelperMessage::Band(band)) = decode(&bytes) {
                prop_assert_eq!(band.samples.means.len() as u64, band.samples.rect.area());
            }
        }
    }
}
