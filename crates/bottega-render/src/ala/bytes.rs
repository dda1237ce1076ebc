//! Agents as bytes, for others who paint the same picture of the same scene.

use std::{sync::Arc, time::Duration};

use super::{
    map::{Agents, Indirect},
    paper::Fitted,
    report::{AgentReport, Tallies, Tally},
    visibility::Visibility,
};
use crate::{
    AgentSettings, Oracle,
    photon::{
        bytes::{Reader, Writer},
        cache::IrradianceCache,
    },
};

impl Agents {
    pub(crate) fn write(&self, to: &mut Writer) {
        self.visibility.write(to);
        match &self.indirect {
            Indirect::Fitted(Fitted { sensors, object_distance }) => {
                to.value(*object_distance);
                to.map(sensors);
            }
            Indirect::Records(cache, most) => {
                to.value(*most);
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

    /// - `settings`: of the picture.
    pub(crate) fn read(settings: AgentSettings, from: &mut Reader<'_>) -> Option<Self> {
        let visibility = Arc::new(Visibility::read(from)?);
        let length = from.value()?;
        let indirect = match settings.oracle {
            Oracle::Paper => Indirect::Fitted(Fitted { sensors: from.map()?, object_distance: length }),
            Oracle::Error => Indirect::Records(IrradianceCache::read(settings.tolerance(), from)?, length),
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
            casting: Duration::from_nanos(long()?),
            sensing: Duration::from_nanos(long()?),
            tally: Tally::default(),
        };
        Some(Self { settings, visibility, indirect, report, tallies: Tallies::default() })
    }
}
