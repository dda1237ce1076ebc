//! Options that select a farm, and the credentials for it.

use std::path::PathBuf;

use bottega_cluster::{Credentials, FarmAddress, FarmLink, JobBoard, link_as};
use clap::{Args, ValueHint};

use crate::{config, error::CliError, option_value::InvalidValue};

/// Credentials for a remote server.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "NATS servers of others")]
pub(crate) struct LoginArgs {
    /// Credentials for NATS servers that others run: a `.creds` file.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, global = true)]
    creds: Option<PathBuf>,
    /// An NKey for NATS servers that others run: a file with its seed.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, global = true, conflicts_with = "creds")]
    nkey: Option<PathBuf>,
    /// Certificates of authorities, in place of the system's (PEM).
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, global = true)]
    tls_ca: Option<PathBuf>,
    /// The certificate by which the servers know this machine (PEM).
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, global = true, requires = "tls_key")]
    tls_cert: Option<PathBuf>,
    /// The key of that certificate (PEM).
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, global = true, requires = "tls_cert")]
    tls_key: Option<PathBuf>,
}

impl LoginArgs {
    /// Returns the credentials of the options; by default, if no farm is named, those of the configuration file.
    pub(crate) fn credentials(&self, farm: Option<&FarmAddress>) -> Credentials {
        let said = Credentials {
            creds: self.creds.clone(),
            nkey: self.nkey.clone(),
            tls_ca: self.tls_ca.clone(),
            tls_own: self.tls_cert.clone().zip(self.tls_key.clone()),
        };
        if said == Credentials::default() && farm.is_none() { config::farm_credentials() } else { said }
    }

    /// Connects to a farm: the named one, that of the configuration file, or that of this machine.
    pub(crate) fn link(&self, farm: Option<&FarmAddress>) -> Result<FarmLink, CliError> {
        self.link_as(farm, None)
    }

    /// Connects as a machine with this name.
    pub(crate) fn link_as(&self, farm: Option<&FarmAddress>, name: Option<&str>) -> Result<FarmLink, CliError> {
        let credentials = self.credentials(farm);
        Ok(link_as(farm.cloned().or_else(config::farm_address).as_ref(), &credentials, name)?)
    }
}

/// Options that select a farm.
#[derive(Debug, Args)]
pub(crate) struct FarmArgs {
    /// Address of the farm; default: the one that `bottega up` runs on this machine.
    #[arg(long, value_name = "ADDRESS", env = "BOTTEGA_FARM", hide_env_values = true, global = true)]
    farm: Option<FarmAddress>,
    /// Print one JSON object per line instead of text for people.
    #[arg(long, global = true)]
    pub(crate) json: bool,
    #[command(flatten)]
    login: LoginArgs,
}

impl FarmArgs {
    /// Returns the address of the named farm, or that of the configuration file.
    pub(crate) fn address(&self) -> Option<FarmAddress> {
        self.farm.clone().or_else(config::farm_address)
    }

    /// Connects to the farm.
    pub(crate) fn board(&self) -> Result<JobBoard, CliError> {
        Ok(JobBoard { uplink: self.login.link(self.farm.as_ref())?.uplink })
    }
}

/// Parses a size in gigabytes; returns bytes.
pub(crate) fn parse_gigabytes(text: &str) -> Result<u64, InvalidValue> {
    let size = text.parse().ok().filter(|size: &f64| (0.0..=1e6).contains(size));
    size.map(|gigabytes| (gigabytes * 1e9) as u64).ok_or_else(|| "a number of gigabytes is needed, such as 20".into())
}
