//! The configuration file: options that apply unless the command line or the environment set them.
//!
//! A table has the name of a command and holds its options as on the command line, without the dashes. `[profile.NAME]` holds
//! such tables, too, which `--profile NAME` adds. `[farm]` is the default farm of all commands.

mod command;
mod words;

use std::{
    env, fs,
    ops::Range,
    path::{Path, PathBuf},
    sync::OnceLock,
};

use bottega_cluster::{Credentials, FarmAddress, address::AddressError, energy::EnergyPrice};
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

/// The environment variable that names the file.
const FILE_VARIABLE: &str = "BOTTEGA_CONFIG";
/// The environment variable that names the profile.
pub(crate) const PROFILE_VARIABLE: &str = "BOTTEGA_PROFILE";
/// The maximum size of the file, in bytes.
const BYTES_MAX: u64 = 1 << 20;
/// The tables that are not commands.
const FARM: &str = "farm";
const PROFILE: &str = "profile";

/// The configuration file as read.
#[derive(Debug)]
pub(crate) struct ConfigFile {
    pub(crate) path: PathBuf,
    pub(crate) text: String,
}

/// The default farm.
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

/// The farm of the file; set once, before a command runs.
static FARM_OF_FILE: OnceLock<(Option<FarmAddress>, Credentials)> = OnceLock::new();

/// The energy price of the file; set once, before a command runs.
static PRICE_OF_FILE: OnceLock<EnergyPrice> = OnceLock::new();

/// Returns the energy price of the file.
pub(crate) fn energy_price() -> Option<EnergyPrice> {
    PRICE_OF_FILE.get().cloned()
}

/// Returns the address of the file's farm.
pub(crate) fn farm_address() -> Option<FarmAddress> {
    FARM_OF_FILE.get()?.0.clone()
}

/// Returns the credentials for the file's farm.
pub(crate) fn farm_credentials() -> Credentials {
    FARM_OF_FILE.get().map(|(_, credentials)| credentials.clone()).unwrap_or_default()
}

/// Returns the path of the file, which need not exist.
pub(crate) fn path() -> PathBuf {
    let named = |name: &str| env::var_os(name).filter(|path| !path.is_empty()).map(PathBuf::from);
    named(FILE_VARIABLE).unwrap_or_else(|| config_folder().join("config.toml"))
}

impl ConfigFile {
    /// Reads the file; `None`: it does not exist, and no variable names it.
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

    /// Parses the tables of the file.
    fn tables(&self) -> Result<DeTable<'_>, CliError> {
        DeTable::parse(&self.text)
            .map(toml::Spanned::into_inner)
            .map_err(|error| self.wrong(error.span().unwrap_or_default(), error.message()))
    }

    /// Stores the file's farm and energy price.
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
        let address =
            address.map_err(|error: AddressError| self.wrong(name.span(), &format!("farm.address: {error}")))?;
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
            // This is the only place that sets it.
            (Some(per_kwh), Some(currency)) => _ = PRICE_OF_FILE.set(EnergyPrice { per_kwh, currency }),
            (None, None) => {}
            _ => return Err(self.wrong(name.span(), "farm.price-per-kwh and farm.currency need each other")),
        }
        // This is the only place that sets it.
        _ = FARM_OF_FILE.set((address, credentials));
        Ok(())
    }

    /// Returns an error at a position in the file.
    fn wrong(&self, span: Range<usize>, problem: &str) -> CliError {
        let before = self.text.get(..span.start).unwrap_or(&self.text);
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().unwrap_or_default().chars().count() + 1;
        CliError::usage(
            format!("`{}`, line {line}, column {column}: {problem}", self.path.display()),
            "correct the file, or set BOTTEGA_CONFIG to another one; docs/render.md shows one",
        )
    }
}

/// Returns the kind of a value, for messages.
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
