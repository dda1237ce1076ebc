//! Groups of lights, found by the names of their lights.

use std::{collections::BTreeMap, sync::Arc};

use bottega_image::{Combine, Layer};
use bottega_render::{LightGroups, PreparedScene};
use wildmatch::WildMatch;

/// Groups by name, with the patterns of their lights.
type Patterns = BTreeMap<String, Vec<String>>;

/// Number of things that a warning names.
const NAMED_MAX: usize = 8;

/// Returns the layers of groups: red, green and blue of each, in the order of the groups.
pub(crate) fn group_layers(groups: &Patterns) -> Vec<Layer> {
    let channels = || ["R", "G", "B"].map(str::to_owned).to_vec();
    let layer = |name: &String| Layer { name: layer_name(name), channels: channels(), combine: Combine::Mean };
    groups.keys().map(layer).collect()
}

/// Returns the name of a group's layer.
fn layer_name(group: &str) -> String {
    format!("light_{group}")
}

/// Finds the lights of groups. Returns the groups of each light, `None` without any group; and warnings about groups without
/// lights.
pub(crate) fn light_groups(groups: &Patterns, prepared: &PreparedScene) -> (Option<Arc<LightGroups>>, Vec<String>) {
    if groups.is_empty() {
        return (None, Vec::new());
    }
    let patterns: Vec<Vec<WildMatch>> =
        groups.values().map(|patterns| patterns.iter().map(|pattern| WildMatch::new(pattern)).collect()).collect();
    let (mut found, mut lights) = (0, Vec::new());
    let known = LightGroups::new(prepared, groups.len(), |names| {
        let matches = |patterns: &Vec<WildMatch>| patterns.iter().any(|it| names.iter().any(|name| it.matches(name)));
        let of_light = patterns.iter().zip(0..).map(|(patterns, group)| u16::from(matches(patterns)) << group).sum();
        found |= of_light;
        lights.push(names[0].to_owned());
        of_light
    });
    let without = groups.keys().zip(0..).filter(|(_, group)| found & 1 << group == 0);
    let notes = without.map(|(group, _)| {
        let listed = listed("lights", &lights);
        format!("film.light_groups: no light belongs to `{group}`, so its layer is black; {listed}")
    });
    let notes = notes.collect();
    (Some(Arc::new(known)), notes)
}

/// Returns a sentence that lists things of a scene.
///
/// - `kind`: the word for several of them, such as `lights`.
pub(super) fn listed(kind: &str, all: &[String]) -> String {
    let named: Vec<&str> = all.iter().take(NAMED_MAX).map(String::as_str).collect();
    match (named.join(", "), all.len().saturating_sub(NAMED_MAX)) {
        (names, _) if names.is_empty() => format!("the scene has no {kind}"),
        (names, 0) => format!("the {kind} are {names}"),
        (names, more) => format!("the {kind} are {names} and {more} more"),
    }
}
