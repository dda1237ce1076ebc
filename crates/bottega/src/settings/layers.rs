//! The layers of the built-in engine, in addition to the color.

use bottega_image::{Aov, AovSet};

use crate::error::Error;

/// The layers that help a denoiser.
pub const GUIDES: [Aov; 2] = [Aov::Albedo, Aov::Normal];

/// The word that requests all layers.
pub(crate) const ALL: &str = "all";

/// Returns the layers that a request may name: all but those of shadow catchers, which come with the catchers.
fn named() -> impl Iterator<Item = Aov> {
    Aov::ALL.into_iter().filter(|aov| !Aov::CATCHERS.contains(aov))
}

/// Returns the requested layers of the built-in engine.
///
/// - `requested`: names of layers; `all` alone means all of them, an empty list none at all.
/// - `denoise`: true if the picture will be denoised; adds the layers that help the denoiser, unless `requested` is empty.
///
/// # Errors
/// There is no layer of that name.
pub fn own_layers(requested: Option<&[String]>, denoise: bool) -> Result<AovSet, Error> {
    let guides = if denoise && requested.is_none_or(|requested| !requested.is_empty()) { &GUIDES[..] } else { &[] };
    let requested = match requested {
        None => AovSet::NONE,
        Some([all]) if all == ALL => named().collect(),
        Some(names) => names.iter().map(|name| own_layer(name)).collect::<Result<AovSet, Error>>()?,
    };
    Ok(requested.iter().chain(guides.iter().copied()).collect())
}

fn own_layer(name: &str) -> Result<Aov, Error> {
    if let Some(aov) = Aov::CATCHERS.into_iter().find(|aov| aov.name() == name) {
        return Err(Error::usage(
            format!("the layer `{}` cannot be named (--aov, `film.layers`)", aov.name()),
            "it comes with --shadow-catcher (`film.shadow_catchers`)",
        ));
    }
    named().find(|aov| aov.name() == name).ok_or_else(|| {
        Error::usage(
            format!("the built-in engine has no layer `{name}` (--aov, `film.layers`)"),
            format!(
                "it has {}; `all` stands for all of them, `none` for no layer",
                named().map(Aov::name).collect::<Vec<_>>().join(", ")
            ),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(names: &[&str]) -> Result<AovSet, Error> {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        own_layers(Some(&names), false)
    }

    #[test]
    fn layers_of_our_own_engine_are_named_all_or_none() {
        assert_eq!(chosen(&["depth", "normal"]).ok(), Some([Aov::Depth, Aov::Normal].into_iter().collect()));
        assert_eq!(chosen(&["all"]).ok(), Some(named().collect()));
        assert_eq!(chosen(&[]).ok(), Some(AovSet::NONE));
        for wrong in [&["beauty"][..], &[""], &["depth", ""], &["depth", "all"]] {
            let error = chosen(wrong).expect_err("no such layer");
            assert!(error.is_usage() && error.to_string().contains("has no layer"), "{wrong:?}: {error}");
        }
        assert_eq!(own_layers(None, true).ok(), Some(GUIDES.into_iter().collect()));
        assert_eq!(own_layers(Some(&[]), true).ok(), Some(AovSet::NONE));
    }
}
