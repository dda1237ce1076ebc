//! The configuration file: options that hold where the command line and the environment do not say otherwise.
//!
//! A table is called like a command and holds its options as one types them, without the dashes. `[profile.NAME]` holds such
//! tables, too, which `--profile NAME` adds. `[farm]` is the farm that commands mean which name none.

mod command;
mod words;

use std::{
    env, fs,
    ops::Range,
    path::{Path, PathBuf},
    sync::OnceLock,
};

use bottega_cluster::{Credentials, FarmAddress, energy::EnergyPrice};
use bottega_platform::folders::config_folder;
use serde::Deserialize;
use toml::de::{DeTable, DeValue};

pub(crate) use self::{
    command::{ConfigArgs, run},
    words::{OPTION_VARIABLE, with_config},
};
use crate::{
    energy_values::{parse_currency, parse_price},
    error::CliError,
};

/// The variable of the environment that names the file.
const FILE_VARIABLE: &str = "BOTTEGA_CONFIG";
/// The variable of the environment that names the profile.
pub(crate) const PROFILE_VARIABLE: &str = "BOTTEGA_PROFILE";
/// Bytes that are read at most.
const BYTES_MAX: u64 = 1 << 20;
/// The tables that are no commands.
const FARM: &str = "farm";
const PROFILE: &str = "profile";

/// A file as it was read.
#[derive(Debug)]
pub(crate) struct ConfigFile {
    pub(crate) path: PathBuf,
    pub(crate) text: String,
}

/// The farm that is meant where none is named.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct FarmTable {
    address: Option<String>,
    creds: Option<PathBuf>,
    nkey: Option<PathBuf>,
    tls_ca: Option<PathBuf>,
    tls_cert: Option<PathBuf>,
    tls_key: Option<PathBuf>,
    price_per_kwh: Option<f64>,
    currency: Option<String>,
}

/// What the file says of the farm; set once, before a command runs.
static FARM_OF_FILE: OnceLock<(Option<FarmAddress>, Credentials)> = OnceLock::new();

/// What energy costs, as the file says; set once, before a command runs.
static PRICE_OF_FILE: OnceLock<EnergyPrice> = OnceLock::new();

/// What energy costs, as the file says.
pub(crate) fn energy_price() -> Option<EnergyPrice> {
    PRICE_OF_FILE.get().cloned()
}

/// The address of the farm that the file names.
pub(crate) fn farm_address() -> Option<FarmAddress> {
    FARM_OF_FILE.get()?.0.clone()
}

/// The credentials that the file names for it.
pub(crate) fn farm_credentials() -> Credentials {
    FARM_OF_FILE.get().map(|(_, credentials)| credentials.clone()).unwrap_or_default()
}

/// Where the file is, or would be.
pub(crate) fn path() -> PathBuf {
    let named = |name: &str| env::var_os(name).filter(|path| !path.is_empty()).map(PathBuf::from);
    named(FILE_VARIABLE).unwrap_or_else(|| config_folder().join("config.toml"))
}

impl ConfigFile {
    /// Reads the file; `None`: there is none, and nobody has named one.
    pub(crate) fn read() -> Result<Option<Self>, CliError> {
        let path = path();
        let length = match fs::metadata(&path) {
            Ok(metadata) => metadata.len(),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound && env::var_os(FILE_VARIABLE).is_none() => {
                return Ok(None);
            }
            Err(source) => return Err(CliError::read(path, source)),
        };
        if length > BYTES_MAX {
            let problem = format!("`{}` has {length} bytes: too many for a configuration", path.display());
            return Err(CliError::usage(
                problem,
                format!("at most {BYTES_MAX}; `bottega config path` says where it is"),
            ));
        }
        let text = fs::read_to_string(&path).map_err(|source| CliError::read(path.clone(), source))?;
        Ok(Some(Self { path, text }))
    }

    /// Its tables.
    fn tables(&self) -> Result<DeTable<'_>, CliError> {
        DeTable::parse(&self.text)
            .map(toml::Spanned::into_inner)
            .map_err(|error| self.wrong(error.span().unwrap_or_default(), error.message()))
    }

    /// Takes what it says of the farm.
    fn take_farm(&self, tables: &DeTable<'_>) -> Result<(), CliError> {
        let Some((name, _)) = tables.iter().find(|(name, _)| name.get_ref() == FARM) else { return Ok(()) };
        #[derive(Deserialize)]
        struct WholeFile {
            farm: FarmTable,
        }
        let file: WholeFile = toml::from_str(&self.text)
            .map_err(|error| self.wrong(error.span().unwrap_or_else(|| name.span()), error.message()))?;
        let FarmTable { address, creds, nkey, tls_ca, tls_cert, tls_key, price_per_kwh, currency } = file.farm;
        let address = address.map(|address| address.parse()).transpose();
        let address = address.map_err(|error: String| self.wrong(name.span(), &format!("farm.address: {error}")))?;
        let beside = |path: PathBuf| self.path.parent().unwrap_or(Path::new(".")).join(path);
        let credentials = Credentials {
            creds: creds.map(beside),
            nkey: nkey.map(beside),
            tls_ca: tls_ca.map(beside),
            tls_own: tls_cert.map(beside).zip(tls_key.map(beside)),
        };
        let price = price_per_kwh.map(|price| parse_price(&price.to_string())).transpose();
        let price = price.map_err(|error| self.wrong(name.span(), &format!("farm.price-per-kwh: {error}")))?;
        let currency = currency.map(|currency| parse_currency(&currency)).transpose();
        let currency = currency.map_err(|error| self.wrong(name.span(), &format!("farm.currency: {error}")))?;
        match (price, currency) {
            // Nobody else sets it.
            (Some(per_kwh), Some(currency)) => _ = PRICE_OF_FILE.set(EnergyPrice { per_kwh, currency }),
            (None, None) => {}
            _ => return Err(self.wrong(name.span(), "farm.price-per-kwh and farm.currency are only of use together")),
        }
        // Nobody else sets it.
        _ = FARM_OF_FILE.set((address, credentials));
        Ok(())
    }

    /// An error at a place of the file.
    fn wrong(&self, span: Range<usize>, problem: &str) -> CliError {
        let before = self.text.get(..span.start).unwrap_or(&self.text);
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().unwrap_or_default().chars().count() + 1;
        CliError::usage(
            format!("`{}`, line {line}, column {column}: {problem}", self.path.display()),
            "mend the file, or name another one by BOTTEGA_CONFIG; docs/render.md shows one",
        )
    }
}

/// The kind of a value, for people.
fn kind(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::String(_) => "a text",
        DeValue::Integer(_) | DeValue::Float(_) => "a number",
        DeValue::Boolean(_) => "true or false",
        DeValue::Datetime(_) => "a date",
        DeValue::Array(_) => "a list",
        DeValue::Table(_) => "a table",
    }
}
