use std::path::Path;

use bottega_image::{Aov, AovSet, Combine, ExrOptions, Film, Layer, Metadata, write_exr, write_picture_exr};

use super::*;

fn written(folder: &Path, picture: &Picture, shows: Rect) -> Written {
    let file = folder.join("p.exr");
    write_picture_exr(&file, picture, &Metadata::new(), ExrOptions::default()).expect("written");
    Written { file, shows, is_upside_down: false, samples: None, once: 0.0 }
}

fn numbered(width: u32, height: u32) -> Picture {
    Picture::from_fn(width, height, |x, y| [x as f32, y as f32, 1.0])
}

#[test]
fn a_window_is_cut_from_where_it_lies() {
    let folder = tempfile::tempdir().expect("a folder");
    let window = Rect::new(3, 2, 7, 5);
    let frame = written(folder.path(), &numbered(9, 8), Rect::of_size(9, 8));
    let read_frame = read(&frame, window).expect("sound");
    assert_eq!(read_frame.picture, Picture::from_fn(4, 3, |x, y| [x as f32 + 3.0, y as f32 + 2.0, 1.0]));
    assert!(!frame.file.exists(), "the file is of no more use");
    let part = written(folder.path(), &numbered(6, 6), Rect::new(2, 1, 8, 7));
    let read_part = read(&part, window).expect("sound");
    assert_eq!(read_part.picture, Picture::from_fn(4, 3, |x, y| [x as f32 + 1.0, y as f32 + 1.0, 1.0]));
}

#[test]
fn rows_from_below_are_turned() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut frame = written(folder.path(), &numbered(4, 4), Rect::of_size(4, 4));
    frame.is_upside_down = true;
    let read = read(&frame, Rect::new(0, 0, 4, 1)).expect("sound");
    assert_eq!(read.picture, Picture::from_fn(4, 1, |x, _| [x as f32, 3.0, 1.0]));
}

#[test]
fn a_picture_of_another_size_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    for (width, height) in [(8, 9), (8, 7), (100, 100)] {
        let wrong = written(folder.path(), &numbered(width, height), Rect::of_size(8, 8));
        let fault = read(&wrong, Rect::of_size(2, 2)).expect_err("another size");
        assert!(
            matches!(fault, EngineFault::Size { found, wanted: (8, 8), .. } if found == (width, height)),
            "{fault}"
        );
    }
}

#[test]
fn half_a_file_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = written(folder.path(), &numbered(64, 64), Rect::of_size(64, 64));
    let bytes = std::fs::read(&whole.file).expect("bytes");
    for end in [0, 3, 100, bytes.len() / 2, bytes.len() - 1] {
        std::fs::write(&whole.file, &bytes[..end]).expect("written");
        assert!(matches!(read(&whole, Rect::of_size(2, 2)), Err(EngineFault::Picture(_))), "{end} bytes");
    }
}

#[test]
fn few_values_that_are_no_numbers_are_black_and_many_are_a_fault() {
    let folder = tempfile::tempdir().expect("a folder");
    let rect = Rect::of_size(16, 16);
    let bad = |count: u32| {
        let value = |i: u32| if i < count { f32::NAN } else { 1.0 };
        let picture = Picture::from_fn(16, 16, |x, y| [1.0, value(x + 16 * y), 1.0]);
        read(&written(folder.path(), &picture, rect), rect)
    };
    let few = bad(2).expect("borne");
    assert_eq!((few.dropped, few.picture.pixel(0, 0), few.picture.pixel(3, 0)), (2, [0.0; 3], [1.0; 3]));
    assert!(matches!(bad(3), Err(EngineFault::NotFinite { count: 3 })));
}

#[test]
fn passes_add_up_to_their_weighted_mean() {
    let rect = Rect::of_size(2, 1);
    let mut tile = Tile::new(rect, Layout::new(AovSet::NONE));
    let pass = |value: f32| PaintedWindow {
        picture: Picture::from_fn(2, 1, |_, _| [value; 3]),
        planes: Vec::new(),
        dropped: 0,
    };
    pass(1.0).add_to(&mut tile, 4);
    pass(2.0).add_to(&mut tile, 12);
    let pixel = tile.pixel(1, 0);
    assert_eq!((pixel[Layout::COLOR], pixel[Layout::SAMPLE_COUNT]), (28.0, 16.0));
}

fn layered() -> Layout {
    let layer = |name: &str, channels: &[&str], combine| Layer {
        name: name.to_owned(),
        channels: channels.iter().map(|&channel| channel.to_owned()).collect(),
        combine,
    };
    let layers = vec![layer("id", &["Y"], Combine::Pick), layer("uv", &["U", "V"], Combine::Mean)];
    Layout::with_layers(AovSet::NONE.with(Aov::Normal), layers).expect("sound")
}

/// A file of a frame of 4 x 3 pixels, whose values tell pixel and channel, plus `more`.
fn written_layers(folder: &Path, more: f32) -> Written {
    let (layout, rect) = (layered(), Rect::of_size(4, 3));
    let mut tile = Tile::new(rect, layout.clone());
    for (index, pixel) in tile.sums_mut().chunks_exact_mut(layout.stride()).enumerate() {
        pixel.iter_mut().enumerate().for_each(|(i, value)| *value = (100 * i + index) as f32 + more);
        pixel[Layout::SAMPLE_COUNT] = 1.0;
    }
    let mut film = Film::new(rect, layout);
    film.add_tile(&tile, |_, _| 1.0);
    let file = folder.join("layers.exr");
    write_exr(&file, &film, &Metadata::new(), ExrOptions::default()).expect("written");
    Written { file, shows: rect, is_upside_down: false, samples: None, once: 0.0 }
}

#[test]
fn layers_and_alpha_are_cut_like_the_color_and_averaged_where_that_means_something() {
    let folder = tempfile::tempdir().expect("a folder");
    let (layout, window) = (layered(), Rect::new(1, 1, 3, 3));
    let wanted = ExtraChannels::of(&layout);
    let mut tile = Tile::new(window, layout);
    for (more, samples) in [(4.0, 1), (0.0, 3)] {
        let pass = read_wanted(&written_layers(folder.path(), more), window, &wanted).expect("sound");
        pass.add_to(&mut tile, samples);
    }
    // The pixel (2, 1) of the frame has the index 6; the passes' mean is 1 more than the longer one.
    let pixel = tile.pixel(2, 1);
    let mean = |channel: u32| (4 * (100 * channel + 6) + 4) as f32;
    assert_eq!(pixel[..4], [0, 1, 2, 3].map(mean));
    assert_eq!(pixel[6..11], [6, 7, 8, 9, 10].map(mean));
    assert_eq!(pixel[11..], [1106.0, 3.0]);
}

#[test]
fn a_layer_that_is_not_there_is_a_fault_and_one_that_is_no_number_is_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let (layout, rect) = (layered(), Rect::of_size(4, 3));
    let wanted = ExtraChannels::of(&layout);
    let plain = written(folder.path(), &numbered(4, 3), rect);
    let fault = read_wanted(&plain, rect, &wanted).expect_err("no layers");
    assert!(matches!(&fault, EngineFault::Layer { channel } if channel == "normal.X"), "{fault}");
    let window = read_wanted(&written_layers(folder.path(), 1e32), rect, &wanted).expect("sound");
    assert!(window.planes.iter().all(|(_, plane)| plane.iter().all(|value| *value == 0.0)));
}
