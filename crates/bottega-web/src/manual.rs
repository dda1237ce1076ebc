//! The manual as web pages below `/manual/`, from the Markdown files of `docs/` built into the program.

use std::{collections::HashMap, sync::Arc};

use axum::{
    Router,
    extract::Path,
    http::{StatusCode, header},
    response::{IntoResponse, Redirect, Response},
    routing::get,
};
use pulldown_cmark::{CowStr, Event, Options, Parser, Tag, TagEnd, html};

use crate::state::DoorState;

macro_rules! pages {
    ($($name:literal)*) => {
        &[$(($name, include_str!(concat!("../../../docs/", $name, ".md")))),*]
    };
}

macro_rules! pictures {
    ($($name:literal)*) => {
        &[$(($name, include_bytes!(concat!("../../../docs/pictures/", $name)))),*]
    };
}

/// The pages: name relative to `docs/`, and text.
const PAGES: &[(&str, &str)] = pages! {
    "ala" "api" "decisions" "devices" "engines" "explanation/agents" "explanation/exact" "explanation/nats" "explanation/platform"
    "explanation/reading" "farm" "guides/blender" "guides/cameras" "guides/hair" "guides/layers" "guides/motion" "guides/quality" "guides/scenes"
    "guides/security" "guides/studio" "guides/subsurface" "guides/systems" "guides/trouble" "guides/volumes" "hra" "index" "magarro" "python" "reference/commands"
    "reference/configuration" "reference/events" "reference/files" "reference/models" "reference/request" "render" "requests" "strangers" "symbols"
    "tools" "tutorials/first-picture" "tutorials/from-blender" "tutorials/own-rules" "tutorials/paper-table"
    "tutorials/scene-in-memory" "tutorials/two-machines"
};
/// The table of contents.
const CONTENTS: &str = include_str!("../../../docs/SUMMARY.md");
/// The pictures of the pages: file name, and bytes.
const PICTURES: &[(&str, &[u8])] = pictures! {
    "bands.png" "blender-beside-cycles.jpg" "cameras.jpg" "clear-coat.jpg" "cornell-box.jpg" "cube.png" "flight-helmet.jpg" "goblets.jpg" "hair.jpg" "ies.jpg" "layers.jpg" "light-groups.jpg" "ludd.png"
    "models/ala.png" "models/coat.png"
    "models/coated.png" "models/conductor.png" "models/dielectric.png" "models/environment.png" "models/film.png" "models/gloss.png" "models/hair.png" "models/matte.png"
    "models/measured.png" "models/medium.png" "models/path.png" "models/photon.png" "models/plastic.png" "models/principled.png" "models/punctual.png"
    "models/sheen.png" "models/sphere.png" "models/surface.png" "models/varnish.png" "motion.jpg" "motion-vectors.jpg" "shadow-catchers.jpg" "subsurface.jpg" "page-compare.webp"
    "page-importance.webp" "page-job.webp" "page-jobs.webp" "page-look-around.webp" "page-machines.webp" "page-messages.webp"
    "page-new-picture.webp" "page-picture.webp" "page-rules.webp" "volumes.jpg" "zones.png"
};
/// The URL path of the manual.
const ROOT: &str = "/manual/";

/// Returns the routes of the manual, which need no token.
pub(crate) fn routes() -> Router<Arc<DoorState>> {
    Router::new()
        .route("/manual", get(async || Redirect::permanent(ROOT)))
        .route("/manual/", get(async || page("index")))
        .route("/manual/{*name}", get(async |Path(name): Path<String>| file(&name)))
}

/// Returns a picture or a page. The name of a page may end with `.md`, as links in the pages do.
fn file(name: &str) -> Response {
    let picture = name.strip_prefix("pictures/").and_then(|name| PICTURES.iter().find(|(known, _)| *known == name));
    let Some((name, bytes)) = picture else { return page(name.strip_suffix(".md").unwrap_or(name)) };
    let kind = match name.rsplit('.').next() {
        Some("jpg") => "image/jpeg",
        Some("webp") => "image/webp",
        _ => "image/png",
    };
    ([(header::CONTENT_TYPE, kind), (header::CACHE_CONTROL, "no-cache")], *bytes).into_response()
}

fn page(name: &str) -> Response {
    let headers = [(header::CONTENT_TYPE, "text/html; charset=utf-8"), (header::CACHE_CONTROL, "no-cache")];
    match PAGES.iter().find(|(known, _)| *known == name) {
        Some((name, text)) => (headers, whole(name, text)).into_response(),
        None => {
            let text = "# The manual has no such page\n\nIts pages are named at the side.\n";
            (StatusCode::NOT_FOUND, headers, whole("index", text)).into_response()
        }
    }
}

/// Returns the HTML of a page, with the table of contents.
fn whole(name: &str, text: &str) -> String {
    let title =
        text.lines().find_map(|line| line.strip_prefix("# ")).unwrap_or("The manual").replace(['`', '<', '&'], "");
    let (link, here) = (format!("href=\"{ROOT}{name}\""), format!("href=\"{ROOT}{name}\" aria-current=\"page\""));
    let contents = html_of("index", CONTENTS, false).replace(&link, &here);
    let body = html_of(name, text, true);
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<meta name=\"color-scheme\" content=\"light dark\">\n\
         <title>{title} – Bottega</title>\n<link rel=\"icon\" href=\"/icon.svg\" type=\"image/svg+xml\">\n\
         <link rel=\"stylesheet\" href=\"/style.css\">\n</head>\n<body>\n\
         <header class=\"of-manual\"><a class=\"name\" href=\"/\"><img src=\"/icon.svg\" alt=\"\" width=\"24\" height=\"24\"> Bottega</a></header>\n\
         <div class=\"manual\">\n<nav aria-label=\"Contents\">{contents}</nav>\n<main>{body}</main>\n</div>\n</body>\n</html>\n"
    )
}

/// Converts Markdown to HTML. Links to files outside of the manual are replaced by their text.
///
/// - `is_linked`: true to give headings the ids that links use.
fn html_of(name: &str, text: &str, is_linked: bool) -> String {
    let mut events: Vec<Event<'_>> = Vec::new();
    let mut heading = None;
    let mut names: HashMap<String, usize> = HashMap::new();
    // For each open link or picture: true if it is left out
    let mut left_out: Vec<bool> = Vec::new();
    for mut event in Parser::new_ext(text, Options::ENABLE_TABLES) {
        match &mut event {
            Event::Start(Tag::Heading { .. }) if is_linked => heading = Some((events.len(), String::new())),
            Event::Text(text) | Event::Code(text) => {
                if let Some((_, words)) = &mut heading {
                    words.push_str(text);
                }
            }
            Event::End(TagEnd::Heading(_)) => {
                if let Some((at, words)) = heading.take()
                    && let Some(Event::Start(Tag::Heading { id, .. })) = events.get_mut(at)
                {
                    *id = Some(heading_name(&words, &mut names).into());
                }
            }
            Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => {
                let place = place(name, dest_url);
                left_out.push(place.is_none());
                match place {
                    Some(place) => *dest_url = place,
                    None => continue,
                }
            }
            Event::End(TagEnd::Link | TagEnd::Image) if left_out.pop() == Some(true) => continue,
            _ => {}
        }
        events.push(event);
    }
    let mut out = String::new();
    html::push_html(&mut out, events.into_iter());
    out
}

/// Returns the id of a heading as GitHub makes it; repeated ones get a number.
fn heading_name(words: &str, names: &mut HashMap<String, usize>) -> String {
    let kept = words.trim().to_lowercase();
    let kept = kept.chars().filter(|c| c.is_alphanumeric() || [' ', '-', '_'].contains(c));
    let name: String = kept.map(|c| if c == ' ' { '-' } else { c }).collect();
    let count = names.entry(name.clone()).or_default();
    *count += 1;
    if *count == 1 { name } else { format!("{name}-{}", *count - 1) }
}

/// Returns the URL of a link in a page; `None`: it leads out of the manual.
fn place<'a>(page: &str, link: &CowStr<'a>) -> Option<CowStr<'a>> {
    if link.contains("://") || link.starts_with('#') {
        return Some(link.clone());
    }
    let (file, heading) = link.split_once('#').unwrap_or((link, ""));
    let mut parts: Vec<&str> = page.split('/').collect();
    parts.pop();
    for part in file.split('/') {
        match part {
            ".." => _ = parts.pop()?,
            "." | "" => {}
            part => parts.push(part),
        }
    }
    let file = parts.join("/");
    let known = file.strip_suffix(".md").unwrap_or(&file);
    let picture = file.strip_prefix("pictures/").unwrap_or_default();
    let is_known = PAGES.iter().any(|(name, _)| *name == known) || PICTURES.iter().any(|(name, _)| *name == picture);
    let mark = if heading.is_empty() { "" } else { "#" };
    is_known.then(|| format!("{ROOT}{known}{mark}{heading}").into())
}

#[cfg(test)]
mod tests {
    use std::{fs, path::Path};

    use super::*;

    /// All files below a folder, from there.
    fn files(folder: &Path, prefix: &str) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap().map(Result::unwrap);
        let all = entries.flat_map(|entry| {
            let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
            if entry.path().is_dir() { files(&entry.path(), &format!("{name}/")) } else { vec![name] }
        });
        all.collect()
    }

    #[test]
    fn all_pages_and_pictures_of_the_manual_are_part_of_the_program() {
        let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs");
        for name in files(&docs, "") {
            let is_page = name.strip_suffix(".md").is_some_and(|name| PAGES.iter().any(|(known, _)| *known == name));
            let is_picture =
                name.strip_prefix("pictures/").is_some_and(|name| PICTURES.iter().any(|(known, _)| *known == name));
            assert!(is_page || is_picture || ["SUMMARY.md", "book.toml"].contains(&&*name), "{name} is in no table");
        }
    }

    #[test]
    fn every_link_within_the_manual_leads_to_a_heading_that_is_there() {
        let pages: HashMap<&str, String> =
            PAGES.iter().map(|(name, text)| (*name, html_of(name, text, true))).collect();
        let mut count = 0;
        for (name, page) in &pages {
            for link in page.split("href=\"").skip(1).filter_map(|rest| rest.split('"').next()) {
                let Some((place, heading)) = link.split_once('#') else { continue };
                let target = place.strip_prefix(ROOT).unwrap_or(name);
                if place.contains("://") {
                    continue;
                }
                assert!(pages[target].contains(&format!("id=\"{heading}\"")), "{name}: {link}");
                count += 1;
            }
        }
        assert!(count > 50, "{count} links");
    }

    #[test]
    fn links_lead_to_pages_and_those_out_of_the_manual_are_text() {
        let text =
            "## A `b` c\n## A b c\n[x](../api.md#tokens) [y](../../README.md) ![z](../pictures/zones.png) [w](#a-b-c)";
        let html = html_of("guides/studio", text, true);
        assert!(html.contains("<h2 id=\"a-b-c\">") && html.contains("<h2 id=\"a-b-c-1\">"), "{html}");
        assert!(html.contains("<a href=\"/manual/api#tokens\">x</a> y "), "{html}");
        assert!(
            html.contains("src=\"/manual/pictures/zones.png\" alt=\"z\"") && html.contains("href=\"#a-b-c\""),
            "{html}"
        );
    }

    #[test]
    fn an_unknown_page_answers_404_with_the_contents() {
        let response = page("no/such");
        assert_eq!(response.status(), StatusCode::NOT_FOUND);
        let text = whole("index", PAGES.iter().find(|(name, _)| *name == "index").unwrap().1);
        assert!(text.contains("<title>") && text.contains("href=\"/manual/tutorials/first-picture\""), "{text}");
    }
}
