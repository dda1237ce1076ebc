//! Energy and cost of jobs: options for what is not measured, and the printed summary.

use bottega_cluster::energy::{EnergyPrice, JobEnergy, Tariff};
use clap::Args;

use crate::{
    config,
    energy_values::{parse_currency, parse_price, parse_watts},
    error::CliError,
};

/// The number of zones that `bottega jobs show` lists: those that took most energy.
const ZONES_SHOWN: usize = 5;

/// The price of energy in a farm, and the assumed power of machines that cannot measure it.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Energy and cost")]
pub(crate) struct TariffArgs {
    /// Power of a machine with all processors at work, in watts, for machines without counters (RAPL) and without `join
    /// --watts`. Without it their energy is unknown.
    #[arg(long, value_name = "WATTS", value_parser = parse_watts)]
    watts: Option<f64>,
    /// Price of a kilowatt hour.
    #[arg(long, value_name = "PRICE", value_parser = parse_price, requires = "currency")]
    price_per_kwh: Option<f64>,
    /// Currency of the price, such as EUR.
    #[arg(long, value_name = "CODE", value_parser = parse_currency, requires = "price_per_kwh")]
    currency: Option<String>,
}

impl TariffArgs {
    /// Returns the tariff of the options, or else that of the configuration file.
    pub(super) fn tariff(&self) -> Result<Tariff, CliError> {
        let said = self.price_per_kwh.zip(self.currency.clone());
        let price = said.map(|(per_kwh, currency)| EnergyPrice { per_kwh, currency });
        Ok(Tariff { price: price.or_else(config::energy_price), watts: self.watts })
    }
}

/// Returns lines of text about a job's energy; empty if nothing is known.
pub(super) fn lines(energy: &JobEnergy) -> Vec<String> {
    if energy.processor_seconds <= 0.0 {
        return Vec::new();
    }
    let currency = energy.currency.as_deref().unwrap_or_default();
    let mut lines = vec![format!("processor time {}", time(energy.processor_seconds))];
    if let Some(kwh) = energy.kwh {
        let less = if energy.is_partial { ", without machines that report nothing" } else { "" };
        lines[0] += &format!(", energy {}{less}", amount(kwh, energy.cost, currency));
    }
    lines.extend(energy.machines.iter().filter_map(|machine| {
        let energy = amount(machine.kwh?, machine.cost, currency);
        let source =
            machine.source.map(|source| format!(" by its {}", serde_json::json!(source).as_str().unwrap_or_default()));
        Some(format!(
            "  {}: {}, {energy}{}",
            machine.machine,
            time(machine.processor_seconds),
            source.unwrap_or_default()
        ))
    }));
    let mut zones: Vec<_> = energy.zones.iter().collect();
    zones.sort_by(|a, b| b.kwh.total_cmp(&a.kwh));
    if !zones.is_empty() {
        let shown: Vec<String> = zones
            .iter()
            .take(ZONES_SHOWN)
            .map(|zone| format!("{}: {}", zone.id, amount(zone.kwh, zone.cost, currency)))
            .collect();
        lines.push(format!("  zones that took most of it: {}", shown.join("; ")));
    }
    lines
}

fn time(seconds: f64) -> String {
    format!("{seconds:.1} s")
}

/// Formats an energy in a suitable unit, with its cost.
fn amount(kwh: f64, cost: Option<f64>, currency: &str) -> String {
    let energy = if kwh < 0.1 { format!("{} Wh", digits(1e3 * kwh)) } else { format!("{} kWh", digits(kwh)) };
    cost.map_or(energy.clone(), |cost| format!("{energy} ({} {currency})", digits(cost)))
}

/// Formats a number with three significant digits, and at least two decimals.
fn digits(value: f64) -> String {
    let places = if value > 0.0 { (2.0 - value.log10().floor()).clamp(2.0, 12.0) as usize } else { 2 };
    format!("{value:.places$}")
}

#[cfg(test)]
mod tests {
    use bottega_cluster::energy::{MachineEnergy, ZoneEnergy};

    use super::*;

    #[test]
    fn what_is_known_is_said_and_nothing_else() {
        assert_eq!(lines(&JobEnergy::default()), [""; 0]);
        let machine =
            |kwh| MachineEnergy { machine: "a.1".to_owned(), processor_seconds: 3.0, kwh, cost: None, source: None };
        let unknown = JobEnergy {
            processor_seconds: 3.0,
            machines: vec![machine(None)],
            is_partial: true,
            ..JobEnergy::default()
        };
        assert_eq!(lines(&unknown), ["processor time 3.0 s"]);
        let known = JobEnergy {
            kwh: Some(0.25),
            cost: Some(0.125),
            currency: Some("EUR".to_owned()),
            machines: vec![machine(Some(0.25)), machine(None)],
            zones: vec![ZoneEnergy { id: 1, kwh: 0.0005, cost: None }, ZoneEnergy { id: 2, kwh: 0.2, cost: None }],
            ..unknown
        };
        assert_eq!(
            lines(&known),
            [
                "processor time 3.0 s, energy 0.250 kWh (0.125 EUR), without machines that report nothing",
                "  a.1: 3.0 s, 0.250 kWh",
                "  zones that took most of it: 2: 0.200 kWh; 1: 0.500 Wh",
            ]
        );
    }
}
