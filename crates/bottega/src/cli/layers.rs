//! Which layers a picture has beside its color.

use std::{convert::Infallible, str::FromStr};

use bottega_image::{Aov, AovSet};

use crate::error::CliError;

/// The layers that help a denoiser.
pub(crate) const GUIDES: [Aov; 2] = [Aov::Albedo, Aov::Normal];

/// What `--aov` says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum LayersArg {
    None,
    All,
    Named(Vec<String>),
}

impl FromStr for LayersArg {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(match text.trim() {
            "none" => Self::None,
            "all" => Self::All,
            list => Self::Named(list.split(',').map(|name| name.trim().to_owned()).collect()),
        })
    }
}

impl LayersArg {
    /// Which of our own engine's layers are asked for.
    ///
    /// - `denoise`: a denoiser will look at the picture, whom some of them help. Who wants none of them has none.
    pub(crate) fn of_own_engine(asked: Option<&Self>, denoise: bool) -> Result<AovSet, CliError> {
        let guides = if denoise && asked != Some(&Self::None) { &GUIDES[..] } else { &[] };
        let asked = match asked {
            None | Some(Self::None) => Ok(AovSet::NONE),
            Some(Self::All) => Ok(Aov::ALL.into_iter().collect()),
            Some(Self::Named(names)) => names.iter().map(|name| own_layer(name)).collect::<Result<AovSet, CliError>>(),
        };
        Ok(asked?.iter().chain(guides.iter().copied()).collect())
    }
}

fn own_layer(name: &str) -> Result<Aov, CliError> {
    Aov::ALL.into_iter().find(|aov| aov.name() == name).ok_or_else(|| {
        CliError::usage(
            format!("our own engine has no layer `{name}` for --aov"),
            format!("it has {}; `all` is all of them, `none` is none", Aov::ALL.map(Aov::name).join(", ")),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(text: &str) -> Result<AovSet, CliError> {
        let Ok(layers) = text.parse::<LayersArg>();
        LayersArg::of_own_engine(Some(&layers), false)
    }

    #[test]
    fn layers_of_our_own_engine_are_named_all_or_none() {
        assert_eq!(asked("depth, normal").ok(), Some([Aov::Depth, Aov::Normal].into_iter().collect()));
        assert_eq!(asked("all").ok(), Some(Aov::ALL.into_iter().collect()));
        assert_eq!(asked("none").ok(), Some(AovSet::NONE));
        for wrong in ["beauty", "", "depth,", "depth,all"] {
            let error = asked(wrong).expect_err(wrong);
            assert!(error.is_usage() && error.to_string().contains("has no layer"), "{wrong}: {error}");
        }
        let denoised = |asked: Option<LayersArg>| LayersArg::of_own_engine(asked.as_ref(), true).ok();
        assert_eq!(denoised(None), Some(GUIDES.into_iter().collect()));
        assert_eq!(denoised(Some(LayersArg::None)), Some(AovSet::NONE));
    }
}
