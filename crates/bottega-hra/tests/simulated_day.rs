//! A day of random load with faults, in virtual time, over many seeds: nothing is lost and nothing answered twice.

use std::time::Duration;

use bottega_hra::simulate::{AnsweredUnit, Arrival, Faults, Load, LoadRandom, Model, simulate};
use bottega_hra::{CostBook, DataId, HraConfig, Link, Primitive, Time, UnitError, Window};

const DAY: f64 = 86_400.0;

fn seconds(random: &mut LoadRandom, from: f64, to: f64) -> Duration {
    Duration::from_secs_f64(random.by_magnitude(from, to))
}

/// Resources of which all but the first have all kinds of faults.
fn models(random: &mut LoadRandom) -> Vec<Model> {
    let mut models = vec![Model::near("sound", random.by_magnitude(1e8, 1e9))];
    for index in 0..1 + random.below(5) {
        let ns_per_item = random.by_magnitude(1e7, 1e9);
        let name = format!("{index}");
        let mut model = if random.chance(0.4) {
            Model::near(name, ns_per_item)
        } else {
            let latency = Duration::from_secs_f64(random.by_magnitude(1e-5, 0.05));
            let link = Link { latency, bandwidth: random.by_magnitude(1e6, 1e10) };
            let window = Window { patience: Duration::from_secs(3600), ..Window::default() };
            Model { window: Some(window), ..Model::far(name, ns_per_item, link) }
        };
        for time in &mut model.time_per_item {
            *time = time.filter(|_| random.chance(0.7));
        }
        model.noise = random.between(0.0, 0.3);
        model.memory_bytes = random.chance(0.5).then(|| 50 + random.below(200));
        let mut chance = |most: f64| if random.chance(0.5) { random.between(0.0, most) } else { 0.0 };
        model.faults = Faults {
            hang: chance(0.01),
            garbage: chance(0.05),
            death: chance(0.02),
            lasts: seconds(random, 0.01, 3600.0),
            units_max: random.chance(0.2).then(|| 1 + random.below(3) as usize),
        };
        models.push(model);
    }
    models
}

/// Work that comes in waves all day, some of it urgent, some of it with a short life time.
fn load(random: &mut LoadRandom, units: usize) -> Load {
    let mut load = Load::default();
    let mut at = 0.0;
    while load.arrivals.len() < units {
        at += random.exponential(DAY / units as f64 * 20.0);
        let data = random.chance(0.6).then(|| random.below(12)).map(|id| (DataId(id), 20 + 7 * id));
        let primitive = Primitive::ALL[random.below(Primitive::COUNT as u64) as usize];
        for _ in 0..1 + random.below(39) {
            let mut arrival = Arrival::new(Time::at(Duration::from_secs_f64(at)), primitive, 1 + random.below(20));
            arrival.data = data;
            arrival.payload_bytes = random.below(1000);
            arrival.priority = random.below(3) as i32;
            if random.chance(0.3) {
                arrival.max_delay = seconds(random, 1.0, 1000.0);
            }
            if random.chance(0.1) {
                arrival.validity = seconds(random, 0.1, 5000.0);
            }
            load.arrivals.push(arrival);
        }
    }
    for _ in 0..random.below(3) {
        load.cancelled.push(Time::at(Duration::from_secs_f64(random.between(0.0, DAY))));
    }
    load
}

fn check(answer: &AnsweredUnit, arrival: &Arrival, config: &HraConfig) {
    let expires = answer.submitted.after(arrival.validity);
    match &answer.outcome {
        Some(Ok(())) => assert!(answer.at < expires, "an output that nobody wants any more: {answer:?}"),
        Some(Err(UnitError::Expired)) => assert!(answer.at >= expires, "expired too early: {answer:?}"),
        Some(Err(UnitError::Failed { attempts, .. })) => assert_eq!(*attempts, config.max_attempts, "{answer:?}"),
        Some(Err(error)) => panic!("the sound resource could have done it: {error}, {arrival:?}"),
        None => {}
    }
}

#[test]
fn a_day_of_faults_loses_nothing_and_does_nothing_twice() {
    let seeds: u64 = std::env::var("BOTTEGA_HRA_SEEDS").ok().and_then(|text| text.parse().ok()).unwrap_or(200);
    let (mut done, mut failed, mut expired, mut cancelled, mut incidents) = (0, 0, 0, 0, 0);
    for seed in 0..seeds {
        let mut random = LoadRandom::new(seed);
        let models = models(&mut random);
        let load = load(&mut random, 2_000);
        let config = HraConfig {
            bin_capacity: 1 + random.below(500) as usize,
            hang_max: Duration::from_secs(3600),
            max_failures: if random.chance(0.5) { u32::MAX } else { 12 },
            ..HraConfig::default()
        };
        let outcome = simulate(config, &models, &load, &CostBook::new(""), seed);
        assert_eq!((outcome.lost(), outcome.doubled, outcome.overfull), (0, 0, false), "seed {seed}");
        assert_eq!(outcome.report.pending, 0, "seed {seed}");
        for (answer, arrival) in outcome.answers.iter().flatten().zip(&load.arrivals) {
            check(answer, arrival, &config);
            match answer.outcome {
                Some(Ok(())) => done += 1,
                Some(Err(UnitError::Expired)) => expired += 1,
                Some(Err(_)) => failed += 1,
                None => cancelled += 1,
            }
        }
        incidents += outcome.report.incidents.iter().map(|incident| incident.count).sum::<u64>();
        assert!(outcome.end > Time::at(Duration::from_secs(3600)), "seed {seed} is shorter than a day");
    }
    eprintln!(
        "{seeds} days: {done} units done, {failed} failed, {expired} expired, {cancelled} cancelled, {incidents} incidents"
    );
    assert!(done > 1_500 * seeds && expired > seeds && incidents > 50 * seeds);
}

#[test]
fn no_unit_waits_longer_than_its_maximum_delay() {
    for seed in 0..100 {
        let mut random = LoadRandom::new(seed);
        let models: Vec<Model> = (0..1 + random.below(6))
            .map(|index| Model { noise: 0.1, ..Model::near(format!("{index}"), random.by_magnitude(1e5, 1e6)) })
            .collect();
        let rate: f64 = models.iter().map(|model| 1e9 / (model.time_per_item[0].unwrap_or(1.0) * 10.0)).sum();
        // One and a half times what can be done: the bin is always full, and the client waits for room.
        let mut load = Load::default();
        let mut at = 0.0;
        while load.arrivals.len() < 5_000 {
            at += random.exponential(1.0 / (1.5 * rate));
            let mut arrival = Arrival::new(Time::at(Duration::from_secs_f64(at)), Primitive::Intersect, 10);
            // Urgent units all the time, behind which others starve without maximum delays.
            arrival.priority = if random.chance(0.8) { 5 } else { random.below(5) as i32 };
            arrival.max_delay = Duration::from_secs_f64(random.by_magnitude(0.2, 2.0));
            load.arrivals.push(arrival);
        }
        let outcome = simulate(HraConfig::default(), &models, &load, &CostBook::new(""), seed);
        assert_eq!(outcome.done(), 5_000);
        let late = outcome.answers.iter().flatten().zip(&load.arrivals);
        let late: Vec<_> = late.filter(|(answer, arrival)| answer.waited > Some(arrival.max_delay)).collect();
        assert!(late.is_empty(), "seed {seed}: {} late, {} resources, {:?}", late.len(), models.len(), &late[..1]);
    }
}
