//! Requests as values: their JSON, their limits, their fields by path.

use std::{collections::BTreeMap, path::PathBuf};

use bottega::{
    Request, RequestError,
    request::{
        AdaptationChoice, AuctionChoice, BAND_PIXELS_MAX, BalanceChoice, BandChoice, EnvironmentLight, FrameOptions,
        GuideChoice, GuideUse, ImportanceChoice, IntegratorChoice, OptimizationChoice, OracleChoice, OracleQuestion,
        PixelFilter, PngEncoding, REQUEST_BYTES_MAX, RulesSource, RulesText, ToneCurve, WordChoice,
    },
};
use bottega_farm::Channel;
use proptest::{option, prelude::*, sample::select};

fn choice<T: WordChoice + std::fmt::Debug>() -> impl Strategy<Value = T> {
    select(T::VARIANTS)
}

fn name() -> impl Strategy<Value = String> {
    "[a-zA-Z0-9 äß\"\\\\/._-]{1,12}"
}

fn map() -> impl Strategy<Value = BTreeMap<String, String>> {
    proptest::collection::btree_map("[a-z]{1,6}", name(), 0..3)
}

fn rules() -> impl Strategy<Value = RulesSource> {
    prop_oneof![
        name().prop_map(|file| RulesSource::File(file.into())),
        (name(), ".{0,40}").prop_map(|(name, text)| RulesSource::Text(RulesText { name: name.into(), text })),
    ]
}

fn light() -> impl Strategy<Value = EnvironmentLight> {
    prop_oneof![
        name().prop_map(|file| EnvironmentLight::File(file.into())),
        [0.0f32..1e6, 0.0f32..1e6, 0.0f32..1e6].prop_map(EnvironmentLight::Radiance),
        Just(EnvironmentLight::Sky),
    ]
}

fn bands() -> impl Strategy<Value = BandChoice> {
    prop_oneof![Just(BandChoice::Off), Just(BandChoice::Rules), (1..=BAND_PIXELS_MAX).prop_map(BandChoice::Pixels),]
}

/// Changes a request.
struct Apply(Box<dyn Fn(&mut Request)>);

impl std::fmt::Debug for Apply {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("a change")
    }
}

/// A change of a request that is valid alone.
fn change() -> impl Strategy<Value = Apply> {
    fn of<T: Clone + std::fmt::Debug + 'static>(
        values: impl Strategy<Value = T> + 'static,
        set: impl Fn(&mut Request, T) + Clone + 'static,
    ) -> BoxedStrategy<Apply> {
        values
            .prop_map(move |value| {
                let set = set.clone();
                Apply(Box::new(move |request: &mut Request| set(request, value.clone())))
            })
            .boxed()
    }
    proptest::strategy::Union::new([
        of(any::<bool>(), |r, v| r.scene.strict = v),
        of(any::<bool>(), |r, v| r.scene.allow_outside = v),
        of(proptest::collection::vec(name().prop_map(PathBuf::from), 0..3), |r, v| r.scene.asset_roots = v),
        of(map(), |r, v| r.scene.defines = v),
        of(option::of(-1e6f32..1e6), |r, v| r.scene.time = v),
        of(option::of(name()), |r, v| r.scene.animation = v),
        of(option::of(0u8..7), |r, v| r.scene.subdivision = v),
        of(option::of(0u8..13), |r, v| r.scene.displacement = v),
        of(option::of(light()), |r, v| r.environment.light = v),
        of(-720.0f32..720.0, |r, v| r.environment.rotate = v),
        of(0.0f32..1e5, |r, v| r.environment.strength = v),
        of(option::of(name()), |r, v| r.view.camera = v),
        of((0.0f32..10.0, 1e-6f32..1e9), |r, (radius, distance)| {
            (r.view.lens_radius, r.view.focus_distance) = (Some(radius), Some(distance));
        }),
        of(option::of([1u32..4096, 1u32..4096]), |r, v| r.film.size = v),
        of((0u32..9, 0u32..9, 9u32..99, 9u32..99), |r, (a, b, c, d)| r.film.crop = Some([a, b, c, d])),
        of(option::of(choice::<PixelFilter>()), |r, v| r.film.filter = v),
        of(option::of(proptest::collection::vec(name(), 0..3)), |r, v| r.film.layers = v),
        of(any::<bool>(), |r, v| r.film.denoise = v),
        of(option::of(1u32..1 << 22), |r, v| r.goal.samples = v),
        of(1e-6f64..10.0, |r, v| (r.goal.error, r.goal.time) = (Some(v), None)),
        of(0.1f64..1e7, |r, v| (r.goal.error, r.goal.time) = (None, Some(v))),
        of(option::of(choice::<IntegratorChoice>()), |r, v| r.integrator.method = v),
        of(option::of(0u32..4096), |r, v| r.integrator.max_depth = v),
        of(1u32..1024, |r, v| r.integrator.light_samples = v),
        of(option::of(1u32..100_000_000), |r, v| r.photons.count = v),
        of(option::of(1e-6f32..1.0), |r, v| r.photons.radius = v),
        of(any::<bool>(), |r, v| r.photons.lookouts = v),
        of(any::<bool>(), |r, v| r.photons.shadow_photons = v),
        of(any::<[bool; 2]>(), |r, v| [r.photons.separate_maps, r.photons.indirect] = v),
        of(option::of(any::<bool>()), |r, v| r.photons.gather_directions = v),
        of((choice::<OracleChoice>(), 0.001f64..1.0), |r, (oracle, error)| {
            (r.lighting_agents.oracle, r.lighting_agents.error) = (oracle, error);
        }),
        of(proptest::collection::vec(choice::<OracleQuestion>(), 0..3), |r, v| r.lighting_agents.decides = v),
        of(proptest::collection::vec(choice::<GuideUse>(), 0..4), |r, v| {
            (r.guide.by, r.guide.uses) = (Some(GuideChoice::Ala), v);
        }),
        of(rules(), |r, v| {
            r.engine.names = vec!["builtin".to_owned(), "mitsuba".to_owned()];
            r.engine.rules = Some(v);
        }),
        of(rules(), |r, v| {
            r.integrator.method = Some(IntegratorChoice::Auto);
            r.integrator.rules = Some(v);
        }),
        of(map(), |r, v| r.engine.options = v),
        of(option::of(1u16..1024), |r, v| r.work.agents = v),
        of((0u8..=3, choice::<ImportanceChoice>()), |r, v| (r.work.level, r.work.importance) = v),
        of(option::of(proptest::collection::vec(select(&Channel::ALL[..]), 0..4)), |r, v| r.work.channels = v),
        of((choice::<AuctionChoice>(), choice::<AdaptationChoice>()), |r, v| (r.work.auction, r.work.adaptation) = v),
        of(choice::<OptimizationChoice>(), |r, v| r.work.optimization = v),
        of(proptest::collection::vec(rules(), 0..3), |r, v| r.work.rules = v),
        of((1u32..65536, option::of(1e-6f64..1.0), 0.0f64..=1.0), |r, v| {
            (r.work.zone_min_size, r.work.zone_max_complexity, r.work.zone_similarity) = v;
        }),
        of(choice::<BalanceChoice>(), |r, v| r.work.zone_balance = v),
        of((1u32..=1024, any::<bool>()), |r, v| (r.work.prefetch, r.work.share_tail) = v),
        of(bands(), |r, v| r.work.bands = v),
        of(option::of(1u16..1024), |r, v| r.devices.threads = v),
        of(select(&["auto", "cpu", "llvmpipe", "cpu,H100"][..]), |r, v| {
            (r.devices.names, r.devices.exact) = (v.split(',').map(str::to_owned).collect(), false);
        }),
        of(any::<u64>(), |r, v| r.seed = v),
        of(("[0-9]{1,3}", 1e-3f32..240.0), |r, (list, fps)| {
            (r.scene.time, r.engine.frame) = (None, None);
            r.output.file = Some("a.####.exr".into());
            r.frames = Some(FrameOptions { fps, ..FrameOptions::new(list.parse().unwrap()) });
        }),
        of((choice::<ToneCurve>(), choice::<PngEncoding>(), -40.0f32..40.0), |r, v| {
            (r.output.tonemap, r.output.encoding, r.output.exposure) = v;
        }),
        of((1u32..1000, option::of(1u32..=3)), |r, v| (r.farm.priority, r.farm.verify) = v),
    ])
}

fn request() -> impl Strategy<Value = Request> {
    (name(), proptest::collection::vec(change(), 0..12)).prop_map(|(file, changes)| {
        let mut request = Request::new(file);
        changes.iter().for_each(|Apply(change)| change(&mut request));
        if request.frames.is_some() {
            request.scene.time = None;
        }
        if request.integrator.method != Some(IntegratorChoice::Auto) {
            request.integrator.rules = None;
        }
        request
    })
}

proptest! {
    #[test]
    fn a_request_is_the_same_after_json(request in request()) {
        prop_assert_eq!(request.validate(), Ok(()));
        let json = request.to_json().unwrap();
        prop_assert_eq!(&Request::from_json(json.as_bytes()).unwrap(), &request);
        let line = request.to_line().unwrap();
        prop_assert_eq!(&Request::from_json(line.as_bytes()).unwrap(), &request);
        prop_assert_eq!(&Request::from_value(request.to_value().unwrap()).unwrap(), &request);
    }

    #[test]
    fn text_that_is_cut_or_changed_is_refused_or_a_request(request in request(), at in any::<prop::sample::Index>(), byte in any::<u8>()) {
        let line = request.to_line().unwrap();
        let mut bytes = line.into_bytes();
        let at = at.index(bytes.len());
        prop_assert!(Request::from_json(&bytes[..at]).is_err());
        bytes[at] = byte;
        if let Ok(changed) = Request::from_json(&bytes) {
            prop_assert_eq!(changed.validate(), Ok(()));
        }
    }
}

#[test]
fn what_is_left_out_has_its_default() {
    let read = Request::from_json(br#"{"scene": {"file": "a.glb"}}"#).unwrap();
    assert_eq!(read, Request::new("a.glb"));
}

/// The field that an error names, and the whole of it.
fn refused(json: &str) -> String {
    match Request::from_json(json.as_bytes()) {
        Ok(_) => panic!("{json} is no request"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn wrong_fields_are_refused_with_their_path() {
    for (members, words) in [
        (r#""film": {"sice": [1, 1]}"#, &["`film.sice`", "there is no field `sice` here; there are `size`"][..]),
        (r#""film": {"size": [0, 4]}"#, &["`film.size` is 0x4", "from 1 to 65536"]),
        (r#""film": {"size": [70000, 70000]}"#, &["`film.size`"]),
        (r#""film": {"size": "640x480"}"#, &["`film.size` is \"640x480\": a list of 2 values is needed"]),
        (r#""film": {"crop": [5, 5, 5, 9]}"#, &["`film.crop`", "x0 < x1"]),
        (r#""goal": {"samples": 0}"#, &["`goal.samples` is 0", "from 1 to 4194304"]),
        (
            r#""goal": {"samples": 1e99}"#,
            &["`goal.samples` is 1e+99: a whole number is needed; from 1 to 4194304 is allowed"],
        ),
        (r#""goal": {"samples": -1}"#, &["`goal.samples` is -1: from 1 to 4194304 is allowed"]),
        (
            r#""goal": {"samples": "many"}"#,
            &["`goal.samples` is \"many\": a whole number is needed; from 1 to 4194304"],
        ),
        (r#""goal": {"samples": -1}, "film": {"size": 3}"#, &["`goal.samples` is -1: from 1 to 4194304 is allowed"]),
        (r#""goal": {"time": "3"}"#, &["`goal.time` is \"3\": a number is needed; from "]),
        (r#""film": {"size": [-1, 4]}"#, &["`film.size[0]` is -1: each side must be from 1 to 65536"]),
        (r#""film": {"size": [1, 2, 3]}"#, &["`film.size`: it has 3 values"]),
        (r#""work": {"agents": 70000}"#, &["`work.agents` is 70000: from 1 to "]),
        (r#""integrator": {"max_depth": -1}"#, &["`integrator.max_depth` is -1: from 0 to "]),
        (r#""seed": -1"#, &["`seed` is -1: a whole number from 0 to 18446744073709551615 is needed"]),
        (r#""output": {"alpha": 1}"#, &["`output.alpha` is 1: true or false is needed"]),
        (r#""goal": {"error": NaN}"#, &["`goal.error`", "line 1"]),
        (r#""goal": {"error": 1e999}"#, &["`goal.error`", "the number is too large"]),
        (r#""goal": {"error": 0.1, "time": 5}"#, &["`goal.error`", "`goal.time`"]),
        (r#""environment": {"strength": 1e300}"#, &["`environment.strength`"]),
        (r#""environment": {"light": {"radiance": [1, 2]}}"#, &["`environment.light", "a list of 3 values is needed"]),
        (r#""environment": {"light": {"file": 5}}"#, &["`environment.light"]),
        (r#""integrator": {"method": "magic"}"#, &["`integrator.method`", "`path`, `photon`, `ala`"]),
        (r#""photons": {"progressive": true, "final_rays": 4}"#, &["`photons.progressive`", "exclude"]),
        (r#""guide": {"by": "none", "uses": ["lights"]}"#, &["`guide.uses`"]),
        (r#""engine": {"names": []}"#, &["`engine.names`"]),
        (r#""engine": {"names": ["builtin"], "rules": {"file": "a.fcl"}}"#, &["`engine.rules`"]),
        (r#""integrator": {"method": "path", "rules": {"file": "a.fcl"}}"#, &["`integrator.rules`"]),
        (r#""devices": {"names": ["cpu", "auto"]}"#, &["`devices.names`"]),
        (r#""devices": {"names": ["H100"], "exact": true}"#, &["`devices.names`", "exact"]),
        (r#""frames": {"list": "5..3"}, "output": {"file": "a.exr"}"#, &["`frames.list`", "write 5..3:-1"]),
        (r#""frames": {"list": "1..3"}"#, &["`output.file`"]),
        (r#""output": {"file": "a.jpg"}"#, &["`output.file`", ".exr or .png"]),
        (r#""farm": {"priority": 0}"#, &["`farm.priority`"]),
        (r#""film": [[1, 1]]"#, &["`film` is a list: an object is needed"]),
        (r#""work": {"rules": [{"text": ["a", "b"]}]}"#, &["`work.rules[0]", "is a list: an object is needed"]),
        (r#""work": {"zone_min_size": 0}"#, &["`work.zone_min_size` is 0", "from 1 to 65536"]),
        (r#""work": {"zone_max_complexity": 0}"#, &["`work.zone_max_complexity` is 0", "from 0.000001 to 1"]),
        (r#""work": {"prefetch": 0}"#, &["`work.prefetch` is 0: from 1 to "]),
        (r#""work": {"zone_similarity": 1.5}"#, &["`work.zone_similarity` is 1.5", "from 0 to 1"]),
        (r#""work": {"zone_balance": "size"}"#, &["`work.zone_balance`", "`time` or `ratio`"]),
        (r#""work": {"bands": "on"}"#, &["`work.bands`", "`off`, `rules`, `pixels`"]),
        (r#""work": {"bands": {"pixels": 65}}"#, &["`work.bands.pixels` is 65", "from 1 to 64"]),
        (r#""surprise": 1"#, &["there is no field `surprise` here"]),
    ] {
        let error = refused(&format!(r#"{{"scene": {{"file": "a.glb"}}, {members}}}"#));
        words.iter().for_each(|word| assert!(error.contains(word), "{members}: {error}"));
    }
}

#[test]
fn errors_of_invalid_requests_differ() {
    assert!(refused("").contains("line 1, column 0"));
    assert!(refused("[]").contains("it is a list: an object is needed"));
    assert!(refused("{}").contains("the field `scene` is missing"));
    assert!(refused(r#"{"scene": {"file": "a.glb"}} and more"#).contains("something follows the end"));
    assert!(refused(r#"{"scene": {"file": ""}}"#).contains("`scene.file` is empty"));
    assert!(refused(&"[".repeat(100_000)).contains("an object is needed"));
    let deep =
        format!(r#"{{"scene": {{"file": "a", "defines": {}1{}}}}}"#, r#"{"a":"#.repeat(50_000), "}".repeat(50_000));
    assert!(refused(&deep).contains("scene.defines"));
    let newer = refused(r#"{"version": 2, "scene": 7, "what": "comes later"}"#);
    assert!(newer.contains("version 2") && newer.contains("install a newer"), "{newer}");
    let long = format!(r#"{{"scene": {{"file": "{}"}}}}"#, "a".repeat(REQUEST_BYTES_MAX));
    assert!(matches!(Request::from_json(long.as_bytes()), Err(RequestError::TooLong)));
}

#[test]
fn fields_are_set_by_their_paths() {
    let request = Request::new("a.glb");
    let with = |field: &str, value: &str| request.with(field, value);
    assert_eq!(with("film.size", "[640, 480]").unwrap().film.size, Some([640, 480]));
    assert_eq!(with("film.filter", "box").unwrap().film.filter, Some(PixelFilter::Box));
    assert_eq!(with("view.camera", "2").unwrap().view.camera.as_deref(), Some("2"));
    assert_eq!(with("scene.defines.spp", "64").unwrap().scene.defines["spp"], "64");
    assert_eq!(
        with("environment.light", r#"{"radiance": [1, 2, 3]}"#).unwrap().environment.light,
        Some(EnvironmentLight::Radiance([1.0, 2.0, 3.0]))
    );
    assert_eq!(with("work.bands", "off").unwrap().work.bands, BandChoice::Off);
    assert_eq!(with("work.bands", r#"{"pixels": 12}"#).unwrap().work.bands, BandChoice::Pixels(12));
    assert_eq!(with("work.bands.pixels", "12").unwrap().work.bands, BandChoice::Pixels(12));
    assert_eq!(with("film.size", "640,480").unwrap().film.size, Some([640, 480]));
    assert_eq!(with("guide.uses", "lights,roulette").unwrap().guide.uses, [GuideUse::Lights, GuideUse::Roulette]);
    assert_eq!(with("farm.require", "2").unwrap().farm.require, ["2"]);
    assert_eq!(with("engine.names", "blender").unwrap().engine.names, ["blender"]);
    assert_eq!(with("film.size", "null").unwrap(), request);
    let animated = with("output.file", "a.exr").unwrap().with("frames.list", "1..3").unwrap();
    assert_eq!(animated.frames.unwrap().list.iter().collect::<Vec<_>>(), [1, 2, 3]);
    for (field, value, words) in [
        ("film.sice", "1", "there is no field `sice`"),
        ("film.size.width", "1", "film.size"),
        ("scene.file.name", "1", "has no fields"),
        ("goal.samples", "many", "goal.samples"),
        ("guide.uses", "lights,cats", "`guide.uses[1]` is `cats`"),
        ("", "1", "there is no field"),
    ] {
        let error = with(field, value).unwrap_err().to_string();
        assert!(error.contains(words), "{field}={value}: {error}");
    }
}

#[test]
fn the_schema_says_what_each_field_means() {
    let schema = serde_json::to_value(Request::schema()).unwrap();
    assert_eq!(schema["title"], "Request");
    assert_eq!(schema["additionalProperties"], false);
    let film = &schema["$defs"]["FilmOptions"];
    assert_eq!(film["additionalProperties"], false);
    assert!(film["properties"]["size"]["description"].as_str().unwrap().contains("Width and height in pixels"));
    let filter = schema["$defs"]["PixelFilter"].to_string();
    assert!(filter.contains("blackman-harris") && filter.contains("Sharp and clean"), "{filter}");
}
