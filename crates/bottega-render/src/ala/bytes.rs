//! The byte form of agents, for other machines that render the same picture.

use std::{sync::Arc, time::Duration};

use super::{
    agent::Agent,
    map::{Agents, Indirect},
    paper::FittedSensors,
    report::{AgentReport, Tallies, Tally},
    sensing::{Discovery, SensorReadings},
    visibility::Visibility,
};
use crate::{
    extent::Extent,
    photon::{
        IrradianceMap, IrradiancePlaces,
        bytes::{ByteForm, Reader, Writer},
        cache::{IrradianceCache, IrradianceRecord},
    },
    settings::{AgentSettings, Oracle},
};

impl ByteForm for Vec<Agent> {
    fn write(&self, to: &mut Writer) {
        to.number(self.len() as u32);
        for Agent { p, normal, to_light, light, distance, gap, cast, clone, is_matte, is_glossy } in self {
            [p, normal, to_light].into_iter().for_each(|&vector| to.vector(vector));
            // Write bits: lights may be infinitely far away
            [*light, distance.to_bits(), gap.to_bits(), *cast, *clone].into_iter().for_each(|number| to.number(number));
            to.number(u32::from(*is_matte) | u32::from(*is_glossy) << 1);
        }
    }

    fn read(from: &mut Reader<'_>) -> Option<Self> {
        const AGENT_BYTES: usize = 4 * 15;
        let count = from.count(AGENT_BYTES)?;
        let read = |_| {
            let [p, normal, to_light] = [from.vector()?, from.vector()?, from.vector()?];
            let [light, distance, gap, cast, clone, kind] =
                [from.number()?, from.number()?, from.number()?, from.number()?, from.number()?, from.number()?];
            let [distance, gap] = [distance, gap].map(f32::from_bits);
            let (is_matte, is_glossy) = (kind & 1 != 0, kind & 2 != 0);
            (kind < 4).then_some(Agent { p, normal, to_light, light, distance, gap, cast, clone, is_matte, is_glossy })
        };
        (0..count).map(read).collect()
    }
}

impl ByteForm for SensorReadings {
    fn write(&self, to: &mut Writer) {
        to.number(self.discoveries.len() as u32);
        let numbers = self.discoveries.iter().flat_map(|&Discovery { lit, shaded, lost }| [lit, shaded, lost]);
        numbers.for_each(|number| to.number(number));
        self.irradiance.write(to);
        to.number(self.records.len() as u32);
        self.records.iter().for_each(|record| record.write(to));
        self.sensors.into_iter().for_each(|count| to.long(count));
    }

    fn read(from: &mut Reader<'_>) -> Option<Self> {
        const DISCOVERY_BYTES: usize = 4 * 3;
        let count = from.count(DISCOVERY_BYTES)?;
        let mut discovery = || Some(Discovery { lit: from.number()?, shaded: from.number()?, lost: from.number()? });
        let discoveries = (0..count).map(|_| discovery()).collect::<Option<_>>()?;
        let irradiance = IrradiancePlaces::read(from)?;
        let count = from.count(IrradianceRecord::BYTES_MIN)?;
        let records = (0..count).map(|_| IrradianceRecord::read(from)).collect::<Option<_>>()?;
        let sensors = [from.long()?, from.long()?, from.long()?, from.long()?];
        Some(Self { discoveries, irradiance, records, sensors })
    }
}

impl Agents {
    /// Writes the agents with their report.
    pub(crate) fn write(&self, to: &mut Writer) {
        self.visibility.write(to);
        match &self.indirect {
            Indirect::Fitted(FittedSensors { sensors, object_distance }) => {
                to.value(*object_distance);
                sensors.write(to);
            }
            Indirect::Records(cache, _) => {
                to.value(0.0);
                cache.write(to);
            }
        }
        let report = &self.report;
        to.number(report.cast);
        to.value(report.object_distance);
        let AgentReport { agents, clones, links, map_bytes, .. } = *report;
        let nanoseconds = [report.casting, report.sensing].map(|time| time.as_nanos() as u64);
        let counts = [agents, clones, links, map_bytes].into_iter().chain(report.sensors).chain(report.answers);
        counts.chain(nanoseconds).for_each(|number| to.long(number));
    }

    /// Reads the agents of a picture with these settings and this extent; `None`: not valid.
    pub(crate) fn read(settings: AgentSettings, extent: Extent, from: &mut Reader<'_>) -> Option<Self> {
        let visibility = Arc::new(Visibility::read(from)?);
        let length = from.value()?;
        let indirect = match settings.oracle {
            Oracle::Paper => {
                Indirect::Fitted(FittedSensors { sensors: IrradianceMap::read(from)?, object_distance: length })
            }
            Oracle::Error => Indirect::Records(IrradianceCache::read(settings.tolerance(), from)?, extent),
        };
        let (cast, object_distance) = (from.number()?, from.value()?);
        let mut long = || from.long();
        let report = AgentReport {
            cast,
            object_distance,
            agents: long()?,
            clones: long()?,
            links: long()?,
            map_bytes: long()?,
            sensors: [long()?, long()?, long()?, long()?],
            answers: [long()?, long()?, long()?],
            caustics_seen: None,
            casting: Duration::from_nanos(long()?),
            sensing: Duration::from_nanos(long()?),
            tally: Tally::default(),
        };
        Some(Self { settings, visibility, indirect, report, tallies: Tallies::default() })
    }
}
