//! The energy of a job and what it costs: by machine and by zone, from what machines say that they have used.
//!
//! - `tariff`: what the keeper of the farm says of prices, and of machines that know nothing of their own.

use std::collections::BTreeMap;

use bottega::{Event, events::ZoneEvent};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    error::Error,
    job::Job,
    job_board::JobBoard,
    usage::{EnergySource, JobUsage},
};

const TARIFF: &str = "tariff";
const JOULES_PER_KWH: f64 = 3.6e6;

/// A price, and the currency that it is in.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EnergyPrice {
    /// Of a kilowatt hour.
    pub per_kwh: f64,
    /// Such as `EUR`.
    pub currency: String,
}

/// What the keeper of a farm says.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Tariff {
    /// What energy costs.
    pub price: Option<EnergyPrice>,
    /// What a machine draws with all processors at work that knows nothing of its own.
    pub watts: Option<f64>,
}

/// The energy of a machine for a job. What is not known is left out.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct MachineEnergy {
    /// The process.
    pub machine: String,
    /// Processor seconds.
    pub processor_seconds: f64,
    /// Energy.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kwh: Option<f64>,
    /// What that costs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cost: Option<f64>,
    /// By what the energy is known: `counters` of the processors, or the `watts` that somebody said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source: Option<EnergySource>,
}

/// The energy of a zone: its share of that of the machine that painted it, by measured time.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ZoneEnergy {
    /// IdZone.
    pub id: u32,
    /// Energy.
    pub kwh: f64,
    /// What that costs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cost: Option<f64>,
}

/// The energy of a job. What is not known is left out.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct JobEnergy {
    /// Processor seconds of all machines.
    pub processor_seconds: f64,
    /// Energy of those machines of which it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kwh: Option<f64>,
    /// What that costs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cost: Option<f64>,
    /// In which currency.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub currency: Option<String>,
    /// The price of a kilowatt hour.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub price_per_kwh: Option<f64>,
    /// Whether the energy of some machines is not known, and `kwh` is too little.
    pub is_partial: bool,
    /// Each machine.
    pub machines: Vec<MachineEnergy>,
    /// Zones that are painted, whose machine's energy is known.
    pub zones: Vec<ZoneEnergy>,
}

impl JobEnergy {
    /// - `usages`: what each process says.
    /// - `rows`: the rows of the job.
    pub fn of(usages: &BTreeMap<String, JobUsage>, rows: &[Event], tariff: &Tariff) -> Self {
        let price = tariff.price.as_ref();
        let cost = |kwh: f64| price.map(|price| kwh * price.per_kwh);
        let machines: Vec<MachineEnergy> = usages
            .iter()
            .map(|(name, usage)| {
                let (kwh, source) = known_energy(usage, tariff.watts).unzip();
                let processor_seconds = usage.processor_ms as f64 / 1e3;
                MachineEnergy { machine: name.clone(), processor_seconds, kwh, cost: kwh.and_then(cost), source }
            })
            .collect();
        let known = || machines.iter().filter_map(|machine| machine.kwh);
        let kwh = known().next().map(|_| known().sum());
        Self {
            processor_seconds: machines.iter().fold(0.0, |all, machine| all + machine.processor_seconds),
            kwh,
            cost: kwh.and_then(cost),
            currency: price.map(|price| price.currency.clone()),
            price_per_kwh: price.map(|price| price.per_kwh),
            is_partial: machines.iter().any(|machine| machine.kwh.is_none()),
            zones: zones(&machines, rows, &cost),
            machines,
        }
    }
}

/// The energy of a process, in kilowatt hours, and by what it is known.
fn known_energy(usage: &JobUsage, watts: Option<f64>) -> Option<(f64, EnergySource)> {
    let told = usage.millijoules.zip(usage.source).map(|(energy, source)| (energy as f64 / 1e3, source));
    let by_farm = || {
        let seconds = usage.processor_ms as f64 / 1e3 / usage.processors.max(1) as f64;
        watts.map(|watts| (watts * seconds, EnergySource::Watts))
    };
    told.or_else(by_farm).map(|(joules, source)| (joules / JOULES_PER_KWH, source))
}

fn zones(machines: &[MachineEnergy], rows: &[Event], cost: &impl Fn(f64) -> Option<f64>) -> Vec<ZoneEnergy> {
    let painted: Vec<&ZoneEvent> = rows
        .iter()
        .filter_map(|row| match row {
            Event::Zone(zone) => Some(&**zone).filter(|zone| zone.state == "done"),
            _ => None,
        })
        .collect();
    let mut zones = Vec::new();
    for MachineEnergy { machine, kwh, .. } in machines {
        let Some(kwh) = kwh else { continue };
        // Agents are called after the process that they live in.
        let is_of_it = |zone: &&&ZoneEvent| zone.agent.as_deref().and_then(|it| it.split('@').nth(1)) == Some(machine);
        let own: Vec<(u32, f64)> =
            painted.iter().filter(is_of_it).filter_map(|zone| Some((zone.id, zone.seconds_measured?))).collect();
        let all: f64 = own.iter().map(|(_, seconds)| seconds).sum();
        if all > 0.0 {
            zones.extend(own.into_iter().map(|(id, seconds)| {
                let kwh = kwh * seconds / all;
                ZoneEnergy { id, kwh, cost: cost(kwh) }
            }));
        }
    }
    zones.sort_by_key(|zone| zone.id);
    zones
}

impl JobBoard {
    /// What the keeper of the farm says of prices.
    pub fn tariff(&self) -> Tariff {
        self.read_notice(TARIFF).unwrap_or_default()
    }

    /// Says what energy costs, and what machines draw that know nothing of their own.
    ///
    /// # Errors
    /// The farm does not answer.
    pub fn set_tariff(&self, tariff: &Tariff) -> Result<(), Error> {
        self.put_notice(TARIFF, tariff)
    }

    /// The energy of a job.
    ///
    /// # Errors
    /// The farm does not answer.
    pub fn energy(&self, number: u32, job: &Job, tariff: &Tariff) -> Result<JobEnergy, Error> {
        let usages = self.society(number).unwrap_or_default().usages;
        if usages.is_empty() {
            return Ok(JobEnergy::of(&usages, &[], tariff));
        }
        Ok(JobEnergy::of(&usages, &self.rows(job)?, tariff))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn usage(processor_ms: u64, millijoules: Option<u64>) -> JobUsage {
        JobUsage {
            work: 1,
            processor_ms,
            millijoules,
            source: millijoules.map(|_| EnergySource::Counters),
            processors: 4,
        }
    }

    fn zone(id: u32, agent: &str, seconds: f64) -> Event {
        let (state, agent) = ("done".to_owned(), Some(agent.to_owned()));
        Event::Zone(Box::new(ZoneEvent { id, state, agent, seconds_measured: Some(seconds), ..ZoneEvent::default() }))
    }

    #[test]
    fn a_job_costs_what_its_machines_use_and_a_zone_its_share_of_that() {
        let usages = BTreeMap::from([
            ("a.1".to_owned(), usage(8000, Some(3_600_000_000))),
            ("a.12".to_owned(), usage(4000, None)),
        ]);
        let rows = [zone(1, "render-1@a.1", 3.0), zone(2, "render-2@a.1", 1.0), zone(3, "render-1@a.12", 5.0)];
        let energy = JobEnergy::of(&usages, &rows, &Tariff::default());
        assert_eq!((energy.processor_seconds, energy.kwh, energy.cost), (12.0, Some(1.0), None));
        assert!(energy.is_partial, "nobody knows what the other one draws");
        let shares: Vec<(u32, f64)> = energy.zones.iter().map(|zone| (zone.id, zone.kwh)).collect();
        assert_eq!(shares, [(1, 0.75), (2, 0.25)]);
        let nobody = JobEnergy::of(&BTreeMap::new(), &[], &Tariff::default());
        assert_eq!(format!("{:?}", nobody.processor_seconds), "0.0", "not -0.0");

        let price = EnergyPrice { per_kwh: 0.5, currency: "EUR".to_owned() };
        let energy = JobEnergy::of(&usages, &rows, &Tariff { price: Some(price), watts: Some(3.6e6) });
        // 3.6 MW for a quarter of 4 s is 1 kWh.
        assert_eq!((energy.kwh, energy.cost, energy.is_partial), (Some(2.0), Some(1.0), false));
        assert_eq!(energy.zones.iter().filter_map(|zone| zone.cost).sum::<f64>(), 1.0);
    }

    #[test]
    fn where_nothing_is_known_nothing_is_said() {
        let usages = BTreeMap::from([("a.1".to_owned(), usage(8000, None))]);
        let price = EnergyPrice { per_kwh: 0.5, currency: "EUR".to_owned() };
        let tariff = Tariff { price: Some(price), watts: None };
        let energy = JobEnergy::of(&usages, &[zone(1, "render-1@a.1", 3.0)], &tariff);
        assert_eq!((energy.kwh, energy.cost, energy.zones.len()), (None, None, 0));
        let told = serde_json::to_value(&energy).unwrap();
        assert!(told.get("kwh").is_none() && told["machines"][0].get("source").is_none(), "{told}");
    }
}
