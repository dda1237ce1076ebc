//! The request of an existing job, in a form that can be submitted again with the same files.

use std::path::{Path, PathBuf};

use bottega::{
    Request,
    devices::DeviceChoice,
    request::{EnvironmentLight, RulesSource},
};
use serde_json::Value;

use crate::{
    error::Error,
    job::{
        board::JobBoard,
        record::{Job, JobSpec},
    },
};

impl JobBoard {
    /// Returns the request of a job, for a [`Submission`](crate::client::uploads::Submission) with `files_of_job`: `scene.file` and
    /// the fields that differ from their defaults. Files are named without their folders.
    ///
    /// # Errors
    /// The farm does not answer, or has no readable specification of the job.
    pub fn request_again(&self, job: &Job) -> Result<Value, Error> {
        let spec = self.spec(job)?;
        let request = without_places(&spec);
        let text = |request: &Request| {
            let origin = "the request of the job".to_owned();
            request.to_value().map_err(|source| Error::from(bottega::Error::Request { origin, source }))
        };
        let usual = text(&Request::new(&request.scene.file))?;
        Ok(without_defaults(text(&request)?, &usual))
    }
}

/// Returns the request of a job without folders, programs or devices of its submitter.
fn without_places(spec: &JobSpec) -> Request {
    let mut request = spec.request.clone();
    let files = &spec.files;
    request.scene.file = PathBuf::from(files.scene_name());
    (request.scene.allow_outside, request.scene.asset_roots) = (false, Vec::new());
    if let Some(EnvironmentLight::File(path)) = &mut request.environment.light {
        *path = files.environment_name().map_or_else(|| last(path), PathBuf::from);
    }
    (request.engine.trust, request.engine.manifests) = (false, Vec::new());
    let Request { work, engine, integrator, .. } = &mut request;
    for rules in work.rules.iter_mut().chain(&mut engine.rules).chain(&mut integrator.rules) {
        if let RulesSource::Text(text) = rules {
            text.name = last(&text.name);
        }
    }
    (request.work.agents, request.devices.threads) = (None, None);
    request.devices.names = DeviceChoice::Auto.names();
    request.output.file = request.output.file.as_deref().map(last);
    request
}

fn last(path: &Path) -> PathBuf {
    path.file_name().map(PathBuf::from).unwrap_or_default()
}

/// Keeps the fields of a request, and of its sections, that differ from the defaults; the scene file in any case.
fn without_defaults(request: Value, usual: &Value) -> Value {
    let Value::Object(sections) = request else { return request };
    let mut left = serde_json::Map::new();
    for (name, section) in sections {
        match section {
            Value::Object(mut fields) if usual[&name].is_object() => {
                fields.retain(|field, value| usual[&name][field] != *value || (&*name, &**field) == ("scene", "file"));
                if !fields.is_empty() {
                    left.insert(name, fields.into());
                }
            }
            section if section != usual[&name] => _ = left.insert(name, section),
            _ => {}
        }
    }
    left.into()
}

#[cfg(test)]
mod tests {
    use bottega::request::RulesText;
    use serde_json::json;

    use super::*;
    use crate::files::sent_files::SentFiles;

    #[test]
    fn a_resubmitted_request_names_no_folder_of_the_first_submitter() {
        let contents = || serde_json::from_value(json!({ "hash": "", "chunks": [] })).unwrap();
        let files =
            SentFiles::at_farm(vec![("room.glb".to_owned(), contents())], Some(("noon.hdr".to_owned(), contents())));
        let mut request = Request::new("/home/anna/rooms/room.glb");
        request.scene.asset_roots = vec![PathBuf::from("/home/anna/textures")];
        request.environment.light = Some(EnvironmentLight::File(PathBuf::from("/home/anna/sky/noon.hdr")));
        request.film.size = Some([96, 72]);
        request.goal.samples = Some(8);
        request.view.camera = Some("2".to_owned());
        request.work.rules = vec![RulesSource::Text(RulesText {
            name: PathBuf::from("/home/anna/own.fcl"),
            text: "// mine".to_owned(),
        })];
        request.devices.threads = Some(1);
        request.output.file = Some(PathBuf::from("/home/anna/out/room.exr"));
        let spec = JobSpec { request, files, engine: None, journal: None };
        let again = without_places(&spec);
        let usual = Request::new("room.glb").to_value().unwrap();
        let expected = json!({
            "scene": { "file": "room.glb" },
            "environment": { "light": { "file": "noon.hdr" } },
            "film": { "size": [96, 72] },
            "goal": { "samples": 8 },
            "view": { "camera": "2" },
            "work": { "rules": [{ "text": { "name": "own.fcl", "text": "// mine" } }] },
            "output": { "file": "room.exr" },
        });
        let short = without_defaults(again.to_value().unwrap(), &usual);
        assert_eq!(short, expected);
        assert_eq!(Request::from_value(short).unwrap(), again, "what is left out is the default");
    }
}
