//! Conversion of a request to the options that produce it.

use bottega::{Request, RequestError};
use serde_json::{Map, Value};

use super::fields::{FIELD_OPTIONS, FieldOption, OptionForm};

/// Returns the words after `bottega render` that produce a request: options, and `--set` for fields without one.
///
/// # Errors
/// The request is invalid, or a file name in it is not Unicode.
pub(crate) fn words(request: &Request) -> Result<Vec<String>, RequestError> {
    // Numbers are taken from the text, which has the fewest digits that a number needs
    let tree = |request: &Request| -> Result<Value, RequestError> {
        Ok(serde_json::from_str(&request.to_line()?).unwrap_or_default())
    };
    let (mut tree, usual) = (tree(request)?, tree(&Request::new(&request.scene.file))?);
    let mut words = vec![request.scene.file.display().to_string()];
    let mut is_of_farm = false;
    for row in FIELD_OPTIONS {
        let pointer = format!("/{}", row.field.replace('.', "/"));
        let usual = usual.pointer(&pointer).unwrap_or(&Value::Null);
        let Some(value) = tree.pointer_mut(&pointer).filter(|value| *value != usual) else { continue };
        if let Some(written) = option_words(row, value) {
            if row.field.starts_with("farm.") && !is_of_farm {
                words.push("--farm".to_owned());
                is_of_farm = true;
            }
            words.extend(written);
            *value = usual.clone();
        }
    }
    set_words("", &tree, &usual, &mut words);
    Ok(words)
}

/// Returns the words of an option with a value. `None`: the option cannot express it.
fn option_words(row: &FieldOption, value: &Value) -> Option<Vec<String>> {
    let option = row.option;
    // Use one word, so that a value that begins with `-` is not taken for an option.
    let with = |value: String| format!("{option}={value}");
    let list = |value: &Value| value.as_array()?.iter().map(plain).collect::<Option<Vec<String>>>();
    match row.form {
        OptionForm::Plain => Some(vec![with(plain(value)?)]),
        OptionForm::Switch => Some(vec![option.to_owned()]),
        OptionForm::List => {
            let values = list(value)?;
            match (values.is_empty(), row.option) {
                (false, _) => Some(vec![with(values.join(","))]),
                (true, "--aov") => Some(vec![with("none".to_owned())]),
                (true, _) => None,
            }
        }
        OptionForm::Repeated => Some(list(value)?.into_iter().map(with).collect()),
        OptionForm::Pairs => {
            let pair = |(name, value): (&String, &Value)| Some(with(format!("{name}={}", plain(value)?)));
            value.as_object()?.iter().map(pair).collect()
        }
        OptionForm::PairLists if value.as_object()?.keys().any(|name| name.contains('=')) => None,
        OptionForm::PairLists => {
            let lists = value.as_object()?.iter().map(|(name, values)| {
                Some(list(values)?.into_iter().map(move |value| with(format!("{name}={value}"))).collect::<Vec<_>>())
            });
            lists.collect::<Option<Vec<_>>>().map(|lists| lists.concat())
        }
        OptionForm::Size => Some(vec![with(list(value)?.join("x"))]),
        OptionForm::Environment => {
            let written = match (value.get("file"), value.get("radiance")) {
                (Some(file), _) => plain(file)?,
                (None, Some(radiance)) => list(radiance)?.join(","),
                (None, None) => plain(value)?,
            };
            Some(vec![with(written)])
        }
        OptionForm::Times => {
            let part = |name: &str| plain(value.get(name)?);
            Some(vec![with([part("open")?, part("close")?, part("ramp")?].join(":"))])
        }
        OptionForm::Rules => value.as_array()?.iter().map(|rules| Some(with(plain(rules.get("file")?)?))).collect(),
    }
}

/// Returns a text or a number as an option writes it.
fn plain(value: &Value) -> Option<String> {
    match value {
        Value::String(text) => Some(text.clone()),
        Value::Number(number) => Some(number.to_string().trim_end_matches(".0").to_owned()),
        _ => None,
    }
}

/// Appends `--set` for each field that differs from its default.
fn set_words(path: &str, value: &Value, usual: &Value, words: &mut Vec<String>) {
    if value == usual {
        return;
    }
    let inner = |fields: &Map<String, Value>, words: &mut Vec<String>| {
        for (name, value) in fields {
            let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
            set_words(&path, value, usual.get(name).unwrap_or(&Value::Null), words);
        }
    };
    // A path names no member with these characters: the whole object is then written
    let has_path = |fields: &Map<String, Value>| !fields.keys().any(|name| name.contains(['=', '.']));
    match (value, usual) {
        (Value::Object(fields), Value::Object(_)) if has_path(fields) => inner(fields, words),
        // The fields of `frames` are options
        (Value::Object(fields), Value::Null) if fields.values().all(Value::is_null) => {}
        _ => words.push(format!("--set={path}={}", set_text(value))),
    }
}

/// Returns a value as `--set` reads it: a word as it is, a list of words with commas, anything else as JSON.
fn set_text(value: &Value) -> String {
    let is_word = |text: &str| !text.is_empty() && !text.contains(',') && serde_json::from_str::<Value>(text).is_err();
    match value {
        Value::String(text) if is_word(text) => text.clone(),
        Value::Array(values)
            if !values.is_empty() && values.iter().all(|value| value.as_str().is_some_and(is_word)) =>
        {
            values.iter().filter_map(Value::as_str).collect::<Vec<_>>().join(",")
        }
        _ => value.to_string(),
    }
}

/// Joins words to a line for a shell.
pub(crate) fn line(words: &[String]) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "-_=./,:#%+@".contains(c);
    let quoted = |word: &String| {
        if !word.is_empty() && word.chars().all(is_plain) {
            word.clone()
        } else {
            format!("'{}'", word.replace('\'', r"'\''"))
        }
    };
    words.iter().map(quoted).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use bottega::request::{
        AdaptationChoice, AuctionChoice, BalanceChoice, BandChoice, CameraPose, ColorSpace, Compression,
        EnvironmentLight, FrameOptions, GuideChoice, GuideUse, ImportanceChoice, IntegratorChoice, OptimizationChoice,
        OracleChoice, OracleQuestion, PixelFilter, PngEncoding, ProjectionChoice, RulesSource, RulesText, ShutterTimes,
        ToneCurve, WordChoice,
    };
    use bottega_farm::Channel;
    use clap::Parser;
    use proptest::{option, prelude::*, sample::select};

    use super::*;
    use crate::cli::{Cli, Command};

    /// The request that a command line produces.
    fn made(words: &[String]) -> Request {
        let all = ["bottega", "render"].into_iter().chain(words.iter().map(String::as_str));
        let cli = Cli::try_parse_from(all).unwrap_or_else(|error| panic!("{words:?}: {error}"));
        let Command::Render(args) = cli.command else { panic!("{words:?}") };
        args.to_request().unwrap_or_else(|error| panic!("{words:?}: {error}"))
    }

    fn choice<T: WordChoice + std::fmt::Debug>() -> impl Strategy<Value = T> {
        select(T::VARIANTS)
    }

    fn word() -> impl Strategy<Value = String> {
        "[a-zA-Z0-9äß-][a-zA-Z0-9 äß'=-]{0,8}"
    }

    prop_compose! {
        fn picture()(
            size in option::of([1u32..4096, 1u32..4096]), filter in option::of(choice::<PixelFilter>()),
            layers in option::of(proptest::collection::vec("[a-z]{1,5}", 0..3)), camera in option::of(word()),
            lens in option::of((0.0f32..9.0, 1e-3f32..1e6)), projection in option::of(choice::<ProjectionChoice>()), strength in 0.0f32..1e4, rotate in -720.0f32..720.0,
            light in option::of(prop_oneof![
                "[a-z]{1,8}\\.hdr".prop_map(|file| EnvironmentLight::File(file.into())),
                [0.0f32..1e6, 0.0f32..1e6, 0.0f32..1e6].prop_map(EnvironmentLight::Radiance), Just(EnvironmentLight::Sky),
            ]),
            switches in [any::<bool>(), any::<bool>(), any::<bool>(), any::<bool>()], variant in option::of(word()),
            defines in proptest::collection::btree_map("[a-z]{1,5}", word(), 0..3), time in option::of(-99.0f32..99.0),
            shutter in option::of((-9.0f64..9.0, 0.0f64..9.0, 0.0f64..0.5)),
        ) -> Request {
            let mut request = Request::new("a scene.glb");
            request.output.file = Some("picture.exr".into());
            (request.film.size, request.film.filter, request.film.layers) = (size, filter, layers);
            (request.view.camera, request.view.projection) = (camera, projection);
            if let Some((radius, distance)) = lens {
                (request.view.lens_radius, request.view.focus_distance) = (Some(radius), Some(distance));
            }
            (request.environment.light, request.environment.strength, request.environment.rotate) = (light, strength, rotate);
            [request.scene.strict, request.scene.cull_backfaces, request.film.denoise, request.output.half] = switches;
            (request.scene.variant, request.scene.defines, request.scene.time) = (variant, defines, time);
            let times = |(open, span, ramp): (f64, f64, f64)| ShutterTimes { open, close: open + span, ramp };
            request.scene.shutter = shutter.map(times);
            request
        }
    }

    prop_compose! {
        fn request()(
            mut request in picture(), samples in option::of(1u32..1 << 22), error in option::of(1e-6f64..10.0),
            method in option::of(choice::<IntegratorChoice>()), depth in option::of(0u32..4096), seed in any::<u64>(),
            photons in (option::of(1u32..100_000_000), option::of(1e-6f32..1.0), any::<bool>()),
            oracle in (choice::<OracleChoice>(), 0.001f64..1.0, proptest::collection::vec(choice::<OracleQuestion>(), 1..3)),
            wavefront in proptest::bool::ANY,
            guide in prop_oneof![
                Just((None, vec![])), Just((Some(GuideChoice::None), vec![])),
                proptest::collection::vec(choice::<GuideUse>(), 0..4).prop_map(|uses| (Some(GuideChoice::Ala), uses)),
            ],
            work in (option::of(1u16..1024), 0u8..=3, choice::<ImportanceChoice>(), choice::<OptimizationChoice>()),
            channels in option::of(proptest::collection::vec(select(&Channel::ALL[..]), 1..4)),
            learning in (choice::<AuctionChoice>(), choice::<AdaptationChoice>()),
            zones in (1u32..65536, option::of(1e-6f64..1.0), 0.0f64..=1.0, choice::<BalanceChoice>()),
            bands in prop_oneof![
                Just(BandChoice::Off), Just(BandChoice::Rules), (1u32..=64).prop_map(BandChoice::Pixels)
            ],
            rules in proptest::collection::vec("paper|(\\./)?[a-z]{1,8}\\.fcl", 0..3), threads in option::of(1u16..1024),
            devices in (select(&["auto", "cpu", "cpu,H100"][..]), option::of(1u32..90_000)), frames in option::of(("-?[0-9]{1,3}(,[0-9]{1,3})?", 0.1f32..99.0)),
            tone in (choice::<ToneCurve>(), choice::<PngEncoding>(), -40.0f32..40.0),
            file in (choice::<Compression>(), choice::<ColorSpace>(), proptest::bool::ANY),
            groups in proptest::collection::btree_map("[a-z=]{1,5}", proptest::collection::vec(word(), 1..3), 0..3),
            catchers in proptest::collection::vec(word(), 0..3), farm in (1u32..1000, option::of(1u32..=3)),
        ) -> Request {
            (request.goal.samples, request.goal.error) = (samples, error);
            (request.integrator.method, request.integrator.max_depth, request.seed) = (method, depth, seed);
            request.integrator.wavefront = wavefront;
            (request.photons.count, request.photons.radius, request.photons.progressive) = photons;
            let agents = &mut request.lighting_agents;
            (agents.oracle, agents.error, agents.decides) = oracle;
            (request.guide.by, request.guide.uses) = guide;
            let to = &mut request.work;
            (to.agents, to.level, to.importance, to.optimization) = work;
            (to.channels, to.rules) = (channels, rules.into_iter().map(|file| RulesSource::File(file.into())).collect());
            (to.auction, to.adaptation) = learning;
            (to.zone_min_size, to.zone_max_complexity, to.zone_similarity, to.zone_balance) = zones;
            to.bands = bands;
            request.devices.threads = threads;
            request.devices.memory_mb = devices.1;
            request.devices.names = devices.0.split(',').map(str::to_owned).collect();
            if let Some((list, fps)) = frames {
                request.scene.time = None;
                request.frames = Some(FrameOptions { fps, ..FrameOptions::new(list.parse().unwrap()) });
            }
            (request.output.tonemap, request.output.encoding, request.output.exposure) = tone;
            (request.output.compression, request.output.colorspace, request.output.parts) = file;
            (request.film.light_groups, request.film.shadow_catchers) = (groups, catchers);
            (request.farm.priority, request.farm.verify) = farm;
            request
        }
    }

    proptest! {
        #[test]
        fn options_make_the_request_that_they_are_made_of(request in request()) {
            prop_assert_eq!(request.validate(), Ok(()));
            let words = words(&request).unwrap();
            prop_assert_eq!(made(&words), request, "{}", line(&words));
        }
    }

    #[test]
    fn a_request_of_defaults_is_the_scene_alone() {
        let mut request = Request::new("a.glb");
        request.output.file = Some("b.png".into());
        assert_eq!(words(&request).unwrap(), ["a.glb", "--output=b.png"]);
        assert_eq!(made(&["a.glb", "-o", "b.png"].map(str::to_owned)), request);
        assert_eq!(line(&["a b".to_owned(), "it's".to_owned(), "--x=1".to_owned()]), r"'a b' 'it'\''s' --x=1");
    }

    #[test]
    fn as_in_paper_says_all_that_the_paper_says_and_options_beside_it_win() {
        let request = |more: &[&str]| {
            let words = ["a.glb", "-o", "b.png", "--as-in-paper"].iter().chain(more);
            made(&words.map(|word| (*word).to_owned()).collect::<Vec<_>>())
        };
        let made = |more: &[&str]| request(more).work;
        let paper = made(&[]);
        assert_eq!((paper.prefetch, paper.share_tail), (1, false));
        assert_eq!(request(&[]).integrator.light_samples, 16);
        assert_eq!(request(&["--set", "integrator.light_samples=1"]).integrator.light_samples, 1);
        // Other engines have light samples of their own.
        assert_eq!(request(&["--engine", "mitsuba"]).integrator.light_samples, 1);
        assert_eq!((paper.importance, paper.zone_balance), (ImportanceChoice::Paper, BalanceChoice::Ratio));
        assert_eq!((paper.auction, paper.adaptation), (AuctionChoice::Paper, AdaptationChoice::Paper));
        assert_eq!(paper.rules, [RulesSource::File("paper".into())]);
        let other = made(&["--set", "work.zone_balance=time", "--rules", "./paper"]);
        assert_eq!((other.zone_balance, other.auction), (BalanceChoice::Time, AuctionChoice::Paper));
        assert_eq!(other.rules, [RulesSource::File("./paper".into())]);
    }

    #[test]
    fn a_field_without_an_option_is_set() {
        let mut request = Request::new("a.glb");
        request.output.file = Some("a.exr".into());
        let text = RulesText { name: "a.fcl".into(), text: "FUNCTION_BLOCK a".to_owned() };
        request.work.rules = vec![RulesSource::Text(text)];
        request.lighting_agents.decides.clear();
        request.photons.count = Some(2000);
        request.guide.uses = vec![GuideUse::Lights, GuideUse::Roulette];
        request.view.pose = Some(CameraPose { eye: [0.0, 1.0, 5.5], target: [0.0; 3], up: [0.0, 1.0, 0.0], fov: None });
        let words = words(&request).unwrap();
        assert!(words.contains(&"--set=photons.count=2000".to_owned()), "{words:?}");
        assert!(words.contains(&"--set=guide.uses=lights,roulette".to_owned()), "{words:?}");
        assert_eq!(made(&words), request, "{}", line(&words));
    }
}
