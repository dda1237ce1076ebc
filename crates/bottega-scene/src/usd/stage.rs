//! Opening of a stage, and the scene that is made of it.

use glam::{DAffine3, DMat3, DVec3};
use openusd::pcp;
use openusd::sdf::Value;
use openusd::usd::Stage;
use openusd::usda::parser::Parser;

use super::camera::RenderSettings;
use super::error::chain;
use super::files::{Client, Files, SESSION};
use super::material::Materials;
use super::source::StageSource;
use super::time::StageTimes;
use super::{values, walk};
use crate::error::{SceneError, Warnings};
use crate::hints::{Metadata, RenderHints};
use crate::import::merge::{StillParts, merge};
use crate::import::request::{ImportOutput, ImportRequest};
use crate::text::shortened;

/// Reads the stage of a request. Also returns its warnings.
pub(super) fn read(
    request: &ImportRequest<'_>,
    files: &Files<'_>,
    client: Client,
) -> Result<(ImportOutput, Warnings), SceneError> {
    let stage = open(request, files, client)?;
    let source = StageSource::new(request, files, stage);
    let times = StageTimes::new(&source.stage, request.options);
    if let Some(animation) = &request.options.animation {
        source.warn("", format!("the animation `{}` is not chosen: a stage has one", shortened(animation)));
    }
    let world_from_stage = world_from_stage(&source);
    let mut materials = Materials::new(&source, times.first);
    let mut scene = walk::scene(&source, times.first, world_from_stage, &mut materials)?;
    let material_count = materials.count();
    // Read the parts that may move at later times
    let mut stills = Vec::new();
    for &time in &times.later {
        let still = walk::scene(&source, time, world_from_stage, &mut materials)?;
        let meshes = still.meshes.iter().cloned().collect();
        let (instances, cameras, lights) = (still.instances, still.cameras, still.lights);
        stills.push((StillParts { time: times.seconds(time), meshes, instances, cameras, lights }, still.spheres));
    }
    materials.truncate(material_count);
    let (stills, spheres): (Vec<StillParts>, Vec<_>) = stills.into_iter().unzip();
    if !stills.is_empty() {
        let times: Vec<f64> = stills.iter().map(|still| still.time).collect();
        walk::add_sphere_keys(&mut scene.spheres, request.options.open_shutter(), &times, &spheres);
        for problem in merge(&mut scene, request.options.open_shutter().unwrap_or_default().open, &stills) {
            source.unsupported("", problem);
        }
    }
    report_composition(&source);
    let (list, images) = materials.finish()?;
    scene.materials = list;
    scene.images = images.into();
    let settings = RenderSettings::find(&source, times.first);
    settings.put_camera_first(&source, &mut scene);
    let hints = RenderHints { resolution: settings.resolution, ..RenderHints::default() };
    Ok(((scene, metadata(&source), hints), source.take_warnings()))
}

/// Opens the stage, with the selected variants.
fn open(request: &ImportRequest<'_>, files: &Files<'_>, client: Client) -> Result<Stage, SceneError> {
    let mut builder = Stage::builder().resolver(client);
    if let Some(choice) = &request.options.variant {
        files.set_session(session(request, choice)?);
        builder = builder.session_layer(SESSION);
    }
    let stage = builder.open(files.root()).map_err(|fault| {
        // The parser gives the place of a fault only when asked
        if let Some(text) = files.root_text() {
            let mut parser = Parser::new(&text);
            if let Err(problem) = parser.parse()
                && let Some(place) = parser.last_error_highlight()
            {
                let problem = shortened(&chain(problem.as_ref())).into_owned();
                return SceneError::Text { path: request.path.into(), line: place.line, column: place.column, problem };
            }
        }
        SceneError::Damaged { path: request.path.into(), problem: chain(fault.as_ref()) }
    })?;
    if let Some(choice) = &request.options.variant {
        check_variants(request, &stage, choice)?;
    }
    Ok(stage)
}

/// A selected variant, as in `/Car{color=red}`.
struct VariantChoice<'a> {
    prim: &'a str,
    set: &'a str,
    name: &'a str,
}

/// Returns the selections of a text: one or several, separated by commas or spaces.
fn variant_choices(choice: &str) -> Option<Vec<VariantChoice<'_>>> {
    let one = |text| {
        let (prim, rest) = str::split_once(text, '{')?;
        let (set, name) = rest.strip_suffix('}')?.split_once('=')?;
        let names = prim.strip_prefix('/')?.split('/');
        let is_name =
            |name: &str| !name.is_empty() && name.chars().all(|letter| letter.is_alphanumeric() || letter == '_');
        let is_sound = is_name(set) && names.clone().all(is_name) && !name.contains(['"', '\\', '\n']);
        is_sound.then_some(VariantChoice { prim, set, name })
    };
    choice.split([',', ' ']).filter(|text| !text.is_empty()).map(one).collect()
}

/// Returns the text of a layer that selects variants.
fn session(request: &ImportRequest<'_>, choice: &str) -> Result<String, SceneError> {
    let choices = variant_choices(choice).filter(|choices| !choices.is_empty());
    let choices = choices.ok_or_else(|| SceneError::NoSuch {
        path: request.path.into(),
        what: "variant",
        wanted: choice.into(),
        known: "variants of prims, as in `/Car{color=red}`".into(),
    })?;
    let mut text = String::from("#usda 1.0\n");
    for VariantChoice { prim, set, name } in choices {
        let names: Vec<&str> = prim[1..].split('/').collect();
        for (depth, prim) in names.iter().enumerate() {
            let is_last = depth + 1 == names.len();
            let selection =
                if is_last { format!(" (variants = {{ string {set} = \"{name}\" }})") } else { String::new() };
            text += &format!("over \"{prim}\"{selection}\n{{\n");
        }
        text += &"}\n".repeat(names.len());
    }
    Ok(text)
}

/// Returns an error if a selected variant does not exist.
fn check_variants(request: &ImportRequest<'_>, stage: &Stage, choice: &str) -> Result<(), SceneError> {
    for VariantChoice { prim, set, name } in variant_choices(choice).unwrap_or_default() {
        let chosen = stage.prim(prim).variant_sets().get_all_variant_selections().unwrap_or_default();
        // A variant that exists has contributed a specification
        let selection = format!("{{{set}={name}}}");
        let sites = stage.prim(prim).prim_stack().unwrap_or_default();
        if !sites.iter().any(|(_, site)| site.as_str().contains(&selection)) {
            let known: Vec<String> = chosen.iter().map(|(set, name)| format!("{prim}{{{set}={name}}}")).collect();
            let known = if known.is_empty() { format!("no variants at {prim}") } else { known.join(", ") };
            let wanted = format!("{prim}{{{set}={name}}}");
            return Err(SceneError::NoSuch { path: request.path.into(), what: "variant", wanted, known });
        }
    }
    Ok(())
}

/// Returns the transformation that turns the stage's up axis to y and moves the origin of the request to 0.
fn world_from_stage(source: &StageSource<'_>) -> DAffine3 {
    let up = source.or_warn("upAxis", source.stage.stage_metadata("upAxis"));
    let up = up.and_then(|up| values::text(&up)).unwrap_or_else(|| "Y".into());
    let turn = match up.as_str() {
        "Z" => DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y),
        "Y" => DMat3::IDENTITY,
        other => {
            source.unsupported("upAxis", format!("`{}` is not an up axis; y is used", shortened(other)));
            DMat3::IDENTITY
        }
    };
    DAffine3 { matrix3: turn, translation: -source.request.origin }
}

/// Warns about arcs of the stage that could not be followed.
fn report_composition(source: &StageSource<'_>) {
    for fault in source.stage.composition_errors() {
        let message = match &fault {
            pcp::Error::UnresolvedLayer { asset_path, .. } => {
                format!("there is no layer `{}`; it is left out", shortened(asset_path))
            }
            fault => format!("{fault}; it is left out"),
        };
        let place = match &fault {
            pcp::Error::UnresolvedLayer { site_path, .. } | pcp::Error::MalformedLayer { site_path, .. } => {
                site_path.as_str().to_owned()
            }
            _ => String::new(),
        };
        source.unsupported(&place, message);
    }
}

fn metadata(source: &StageSource<'_>) -> Metadata {
    let file = source.request.file;
    let format = match file {
        [b'P', b'K', ..] => "USD (package)",
        file if file.starts_with(b"PXR-USDC") => "USD (binary)",
        _ => "USD (text)",
    };
    let comment = source.stage.stage_metadata("doc").ok().flatten();
    let text = |value: Value| values::text(&value).filter(|text| !text.is_empty());
    let generator = comment.and_then(text).map(|text| shortened(text.lines().next().unwrap_or_default()).into_owned());
    Metadata { format, generator, extensions: Vec::new() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variants_are_chosen_by_prim_set_and_name() {
        let choices = variant_choices("/Car/Body{color=red}, /Car{lod=2}").unwrap();
        assert_eq!((choices[0].prim, choices[0].set, choices[0].name), ("/Car/Body", "color", "red"));
        assert_eq!((choices[1].prim, choices[1].name), ("/Car", "2"));
        for text in ["red", "/Car{color}", "Car{color=red}", "/{a=b}", "/Car{color=\"}", "/Car{a b=c}"] {
            assert!(variant_choices(text).is_none(), "{text}");
        }
    }
}
