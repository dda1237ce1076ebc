//! Images and grids from arrays.

use bottega::scene::{Blend, Grid, Image, linear_of_srgb};
use pyo3::prelude::*;

use crate::{errors::wrong, numpy_input::InputArray};

/// Converts an array of texels to an image: uint8, uint16 or float32; (height, width) or (height, width, 1, 3 or 4).
pub(crate) fn image_of(key: &str, pixels: &Bound<'_, PyAny>, color_space: &str) -> PyResult<Image> {
    const ARGUMENT: &str = "pixels";
    let dtype = pixels.getattr("dtype").and_then(|dtype| dtype.str()).map(|name| name.to_string());
    let is_srgb = color_space == "srgb";
    match dtype.as_deref() {
        Ok("uint8") => {
            let array = InputArray::<u8>::of_any_shape(ARGUMENT, pixels)?;
            let (width, height, channels) = shape_of(array.shape())?;
            let values = array.values()?;
            Ok(match channels {
                1 => Image::from_gray8(key, width, height, values.to_vec(), is_srgb),
                3 => Image::from_rgb8(key, width, height, values.as_chunks().0.to_vec(), is_srgb),
                _ => Image::from_rgba8(key, width, height, values.as_chunks().0.to_vec(), is_srgb),
            })
        }
        Ok("uint16") => {
            let array = InputArray::<u16>::of_any_shape(ARGUMENT, pixels)?;
            let (width, height, channels) = shape_of(array.shape())?;
            let texel = |texel: &[u16]| match *texel {
                [gray] => [gray, gray, gray, u16::MAX],
                [r, g, b] => [r, g, b, u16::MAX],
                [r, g, b, a] => [r, g, b, a],
                _ => [0; 4],
            };
            let texels = array.values()?.chunks_exact(channels).map(texel).collect();
            Ok(Image::from_rgba16(key, width, height, texels, is_srgb))
        }
        _ => {
            let array = InputArray::<f32>::of_any_shape(ARGUMENT, pixels)?;
            let (width, height, channels) = shape_of(array.shape())?;
            let values = array.values()?;
            if let Some(place) = values.iter().position(|value| !value.is_finite()) {
                let pixel = place / channels;
                let (row, column) = (pixel / width as usize, pixel % width as usize);
                let problem = format!("row {row}, column {column} is {}; finite numbers are needed", values[place]);
                return Err(wrong(ARGUMENT, &problem));
            }
            let color =
                |value: f32| if is_srgb { linear_of_srgb(f64::from(value.clamp(0.0, 1.0))) as f32 } else { value };
            if channels == 4 && color_space != "data" {
                let texel = |&[r, g, b, a]: &[f32; 4]| [color(r), color(g), color(b), a];
                let texels = values.as_chunks().0.iter().map(texel).collect();
                return Ok(Image::from_linear_rgba(key, width, height, texels));
            }
            let texel =
                |texel: &[f32]| if channels < 3 { [color(texel[0]); 3] } else { [0, 1, 2].map(|i| color(texel[i])) };
            let texels = values.chunks_exact(channels).map(texel).collect();
            Ok(if color_space == "data" {
                Image::from_numbers(key, width, height, texels)
            } else {
                Image::from_linear_rgb(key, width, height, texels)
            })
        }
    }
}

/// Returns columns, rows and channels of an array of texels.
fn shape_of(shape: &[usize]) -> PyResult<(u32, u32, usize)> {
    let (height, width, channels) = match *shape {
        [height, width] => (height, width, 1),
        [height, width, channels @ (1 | 3 | 4)] => (height, width, channels),
        _ => {
            let problem =
                format!("its shape is {shape:?}, and (height, width) or (height, width, 1, 3 or 4) is needed");
            return Err(wrong("pixels", &problem));
        }
    };
    if height == 0 || width == 0 || height > 1 << 16 || width > 1 << 16 {
        return Err(wrong("pixels", &format!("its shape is {shape:?}; 1 to 65536 rows and columns are needed")));
    }
    Ok((width as u32, height as u32, channels))
}

/// Converts an array, float32, (depth, height, width) or (depth, height, width, 3), to a grid; x runs along the width.
pub(crate) fn grid_of(argument: &'static str, values: &Bound<'_, PyAny>) -> PyResult<Grid> {
    let array = InputArray::<f32>::of_any_shape(argument, values)?;
    let (depth, height, width) = match *array.shape() {
        [depth, height, width] | [depth, height, width, 3] => (depth, height, width),
        ref shape => {
            let needed = "(depth, height, width) or (depth, height, width, 3)";
            return Err(wrong(argument, &format!("its shape is {shape:?}, and {needed} is needed")));
        }
    };
    let values = array.values()?;
    if let Some(place) = values.iter().position(|value| !(value.is_finite() && *value >= 0.0)) {
        let problem = format!("value {place} is {}; finite numbers from 0 are needed", values[place]);
        return Err(wrong(argument, &problem));
    }
    let size = [width, height, depth].map(|side| u32::try_from(side).unwrap_or(u32::MAX));
    Grid::new(size, values.to_vec(), Blend::Linear).map_err(|error| wrong(argument, &error.to_string()))
}
