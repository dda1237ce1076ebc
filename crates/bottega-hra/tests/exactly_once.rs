//! Every unit is answered exactly once or given back, whatever resources and clients do.

use std::collections::BTreeMap;
use std::thread;
use std::time::Duration;

use crate::support::{Job, custom, double, hush_injected_panics, quick, within_reason};
use bottega_hra::{
    Failed, Hra, HraClient, HraConfig, Lane, Link, Primitive, PrimitiveSet, Simulated, SimulatedModel, SubmitError,
    UnitError, VirtualCpu, Window, WorkUnit,
};
use proptest::prelude::*;

/// The properties of a resource.
#[derive(Clone, Debug)]
enum Character {
    Sound(PrimitiveSet),
    /// Gives back one unit in this many.
    Refusing(u64),
    /// Panics once in this many units.
    Panicking(u64),
    /// Far away; gives back one unit in this many.
    Far {
        packets: usize,
        units_per_packet: usize,
        fail_every: u64,
    },
}

fn character() -> impl Strategy<Value = Character> {
    prop_oneof![
        (0_usize..Primitive::COUNT).prop_map(|index| Character::Sound(PrimitiveSet::NONE.with(Primitive::ALL[index]))),
        (1_u64..6).prop_map(Character::Refusing),
        (1_u64..6).prop_map(Character::Panicking),
        (1_usize..5, 1_usize..4, 0_u64..6).prop_map(|(packets, units_per_packet, fail_every)| Character::Far {
            packets,
            units_per_packet,
            fail_every
        }),
    ]
}

fn lane(character: &Character) -> Lane<Job> {
    let mut count = 0;
    match *character {
        Character::Sound(primitives) => Lane::Direct(custom("sound", primitives, |job| Ok(double(job)))),
        Character::Refusing(every) => Lane::Direct(custom("refusing", PrimitiveSet::ALL, move |work| {
            count += 1;
            if count % every == 0 { Err(Failed { work, reason: "no".into() }) } else { Ok(double(work)) }
        })),
        Character::Panicking(every) => Lane::Direct(custom("panicking", PrimitiveSet::ALL, move |job| {
            count += 1;
            assert!(count % every != 0, "injected");
            Ok(double(job))
        })),
        Character::Far { packets, units_per_packet, fail_every } => {
            let model = SimulatedModel {
                primitives: PrimitiveSet::ALL,
                time_per_item: Duration::from_micros(1),
                link: Link { latency: Duration::from_micros(50), bandwidth: 1e8 },
                fail_every,
            };
            let window = Window { packets, units_per_packet, ..Window::default() };
            Lane::Windowed(Box::new(Simulated::new("far", model, double)), window)
        }
    }
}

/// The actions of a client.
#[derive(Clone, Debug)]
struct Script {
    /// Sizes of the groups that it submits.
    groups: Vec<usize>,
    /// Takes one answer after this many groups.
    take_every: usize,
    /// Cancels after this many groups.
    cancel_every: usize,
    /// Leaves without taking the rest.
    leaves: bool,
    has_backup: bool,
}

fn script() -> impl Strategy<Value = Script> {
    (prop::collection::vec(1_usize..12, 1..12), 1_usize..4, 1_usize..8, prop::bool::weighted(0.2), any::<bool>())
        .prop_map(|(groups, take_every, cancel_every, leaves, has_backup)| Script {
            groups,
            take_every,
            cancel_every,
            leaves,
            has_backup,
        })
}

/// Plays a script; returns how often each of its tickets was answered or given back.
fn play(client: &HraClient<Job>, script: &Script) -> BTreeMap<u64, u32> {
    let mut seen: BTreeMap<u64, u32> = BTreeMap::new();
    let mut submitted = 0;
    let check = |answer: bottega_hra::Completed<u64>| {
        match answer.output {
            Ok(output) => assert_eq!(output, 2 * answer.ticket),
            Err(UnitError::Failed { attempts, .. }) => assert_eq!(attempts, quick().max_attempts),
            Err(UnitError::Lost { .. }) => assert!(!script.has_backup, "a unit with a backup was lost"),
            Err(UnitError::Closed) => {}
            Err(UnitError::Expired) => panic!("no unit had a life time"),
            Err(error @ UnitError::NoResource(_)) => panic!("{error}"),
        }
        answer.ticket
    };
    for (index, &size) in script.groups.iter().enumerate() {
        let units = (submitted..submitted + size as u64).map(|number| {
            let primitive = Primitive::ALL[number as usize % Primitive::COUNT];
            let work = Job { number, primitive, has_backup: script.has_backup };
            let (priority, delay_ms) = ((number % 3) as i32, number % 2);
            WorkUnit { max_delay: Duration::from_millis(delay_ms), priority, ..WorkUnit::new(work, number) }
        });
        match client.submit_group(units.collect()) {
            Ok(()) => submitted += size as u64,
            Err(SubmitError::Closed(_)) => break, // Some of the group may be answered, which the caller allows for.
            Err(error) => panic!("{error}"),
        }
        if index % script.take_every == 0 {
            let answer = client.take().expect("something is outstanding, or was cancelled by nobody");
            *seen.entry(check(answer)).or_default() += 1;
        }
        if index % script.cancel_every == script.cancel_every - 1 {
            for unit in client.cancel_pending() {
                *seen.entry(unit.ticket).or_default() += 1;
            }
        }
    }
    if !script.leaves {
        while let Some(answer) = client.take() {
            *seen.entry(check(answer)).or_default() += 1;
        }
        assert_eq!(client.outstanding(), 0);
        assert!(seen.len() as u64 >= submitted, "{} of {submitted} units were answered", seen.len());
    }
    seen
}

fn run(config: HraConfig, characters: &[Character], scripts: Vec<Script>, close_after: Option<Duration>) {
    // One lane that works, so that no primitive is without a resource.
    let sound = VirtualCpu::lanes(1, double).into_iter().map(Lane::from);
    let hra = Hra::with_lanes(config, characters.iter().map(lane).chain(sound).collect());
    let players: Vec<_> = scripts
        .into_iter()
        .map(|script| {
            let client = hra.client();
            thread::spawn(move || play(&client, &script))
        })
        .collect();
    let hra = close_after.map_or(Some(hra), |delay| {
        thread::sleep(delay);
        None
    });
    for player in players {
        let seen = player.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        assert!(seen.values().all(|&times| times == 1), "answered more than once: {seen:?}");
    }
    assert!(hra.is_none_or(|hra| hra.report().pending == 0), "something is left in the bin");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, max_shrink_iters: 50, ..ProptestConfig::default() })]

    #[test]
    fn nothing_is_lost_and_nothing_done_twice(
        bin_capacity in 1_usize..12,
        characters in prop::collection::vec(character(), 0..4),
        scripts in prop::collection::vec(script(), 1..4),
        close_after_us in prop::option::weighted(0.3, 0_u64..2_000),
    ) {
        hush_injected_panics();
        let config = HraConfig { bin_capacity, ..quick() };
        let close_after = close_after_us.map(Duration::from_micros);
        within_reason(move || run(config, &characters, scripts, close_after));
    }
}
