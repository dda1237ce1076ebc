//! The agents of a simulation, their machines and their faults.

use std::{str::FromStr, time::Duration};

use bottega_agents::driver::Random;

/// Maximum number of agents of a simulation, as of a Master.
pub const SIMULATED_AGENTS_MAX: usize = 1 << 14;

/// Bounds of speeds and times in a specification.
const SPEED_RANGE: std::ops::RangeInclusive<f64> = 1e-3..=1e3;
const SECONDS_MAX: f64 = 1e7;

/// The agents of a simulation, with their machines and their faults.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FarmSpec {
    /// The machines of the farm.
    pub machines: Vec<MachineSpec>,
    /// The agents; their names are `agent-0`, `agent-1` and so on.
    pub agents: Vec<AgentSpec>,
    /// The incidents of agents, in any order.
    pub incidents: Vec<Incident>,
}

/// A machine of a simulation, with its processors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MachineSpec {
    /// Number of processors, shared by all agents of the machine.
    pub processors: u32,
    /// Speed of each processor: 1 is the measured machine, 2 is twice as fast.
    pub speed: f64,
}

/// An agent of a simulation: its machine, and when it joins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AgentSpec {
    /// Index of the agent's machine.
    pub machine: usize,
    /// The time at which the agent joins, from the start of the platform.
    pub joins: Duration,
}

/// A fault or departure of an agent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Incident {
    /// The time, from the start of the platform.
    pub at: Duration,
    /// Index of the agent.
    pub agent: usize,
    /// The kind of the incident, with its parameters.
    pub kind: IncidentKind,
}

/// The kind of an incident, with its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum IncidentKind {
    /// The agent fails silently and does not come back.
    Fail,
    /// The agent leaves with a goodbye.
    Leave,
    /// The agent's machine becomes slower by this factor.
    Slow(f64),
    /// The agent's machine stops painting, while the agent still sends heartbeats.
    Hang,
    /// This share of the agent's orders fails from then on.
    Break(f64),
    /// This share of the agent's paintings is wrong from then on.
    Lie(f64),
    /// The agent's clock runs slow by this factor from then on, so the agent claims to be faster by it than it is.
    Boast(f64),
    /// The agent's next order takes this many seconds longer, spent on loading but measured as painting.
    Load(f64),
}

/// An error in the text that specifies the agents of a simulation.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FarmSpecError {
    /// A word is invalid.
    #[error("`{item}` does not describe agents: {problem}")]
    Item {
        /// The word that cannot be parsed.
        item: String,
        /// The problem, as text for the user.
        problem: &'static str,
    },
    /// There are no agents.
    #[error("no agents: give a number of agents, such as 8 or 4x1.0,4x0.25")]
    Empty,
    /// There are more agents than [`SIMULATED_AGENTS_MAX`].
    #[error("{found} agents are too many: a Master takes {SIMULATED_AGENTS_MAX}")]
    TooMany {
        /// The number of agents.
        found: usize,
    },
    /// An incident names an unknown agent.
    #[error("there is no agent-{agent}: there are {count} agents, from agent-0 on")]
    NoSuchAgent {
        /// The index of the agent.
        agent: usize,
        /// The number of agents.
        count: usize,
    },
}

impl FarmSpec {
    /// Makes a farm of `count` agents with speed 1, each with a processor of its own.
    pub fn equal(count: usize) -> Self {
        let mut farm = Self::default();
        farm.add(count, MachineSpec { processors: 1, speed: 1.0 });
        farm
    }

    /// Makes a farm of `count` agents that share one machine of speed 1 with this many processors, like those of one
    /// process.
    pub fn sharing(count: usize, processors: u32) -> Self {
        let machines = vec![MachineSpec { processors, speed: 1.0 }];
        let agents = vec![AgentSpec { machine: 0, joins: Duration::ZERO }; count];
        Self { machines, agents, incidents: Vec::new() }
    }

    /// Adds `count` agents, each on a machine of its own of this kind, which join at the start.
    pub fn add(&mut self, count: usize, machine: MachineSpec) {
        for _ in 0..count {
            self.agents.push(AgentSpec { machine: self.machines.len(), joins: Duration::ZERO });
            self.machines.push(machine);
        }
    }

    /// Makes some agents fail at random times.
    ///
    /// - `share`: the share of all agents, 0..=1.
    /// - `until`: the end of the interval of these times, from the start of the platform.
    /// - `seed`: determines agents and times.
    pub fn fail_some(&mut self, share: f64, until: Duration, seed: u64) {
        let mut random = Random::new(seed ^ 0xfa11);
        let mut left: Vec<usize> = (0..self.agents.len()).collect();
        let count = (share.clamp(0.0, 1.0) * left.len() as f64).round() as usize;
        for _ in 0..count {
            let agent = left.swap_remove(random.below(left.len()));
            let at = until.mul_f64(random.unit());
            self.incidents.push(Incident { at, agent, kind: IncidentKind::Fail });
        }
    }

    /// Returns the sum of the speeds of all processors, without incidents; 1 is a processor of the measured machine.
    pub fn speed(&self) -> f64 {
        self.machines.iter().map(|machine| f64::from(machine.processors) * machine.speed).sum()
    }

    /// Returns a lower bound on the time at which an amount of work begun at `start` is done, without losses or
    /// waiting; both from the start of the platform. `None`: the remaining agents never finish it.
    ///
    /// - `work`: processor time at speed 1, in seconds.
    ///
    /// # Panics
    /// If the machine of an agent or the agent of an incident does not exist.
    pub fn least_time(&self, start: Duration, work: f64) -> Option<Duration> {
        // Integrate the total speed, which is constant between changes
        let mut changes: Vec<(f64, f64)> = Vec::new();
        for (machine, marks) in self.machines.iter().zip(self.marks()) {
            changes.extend(speed_changes(machine, marks));
        }
        changes.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut now, mut speed, mut left) = (start.as_secs_f64(), 0.0, work);
        for (at, change) in changes {
            if at > now {
                if speed > 0.0 && left <= speed * (at - now) {
                    break;
                }
                left -= speed * (at - now);
                now = at;
            }
            speed += change;
        }
        (speed > 1e-12).then(|| Duration::try_from_secs_f64(now + left / speed).ok()).flatten()
    }

    /// Returns the changes of each machine.
    fn marks(&self) -> Vec<Vec<MachineMark>> {
        let mut marks: Vec<Vec<MachineMark>> = vec![Vec::new(); self.machines.len()];
        let mut gone: Vec<Option<Duration>> = vec![None; self.agents.len()];
        for agent in &self.agents {
            marks[agent.machine].push(MachineMark { at: agent.joins.as_secs_f64(), come: 1, factor: 1.0 });
        }
        for incident in &self.incidents {
            match incident.kind {
                IncidentKind::Slow(factor) => {
                    let mark = MachineMark { at: incident.at.as_secs_f64(), come: 0, factor: factor.recip() };
                    marks[self.agents[incident.agent].machine].push(mark);
                }
                IncidentKind::Break(_) | IncidentKind::Lie(_) | IncidentKind::Boast(_) | IncidentKind::Load(_) => {}
                IncidentKind::Fail | IncidentKind::Leave | IncidentKind::Hang => {
                    let first = &mut gone[incident.agent];
                    *first = Some(first.map_or(incident.at, |first| first.min(incident.at)));
                }
            }
        }
        for (agent, gone) in self.agents.iter().zip(gone) {
            marks[agent.machine].extend(gone.map(|at| MachineMark { at: at.as_secs_f64(), come: -1, factor: 1.0 }));
        }
        marks
    }
}

/// A change of a machine.
#[derive(Clone, Copy, Debug)]
struct MachineMark {
    /// Time, in seconds.
    at: f64,
    /// Number of the machine's agents that come, or negative: that leave.
    come: i32,
    /// Factor on its speed.
    factor: f64,
}

/// Times and amounts of the changes in a machine's speed, which counts while any of its agents is present.
fn speed_changes(machine: &MachineSpec, mut marks: Vec<MachineMark>) -> Vec<(f64, f64)> {
    marks.sort_by(|a, b| a.at.total_cmp(&b.at));
    let (mut present, mut speed, mut counted) = (0, f64::from(machine.processors) * machine.speed, 0.0);
    let mut changes = Vec::new();
    for MachineMark { at, come, factor } in marks {
        present += come;
        speed *= factor;
        let counts = if present > 0 { speed } else { 0.0 };
        changes.push((at, counts - counted));
        counted = counts;
    }
    changes
}

impl FromStr for FarmSpec {
    type Err = FarmSpecError;

    /// Parses words separated by commas, white space or line ends; `#` starts a comment that extends to the end of the
    /// line.
    ///
    /// - `8`: eight agents of speed 1, each with a processor of its own; `4x0.25`: four of speed 0.25; `2x1:8`: two
    ///   with eight processors each.
    /// - `agent-3@join=5s`, `agent-3@leave=20s`, `agent-3@fail=12s`, `agent-3@slow=10s:4` (four times slower from
    ///   then on), `agent-3@hang=8s` (sends heartbeats, but paints nothing), `agent-3@break=5s:0.5` (half of its orders
    ///   fail), `agent-3@lie=5s:0.1` (a tenth of its paintings is wrong), `agent-3@boast=0s:2` (claims to be twice as
    ///   fast as it is), `agent-3@load=0s:60` (loads something for 60 s during its next zone, and measures that as
    ///   painting).
    fn from_str(text: &str) -> Result<Self, FarmSpecError> {
        let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default());
        let words: Vec<&str> = lines
            .flat_map(|line| line.split([',', ' ', '\t']))
            .map(str::trim)
            .filter(|word| !word.is_empty())
            .collect();
        let mut farm = Self::default();
        let (incidents, groups): (Vec<&str>, Vec<&str>) = words.into_iter().partition(|word| word.contains('@'));
        for word in groups {
            let (count, machine) =
                group(word).map_err(|problem| FarmSpecError::Item { item: word.to_owned(), problem })?;
            let found = farm.agents.len().saturating_add(count);
            if found > SIMULATED_AGENTS_MAX {
                return Err(FarmSpecError::TooMany { found });
            }
            farm.add(count, machine);
        }
        if farm.agents.is_empty() {
            return Err(FarmSpecError::Empty);
        }
        for word in incidents {
            farm.befall(word)?;
        }
        Ok(farm)
    }
}

/// Parses `COUNT[xSPEED][:PROCESSORS]`.
fn group(word: &str) -> Result<(usize, MachineSpec), &'static str> {
    let (word, processors) = word.split_once(':').unwrap_or((word, "1"));
    let (count, speed) = word.split_once('x').unwrap_or((word, "1"));
    let count = count.parse().ok().filter(|&count| count > 0).ok_or("it must begin with a number of agents")?;
    let speed = speed.parse().ok().filter(|speed| SPEED_RANGE.contains(speed));
    let speed = speed.ok_or("a speed from 0.001 to 1000 is needed after the `x`")?;
    let processors = processors.parse().ok().filter(|count| (1..=4096).contains(count));
    let processors = processors.ok_or("a number of processors from 1 to 4096 is needed after the `:`")?;
    Ok((count, MachineSpec { processors, speed }))
}

impl FarmSpec {
    /// Parses `agent-N@KIND=TIME[:FACTOR]`.
    fn befall(&mut self, word: &str) -> Result<(), FarmSpecError> {
        let wrong = |problem| FarmSpecError::Item { item: word.to_owned(), problem };
        let (agent, what) = word.split_once('@').unwrap_or((word, ""));
        let agent: usize = agent
            .strip_prefix("agent-")
            .and_then(|number| number.parse().ok())
            .ok_or_else(|| wrong("an agent is needed before the `@`, such as agent-3"))?;
        let (what, time) = what
            .split_once('=')
            .ok_or_else(|| wrong("an event and its time are needed after the `@`, such as fail=12s"))?;
        let (time, factor) = time.split_once(':').map_or((time, None), |(time, factor)| (time, Some(factor)));
        let at = seconds(time).ok_or_else(|| wrong("the time must be a number of seconds, such as 12s"))?;
        let count = self.agents.len();
        let member = self.agents.get_mut(agent).ok_or(FarmSpecError::NoSuchAgent { agent, count })?;
        let kind = match what {
            "join" => {
                member.joins = at;
                return Ok(());
            }
            "fail" => IncidentKind::Fail,
            "leave" => IncidentKind::Leave,
            "slow" => {
                let factor = factor.unwrap_or("4").parse().ok().filter(|factor| SPEED_RANGE.contains(factor));
                IncidentKind::Slow(factor.ok_or_else(|| wrong("a factor of slowness is needed after the `:`"))?)
            }
            "boast" => {
                let factor = factor.unwrap_or("2").parse().ok().filter(|factor| SPEED_RANGE.contains(factor));
                IncidentKind::Boast(factor.ok_or_else(|| wrong("a factor of speed is needed after the `:`"))?)
            }
            "load" => {
                let seconds =
                    factor.unwrap_or("60").parse().ok().filter(|seconds| (0.0..=SECONDS_MAX).contains(seconds));
                IncidentKind::Load(seconds.ok_or_else(|| wrong("a number of seconds is needed after the `:`"))?)
            }
            "hang" => IncidentKind::Hang,
            "break" | "lie" => {
                let share = factor.unwrap_or("1").parse().ok().filter(|share| (0.0..=1.0).contains(share));
                let share = share.ok_or_else(|| wrong("a share from 0 to 1 is needed after the `:`"))?;
                if what == "lie" { IncidentKind::Lie(share) } else { IncidentKind::Break(share) }
            }
            _ => return Err(wrong("an agent can join, leave, fail, hang, break, lie, boast, load or become slow")),
        };
        self.incidents.push(Incident { at, agent, kind });
        Ok(())
    }
}

fn seconds(text: &str) -> Option<Duration> {
    let (number, unit) = match text.strip_suffix("ms") {
        Some(number) => (number, 1e-3),
        None => (text.strip_suffix('s').unwrap_or(text), 1.0),
    };
    let seconds = number.parse::<f64>().ok()? * unit;
    (0.0..=SECONDS_MAX).contains(&seconds).then(|| Duration::from_secs_f64(seconds))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_specification_says_who_and_what_befalls_them() {
        let farm: FarmSpec =
            "2x1.0, 1x0.25:4 # the old one\nagent-2@join=5s,agent-0@fail=1500ms agent-1@slow=10s:4".parse().unwrap();
        assert_eq!(farm.agents.len(), 3);
        assert_eq!(farm.machines[2], MachineSpec { processors: 4, speed: 0.25 });
        assert_eq!(farm.agents[2].joins, Duration::from_secs(5));
        assert_eq!(farm.incidents[0], Incident { at: Duration::from_millis(1500), agent: 0, kind: IncidentKind::Fail });
        assert_eq!(farm.incidents[1].kind, IncidentKind::Slow(4.0));
        assert_eq!("8".parse(), Ok(FarmSpec::equal(8)));
        let farm: FarmSpec = "2,agent-0@hang=1s,agent-1@lie=2s:0.5,agent-1@break=3s".parse().unwrap();
        let kinds: Vec<IncidentKind> = farm.incidents.iter().map(|incident| incident.kind).collect();
        assert_eq!(kinds, [IncidentKind::Hang, IncidentKind::Lie(0.5), IncidentKind::Break(1.0)]);
    }

    #[test]
    fn what_makes_no_sense_is_refused_by_name() {
        for (text, names) in [
            ("", "no agents"),
            ("0", "`0`"),
            ("3xfast", "`3xfast`"),
            ("3x-1", "`3x-1`"),
            ("3xnan", "`3xnan`"),
            ("2:0", "`2:0`"),
            ("99999999999", "too many"),
            ("2,agent-2@fail=1s", "no agent-2"),
            ("2,agent-1@explode=1s", "explode"),
            ("2,agent-1@fail=soon", "seconds"),
            ("2,bob@fail=1s", "agent-3"),
            ("2,agent-1@slow=1s:0", "slowness"),
            ("2,agent-1@lie=1s:2", "share"),
        ] {
            let error = text.parse::<FarmSpec>().unwrap_err().to_string();
            assert!(error.contains(names), "{text}: {error}");
        }
    }

    #[test]
    fn the_least_time_counts_who_is_there() {
        let farm = FarmSpec::equal(2);
        assert_eq!(farm.least_time(Duration::from_secs(1), 10.0), Some(Duration::from_secs(6)));
        let farm: FarmSpec = "2,agent-1@join=5s".parse().unwrap();
        assert_eq!(farm.least_time(Duration::from_secs(1), 10.0), Some(Duration::from_secs(8)));
        let farm: FarmSpec = "2,agent-1@fail=3s,agent-0@slow=5s:2".parse().unwrap();
        // 4 until 3 s, 2 until 5 s, and half a second's worth a second from there.
        assert_eq!(farm.least_time(Duration::from_secs(1), 10.0), Some(Duration::from_secs(13)));
        let farm: FarmSpec = "1,agent-0@fail=3s".parse().unwrap();
        assert_eq!(farm.least_time(Duration::ZERO, 10.0), None);
        assert_eq!(FarmSpec::sharing(3, 2).least_time(Duration::ZERO, 10.0), Some(Duration::from_secs(5)));
    }

    #[test]
    fn some_fail_by_share_and_seed() {
        let mut farm = FarmSpec::equal(100);
        farm.fail_some(0.05, Duration::from_secs(10), 7);
        assert_eq!(farm.incidents.len(), 5);
        let mut agents: Vec<usize> = farm.incidents.iter().map(|incident| incident.agent).collect();
        agents.dedup();
        assert_eq!(agents.len(), 5);
        assert!(farm.incidents.iter().all(|incident| incident.at < Duration::from_secs(10)));
    }
}
