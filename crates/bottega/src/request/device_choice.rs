//! The choice of devices by their names in a request.

use std::str::FromStr;

use thiserror::Error as ThisError;

use super::InvalidField;
use crate::devices::board_address::{self, BoardAddressError};

/// The word for the processors in a list of devices.
const PROCESSORS: &str = "cpu";
/// The word for the default devices: processors and the best GPU.
pub const AUTO: &str = "auto";
/// The prefix of the address of a board.
const BOARD: &str = "tcp://";

/// The reason why names of devices cannot be chosen. Its text says which names are allowed.
#[derive(Clone, Debug, PartialEq, Eq, ThisError)]
pub enum DeviceNamesError {
    /// No name is given, a name is empty, or `auto` is given with other names.
    #[error(
        "`{auto}`, or names with commas between them: `{cpu}`, parts of GPUs' names, tcp://HOST:PORT of boards",
        auto = AUTO,
        cpu = PROCESSORS
    )]
    Names,
    /// Boards are named without `cpu`, the processors.
    #[error("`{cpu}` beside boards, which trace rays but do not shade", cpu = PROCESSORS)]
    NoProcessors,
    /// The address of a board cannot be used.
    #[error(transparent)]
    Board(#[from] BoardAddressError),
}

/// The devices that a request names for rendering.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum DeviceChoice {
    /// The processors, and the best GPU if there is one.
    #[default]
    Auto,
    /// Exactly these devices.
    These {
        /// True if the processors are among them.
        processors: bool,
        /// GPUs, each by a part of its name.
        gpus: Vec<String>,
        /// Addresses of boards, which trace rays.
        boards: Vec<String>,
    },
}

impl DeviceChoice {
    /// Returns the choice of the processors alone.
    fn processors() -> Self {
        Self::These { processors: true, gpus: Vec::new(), boards: Vec::new() }
    }

    /// Returns the choice for bit-identical pixels on every machine: with `exact`, the default devices become the processors
    /// alone.
    ///
    /// # Errors
    /// `exact` is set and the choice names a GPU.
    pub fn exactly(&self, exact: bool) -> Result<Self, InvalidField> {
        match self {
            _ if !exact => Ok(self.clone()),
            Self::These { gpus, .. } if !gpus.is_empty() => Err(InvalidField::new(
                "devices.names",
                format!("`{}`", self.names().join(",")),
                "the pixels of a GPU are not bit-identical to those of processors: leave out `devices.exact` (--exact), or the GPU",
            )),
            // Boards give the same bits.
            Self::These { .. } => Ok(self.clone()),
            Self::Auto => Ok(Self::processors()),
        }
    }

    /// Returns the devices of a machine for another machine's job: with `exact` the processors alone, if they are in the
    /// choice.
    pub fn for_others(&self, exact: bool) -> Self {
        match self {
            Self::These { processors: true, .. } if exact => Self::processors(),
            _ => self.clone(),
        }
    }
}

impl DeviceChoice {
    /// Makes a choice from its names; the opposite of [`Self::names`].
    ///
    /// # Errors
    /// A name is empty, `auto` stands beside others, the address of a board is invalid, or boards stand without the processors.
    pub fn of(names: &[String]) -> Result<Self, DeviceNamesError> {
        if names == [AUTO] {
            return Ok(Self::Auto);
        }
        if names.is_empty() || names.iter().any(|name| name.trim().is_empty() || name == AUTO) {
            return Err(DeviceNamesError::Names);
        }
        let others = names.iter().filter(|name| *name != PROCESSORS).cloned();
        let (boards, gpus): (Vec<String>, _) = others.partition(|name| name.starts_with(BOARD));
        boards.iter().try_for_each(|name| board_address::check(name))?;
        let processors = names.iter().any(|name| name == PROCESSORS);
        if !boards.is_empty() && !processors {
            return Err(DeviceNamesError::NoProcessors);
        }
        Ok(Self::These { processors, gpus, boards })
    }

    /// Returns the names that stand for this choice.
    pub fn names(&self) -> Vec<String> {
        match self {
            Self::Auto => vec![AUTO.to_owned()],
            Self::These { processors, gpus, boards } => {
                let processors = processors.then(|| PROCESSORS.to_owned()).into_iter();
                processors.chain(gpus.iter().cloned()).chain(boards.iter().cloned()).collect()
            }
        }
    }
}

impl FromStr for DeviceChoice {
    type Err = DeviceNamesError;

    fn from_str(text: &str) -> Result<Self, DeviceNamesError> {
        Self::of(&text.split(',').map(|name| name.trim().to_owned()).collect::<Vec<_>>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_are_chosen_by_name_or_all_that_the_machine_has() {
        let these = |processors, gpus: &[&str]| {
            let gpus = gpus.iter().map(|gpu| (*gpu).to_owned()).collect();
            Ok(DeviceChoice::These { processors, gpus, boards: Vec::new() })
        };
        assert_eq!("auto".parse(), Ok(DeviceChoice::Auto));
        assert_eq!("cpu".parse(), these(true, &[]));
        assert_eq!("llvmpipe".parse(), these(false, &["llvmpipe"]));
        assert_eq!("cpu, H200".parse(), these(true, &["H200"]));
        for names in ["auto", "cpu", "llvmpipe", "cpu,H200", "cpu,H200,tcp://10.0.0.7:7070"] {
            assert_eq!(names.parse::<DeviceChoice>().unwrap().names().join(","), names);
        }
        for wrong in ["", "cpu,", "auto,cpu", "tcp://10.0.0.7:7070", "cpu,tcp://nowhere"] {
            assert!(wrong.parse::<DeviceChoice>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn what_is_exact_is_the_processors_matter() {
        assert_eq!(DeviceChoice::Auto.exactly(true).unwrap(), DeviceChoice::processors());
        assert_eq!(DeviceChoice::Auto.exactly(false).unwrap(), DeviceChoice::Auto);
        let gpu: DeviceChoice = "cpu,llvmpipe".parse().unwrap();
        assert!(gpu.exactly(true).is_err() && gpu.exactly(false).is_ok());
        assert_eq!(gpu.for_others(true).exactly(true).unwrap(), DeviceChoice::processors());
        assert_eq!(gpu.for_others(false), gpu);
        let alone: DeviceChoice = "llvmpipe".parse().unwrap();
        assert!(alone.for_others(true).exactly(true).is_err(), "nobody is left who could");
    }
}
