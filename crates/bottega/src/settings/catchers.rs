//! Shadow catchers, found by the names of their objects.

use std::sync::Arc;

use bottega_render::{PreparedScene, ShadowCatchers};
use wildmatch::WildMatch;

use super::light_groups::listed;

/// Finds the shadow catchers of a scene. Returns them, `None` without any pattern; and warnings about patterns that match
/// nothing.
pub(crate) fn catchers(patterns: &[String], prepared: &PreparedScene) -> (Option<Arc<ShadowCatchers>>, Vec<String>) {
    if patterns.is_empty() {
        return (None, Vec::new());
    }
    let mut matched: Vec<(WildMatch, bool)> = patterns.iter().map(|pattern| (WildMatch::new(pattern), false)).collect();
    let mut objects = Vec::new();
    let found = ShadowCatchers::new(prepared, |names| {
        objects.push(names[0].to_owned());
        matched.iter_mut().fold(false, |is_catcher, (pattern, is_used)| {
            let matches = names.iter().any(|name| pattern.matches(name));
            *is_used |= matches;
            is_catcher || matches
        })
    });
    let unused = patterns.iter().zip(&matched).filter(|(_, (_, is_used))| !is_used);
    let notes = unused.map(|(pattern, _)| {
        let listed = listed("objects", &objects);
        format!("film.shadow_catchers: no object, mesh or material is named `{pattern}`; {listed}")
    });
    let notes = notes.collect();
    (Some(Arc::new(found)), notes)
}
