//! With the real library: noise goes, other detail stays, and the user can stop it.

use std::ops::ControlFlow;

use bottega_denoise::{DenoiseError, Denoised, Denoiser, GuideUse, NOISY};
use bottega_image::{Aov, AovSet, Film, Layout, Picture, Rect, SampleValues, Tile, read_channels, rmse};

const SIDE: u32 = 96;

/// Returns the library; prints a message if it is missing.
fn denoiser() -> Option<Denoiser> {
    match Denoiser::load() {
        Ok(denoiser) => Some(denoiser),
        Err(DenoiseError::NotFound { tried }) => {
            eprintln!("SKIPPED: there is no Open Image Denoise ({tried}); BOTTEGA_OIDN may name one");
            None
        }
        Err(error) => panic!("{error}"),
    }
}

/// A checkerboard in soft light, without noise.
fn truth() -> Picture {
    Picture::from_fn(SIDE, SIDE, |x, y| light(x, y).map(|light| light * albedo(x, y)))
}

fn albedo(x: u32, y: u32) -> f32 {
    if (x / 12 + y / 12).is_multiple_of(2) { 0.8 } else { 0.2 }
}

fn light(x: u32, y: u32) -> [f32; 3] {
    [2.0 + x as f32 / SIDE as f32, 2.0, 2.0 + y as f32 / SIDE as f32]
}

/// The same with noise: four samples per pixel, most of them black.
fn noisy(aovs: AovSet) -> Film {
    let rect = Rect::of_size(SIDE, SIDE);
    let layout = Layout::new(aovs);
    let mut tile = Tile::new(rect, layout.clone());
    let mut state = 1_u64;
    let mut random = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 24) as f32
    };
    for (x, y) in rect.pixels() {
        for _ in 0..4 {
            let factor = if random() < 0.25 { 4.0 } else { 0.0 };
            let radiance = light(x, y).map(|light| light * albedo(x, y) * factor);
            let values =
                SampleValues { radiance, albedo: [albedo(x, y); 3], normal: [0.0, 0.0, 1.0], ..Default::default() };
            tile.add(x, y, &values);
        }
    }
    let mut film = Film::new(rect, layout);
    film.add_tile(&tile, |_, _| 1.0);
    film
}

#[test]
fn noise_goes_and_the_noisy_color_is_kept() {
    let Some(denoiser) = denoiser() else { return };
    assert!(denoiser.version().starts_with(['1', '2']), "{}", denoiser.version());
    let film = noisy([Aov::Albedo, Aov::Normal].into_iter().collect());
    let (mut last, mut shares) = (0.0, 0);
    let mut progress = |share: f64| {
        assert!(share >= last && share <= 1.0, "{share} after {last}");
        (last, shares) = (share, shares + 1);
        ControlFlow::Continue(())
    };
    let Denoised { film: clean, guides } =
        denoiser.denoise(&film, GuideUse::Denoised, 2, &mut progress).expect("it is denoised");
    assert_eq!(guides, [Aov::Albedo, Aov::Normal]);
    assert!(shares > 2 && last > 0.99, "reported {shares} times, up to {last}");
    let error = |picture: &Picture| rmse(picture, &truth()).expect("one size");
    let (before, after) = (error(&film.to_picture()), error(&clean.to_picture()));
    assert!(after < 0.15 * before, "from {before} to {after}");
    // Noisy layers help, too.
    let mut shares = Vec::new();
    let mut progress = |share| {
        shares.push(share);
        ControlFlow::Continue(())
    };
    let passing = denoiser.denoise(&film, GuideUse::AsPainted, 2, &mut progress).expect("it is denoised");
    assert_eq!(passing.guides, guides);
    let passing = error(&passing.film.to_picture());
    assert!(passing < 0.2 * before && shares.is_sorted(), "from {before} to {passing}");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.exr");
    bottega_image::write_exr(&path, &clean, &Default::default(), Default::default()).expect("written");
    let names = ["R", "G", "B"].map(|channel| format!("{NOISY}.{channel}"));
    let (_, planes) = read_channels(&path, Default::default(), &names).expect("read");
    for (channel, plane) in planes.into_iter().enumerate() {
        let expected: Vec<f32> = film.to_picture().data.iter().map(|color| color[channel]).collect();
        assert_eq!(plane, Some(expected), "nothing is lost");
    }
    // Without the layers the result is worse.
    let Denoised { film: alone, guides } = denoiser
        .denoise(&noisy(AovSet::NONE), GuideUse::Denoised, 2, &mut |_| ControlFlow::Continue(()))
        .expect("it is denoised");
    assert!(guides.is_empty());
    let alone = error(&alone.to_picture());
    assert!(after < alone && alone < before, "{after}, {alone}, {before}");
}

#[test]
fn the_same_picture_comes_out_by_any_number_of_threads() {
    let Some(denoiser) = denoiser() else { return };
    let film = noisy([Aov::Albedo, Aov::Normal].into_iter().collect());
    let by = |threads| {
        let denoised = denoiser.denoise(&film, GuideUse::Denoised, threads, &mut |_| ControlFlow::Continue(()));
        denoised.expect("it is denoised").film.to_picture()
    };
    let expected = by(1);
    // Several times: whose thread comes first must not show.
    for attempt in 0..8 {
        assert_eq!(by(2), expected, "attempt {attempt}");
    }
}

#[test]
fn a_dark_picture_is_denoised_like_a_bright_one() {
    let Some(denoiser) = denoiser() else { return };
    let denoised = |scale: f32| {
        let film = noisy(AovSet::NONE);
        let picture = film.to_picture();
        let dark = Picture::from_fn(SIDE, SIDE, |x, y| picture.pixel(x, y).map(|value| value * scale));
        let film = film.with_color(&dark, "bright").expect("there is room");
        let denoised = denoiser.denoise(&film, GuideUse::Denoised, 2, &mut |_| ControlFlow::Continue(()));
        denoised
            .expect("it is denoised")
            .film
            .to_picture()
            .data
            .into_iter()
            .map(move |color| color.map(|it| it / scale))
    };
    for (bright, dark) in denoised(1.0).zip(denoised(1e-4)) {
        assert!(
            bright.iter().zip(dark).all(|(bright, dark)| (bright - dark).abs() < 1e-3 * bright),
            "{bright:?}, {dark:?}"
        );
    }
}

#[test]
fn who_wants_to_stop_can() {
    let Some(denoiser) = denoiser() else { return };
    let stopped = denoiser.denoise(&noisy(AovSet::NONE), GuideUse::Denoised, 2, &mut |_| ControlFlow::Break(()));
    assert!(matches!(stopped, Err(DenoiseError::Cancelled)), "{stopped:?}");
}
