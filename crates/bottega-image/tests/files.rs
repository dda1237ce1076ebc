//! Files: our own are read back, those of other programs are read, broken ones are refused.

use std::path::PathBuf;

use bottega_image::{
    Aov, AovSet, Combine, Encoding, ExrColorSpace, ExrCompression, ExrOptions, FileLayer, Film, HalfOrFloat,
    ImageError, Layer, Layout, Metadata, Picture, PngBits, PngOptions, ReadLimits, Rect, SampleValues, SurfaceValues,
    Tile, ToneMap, WhitePoint, WholeHeader, read_channels, read_image, read_image_bytes, read_picture, read_whole,
    write_exr, write_picture_exr, write_png, write_png_rgb8,
};

/// Makes a film with every AOV, whose values identify their pixel.
fn film(rect: Rect, picture: (u32, u32)) -> Film {
    let layout = Layout::new(Aov::ALL.into_iter().collect());
    let mut tile = Tile::new(rect, layout.clone());
    for (x, y) in rect.pixels() {
        let (x0, y0) = (x as f32, y as f32);
        for sample in 0..2 {
            let values = SampleValues {
                radiance: [x0 * 0.01 + sample as f32, y0 * 0.01, 1e5 * (x0 + 1.0)],
                alpha: 1.0,
                albedo: [0.25, 0.5, 0.75],
                normal: [0.0, -1.0, x0],
                depth: 1e6 + y0,
                cost: 17.0,
                direct: [x0 * 0.01, 0.0, 1e5],
            };
            tile.add(x, y, &values);
        }
    }
    let mut film = Film::new(rect, layout).with_picture_size(picture.0, picture.1);
    film.add_tile(&tile, |_, _| 1.0);
    film
}

fn all_options() -> impl Iterator<Item = ExrOptions> {
    use ExrCompression::{None, Piz, Rle, Zip, Zips};
    let pairs = [None, Rle, Zip, Zips, Piz].into_iter().flat_map(|method| [(method, false), (method, true)]);
    pairs.flat_map(|(compression, tiled)| {
        [(HalfOrFloat::Half, false), (HalfOrFloat::Float, false), (HalfOrFloat::Float, true)]
            .into_iter()
            .map(move |(depth, parts)| ExrOptions { depth, tiled, compression, parts, ..ExrOptions::default() })
    })
}

#[test]
fn an_exr_file_holds_the_film_in_every_layout() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let film = film(Rect::new(30, 7, 170, 90), (200, 100));
    let mut metadata = Metadata::new();
    metadata.set("scene", "Küche №7\nsecond line");
    metadata.set("a_key_that_is_longer_than_the_31_bytes_of_short_names", "1");
    metadata.set("channels", "of a name that the format uses otherwise");
    for options in all_options() {
        write_exr(&path, &film, &metadata, options).unwrap();
        let read = read_image(&path, ReadLimits::default()).unwrap();
        assert_eq!(read.offset, (30, 7));
        assert_eq!(read.full_size, (200, 100));
        assert_eq!(read.metadata.get("scene"), metadata.get("scene"));
        assert!(metadata.iter().all(|(key, value)| read.metadata.get(key) == Some(value)), "{:?}", read.metadata);
        let expected = film.to_picture();
        match options.depth {
            HalfOrFloat::Float => assert_eq!(read.picture, expected, "{options:?}"),
            HalfOrFloat::Half => {
                for (got, want) in read.picture.data.iter().zip(&expected.data) {
                    assert!((got[0] - want[0]).abs() <= want[0] * 5e-4 && got[2] == 65504.0, "{options:?}");
                }
            }
        }
    }
}

#[test]
fn layers_of_a_film_are_read_back_from_a_file() {
    let layer = |name: &str, channels: &[&str], combine| Layer {
        name: name.to_owned(),
        channels: channels.iter().map(|&channel| channel.to_owned()).collect(),
        combine,
    };
    let long = "a layer of a name that is longer than 31 bytes";
    let layers = vec![
        layer("id", &["Y"], Combine::Pick),
        layer(long, &["R", "G", "B"], Combine::Mean),
        layer("motion", &["X", "Y", "Z", "W"], Combine::Mean),
    ];
    let layout = Layout::with_layers(AovSet::NONE.with(Aov::Depth), layers).unwrap();
    let rect = Rect::of_size(70, 9);
    let mut tile = Tile::new(rect, layout.clone());
    let stride = layout.stride();
    for (index, pixel) in tile.sums_mut().chunks_exact_mut(stride).enumerate() {
        pixel[Layout::SAMPLE_COUNT] = 2.0;
        // The mean of sums is half; an identity stays.
        pixel[Layout::SAMPLE_COUNT + 1..].iter_mut().enumerate().for_each(|(i, sum)| *sum = (2 * (index + i)) as f32);
    }
    let mut film = Film::new(rect, layout.clone());
    film.add_tile(&tile, |_, _| 0.3);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    for options in all_options() {
        write_exr(&path, &film, &Metadata::new(), options).unwrap();
        let names = ["depth.Z", &format!("{long}.G"), "motion.W", "id.Y", "nothing.Y", "A"].map(str::to_owned);
        let (file, planes) = read_channels(&path, ReadLimits::default(), &names).unwrap();
        assert_eq!(file.picture, film.to_picture());
        for (plane, offset, scale) in [(0, 0, 1), (1, 2, 1), (2, 7, 1), (3, 8, 2)] {
            let expected: Vec<f32> = (0..70 * 9).map(|index| (scale * (index + offset)) as f32).collect();
            assert_eq!(planes[plane].as_deref(), Some(expected.as_slice()), "{} {options:?}", names[plane]);
        }
        assert!(planes[4].is_none() && planes[5].is_some());
    }
}

#[test]
fn an_exr_file_names_its_channels_as_the_field_does() {
    use exr::prelude::*;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let film = film(Rect::of_size(70, 40), (70, 40));
    write_exr(&path, &film, &Metadata::new(), ExrOptions { depth: HalfOrFloat::Half, ..Default::default() }).unwrap();
    let image = read_first_flat_layer_from_file(&path).unwrap();
    let names: Vec<String> = image.layer_data.channel_data.list.iter().map(|c| c.name.to_string()).collect();
    let mattes = ["Asset", "Material", "Object"].map(|kind| {
        let ranks =
            (0..3).flat_map(|rank| ["A", "B", "G", "R"].map(|channel| format!("Crypto{kind}0{rank}.{channel}")));
        ranks.collect::<Vec<_>>().join(" ")
    });
    let others = "P.X P.Y P.Z R albedo.B albedo.G albedo.R backward.u backward.v catcher_light.B catcher_light.G \
                  catcher_light.R cost depth.Z direct.B direct.G direct.R error forward.u forward.v \
                  geometric_normal.X geometric_normal.Y geometric_normal.Z indirect.B indirect.G indirect.R \
                  normal.X normal.Y normal.Z samples shadow_catcher.A shadow_catcher.B shadow_catcher.G \
                  shadow_catcher.R uv.U uv.V";
    assert_eq!(names.join(" "), format!("A B {} G {others}", mattes.join(" ")));
    let value = |name: &str, x: usize, y: usize| {
        let index = names.iter().position(|n| n == name).unwrap();
        image.layer_data.channel_data.list[index].sample_data.value_by_flat_index(y * 70 + x).to_f32()
    };
    assert_eq!(value("depth.Z", 3, 9), 1e6 + 9.0);
    assert_eq!(value("normal.X", 0, 0), 0.0);
    assert_eq!(value("normal.Z", 12, 0), 12.0);
    assert_eq!(value("albedo.B", 69, 39), 0.75);
    assert_eq!(value("samples", 5, 5), 2.0);
    assert_eq!(value("cost", 5, 5), 17.0);
    assert_eq!(value("A", 5, 5), 1.0);
    assert!(image.layer_data.attributes.software_name.unwrap().to_string().starts_with("Bottega "));
}

#[test]
fn equal_films_give_equal_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let film = film(Rect::of_size(130, 70), (130, 70));
    let mut metadata = Metadata::new();
    (0..20).for_each(|i| metadata.set(&format!("key{i}"), "value"));
    let bytes = |name: &str| {
        let path = folder.path().join(name);
        write_exr(&path, &film, &metadata, ExrOptions::default()).unwrap();
        std::fs::read(path).unwrap()
    };
    assert_eq!(bytes("a.exr"), bytes("b.exr"));
}

#[test]
fn a_film_without_pixels_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let empty = film(Rect::new(5, 5, 5, 9), (10, 10));
    let exr = write_exr(folder.path().join("a.exr"), &empty, &Metadata::new(), ExrOptions::default());
    assert!(matches!(exr, Err(ImageError::Empty { .. })));
    let png = write_png(folder.path().join("a.png"), &empty, &PngOptions::default(), &Metadata::new());
    assert!(matches!(png, Err(ImageError::Empty { .. })));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn a_png_file_holds_what_was_encoded() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let film = film(Rect::new(10, 10, 60, 40), (100, 100));
    let mut metadata = Metadata::new();
    metadata.set("scene", "Küche");
    for encoding in [Encoding::Srgb, Encoding::Linear] {
        for (bits, tolerance) in [(PngBits::Eight, 1.2 / 255.0), (PngBits::Sixteen, 1e-4)] {
            let options =
                PngOptions { exposure_stops: -1.0, tone: ToneMap::Linear, encoding, bits, ..Default::default() };
            write_png(&path, &film, &options, &metadata).unwrap();
            let read = read_image(&path, ReadLimits::default()).unwrap();
            assert_eq!(read.metadata, metadata);
            for (got, want) in read.picture.data.iter().zip(&film.to_picture().data) {
                for (got, want) in got.iter().zip(want) {
                    let want = (want * 0.5).clamp(0.0, 1.0);
                    // The sRGB curve is at most 2.3 times as steep as the line.
                    assert!((got - want).abs() < 2.3 * tolerance, "{options:?}: {got} {want}");
                }
            }
        }
    }
}

#[test]
fn alpha_of_a_png_file_is_straight() {
    let rect = Rect::of_size(2, 1);
    let layout = Layout::new(AovSet::NONE);
    let mut tile = Tile::new(rect, layout.clone());
    // Half covered by a surface of 0.5 and not at all: of the color nothing is seen there.
    for (x, alpha, radiance) in [(0, 1.0, 0.5), (0, 0.0, 0.0), (1, 0.0, 0.7), (1, 0.0, 0.7)] {
        tile.add(x, 0, &SampleValues { radiance: [radiance; 3], alpha, ..SampleValues::default() });
    }
    let mut film = Film::new(rect, layout);
    film.add_tile(&tile, |_, _| 1.0);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let (tone, encoding, bits) = (ToneMap::Linear, Encoding::Linear, PngBits::Sixteen);
    let options = PngOptions { exposure_stops: 0.0, tone, encoding, bits, alpha: true };
    write_png(&path, &film, &options, &Metadata::new()).unwrap();
    let file = std::io::BufReader::new(std::fs::File::open(&path).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut bytes).unwrap();
    let codes: Vec<u16> = bytes.as_chunks().0.iter().map(|code| u16::from_be_bytes(*code)).collect();
    assert_eq!(codes, [32768, 32768, 32768, 32768, 0, 0, 0, 0]);
}

#[test]
fn gray_palette_and_sixteen_bit_png_files_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let encode = |color, depth, palette: Option<Vec<u8>>, data: &[u8]| {
        let mut encoder = png::Encoder::new(std::fs::File::create(&path).unwrap(), 2, 1);
        encoder.set_color(color);
        encoder.set_depth(depth);
        if let Some(palette) = palette {
            encoder.set_palette(palette);
        }
        encoder.write_header().unwrap().write_image_data(data).unwrap();
        read_picture(&path).unwrap().data
    };
    use png::{BitDepth, ColorType};
    assert_eq!(encode(ColorType::Grayscale, BitDepth::Eight, None, &[0, 255]), [[0.0; 3], [1.0; 3]]);
    assert_eq!(encode(ColorType::Grayscale, BitDepth::One, None, &[0b0100_0000]), [[0.0; 3], [1.0; 3]]);
    let palette = Some(vec![0, 0, 0, 255, 0, 0]);
    assert_eq!(encode(ColorType::Indexed, BitDepth::Two, palette, &[0b0100_0000]), [[1.0, 0.0, 0.0], [0.0; 3]]);
    let alpha = encode(ColorType::GrayscaleAlpha, BitDepth::Sixteen, None, &[0xff, 0xff, 0, 0, 0, 0, 0xff, 0xff]);
    assert_eq!(alpha, [[1.0; 3], [0.0; 3]]);
    let rgba = encode(ColorType::Rgba, BitDepth::Eight, None, &[255, 0, 0, 7, 0, 255, 0, 0]);
    assert_eq!(rgba, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
}

#[test]
fn an_exr_file_of_layers_gives_its_color_and_not_its_albedo() {
    use exr::prelude::*;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let write = |channels: &[(&str, FlatSamples)]| {
        let list = channels.iter().map(|(name, samples)| AnyChannel::new(*name, samples.clone())).collect();
        Image::from_channels((1, 1), AnyChannels::sort(list)).write().to_file(&path).unwrap();
    };
    let float = |v: f32| FlatSamples::F32(vec![v]);
    write(&[
        ("Albedo.R", float(9.0)),
        ("Albedo.G", float(9.0)),
        ("Albedo.B", float(9.0)),
        ("ViewLayer.Combined.R", float(1.0)),
        ("ViewLayer.Combined.G", FlatSamples::F16(vec![f16::from_f32(2.0)])),
        ("ViewLayer.Combined.B", FlatSamples::U32(vec![3])),
    ]);
    assert_eq!(read_picture(&path).unwrap().data, [[1.0, 2.0, 3.0]]);
    write(&[("Y", float(0.5)), ("Z", float(7.0))]);
    assert_eq!(read_picture(&path).unwrap().data, [[0.5; 3]]);
    write(&[("R", float(0.25))]);
    assert_eq!(read_picture(&path).unwrap().data, [[0.25; 3]]);
    write(&[("X", float(0.9505)), ("Y", float(1.0)), ("Z", float(1.0891))]);
    let white = read_picture(&path).unwrap().data[0];
    assert!(white.iter().all(|value| (value - 1.0).abs() < 1e-3), "{white:?}");
    write(&[("Z", float(7.0)), ("id", float(7.0))]);
    let error = read_picture(&path).unwrap_err();
    assert!(matches!(&error, ImageError::NoColor { found, .. } if found == "Z, id"), "{error}");
}

#[test]
fn what_is_no_picture_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let error = read_picture(&path).unwrap_err();
    assert!(matches!(error, ImageError::Read { .. }) && error.to_string().contains("a.exr"));
    assert!(matches!(read_picture(folder.path()), Err(ImageError::Read { .. })));
    for bytes in [&b""[..], b"x", b"glTF\x02\0\0\0"] {
        std::fs::write(&path, bytes).unwrap();
        assert!(matches!(read_picture(&path), Err(ImageError::UnknownFormat { .. })));
    }
}

/// Name and bytes of a small file of each format and way of coding.
fn small_files() -> Vec<(String, Vec<u8>)> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file");
    let film = film(Rect::new(1, 2, 7, 6), (10, 10));
    let mut files = Vec::new();
    let written = [
        (HalfOrFloat::Half, false, ExrCompression::Zip),
        (HalfOrFloat::Float, true, ExrCompression::Zip),
        (HalfOrFloat::Float, false, ExrCompression::None),
        (HalfOrFloat::Half, true, ExrCompression::Rle),
        (HalfOrFloat::Half, false, ExrCompression::Piz),
    ];
    for (depth, tiled, compression) in written {
        write_exr(&path, &film, &Metadata::new(), ExrOptions { depth, tiled, compression, ..ExrOptions::default() })
            .unwrap();
        files.push((format!("{depth:?} {tiled} {compression:?}.exr"), std::fs::read(&path).unwrap()));
    }
    let sixteen = PngOptions { bits: PngBits::Sixteen, encoding: Encoding::Linear, ..Default::default() };
    for (name, options) in [("a.png", PngOptions { alpha: true, ..Default::default() }), ("b.png", sixteen)] {
        write_png(&path, &film, &options, &Metadata::new()).unwrap();
        files.push((name.to_owned(), std::fs::read(&path).unwrap()));
    }
    files.push(("a.hdr".to_owned(), small_hdr()));
    files
}

fn small_hdr() -> Vec<u8> {
    let mut hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 3 +X 9\n".to_vec();
    for _ in 0..3 {
        // New run lengths: four components of nine equal bytes.
        hdr.extend([2, 2, 0, 9, 128 + 9, 200, 128 + 9, 100, 128 + 9, 50, 128 + 9, 129]);
    }
    hdr
}

#[test]
fn a_radiance_file_is_read() {
    let picture = read_image_bytes("a.hdr", &small_hdr(), ReadLimits::default()).unwrap().picture;
    assert_eq!(picture.size(), (9, 3));
    assert!(picture.data.iter().all(|&pixel| pixel == [200.0 / 128.0, 100.0 / 128.0, 50.0 / 128.0]));
}

#[test]
fn a_file_cut_off_at_any_byte_is_refused() {
    for (name, bytes) in small_files() {
        let read = |length: usize| read_image_bytes(&name, &bytes[..length], ReadLimits::default());
        assert!(read(bytes.len()).is_ok(), "{name}");
        for length in 0..bytes.len() {
            assert!(read(length).is_err(), "{name} cut to {length} of {}", bytes.len());
        }
    }
}

#[test]
fn a_file_with_any_byte_changed_is_read_or_refused() {
    let limits = ReadLimits { max_pixels: 1 << 16 };
    let mut state = 1u32;
    for (name, bytes) in small_files() {
        for at in 0..bytes.len() {
            let mut bytes = bytes.clone();
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            bytes[at] = match state >> 30 {
                0 => 0xff,
                1 => bytes[at] ^ 0x80,
                2 => bytes[at].wrapping_add(1),
                _ => (state >> 8) as u8,
            };
            // Any result is fine without a panic and within the limits.
            if let Ok(read) = read_image_bytes(&name, &bytes, limits) {
                assert!(read.picture.data.len() as u64 <= limits.max_pixels);
            }
        }
    }
}

#[test]
fn a_header_that_announces_too_much_is_refused_before_allocating() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bomb");
    std::fs::write(&path, b"#?RADIANCE\n\n-Y 60000 +X 60000\n\x02\x02").unwrap();
    assert!(matches!(read_picture(&path), Err(ImageError::TooLarge { width: 60000, height: 60000, .. })));

    write_png_rgb8(&path, 300, 200, &vec![0; 300 * 200 * 3]).unwrap();
    let limits = ReadLimits { max_pixels: 59_999 };
    assert!(matches!(read_image(&path, limits), Err(ImageError::TooLarge { width: 300, height: 200, .. })));

    write_picture_exr(&path, &Picture::new(300, 200), &Metadata::new(), ExrOptions::default()).unwrap();
    assert!(matches!(read_image(&path, limits), Err(ImageError::TooLarge { width: 300, height: 200, .. })));
    // The same with a data window of a billion columns.
    let mut bytes = std::fs::read(&path).unwrap();
    let window = bytes.windows(16).position(|w| w == b"dataWindow\0box2i").unwrap();
    let x_max = window + b"dataWindow\0box2i\0".len() + 4 + 8;
    bytes[x_max..x_max + 4].copy_from_slice(&1_000_000_000i32.to_le_bytes());
    std::fs::write(&path, &bytes).unwrap();
    assert!(matches!(read_picture(&path), Err(ImageError::TooLarge { .. })));
}

/// An EXR file of one gray level and these chromaticities, data window and display window.
fn exr_of(chromaticities: Option<[f32; 8]>, data: Rect, display: (u32, u32)) -> Vec<u8> {
    use exr::prelude::*;
    let channels = SpecificChannels::rgb(|_| (1.0_f32, 0.1_f32, 0.1_f32));
    let layer_position = Vec2(data.x0 as i32, data.y0 as i32);
    let attributes = LayerAttributes { layer_position, ..LayerAttributes::default() };
    let size = (data.width() as usize, data.height() as usize);
    let layer = Layer::new(size, attributes, exr::prelude::Encoding::SMALL_LOSSLESS, channels);
    let mut image = Image::from_layer(layer);
    image.attributes.display_window = IntegerBounds::new((0, 0), (display.0 as usize, display.1 as usize));
    image.attributes.chromaticities =
        chromaticities.map(|[rx, ry, gx, gy, bx, by, wx, wy]| exr::meta::attribute::Chromaticities {
            red: Vec2(rx, ry),
            green: Vec2(gx, gy),
            blue: Vec2(bx, by),
            white: Vec2(wx, wy),
        });
    let mut file = std::io::Cursor::new(Vec::new());
    image.write().to_buffered(&mut file).unwrap();
    file.into_inner()
}

#[test]
fn colors_of_other_primaries_become_ours() {
    let rec2020 = [0.708, 0.292, 0.17, 0.797, 0.131, 0.046, 0.3127, 0.329];
    for (chromaticities, expected) in [
        // Mitsuba 3.9.1, of the same file.
        (Some(rec2020), [1.594_442, -0.012_096, 0.083_664]),
        (Some([0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329]), [1.0, 0.1, 0.1]),
        (Some([0.0; 8]), [1.0, 0.1, 0.1]),
        (None, [1.0, 0.1, 0.1]),
    ] {
        let bytes = exr_of(chromaticities, Rect::of_size(2, 1), (2, 1));
        let color = read_image_bytes("a.exr", &bytes, ReadLimits::default()).unwrap().picture.data[0];
        let is_close = color.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5);
        assert!(is_close, "{chromaticities:?}: {color:?}");
        let whole = read_whole("a.exr", &bytes, ReadLimits::default(), WhitePoint::Adapted).unwrap();
        assert_eq!(whole.picture.data[1], color);
        assert_eq!(whole.notes.len(), usize::from(chromaticities == Some([0.0; 8])));
    }
}

#[test]
fn a_whole_picture_is_black_where_its_file_holds_nothing() {
    let bytes = exr_of(None, Rect::new(1, 1, 3, 2), (4, 3));
    let header = WholeHeader::read("a.exr", &bytes, ReadLimits::default()).unwrap();
    assert_eq!((header.width, header.height, header.has_alpha), (4, 3, false));
    let whole = read_whole("a.exr", &bytes, ReadLimits::default(), WhitePoint::Adapted).unwrap();
    let reds: Vec<f32> = whole.picture.data.iter().map(|color| color[0]).collect();
    assert_eq!(reds, [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    // The file itself holds two pixels.
    let file = read_image_bytes("a.exr", &bytes, ReadLimits::default()).unwrap();
    assert_eq!((file.picture.size(), file.offset, file.full_size), ((2, 1), (1, 1), (4, 3)));
    // An almost empty frame must not take gigabytes.
    let bytes = exr_of(None, Rect::of_size(1, 1), (11_000, 11_000));
    let refused = WholeHeader::read("a.exr", &bytes, ReadLimits::default());
    assert!(matches!(refused, Err(ImageError::Malformed { .. })), "{refused:?}");
}

#[test]
fn small_files_that_announce_much_are_refused_at_once() {
    let sizes: [(i32, i32); 3] = [(11_000, 11_000), (1 << 26, 1), (1, 1 << 26)];
    for (width, height) in sizes {
        let mut exr = exr_of(None, Rect::of_size(2, 1), (2, 1));
        let window = exr.windows(16).position(|w| w == b"dataWindow\0box2i").unwrap() + 17 + 4;
        exr[window + 8..window + 12].copy_from_slice(&(width - 1).to_le_bytes());
        exr[window + 12..window + 16].copy_from_slice(&(height - 1).to_le_bytes());
        // Files of one part need no count of blocks; a count that contradicts the size is refused.
        let count = exr.windows(11).position(|w| w == b"chunkCount\0").unwrap();
        exr[count..count + 10].copy_from_slice(b"chunkOther");
        let radiance = format!("#?RADIANCE\n\n-Y {height} +X {width}\n\x02\x02").into_bytes();
        let mut png = Vec::new();
        let mut encoder = png::Encoder::new(&mut png, width as u32, height as u32);
        encoder.set_color(png::ColorType::Rgb);
        drop(encoder.write_header().unwrap());
        for (name, bytes) in [("a.exr", exr), ("a.hdr", radiance), ("a.png", png)] {
            assert!(bytes.len() < 500, "{name} has {} bytes", bytes.len());
            let refused = read_image_bytes(name, &bytes, ReadLimits::default());
            let is_refused =
                matches!(&refused, Err(ImageError::Malformed { detail, .. }) if detail.contains("announces"));
            assert!(is_refused, "{name}, {width} × {height}: {refused:?}");
        }
    }
}

#[test]
fn the_references_of_other_programs_are_read() {
    let Some(folder) = std::env::var_os("BOTTEGA_SCENES").filter(|folder| !folder.is_empty()) else {
        eprintln!("skipped: set BOTTEGA_SCENES to the folder of the reference scenes");
        return;
    };
    let mut folders = vec![PathBuf::from(folder)];
    let mut found = 0;
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
            if path.is_dir() {
                folders.push(path);
            } else if ["exr", "hdr", "png"].contains(&extension.as_str()) {
                let picture = match read_picture(&path) {
                    Ok(picture) => picture,
                    // Several values per pixel are not yet a picture.
                    Err(ImageError::Unsupported { detail, .. }) if detail.contains("deep data") => continue,
                    Err(error) => panic!("{}: {error}", path.display()),
                };
                let mean = picture.data.iter().flatten().map(|&v| f64::from(v)).sum::<f64>();
                assert!(mean.is_finite() && mean >= 0.0, "{}", path.display());
                found += 1;
            }
        }
    }
    assert!(found > 20, "{found} pictures");
}

#[test]
fn a_block_that_announces_more_than_it_can_hold_is_refused() {
    use exr::prelude::*;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    let wave = |x: usize, y: usize| ((x * x + 3 * y) % 17) as f32 / 17.0;
    let channels = SpecificChannels::rgb(|Vec2(x, y)| (wave(x, y), wave(y, x), f16::from_f32(0.5)));
    let encoding = Encoding { compression: Compression::DWAA(None), ..Encoding::SMALL_LOSSLESS };
    let layer = Layer::new((64, 32), LayerAttributes::default(), encoding, channels);
    Image::from_layer(layer).write().to_file(&path).unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    assert!(read_image_bytes("a.exr", &bytes, ReadLimits::default()).is_ok());
    // A block begins with its version, 2, as 64 bits; what its first section unfolds to follows.
    let version = bytes.windows(8).rposition(|window| window == 2u64.to_le_bytes()).unwrap();
    bytes[version + 8..version + 16].copy_from_slice(&(1u64 << 40).to_le_bytes());
    let error = read_image_bytes("a.exr", &bytes, ReadLimits::default()).unwrap_err();
    assert!(error.to_string().contains("announces more"), "{error}");
}

#[test]
fn each_layer_is_a_part_for_other_readers() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("parts.exr");
    let film = film(Rect::of_size(40, 30), (40, 30));
    let options = ExrOptions { parts: true, ..ExrOptions::default() };
    write_exr(&path, &film, &Metadata::new(), options).unwrap();
    let parts = exr::prelude::read_all_flat_layers_from_file(&path).unwrap().layer_data;
    let names: Vec<String> =
        parts.iter().map(|part| part.attributes.layer_name.as_ref().unwrap().to_string()).collect();
    assert_eq!(names[..4], ["rgba", "albedo", "normal", "depth"], "{names:?}");
    assert!(names.contains(&"CryptoObject00".to_owned()) && names.contains(&"samples".to_owned()), "{names:?}");
    let channels = |part: usize| parts[part].channel_data.list.iter().map(|it| it.name.to_string()).collect::<Vec<_>>();
    assert_eq!((channels(0).concat(), channels(3)), ("ABGR".to_owned(), vec!["depth.Z".to_owned()]));
    // They are read as in a single part
    let bytes = std::fs::read(&path).unwrap();
    let layers = FileLayer::all(&path, &bytes).unwrap();
    let depth = layers.iter().find(|layer| layer.name == "depth").unwrap().read_planes(&path, &bytes).unwrap();
    assert_eq!(depth.planes[0][..40], [1e6; 40]);
    let samples = layers.iter().find(|layer| layer.name == "samples").unwrap().read_planes(&path, &bytes).unwrap();
    assert_eq!(samples.planes[0][0], 2.0);
}

#[test]
fn colors_of_another_space_are_the_same_colors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("space.exr");
    let film = film(Rect::of_size(8, 8), (8, 8));
    let mut plain = None;
    use ExrColorSpace::{Aces2065, AcesCg, P3, Rec709, Rec2020};
    for color_space in [Rec709, Rec2020, P3, AcesCg, Aces2065] {
        write_exr(&path, &film, &Metadata::new(), ExrOptions { color_space, ..ExrOptions::default() }).unwrap();
        let picture = read_picture(&path).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let layers = FileLayer::all(&path, &bytes).unwrap();
        let layer = |name: &str| {
            let layer = layers.iter().find(|layer| layer.name == name).unwrap();
            layer.read_planes(&path, &bytes).unwrap().planes.iter().map(|plane| plane[9]).collect::<Vec<f32>>()
        };
        let found = (picture.data[9], layer("albedo"), layer("normal"), layer("CryptoObject00"));
        let expected = plain.get_or_insert_with(|| found.clone());
        let is_near = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 3e-4 * b.abs().max(1.0));
        // The bright blue of the test loses some digits of the others
        let scale = 2e5;
        assert!(is_near(&found.0.map(|value| value / scale), &expected.0.map(|value| value / scale)), "{found:?}");
        assert!(is_near(&found.1, &expected.1), "{color_space:?}: {found:?}");
        assert_eq!((&found.2, &found.3), (&expected.2, &expected.3), "{color_space:?}");
    }
    // Numbers of the ACES project: its matrix from Rec. 709 to AP1, by Bradford's adaptation
    write_exr(&path, &film, &Metadata::new(), ExrOptions { color_space: AcesCg, ..ExrOptions::default() }).unwrap();
    let raw = exr::prelude::read_first_flat_layer_from_file(&path).unwrap();
    let channel = |name: &str| {
        let found = raw.layer_data.channel_data.list.iter().find(|channel| channel.name.eq(name)).unwrap();
        found.sample_data.value_by_flat_index(0).to_f32()
    };
    let albedo = ["albedo.R", "albedo.G", "albedo.B"].map(channel);
    let expected =
        [[0.613_097, 0.339_523, 0.047_379], [0.070_194, 0.916_354, 0.013_452], [0.020_616, 0.109_570, 0.869_815]]
            .map(|row: [f32; 3]| row[0] * 0.25 + row[1] * 0.5 + row[2] * 0.75);
    assert!(albedo.iter().zip(expected).all(|(a, b)| (a - b).abs() < 2e-4), "{albedo:?} {expected:?}");
}

#[test]
fn lossy_files_are_near_and_keep_identities() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lossy.exr");
    let rect = Rect::of_size(64, 64);
    let layout = Layout::new([Aov::Depth, Aov::CryptoObject].into_iter().collect());
    let mut tile = Tile::new(rect, layout.clone());
    for (x, y) in rect.pixels() {
        let radiance = [0.2 + 0.01 * x as f32, 0.5, 0.9 - 0.01 * y as f32];
        tile.add(x, y, &SampleValues { radiance, alpha: 1.0, depth: 1.0 + x as f32, ..SampleValues::default() });
        let identities = [f32::from_bits(0x4012_3456 + x), 0.0, 0.0];
        tile.add_surface(x, y, &SurfaceValues { identities, weight: 1.0, ..SurfaceValues::default() });
    }
    let mut film = Film::new(rect, layout);
    film.add_tile(&tile, |_, _| 1.0);
    for compression in [ExrCompression::Dwaa, ExrCompression::Dwab] {
        write_exr(&path, &film, &Metadata::new(), ExrOptions { compression, ..ExrOptions::default() }).unwrap();
        let picture = read_picture(&path).unwrap();
        let error = picture.data.iter().zip(rect.pixels()).map(|(color, (x, y))| {
            let expected = film.color(x, y);
            color.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
        });
        let error = error.fold(0.0, f32::max);
        assert!(error > 0.0 && error < 0.02, "{error}");
        let names = ["depth.Z", "CryptoObject00.R"].map(str::to_owned);
        let (_, planes) = read_channels(&path, ReadLimits::default(), &names).unwrap();
        let [depth, matte] = [0, 1].map(|index| planes[index].as_ref().unwrap());
        assert!((0..64).all(|x| depth[x] == 1.0 + x as f32 && matte[x].to_bits() == 0x4012_3456 + x as u32));
    }
}
