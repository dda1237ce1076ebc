//! The options of what paths learn beforehand.

use bottega_render::AgentUse;
use clap::{Args, ValueEnum};

use crate::error::CliError;

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum GuideArg {
    /// Nothing: paths go where materials send them.
    None,
    /// Where light comes from.
    Directions,
    /// All that lighting agents can tell: as well which lights matter, whether they are seen, and what a path is worth. The
    /// default.
    Ala,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum AlaArg {
    /// Shadow rays only where it is not known well enough whether a light is seen.
    Shadows,
    /// Lights are chosen by what comes of them.
    Lights,
    /// Paths go where light was found to come from.
    Directions,
    /// Paths end, or go on as several, by what they are worth.
    Roulette,
}

#[derive(Clone, Debug, Args)]
pub(crate) struct GuideArgs {
    /// What paths learn of the light before the first sample. It changes the noise, and not what the picture shows. GPUs paint
    /// the same without.
    #[arg(long, value_enum, help_heading = "Quality")]
    guide: Option<GuideArg>,
    /// What lighting agents are asked for; default: all of it.
    #[arg(long, value_enum, value_name = "LIST", value_delimiter = ',', help_heading = "Quality")]
    ala: Vec<AlaArg>,
    /// The same as --guide none.
    #[arg(long, conflicts_with_all = ["guide", "ala"], help_heading = "Quality")]
    no_guiding: bool,
}

impl GuideArg {
    /// Whether paths learn where light comes from, and what else agents are asked for, if it is all of it.
    pub(crate) fn whole(self) -> (bool, AgentUse) {
        let all = GuideArgs { guide: Some(self), ala: Vec::new(), no_guiding: false };
        (all.directions(), all.agents())
    }
}

impl GuideArgs {
    /// # Errors
    /// Agents are told what to do, and nobody asks them.
    pub(crate) fn check(&self) -> Result<(), CliError> {
        if self.ala.is_empty() || self.guide() == GuideArg::Ala {
            return Ok(());
        }
        Err(CliError::usage(
            "--ala says what lighting agents are asked for, and nobody asks them",
            "leave --guide away, or say --guide ala",
        ))
    }

    /// Whether paths learn where light comes from.
    pub(crate) fn directions(&self) -> bool {
        match self.guide() {
            GuideArg::None => false,
            GuideArg::Directions => true,
            GuideArg::Ala => self.has(AlaArg::Directions),
        }
    }

    /// What lighting agents are asked for beside that.
    pub(crate) fn agents(&self) -> AgentUse {
        if self.guide() != GuideArg::Ala {
            return AgentUse::default();
        }
        AgentUse {
            shadows: self.has(AlaArg::Shadows),
            lights: self.has(AlaArg::Lights),
            roulette: self.has(AlaArg::Roulette),
        }
    }

    /// Whether somebody said that lighting agents are to help.
    pub(crate) fn asks_for_agents(&self) -> bool {
        self.guide == Some(GuideArg::Ala) || !self.ala.is_empty()
    }

    fn guide(&self) -> GuideArg {
        if self.no_guiding { GuideArg::None } else { self.guide.unwrap_or(GuideArg::Ala) }
    }

    fn has(&self, what: AlaArg) -> bool {
        self.ala.is_empty() || self.ala.contains(&what)
    }
}
