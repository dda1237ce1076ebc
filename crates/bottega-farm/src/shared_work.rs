//! Shared work: preparation in parts that the machines of a job divide among themselves.
//!
//! No machine hands out the parts. An idle machine claims a free part by a compare-and-set, visible to all others; the
//! result depends on the part alone. A claim ends when its holder leaves the work, or at a deadline, after which an
//! idle machine repeats the part. So machines may leave or hang at any time, and a part may be done twice with the same
//! result.

use std::time::Duration;

/// The state of a part of shared work.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SharedPart {
    /// The machine that last claimed the part; `None`: none has claimed it.
    pub taken_by: Option<String>,
    /// Time since that claim.
    pub since: Duration,
    /// True if the result is available to all.
    pub is_done: bool,
}

/// The next step of an idle machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NextPart {
    /// Do the part with this index.
    Take(usize),
    /// Wait: others are working on all remaining parts.
    Wait,
    /// Stop: all parts are done.
    Done,
}

/// Returns the next step of the machine `me`, when it is idle.
///
/// - `parts`: the states of all parts.
/// - `is_there`: a function that returns true for machines that take part in the work now.
/// - `patience`: time after a claim from which an idle machine may repeat the part.
pub fn next_part(parts: &[SharedPart], me: &str, is_there: impl Fn(&str) -> bool, patience: Duration) -> NextPart {
    let open = || parts.iter().enumerate().filter(|(_, part)| !part.is_done);
    if open().next().is_none() {
        return NextPart::Done;
    }
    // Take a part that is not claimed, or whose holder is gone
    let is_free = |part: &SharedPart| part.taken_by.as_deref().is_none_or(|by| by == me || !is_there(by));
    let free: Vec<usize> = open().filter(|(_, part)| is_free(part)).map(|(index, _)| index).collect();
    if !free.is_empty() {
        // Machines start at different parts, to avoid claims of the same part
        let turn = me.bytes().fold(0_usize, |sum, byte| sum.wrapping_mul(31).wrapping_add(usize::from(byte)));
        return NextPart::Take(free[turn % free.len()]);
    }
    // Else repeat the part claimed longest ago, once its deadline is over
    let longest = open().max_by_key(|(_, part)| part.since);
    longest.filter(|(_, part)| part.since >= patience).map_or(NextPart::Wait, |(index, _)| NextPart::Take(index))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A machine of the simulation.
    struct Machine {
        name: String,
        /// Parts done per thousand steps.
        speed: u32,
        /// The step at which the machine leaves silently, and true if others still take it for present.
        gone: Option<(u32, bool)>,
        /// The part that the machine works on, and the step at which it is done.
        busy: Option<(usize, u32)>,
    }

    /// Runs machines until all parts are done, at a millisecond per step. Returns the number of steps.
    fn simulate(count: usize, mut machines: Vec<Machine>) -> Option<u32> {
        let mut parts = vec![SharedPart::default(); count];
        for now in 0..1_000_000 {
            let there: Vec<String> = machines
                .iter()
                .filter(|it| it.gone.is_none_or(|(at, seems_there)| now < at || seems_there))
                .map(|it| it.name.clone())
                .collect();
            for machine in machines.iter_mut().filter(|it| it.gone.is_none_or(|(at, _)| now < at)) {
                let takes = 1_000_000 / machine.speed;
                if let Some((part, _)) = machine.busy.take_if(|(_, until)| *until <= now) {
                    parts[part].is_done = true;
                }
                if machine.busy.is_some() {
                    continue;
                }
                let is_there = |name: &str| there.iter().any(|it| it == name);
                match next_part(&parts, &machine.name, is_there, Duration::from_millis(2 * u64::from(takes))) {
                    NextPart::Done => return Some(now),
                    NextPart::Wait => {}
                    NextPart::Take(part) => {
                        assert!(!parts[part].is_done);
                        parts[part] =
                            SharedPart { taken_by: Some(machine.name.clone()), since: Duration::ZERO, is_done: false };
                        machine.busy = Some((part, now + takes));
                    }
                }
            }
            parts.iter_mut().for_each(|part| part.since += Duration::from_millis(1));
        }
        None
    }

    fn machine(number: usize, speed: u32) -> Machine {
        Machine { name: format!("machine-{number}"), speed, gone: None, busy: None }
    }

    #[test]
    fn equal_machines_take_as_many_each_and_do_none_twice() {
        // 32 parts of a second: four machines, 8 seconds.
        let all = (0..4).map(|number| machine(number, 1000)).collect();
        assert_eq!(simulate(32, all), Some(8_000));
        assert_eq!(simulate(32, vec![machine(0, 1000)]), Some(32_000));
        assert_eq!(simulate(0, vec![machine(0, 1000)]), Some(0));
    }

    #[test]
    fn a_slow_machine_holds_nobody_up() {
        let with_slow = simulate(32, vec![machine(0, 1000), machine(1, 1000), machine(2, 10)]).unwrap();
        // Two do 31 parts, and after some patience the one that the slow machine is still at.
        assert!(with_slow <= 18_500, "{with_slow}");
    }

    #[test]
    fn if_some_machines_leave_the_others_do_all() {
        for seed in 0..500_u32 {
            let number = |what: u32| (seed + 1).wrapping_mul(what).wrapping_mul(0x9e37_79b9) >> 16;
            let count = 1 + number(3) as usize % 40;
            let mut all: Vec<Machine> = (0..2 + number(5) as usize % 6)
                .map(|index| machine(index, 100 + number(7 + index as u32) % 2000))
                .collect();
            // All but the first may go, some without that it is known.
            for (index, machine) in (0..).zip(&mut all).skip(1) {
                machine.gone = Some((number(11 + index) % 20_000, number(13 + index) % 2 == 0));
            }
            let alone = 1_000_000 / all[0].speed;
            let end = simulate(count, all).expect("an end");
            // No later than the first machine alone, which may wait for each part of another one.
            assert!(end <= alone * (3 * count as u32 + 1), "{seed}: {end}");
        }
    }
}
