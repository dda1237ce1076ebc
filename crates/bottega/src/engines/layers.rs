//! The layers of a picture by an external engine.

use bottega_engines::external::Opened;
use bottega_image::{Aov, AovSet, Layer, Layout, OutputFormat};

use crate::{
    error::Error,
    request::Request,
    settings::{ALL_LAYERS, GUIDES},
};

/// Selects the requested layers from those that the engine offers for the scene. By default all of them if the output format can
/// hold them, plus those that help a requested denoiser.
///
/// - `title`: readable name of the engine.
/// - `is_mixed`: true if the built-in engine takes part; then only layers that both engines make can be selected.
///
/// # Errors
/// The engine does not offer a requested layer.
pub(super) fn layout(request: &Request, opened: &Opened, title: &str, is_mixed: bool) -> Result<Layout, Error> {
    let is_shared = |layer: &Layer| {
        let announced = opened.layers.iter().find(|announced| announced.name == layer.name);
        announced.is_some_and(|announced| announced.shared) && layer.as_aov().is_some()
    };
    let available: Vec<Layer> = opened.layers().filter(|layer| !is_mixed || is_shared(layer)).collect();
    let all = || available.iter().map(|layer| layer.name.as_str()).collect();
    let is_png = || request.output.file.as_deref().map(OutputFormat::of).transpose();
    let requested = request.film.layers.as_deref();
    let mut wanted: Vec<&str> = match requested {
        Some([word]) if word == ALL_LAYERS => all(),
        Some(names) => names.iter().map(String::as_str).collect(),
        None if is_png()? == Some(OutputFormat::Png) => Vec::new(),
        None => all(),
    };
    let helps = |layer: &&Layer| request.film.denoise && layer.as_aov().is_some_and(|aov| GUIDES.contains(&aov));
    if requested.is_none_or(|requested| !requested.is_empty()) {
        wanted.extend(available.iter().filter(helps).map(|layer| layer.name.as_str()));
    }
    let mut aovs = AovSet::NONE;
    let mut layers: Vec<Layer> = Vec::new();
    for name in wanted {
        // The sample count does not come from the engine.
        if name == Aov::SampleCount.name() {
            aovs = aovs.with(Aov::SampleCount);
            continue;
        }
        let Some(layer) = available.iter().find(|layer| layer.name == name) else {
            return Err(lacking(name, &available, title, is_mixed));
        };
        match layer.as_aov() {
            Some(aov) => aovs = aovs.with(aov),
            None if !layers.contains(layer) => layers.push(layer.clone()),
            None => {}
        }
    }
    Layout::with_layers(aovs, layers)
        .map_err(|error| Error::failed(format!("cannot store the layers of {title}: {error}"), "request fewer layers"))
}

fn lacking(name: &str, available: &[Layer], title: &str, is_mixed: bool) -> Error {
    let who = if is_mixed { format!("{title} and the built-in engine both") } else { title.to_owned() };
    let names: Vec<&str> = available.iter().map(|layer| layer.name.as_str()).chain([Aov::SampleCount.name()]).collect();
    let verb = if is_mixed { "do not make the same" } else { "makes no" };
    Error::usage(
        format!("{who} {verb} layer `{name}` of this scene"),
        format!("available: {}; other engines make the layers that their scene file requests", names.join(", ")),
    )
}

#[cfg(test)]
mod tests {
    use bottega_engines::external::{CombineWord, OpenedLayer};

    use super::*;

    fn opened() -> Opened {
        let layer = |name: &str, channels: &str, combine, shared| OpenedLayer {
            name: name.to_owned(),
            channels: channels.chars().map(String::from).collect(),
            combine,
            shared,
        };
        let layers = vec![
            layer("normal", "XYZ", CombineWord::Mean, true),
            layer("albedo", "RGB", CombineWord::Mean, false),
            layer("depth", "Z", CombineWord::Pick, false),
            layer("Shadow", "RGB", CombineWord::Mean, false),
        ];
        Opened { width: 8, height: 8, layers, ..Opened::default() }
    }

    fn chosen_without_denoising(output: &str, layers: Option<&[&str]>, is_mixed: bool) -> Result<String, String> {
        chosen(output, layers, is_mixed, false)
    }

    fn chosen(output: &str, layers: Option<&[&str]>, is_mixed: bool, denoise: bool) -> Result<String, String> {
        let mut request = Request::new("a.blend");
        request.output.file = Some(output.into());
        request.film.denoise = denoise;
        request.film.layers = layers.map(|layers| layers.iter().map(|layer| (*layer).to_owned()).collect());
        let layout = layout(&request, &opened(), "X", is_mixed).map_err(|error| error.to_string())?;
        let mut names: Vec<&str> = layout.aovs().iter().map(Aov::name).collect();
        names.extend(layout.layers().iter().map(|layer| layer.name.as_str()));
        Ok(names.join(","))
    }

    #[test]
    fn all_that_the_scene_asks_for_is_had_unless_somebody_says_otherwise() {
        let all = Ok("albedo,normal,Shadow,depth".to_owned());
        assert_eq!(chosen_without_denoising("a.exr", None, false), all);
        assert_eq!(chosen_without_denoising("a.exr", Some(&["all"]), false), all);
        assert_eq!(chosen_without_denoising("a.exr", Some(&[]), false), Ok(String::new()));
        assert_eq!(chosen_without_denoising("a.png", None, false), Ok(String::new()));
        assert_eq!(
            chosen_without_denoising("a.exr", Some(&["depth", "samples", "depth"]), false),
            Ok("samples,depth".to_owned())
        );
        assert_eq!(chosen("a.png", None, false, true), Ok("albedo,normal".to_owned()));
        assert_eq!(chosen("a.exr", Some(&["depth"]), false, true), Ok("albedo,normal,depth".to_owned()));
        assert_eq!(chosen("a.exr", Some(&[]), false, true), Ok(String::new()));
        let lacking = chosen_without_denoising("a.exr", Some(&["uv"]), false).unwrap_err();
        assert!(lacking.contains("X makes no layer `uv`"), "{lacking}");
    }

    #[test]
    fn of_two_engines_those_are_had_by_which_both_mean_the_same() {
        assert_eq!(chosen_without_denoising("a.exr", None, true), Ok("normal".to_owned()));
        assert_eq!(
            chosen_without_denoising("a.exr", Some(&["normal", "samples"]), true),
            Ok("normal,samples".to_owned())
        );
        assert!(
            chosen_without_denoising("a.exr", Some(&["depth"]), true)
                .unwrap_err()
                .contains("do not make the same layer `depth`")
        );
    }
}
