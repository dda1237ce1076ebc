//! The energy use and cost of a job, per machine and per zone, from the usage that machines report.
//!
//! - `tariff`: the notice with the farm's energy price, and the power of machines that do not measure their own.

use std::collections::BTreeMap;

use bottega::{Event, events::ZoneEvent};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    error::Error,
    job::{
        board::JobBoard,
        record::Job,
        usage::{EnergySource, JobUsage},
    },
};

const TARIFF: &str = "tariff";
const JOULES_PER_KWH: f64 = 3.6e6;

/// The price of energy, with its currency.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EnergyPrice {
    /// The price per kWh.
    pub per_kwh: f64,
    /// The currency, such as `EUR`.
    pub currency: String,
}

/// The energy settings of a farm.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Tariff {
    /// The price of energy; none: costs are not computed.
    pub price: Option<EnergyPrice>,
    /// The power in watts, with all processors busy, of a machine that neither measures nor declares its own; none: its
    /// energy is unknown.
    pub watts: Option<f64>,
}

/// The energy that a machine has used for a job. Unknown values are left out.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct MachineEnergy {
    /// The name of the process on that machine.
    pub machine: String,
    /// Processor time in seconds.
    pub processor_seconds: f64,
    /// Energy in kWh.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kwh: Option<f64>,
    /// The cost of that energy, in the currency of the job.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cost: Option<f64>,
    /// The source of the energy value: the processors' `counters`, or a declared number of `watts`; missing if the energy is
    /// unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source: Option<EnergySource>,
}

/// The energy of a zone: its share, by measured time, of the energy of the machine that painted it.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ZoneEnergy {
    /// The identifier of the zone (IdZone).
    pub id: u32,
    /// Energy in kWh.
    pub kwh: f64,
    /// The cost of that energy, in the currency of the job; missing if the farm has no price of energy.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cost: Option<f64>,
}

/// The energy use of a job. Unknown values are left out.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct JobEnergy {
    /// Processor time of all machines, in seconds.
    pub processor_seconds: f64,
    /// Energy in kWh of the machines for which it is known; missing if it is known for none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kwh: Option<f64>,
    /// The cost of that energy; missing if the energy or its price is unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cost: Option<f64>,
    /// The currency of all costs; missing if the farm has no price of energy.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub currency: Option<String>,
    /// The price per kWh; missing if the farm has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub price_per_kwh: Option<f64>,
    /// `true`: the energy of some machines is unknown, so `kwh` is too low.
    pub is_partial: bool,
    /// The energy of each machine.
    pub machines: Vec<MachineEnergy>,
    /// The energy of each painted zone whose machine's energy is known.
    pub zones: Vec<ZoneEnergy>,
}

impl JobEnergy {
    /// Returns the energy use of a job, by machine and by zone.
    ///
    /// - `usages`: the usage that each process reports, by its name.
    /// - `rows`: the Blackboard rows of the job.
    /// - `tariff`: the energy settings of the farm.
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

/// Returns the energy of a process in kWh, and its source.
fn known_energy(usage: &JobUsage, watts: Option<f64>) -> Option<(f64, EnergySource)> {
    let measured = usage.millijoules.zip(usage.source).map(|(energy, source)| (energy as f64 / 1e3, source));
    let by_farm = || {
        let seconds = usage.processor_ms as f64 / 1e3 / usage.processors.max(1) as f64;
        watts.map(|watts| (watts * seconds, EnergySource::Watts))
    };
    measured.or_else(by_farm).map(|(joules, source)| (joules / JOULES_PER_KWH, source))
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
        // The name of an agent ends with the name of its process.
        let is_of_it =
            |zone: &&&ZoneEvent| zone.agent.as_deref().and_then(|name| name.split('@').nth(1)) == Some(machine);
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
    /// Returns the energy settings of the farm; empty ones if none are set or they cannot be read.
    pub fn tariff(&self) -> Tariff {
        self.read_notice(TARIFF).unwrap_or_default()
    }

    /// Sets the price of energy, and the power of machines that neither measure nor declare their own.
    ///
    /// # Errors
    /// The farm does not store them.
    pub fn set_tariff(&self, tariff: &Tariff) -> Result<(), Error> {
        self.put_notice(TARIFF, tariff)
    }

    /// Returns the energy use of a job so far, from the usage that its leader has published; without machines and zones if it has
    /// published none.
    ///
    /// # Errors
    /// The farm does not return the rows of the job.
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
        let json = serde_json::to_value(&energy).unwrap();
        assert!(json.get("kwh").is_none() && json["machines"][0].get("source").is_none(), "{json}");
    }
}
