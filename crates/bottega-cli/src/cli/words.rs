//! Conversion of a request to the options that produce it.

use std::path::Path;

use bottega::{
    Request,
    request::{BandChoice, EnvironmentLight, GuideChoice, RulesSource, SceneOptions, WordChoice},
};

use crate::error::CliError;

/// The words of a command line under construction.
struct OptionWords(Vec<String>);

impl OptionWords {
    /// Adds a switch if it is on.
    fn switch(&mut self, option: &str, is_on: bool) {
        if is_on {
            self.0.push(option.to_owned());
        }
    }

    /// Adds an option if it has a value.
    fn option(&mut self, option: &str, value: Option<impl ToString>) {
        if let Some(value) = value {
            // Use one word, so that a value that begins with `-` is not taken for an option.
            self.0.push(format!("{option}={}", value.to_string()));
        }
    }

    /// Adds an option if its value differs from the default.
    fn changed<T: PartialEq + ToString>(&mut self, option: &str, value: &T, usual: &T) {
        self.option(option, (value != usual).then(|| value.to_string()));
    }

    fn choice<T: WordChoice>(&mut self, option: &str, value: T, usual: T) {
        self.option(option, (value != usual).then(|| value.word()));
    }

    fn path(&mut self, option: &str, value: &Path) {
        self.option(option, Some(value.display()));
    }

    fn rules(&mut self, option: &str, field: &str, rules: &RulesSource) -> Result<(), CliError> {
        match rules {
            RulesSource::File(file) => {
                self.path(option, file);
                Ok(())
            }
            RulesSource::Text(_) => Err(no_option(&format!("rules as text in `{field}`"))),
        }
    }
}

fn no_option(what: &str) -> CliError {
    CliError::usage(format!("there is no option for {what}"), "paint the request itself: bottega render --request FILE")
}

/// Returns the words after `bottega render` that produce a request.
///
/// # Errors
/// The request contains something that no option can express.
pub(crate) fn words(request: &Request) -> Result<Vec<String>, CliError> {
    let (mut words, usual) = (OptionWords(Vec::new()), Request::new(&request.scene.file));
    words.0.push(request.scene.file.display().to_string());
    request.output.file.iter().for_each(|file| words.path("--output", file));
    let empty = [
        ("lighting_agents.decides", request.lighting_agents.decides.is_empty()),
        ("work.channels", request.work.channels.as_ref().is_some_and(Vec::is_empty)),
    ];
    if let Some((field, _)) = empty.into_iter().find(|(_, is_empty)| *is_empty) {
        return Err(no_option(&format!("an empty `{field}`")));
    }
    scene(&mut words, &request.scene);
    picture(&mut words, request, &usual);
    light(&mut words, request, &usual);
    engine(&mut words, request, &usual)?;
    work(&mut words, request, &usual)?;
    output(&mut words, request, &usual);
    Ok(words.0)
}

fn scene(words: &mut OptionWords, scene: &SceneOptions) {
    words.switch("--strict", scene.strict);
    words.switch("--allow-outside", scene.allow_outside);
    scene.asset_roots.iter().for_each(|root| words.path("--asset-root", root));
    words.switch("--cull-backfaces", scene.cull_backfaces);
    scene.defines.iter().for_each(|(name, value)| words.option("--define", Some(format!("{name}={value}"))));
    words.option("--at", scene.time);
    words.option("--animation", scene.animation.as_ref());
    words.option("--variant", scene.variant.as_ref());
}

fn picture(words: &mut OptionWords, request: &Request, usual: &Request) {
    let (view, film, environment) = (&request.view, &request.film, &request.environment);
    words.option("--camera", view.camera.as_ref());
    words.option("--lens-radius", view.lens_radius);
    words.option("--focus-distance", view.focus_distance);
    words.option("--size", film.size.map(|[width, height]| format!("{width}x{height}")));
    words.option("--crop", film.crop.map(|[x0, y0, x1, y1]| format!("{x0},{y0},{x1},{y1}")));
    words.option("--filter", film.filter.map(WordChoice::word));
    let layers = |names: &Vec<String>| if names.is_empty() { "none".to_owned() } else { names.join(",") };
    words.option("--aov", film.layers.as_ref().map(layers));
    words.switch("--denoise", film.denoise);
    words.option(
        "--env",
        environment.light.as_ref().map(|light| match light {
            EnvironmentLight::File(file) => file.display().to_string(),
            EnvironmentLight::Radiance([r, g, b]) => format!("{r},{g},{b}"),
            EnvironmentLight::Sky => "sky".to_owned(),
        }),
    );
    words.changed("--env-rotate", &environment.rotate, &usual.environment.rotate);
    words.changed("--env-strength", &environment.strength, &usual.environment.strength);
}

fn light(words: &mut OptionWords, request: &Request, usual: &Request) {
    let (goal, integrator, photons) = (&request.goal, &request.integrator, &request.photons);
    words.option("--spp", goal.samples);
    words.option("--error", goal.error);
    words.option("--time", goal.time);
    words.changed("--seed", &request.seed, &usual.seed);
    words.option("--integrator", integrator.method.map(WordChoice::word));
    words.option("--max-depth", integrator.max_depth);
    words.changed("--light-samples", &integrator.light_samples, &usual.integrator.light_samples);
    words.switch("--wavefront", integrator.wavefront);
    words.option("--photons", photons.count);
    words.option("--photon-gather", photons.gather);
    words.option("--photon-radius", photons.radius);
    words.option("--final-rays", photons.final_rays);
    words.option("--irradiance-cache", photons.irradiance_cache);
    words.changed("--photon-lookouts", &photons.lookouts, &usual.photons.lookouts);
    words.switch("--shadow-photons", photons.shadow_photons);
    words.option("--gather-directions", photons.gather_directions);
    words.switch("--separate-maps", photons.separate_maps);
    words.switch("--no-indirect", !photons.indirect);
    words.switch("--progressive", photons.progressive);
    let (agents, usual_agents) = (&request.lighting_agents, &usual.lighting_agents);
    words.changed("--lighting-agents", &agents.cast, &usual_agents.cast);
    words.choice("--oracle", agents.oracle, usual_agents.oracle);
    words.option("--oracle-decides", (agents.decides != usual_agents.decides).then(|| list(&agents.decides)));
    words.switch("--oracle-network", agents.network);
    words.changed("--oracle-error", &agents.error, &usual_agents.error);
    words.changed("--oracle-memory", &agents.memory_mb, &usual_agents.memory_mb);
    words.option("--guide", request.guide.by.map(GuideChoice::word));
    words.option("--ala", (!request.guide.uses.is_empty()).then(|| list(&request.guide.uses)));
}

fn engine(words: &mut OptionWords, request: &Request, usual: &Request) -> Result<(), CliError> {
    let engine = &request.engine;
    words.option("--engine", (engine.names != usual.engine.names).then(|| engine.names.join(",")));
    engine.rules.iter().try_for_each(|rules| words.rules("--engine-rules", "engine.rules", rules))?;
    engine.manifests.iter().for_each(|folder| words.path("--engines", folder));
    engine.options.iter().for_each(|(name, value)| words.option("--engine-option", Some(format!("{name}={value}"))));
    words.switch("--trust", engine.trust);
    words.option("--frame", engine.frame);
    Ok(())
}

fn work(words: &mut OptionWords, request: &Request, usual: &Request) -> Result<(), CliError> {
    let (work, devices, farm) = (&request.work, &request.devices, &request.farm);
    words.option("--agents", work.agents);
    words.changed("--level", &work.level, &usual.work.level);
    words.choice("--importance", work.importance, usual.work.importance);
    let names = |channels: &Vec<bottega_farm::Channel>| {
        channels.iter().map(|channel| channel.name()).collect::<Vec<_>>().join(",")
    };
    words.option("--channels", work.channels.as_ref().map(names));
    words.option("--zones", work.zones);
    words.changed("--zone-min-size", &work.zone_min_size, &usual.work.zone_min_size);
    words.option("--zone-max-complexity", work.zone_max_complexity);
    words.changed("--zone-similarity", &work.zone_similarity, &usual.work.zone_similarity);
    words.choice("--zone-balance", work.zone_balance, usual.work.zone_balance);
    words.choice("--auction", work.auction, usual.work.auction);
    words.choice("--adaptation", work.adaptation, usual.work.adaptation);
    words.choice("--optimize", work.optimization, usual.work.optimization);
    work.rules.iter().try_for_each(|rules| words.rules("--rules", "work.rules", rules))?;
    let bands = match work.bands {
        BandChoice::Off => Some("off".to_owned()),
        BandChoice::Rules => None,
        BandChoice::Pixels(pixels) => Some(pixels.to_string()),
    };
    words.option("--bands", bands);
    words.option("--threads", devices.threads);
    words.option("--devices", (devices.names != usual.devices.names).then(|| devices.names.join(",")));
    words.switch("--exact", devices.exact);
    words.option("--gpu-memory", devices.memory_mb);
    words.option("--frames", request.frames.as_ref().map(|frames| String::from(frames.list.clone())));
    words.option("--fps", request.frames.as_ref().map(|frames| frames.fps));
    if *farm != usual.farm {
        words.0.push("--farm".to_owned());
        words.changed("--priority", &farm.priority, &usual.farm.priority);
        words.option("--verify", farm.verify);
        words.switch("--strangers", farm.strangers);
        farm.require.iter().for_each(|tag| words.option("--require", Some(tag)));
    }
    Ok(())
}

fn output(words: &mut OptionWords, request: &Request, usual: &Request) {
    let (output, usual) = (&request.output, &usual.output);
    words.changed("--exposure", &output.exposure, &usual.exposure);
    words.choice("--tonemap", output.tonemap, usual.tonemap);
    words.choice("--encoding", output.encoding, usual.encoding);
    words.switch("--alpha", output.alpha);
    words.switch("--half", output.half);
    words.switch("--tiled", output.tiled);
}

fn list<T: WordChoice>(choices: &[T]) -> String {
    choices.iter().map(|choice| choice.word()).collect::<Vec<_>>().join(",")
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
        AdaptationChoice, AuctionChoice, BalanceChoice, FrameOptions, GuideUse, ImportanceChoice, IntegratorChoice,
        OptimizationChoice, OracleChoice, OracleQuestion, PixelFilter, PngEncoding, ToneCurve,
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
            lens in option::of((0.0f32..9.0, 1e-3f32..1e6)), strength in 0.0f32..1e4, rotate in -720.0f32..720.0,
            light in option::of(prop_oneof![
                "[a-z]{1,8}\\.hdr".prop_map(|file| EnvironmentLight::File(file.into())),
                [0.0f32..1e6, 0.0f32..1e6, 0.0f32..1e6].prop_map(EnvironmentLight::Radiance), Just(EnvironmentLight::Sky),
            ]),
            switches in [any::<bool>(), any::<bool>(), any::<bool>(), any::<bool>()], variant in option::of(word()),
            defines in proptest::collection::btree_map("[a-z]{1,5}", word(), 0..3), time in option::of(-99.0f32..99.0),
        ) -> Request {
            let mut request = Request::new("a scene.glb");
            request.output.file = Some("picture.exr".into());
            (request.film.size, request.film.filter, request.film.layers) = (size, filter, layers);
            request.view.camera = camera;
            if let Some((radius, distance)) = lens {
                (request.view.lens_radius, request.view.focus_distance) = (Some(radius), Some(distance));
            }
            (request.environment.light, request.environment.strength, request.environment.rotate) = (light, strength, rotate);
            [request.scene.strict, request.scene.cull_backfaces, request.film.denoise, request.output.half] = switches;
            (request.scene.variant, request.scene.defines, request.scene.time) = (variant, defines, time);
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
            farm in (1u32..1000, option::of(1u32..=3)),
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
        let made = |more: &[&str]| {
            let words = ["a.glb", "-o", "b.png", "--as-in-paper"].iter().chain(more);
            made(&words.map(|word| (*word).to_owned()).collect::<Vec<_>>()).work
        };
        let paper = made(&[]);
        assert_eq!((paper.importance, paper.zone_balance), (ImportanceChoice::Paper, BalanceChoice::Ratio));
        assert_eq!((paper.auction, paper.adaptation), (AuctionChoice::Paper, AdaptationChoice::Paper));
        assert_eq!(paper.rules, [RulesSource::File("paper".into())]);
        let other = made(&["--zone-balance", "time", "--rules", "./paper"]);
        assert_eq!((other.zone_balance, other.auction), (BalanceChoice::Time, AuctionChoice::Paper));
        assert_eq!(other.rules, [RulesSource::File("./paper".into())]);
    }

    #[test]
    fn rules_as_text_have_no_option() {
        let mut request = Request::new("a.glb");
        let text = bottega::request::RulesText { name: "a.fcl".into(), text: String::new() };
        request.work.rules = vec![RulesSource::Text(text)];
        assert!(words(&request).unwrap_err().is_usage());
        let mut request = Request::new("a.glb");
        request.lighting_agents.decides.clear();
        assert!(words(&request).unwrap_err().to_string().contains("lighting_agents.decides"));
    }
}
