//! The layers of the built-in engine, in addition to the color.

use bottega_image::{Aov, AovSet};

use crate::error::Error;

/// The auxiliary layers of denoisers.
pub const GUIDES: [Aov; 2] = [Aov::Albedo, Aov::Normal];

/// The word that requests all layers.
pub(crate) const ALL: &str = "all";

/// Returns the requested layers of the built-in engine.
///
/// - `asked`: names of layers; `all` alone means all of them, an empty list none at all.
/// - `denoise`: true if the picture will be denoised; adds the layers that help the denoiser, unless `asked` is empty.
///
/// # Errors
/// There is no layer of that name.
pub fn own_layers(asked: Option<&[String]>, denoise: bool) -> Result<AovSet, Error> {
    let guides = if denoise && asked.is_none_or(|asked| !asked.is_empty()) { &GUIDES[..] } else { &[] };
    let asked = match asked {
        None => AovSet::NONE,
        Some([all]) if all == ALL => Aov::ALL.into_iter().collect(),
        Some(names) => names.iter().map(|name| own_layer(name)).collect::<Result<AovSet, Error>>()?,
    };
    Ok(asked.iter().chain(guides.iter().copied()).collect())
}

fn own_layer(name: &str) -> Result<Aov, Error> {
    Aov::ALL.into_iter().find(|aov| aov.name() == name).ok_or_else(|| {
        Error::usage(
            format!("our own engine has no layer `{name}` (--aov, `film.layers`)"),
            format!("it has {}; `all` is all of them, `none` is none", Aov::ALL.map(Aov::name).join(", ")),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(names: &[&str]) -> Result<AovSet, Error> {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        own_layers(Some(&names), false)
    }

    #[test]
    fn layers_of_our_own_engine_are_named_all_or_none() {
        assert_eq!(asked(&["depth", "normal"]).ok(), Some([Aov::Depth, Aov::Normal].into_iter().collect()));
        assert_eq!(asked(&["all"]).ok(), Some(Aov::ALL.into_iter().collect()));
        assert_eq!(asked(&[]).ok(), Some(AovSet::NONE));
        for wrong in [&["beauty"][..], &[""], &["depth", ""], &["depth", "all"]] {
            let error = asked(wrong).expect_err("no such layer");
            assert!(error.is_usage() && error.to_string().contains("has no layer"), "{wrong:?}: {error}");
        }
        assert_eq!(own_layers(None, true).ok(), Some(GUIDES.into_iter().collect()));
        assert_eq!(own_layers(Some(&[]), true).ok(), Some(AovSet::NONE));
    }
}
