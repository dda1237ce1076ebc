//! OpenEXR: the first layer with colours or luminance, of half or full precision.

use std::io::Cursor;

use bytemuck::Pod;

use super::decode::{DecodedTexels, Header, zeroed};

/// Which channels of an EXR file are read.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Channels {
    Gray,
    Rgb,
    Rgba,
}

/// The channels that are read, and the header of the layer that has them: the first one with colours, or else the
/// first one with luminance.
fn layer(bytes: &[u8]) -> Result<(Channels, exr::meta::header::Header), String> {
    let metadata = exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false);
    let metadata = metadata.map_err(|error| explain(&error))?;
    let has = |layer: &exr::meta::header::Header, names: &[&str]| {
        !layer.deep && names.iter().all(|name| layer.channels.list.iter().any(|channel| channel.name.eq(name)))
    };
    let kinds: [(&[&str], Channels); 2] = [(&["R", "G", "B"], Channels::Rgb), (&["Y"], Channels::Gray)];
    for (names, channels) in kinds {
        if let Some(layer) = metadata.headers.iter().find(|layer| has(layer, names)) {
            let has_alpha = channels == Channels::Rgb && has(layer, &["A"]);
            return Ok((if has_alpha { Channels::Rgba } else { channels }, layer.clone()));
        }
    }
    Err("it has no layer with channels R, G and B, or Y".into())
}

/// Width, height and bytes of a texel.
pub(super) fn header(bytes: &[u8]) -> Result<(u32, u32, usize), String> {
    let (channels, layer) = layer(bytes)?;
    let size = |length: usize| u32::try_from(length).map_err(|_| "it is too large".to_owned());
    let texel_bytes = if channels == Channels::Rgba { 16 } else { 12 };
    Ok((size(layer.layer_size.0)?, size(layer.layer_size.1)?, texel_bytes))
}

fn explain(error: &exr::error::Error) -> String {
    format!("it is damaged or of an unknown kind ({error})")
}

pub(super) fn texels(bytes: &[u8], header: Header) -> Result<DecodedTexels, String> {
    match layer(bytes)?.0 {
        Channels::Gray => {
            let gray = gray(bytes, header)?;
            Ok(DecodedTexels::Rgb32(gray.into_iter().map(|y| [y; 3]).collect()))
        }
        Channels::Rgb => color(bytes, header, |[r, g, b, _]| [r, g, b]).map(DecodedTexels::Rgb32),
        Channels::Rgba => color(bytes, header, |rgba| rgba).map(DecodedTexels::Rgba32),
    }
}

fn color<T: Pod>(bytes: &[u8], header: Header, texel: fn([f32; 4]) -> T) -> Result<Vec<T>, String> {
    use exr::prelude::{ReadChannels, ReadLayers};
    let (width, height) = (header.width as usize, header.height as usize);
    let set = move |texels: &mut Vec<T>, at: exr::math::Vec2<usize>, (r, g, b, a): (f32, f32, f32, f32)| {
        if let Some(to) = texels.get_mut(at.1 * width + at.0) {
            *to = texel([r, g, b, a]);
        }
    };
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgba_channels(move |_, _| zeroed(width * height).unwrap_or_default(), set)
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(|error| explain(&error))?;
    whole(image.layer_data.channel_data.pixels, header)
}

fn gray(bytes: &[u8], header: Header) -> Result<Vec<f32>, String> {
    use exr::prelude::{ReadChannels, ReadLayers, ReadSpecificChannel};
    let (width, height) = (header.width as usize, header.height as usize);
    let set = move |texels: &mut Vec<f32>, at: exr::math::Vec2<usize>, (y,): (f32,)| {
        if let Some(to) = texels.get_mut(at.1 * width + at.0) {
            *to = y;
        }
    };
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .specific_channels()
        .required("Y")
        .collect_pixels(move |_, _| zeroed(width * height).unwrap_or_default(), set)
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(|error| explain(&error))?;
    whole(image.layer_data.channel_data.pixels, header)
}

fn whole<T>(texels: Vec<T>, header: Header) -> Result<Vec<T>, String> {
    let count = header.width as usize * header.height as usize;
    if texels.len() == count { Ok(texels) } else { Err(format!("there is no memory for {count} pixels")) }
}
