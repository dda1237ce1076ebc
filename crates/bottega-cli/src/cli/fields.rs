//! The table of request fields that have an option, and the help of these options.

use std::{collections::BTreeMap, sync::LazyLock};

use bottega::{Request, request::RequestField};
use serde_json::Value;

/// The form in which an option writes the value of its field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OptionForm {
    /// A number, a word or another text.
    Plain,
    /// A switch without a value, which turns the field on.
    Switch,
    /// One option with commas between the values.
    List,
    /// One option per value.
    Repeated,
    /// One option `NAME=VALUE` per member.
    Pairs,
    /// One option `NAME=VALUE` per value of a member, which is a list.
    PairLists,
    /// Width and height with an `x` between.
    Size,
    /// The source of the environment light: a file, `R,G,B` or a word.
    Environment,
    /// One option per file of rules.
    Rules,
    /// Times with colons between.
    Times,
}

/// A request field and its option of `bottega render`.
pub(super) struct FieldOption {
    /// Path of the field.
    pub(super) field: &'static str,
    /// The option, with its dashes.
    pub(super) option: &'static str,
    /// The form of the value.
    pub(super) form: OptionForm,
}

const fn row(field: &'static str, option: &'static str, form: OptionForm) -> FieldOption {
    FieldOption { field, option, form }
}

/// The fields that have an option, in the order in which `bottega request options` prints them. All other fields are set by
/// `--set`.
pub(super) const FIELD_OPTIONS: &[FieldOption] = &[
    row("output.file", "--output", OptionForm::Plain),
    row("scene.strict", "--strict", OptionForm::Switch),
    row("scene.allow_outside", "--allow-outside", OptionForm::Switch),
    row("scene.asset_roots", "--asset-root", OptionForm::Repeated),
    row("scene.cull_backfaces", "--cull-backfaces", OptionForm::Switch),
    row("scene.defines", "--define", OptionForm::Pairs),
    row("scene.time", "--at", OptionForm::Plain),
    row("scene.shutter", "--shutter", OptionForm::Times),
    row("scene.animation", "--animation", OptionForm::Plain),
    row("scene.variant", "--variant", OptionForm::Plain),
    row("view.camera", "--camera", OptionForm::Plain),
    row("view.lens_radius", "--lens-radius", OptionForm::Plain),
    row("view.focus_distance", "--focus-distance", OptionForm::Plain),
    row("view.projection", "--projection", OptionForm::Plain),
    row("film.size", "--size", OptionForm::Size),
    row("film.crop", "--crop", OptionForm::List),
    row("film.filter", "--filter", OptionForm::Plain),
    row("film.layers", "--aov", OptionForm::List),
    row("film.light_groups", "--light-group", OptionForm::PairLists),
    row("film.shadow_catchers", "--shadow-catcher", OptionForm::Repeated),
    row("film.denoise", "--denoise", OptionForm::Switch),
    row("environment.light", "--env", OptionForm::Environment),
    row("environment.rotate", "--env-rotate", OptionForm::Plain),
    row("environment.strength", "--env-strength", OptionForm::Plain),
    row("goal.samples", "--spp", OptionForm::Plain),
    row("goal.error", "--error", OptionForm::Plain),
    row("goal.time", "--time", OptionForm::Plain),
    row("seed", "--seed", OptionForm::Plain),
    row("integrator.method", "--integrator", OptionForm::Plain),
    row("integrator.max_depth", "--max-depth", OptionForm::Plain),
    row("photons.progressive", "--progressive", OptionForm::Switch),
    row("guide.by", "--guide", OptionForm::Plain),
    row("engine.names", "--engine", OptionForm::List),
    row("engine.manifests", "--engines", OptionForm::Repeated),
    row("engine.options", "--engine-option", OptionForm::Pairs),
    row("engine.trust", "--trust", OptionForm::Switch),
    row("engine.frame", "--frame", OptionForm::Plain),
    row("work.agents", "--agents", OptionForm::Plain),
    row("work.optimization", "--optimize", OptionForm::Plain),
    row("work.rules", "--rules", OptionForm::Rules),
    row("devices.threads", "--threads", OptionForm::Plain),
    row("devices.names", "--devices", OptionForm::List),
    row("devices.exact", "--exact", OptionForm::Switch),
    row("frames.list", "--frames", OptionForm::Plain),
    row("frames.fps", "--fps", OptionForm::Plain),
    row("farm.priority", "--priority", OptionForm::Plain),
    row("farm.verify", "--verify", OptionForm::Plain),
    row("farm.strangers", "--strangers", OptionForm::Switch),
    row("farm.require", "--require", OptionForm::Repeated),
    row("output.exposure", "--exposure", OptionForm::Plain),
    row("output.tonemap", "--tonemap", OptionForm::Plain),
    row("output.alpha", "--alpha", OptionForm::Switch),
    row("output.half", "--half", OptionForm::Switch),
    row("output.colorspace", "--colorspace", OptionForm::Plain),
];

/// Fields that are often looked for as an option, by the name that the option would have, with a value for example.
pub(crate) const SET_FIELDS: &[(&str, &str)] = &[
    ("light-samples", "integrator.light_samples=4"),
    ("wavefront", "integrator.wavefront=true"),
    ("bands", "work.bands=off"),
    ("photons", "photons.count=500000"),
    ("photon-gather", "photons.gather=60"),
    ("photon-radius", "photons.radius=0.1"),
    ("final-rays", "photons.final_rays=4"),
    ("irradiance-cache", "photons.irradiance_cache=0.2"),
    ("photon-lookouts", "photons.lookouts=false"),
    ("shadow-photons", "photons.shadow_photons=true"),
    ("gather-directions", "photons.gather_directions=true"),
    ("separate-maps", "photons.separate_maps=true"),
    ("no-indirect", "photons.indirect=false"),
    ("lighting-agents", "lighting_agents.cast=50000"),
    ("oracle", "lighting_agents.oracle=paper"),
    ("oracle-decides", "lighting_agents.decides=shadows,irradiance"),
    ("oracle-network", "lighting_agents.network=true"),
    ("oracle-error", "lighting_agents.error=0.1"),
    ("oracle-memory", "lighting_agents.memory_mb=4"),
    ("ala", "guide.uses=lights,directions"),
    ("engine-rules", "engine.rules.file=choice.fcl"),
    ("level", "work.level=3"),
    ("importance", "work.importance=visual"),
    ("channels", "work.channels=steps,shadow"),
    ("zones", "work.zones=64"),
    ("zone-min-size", "work.zone_min_size=8"),
    ("zone-max-complexity", "work.zone_max_complexity=0.01"),
    ("zone-similarity", "work.zone_similarity=0.15"),
    ("zone-balance", "work.zone_balance=ratio"),
    ("auction", "work.auction=stealing"),
    ("adaptation", "work.adaptation=paper"),
    ("gpu-memory", "devices.memory_mb=4096"),
    ("bin", "devices.bin=16"),
    ("vram", "devices.memory_mb=4096"),
    ("encoding", "output.encoding=linear"),
    ("tiled", "output.tiled=true"),
    ("compression", "output.compression=dwaa"),
    ("parts", "output.parts=true"),
];

/// Returns the option of a field, or of the field that contains it.
pub(super) fn option_of(field: &str) -> Option<&'static str> {
    let contains = |row: &&FieldOption| field.strip_prefix(row.field).is_some_and(|rest| !rest.starts_with('_'));
    FIELD_OPTIONS.iter().find(contains).map(|row| row.option)
}

/// The documentation of all fields of a request, by path.
static FIELDS: LazyLock<BTreeMap<String, RequestField>> =
    LazyLock::new(|| Request::fields().into_iter().map(|field| (field.path.clone(), field)).collect());

/// Returns the help of the option of a field: the documentation of the field, and its default.
///
/// # Panics
/// A request has no such field; a test reads the help of all options.
pub(super) fn help(path: &str) -> String {
    let RequestField { description, default, .. } = &FIELDS[path];
    let text = description.replace("None: ", "Default: ").replace("none: ", "default: ");
    let text = match text.strip_prefix("True to ") {
        // The switch is on: leave out what `false` means
        Some(action) => capitalized(action.split_once("; false ").map_or(action, |(action, _)| action)),
        None => text,
    };
    let text = if text.ends_with('.') { text } else { text + "." };
    match default {
        Value::Number(_) => format!("{text} Default: {}.", default.to_string().trim_end_matches(".0")),
        Value::String(word) => format!("{text} Default: {word}."),
        _ => text,
    }
}

fn capitalized(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::cli::Cli;

    #[test]
    fn every_field_is_reachable_by_an_option_or_by_set() {
        let program = Cli::command();
        let render = program.find_subcommand("render").expect("it exists");
        let request = Request::new("a.glb");
        let optional_sections = ["view.pose.", "scene.shutter.", "frames."];
        let is_optional = |path: &str| optional_sections.iter().any(|section| path.starts_with(section));
        for RequestField { path, default, .. } in FIELDS.values() {
            let row = FIELD_OPTIONS.iter().find(|row| row.field == path);
            let has = |row: &FieldOption| {
                render.get_arguments().any(|known| known.get_long() == row.option.strip_prefix("--"))
            };
            assert!(row.is_none_or(has), "render has no option for `{path}`");
            if path != "version" && path != "scene.file" && !is_optional(path) {
                let set = request.with(path, &default.to_string()).unwrap_or_else(|error| panic!("{path}: {error}"));
                assert_eq!(set, request, "{path}");
            }
        }
        let request = request.with("output.file", "a.####.exr").expect("a name for frames");
        for (field, value) in [
            ("view.pose", r#"{"eye": [0, 1, 5], "target": [0, 0, 0]}"#),
            ("scene.shutter", r#"{"open": 0, "close": 0.5}"#),
            ("frames", r#"{"list": "1..3"}"#),
            ("frames.list", "1..3"),
        ] {
            assert_ne!(request.with(field, value).unwrap_or_else(|error| panic!("{field}: {error}")), request);
        }
    }

    #[test]
    fn every_option_of_the_table_names_a_field() {
        for row in FIELD_OPTIONS {
            let section = format!("{}.", row.field);
            let is_named = FIELDS.keys().any(|field| field == row.field || field.starts_with(&section));
            assert!(is_named, "a request has no `{}`", row.field);
        }
        assert_eq!((option_of("goal.samples"), option_of("frames.fps")), (Some("--spp"), Some("--fps")));
        assert_eq!((option_of("film.size[0]"), option_of("photons.count")), (Some("--size"), None));
    }

    #[test]
    fn a_suggested_field_can_be_set_and_has_no_option() {
        let request = Request::new("a.glb");
        for (former, set) in SET_FIELDS {
            let (field, value) = set.split_once('=').expect("field and value");
            assert_eq!(option_of(field), None, "{former}");
            let mut request = request.clone();
            if field.starts_with("engine.rules") {
                request.engine.names.push("blender".to_owned());
            }
            let set = request.with(field, value).unwrap_or_else(|error| panic!("{set}: {error}"));
            let again = set.with(field, value).expect("as before");
            assert_eq!(set, again, "{former}");
        }
    }

    #[test]
    fn help_comes_from_the_field() {
        assert_eq!(
            help("work.optimization"),
            "Degree to which expert rules may trade quality for time, zone by zone. Default: off."
        );
        assert!(
            help("goal.samples").ends_with("Default: what the scene file asks for, or 64."),
            "{}",
            help("goal.samples")
        );
        assert!(help("film.denoise").starts_with("Denoise the picture"), "{}", help("film.denoise"));
    }
}
