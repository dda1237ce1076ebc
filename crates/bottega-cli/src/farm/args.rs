//! Options by which a farm is named, and who one is there.

use std::path::PathBuf;

use bottega_cluster::{Credentials, FarmAddress, FarmLink, JobBoard, link_as};
use clap::{Args, ValueHint};

use crate::{config, error::CliError};

/// Who one is to servers of others.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "NATS servers of others")]
pub(crate) struct LoginArgs {
    /// Credentials for NATS servers that others run: a `.creds` file.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, global = true)]
    creds: Option<PathBuf>,
    /// An NKey for them: a file with its seed.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, global = true, conflicts_with = "creds")]
    nkey: Option<PathBuf>,
    /// Certificates of more authorities than those of the system (PEM).
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, global = true)]
    tls_ca: Option<PathBuf>,
    /// The certificate by which the servers know this machine (PEM).
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, global = true, requires = "tls_key")]
    tls_cert: Option<PathBuf>,
    /// Its key (PEM).
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, global = true, requires = "tls_cert")]
    tls_key: Option<PathBuf>,
}

impl LoginArgs {
    /// What the options say; where they say nothing, and no farm is named, what the configuration file says.
    pub(crate) fn credentials(&self, farm: Option<&FarmAddress>) -> Credentials {
        let said = Credentials {
            creds: self.creds.clone(),
            nkey: self.nkey.clone(),
            tls_ca: self.tls_ca.clone(),
            tls_own: self.tls_cert.clone().zip(self.tls_key.clone()),
        };
        if said == Credentials::default() && farm.is_none() { config::farm_credentials() } else { said }
    }

    /// Links up with a farm: the one that is named, that of the configuration file, or the one of this machine.
    pub(crate) fn link(&self, farm: Option<&FarmAddress>) -> Result<FarmLink, CliError> {
        self.link_as(farm, None)
    }

    /// The same as a machine of this name.
    pub(super) fn link_as(&self, farm: Option<&FarmAddress>, name: Option<&str>) -> Result<FarmLink, CliError> {
        let credentials = self.credentials(farm);
        Ok(link_as(farm.cloned().or_else(config::farm_address).as_ref(), &credentials, name)?)
    }
}

/// Which farm is looked at.
#[derive(Debug, Args)]
pub(crate) struct FarmArgs {
    /// Where the farm is; default: the one that `bottega up` runs on this machine.
    #[arg(long, value_name = "ADDRESS", env = "BOTTEGA_FARM", hide_env_values = true, global = true)]
    farm: Option<FarmAddress>,
    /// Print JSON, an object a line, instead of text for people.
    #[arg(long, global = true)]
    pub(crate) json: bool,
    #[command(flatten)]
    login: LoginArgs,
}

impl FarmArgs {
    /// The farm that was named, or that of the configuration file.
    pub(super) fn address(&self) -> Option<FarmAddress> {
        self.farm.clone().or_else(config::farm_address)
    }

    /// Links up with the farm.
    pub(crate) fn board(&self) -> Result<JobBoard, CliError> {
        Ok(JobBoard { uplink: self.login.link(self.farm.as_ref())?.uplink })
    }
}

/// A number of bytes, in gigabytes.
pub(super) fn parse_gigabytes(text: &str) -> Result<u64, String> {
    let size = text.parse().ok().filter(|size: &f64| (0.0..=1e6).contains(size));
    size.map(|gigabytes| (gigabytes * 1e9) as u64)
        .ok_or_else(|| "a number of gigabytes is needed, such as 20".to_owned())
}
