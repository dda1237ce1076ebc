//! The validation of requests: limits of fields, and fields that exclude each other.

use bottega_image::{ImageError, OutputFormat};
use bottega_scene::{BLADES_MAX, COORDINATE_MAX, Camera, Shutter};
use glam::{Affine3A, DVec3};
use thiserror::Error as ThisError;

use super::{
    BandChoice, CameraPose, DeviceChoice, DeviceOptions, EngineOptions, EnvironmentLight, EnvironmentOptions,
    FarmOptions, FilmOptions, GoalOptions, GuideChoice, GuideOptions, IntegratorChoice, InvalidField, OutputOptions,
    PhotonOptions, REQUEST_VERSION, Request, SceneOptions, ShutterTimes, ViewOptions, WorkOptions, limits::*,
    ranged::within,
};
use crate::frames::{FrameName, frame_name_help};

type Checked = Result<(), InvalidField>;

/// Checks that a number is finite and at least 0.
fn not_negative(field: &str, value: f32) -> Checked {
    if value.is_finite() && value >= 0.0 {
        Ok(())
    } else {
        Err(InvalidField::new(field, value, "a number from 0 up is needed"))
    }
}

/// Checks that a number is finite and above 0.
fn positive(field: &str, value: f32) -> Checked {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(InvalidField::new(field, value, "a number above 0 is needed"))
    }
}

fn finite(field: &str, value: f32, unit: &str) -> Checked {
    if value.is_finite() {
        Ok(())
    } else {
        Err(InvalidField::new(field, value, format!("a number of {unit} is needed")))
    }
}

/// Checks that a share is above 0 and at most 1; `None` is allowed.
fn share(field: &str, value: Option<f32>) -> Checked {
    match value {
        Some(value) if !(value > 0.0 && value <= 1.0) => {
            Err(InvalidField::new(field, value, "a share above 0 and at most 1 is needed"))
        }
        _ => Ok(()),
    }
}

/// Checks that at most one of two fields is given.
fn not_both(field: &str, is_said: bool, other: &str, is_other_said: bool) -> Checked {
    if is_said && is_other_said {
        return Err(InvalidField::new(field, "given", format!("leave it out, or `{other}`: they exclude each other")));
    }
    Ok(())
}

/// The form of a tag as readable text, for messages; see [`is_tag`].
pub const TAG_FORM: &str = "letters, digits, `-`, `_` and `.`, 32 at most";

/// Returns true if a word has the form of a machine's tag.
pub fn is_tag(word: &str) -> bool {
    let is_sign = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    (1..=TAG_CHARS_MAX).contains(&word.len()) && word.chars().all(is_sign)
}

impl FarmOptions {
    fn validate_tags(&self) -> Checked {
        if self.require.len() > TAGS_MAX {
            let found = format!("{} tags", self.require.len());
            return Err(InvalidField::new("farm.require", found, format!("at most {TAGS_MAX} are allowed")));
        }
        match self.require.iter().find(|tag| !is_tag(tag)) {
            Some(tag) => Err(InvalidField::new("farm.require", tag, format!("a tag consists of {TAG_FORM}"))),
            None => Ok(()),
        }
    }
}

impl Request {
    /// Checks every field, and combinations that exclude each other. Does not look for files.
    ///
    /// # Errors
    /// The first field whose value is not allowed.
    pub fn validate(&self) -> Result<(), InvalidField> {
        within("version", self.version, 1..=REQUEST_VERSION)?;
        self.validate_ranges()?;
        self.scene.validate()?;
        self.environment.validate()?;
        self.view.validate()?;
        self.film.validate()?;
        self.goal.validate()?;
        self.photons.validate()?;
        self.guide.validate()?;
        self.engine.validate()?;
        self.work.validate()?;
        self.devices.validate()?;
        self.output.validate()?;
        self.farm.validate_tags()?;
        if self.integrator.rules.is_some() && self.integrator.method != Some(IntegratorChoice::Auto) {
            return Err(InvalidField::new("integrator.rules", "given", "it needs --integrator auto, or leave it out"));
        }
        not_both("film.light_groups", !self.film.light_groups.is_empty(), "engine.names", !self.engine.is_builtin())?;
        let has_catchers = !self.film.shadow_catchers.is_empty();
        not_both("film.shadow_catchers", has_catchers, "engine.names", !self.engine.is_builtin())?;
        self.validate_strangers()?;
        self.validate_frames()
    }

    /// Checks the ranges of all numbers, as [the sections](super::sections) declare them.
    fn validate_ranges(&self) -> Checked {
        self.environment.validate_ranges("environment")?;
        self.view.validate_ranges("view")?;
        self.film.validate_ranges("film")?;
        self.goal.validate_ranges("goal")?;
        self.integrator.validate_ranges("integrator")?;
        self.photons.validate_ranges("photons")?;
        self.lighting_agents.validate_ranges("lighting_agents")?;
        self.guide.validate_ranges("guide")?;
        self.engine.validate_ranges("engine")?;
        self.work.validate_ranges("work")?;
        self.devices.validate_ranges("devices")?;
        self.output.validate_ranges("output")?;
        self.farm.validate_ranges("farm")
    }

    /// Checks a request for agents of other platforms: they get scene file, size and samples, and return colors alone.
    fn validate_strangers(&self) -> Checked {
        let (film, goal, view, usual) = (&self.film, &self.goal, &self.view, ViewOptions::default());
        let excluded = [
            ("film.layers", film.layers.as_ref().is_some_and(|layers| !layers.is_empty())),
            ("film.light_groups", !film.light_groups.is_empty()),
            ("film.shadow_catchers", !film.shadow_catchers.is_empty()),
            ("film.denoise", film.denoise),
            ("goal.error", goal.error.is_some()),
            ("goal.time", goal.time.is_some()),
            ("environment", self.environment != EnvironmentOptions::default()),
            ("view", *view != ViewOptions { camera: view.camera.clone(), ..usual }),
            ("scene.defines", !self.scene.defines.is_empty()),
            ("engine.names", !self.engine.is_builtin()),
            ("frames", self.frames.is_some()),
        ];
        match excluded.iter().find(|(_, is_said)| self.farm.strangers && *is_said) {
            Some((field, _)) => not_both("farm.strangers", true, field, true),
            None => Ok(()),
        }
    }

    fn validate_frames(&self) -> Checked {
        let Some(frames) = &self.frames else { return Ok(()) };
        positive("frames.fps", frames.fps)?;
        not_both("frames", true, "scene.time", self.scene.time.is_some())?;
        not_both("frames", true, "engine.frame", self.engine.frame.is_some())?;
        let Some(file) = &self.output.file else {
            return Err(InvalidField::new("output.file", "not given", "the pictures of an animation need a name"));
        };
        FrameName::new(file).map(drop).map_err(|error| {
            InvalidField::new("output.file", file.display(), format!("{error}; {}", frame_name_help(&error)))
        })
    }
}

impl SceneOptions {
    fn validate(&self) -> Checked {
        if self.file.as_os_str().is_empty() {
            return Err(InvalidField::new("scene.file", "empty", "the name of a scene file is needed"));
        }
        if let Some(name) = self.defines.keys().find(|name| name.trim().is_empty()) {
            return Err(InvalidField::new("scene.defines", format!("`{name}`"), "each parameter has a name"));
        }
        self.time.map_or(Ok(()), |time| finite("scene.time", time, "seconds"))?;
        let most = bottega_scene::SUBDIVISION_MAX;
        if let Some(level) = self.subdivision.filter(|&level| level > most) {
            let allowed = format!("a number of refinements from 0 to {most} is needed");
            return Err(InvalidField::new("scene.subdivision", level, allowed));
        }
        let most = bottega_scene::DISPLACEMENT_MAX;
        if let Some(level) = self.displacement.filter(|&level| level > most) {
            let allowed = format!("a number of halvings from 0 to {most} is needed");
            return Err(InvalidField::new("scene.displacement", level, allowed));
        }
        let Some(ShutterTimes { open, close, ramp }) = self.shutter else { return Ok(()) };
        for (field, time) in [("scene.shutter.open", open), ("scene.shutter.close", close)] {
            if !time.is_finite() {
                return Err(InvalidField::new(field, time, "a finite number of seconds is needed"));
            }
        }
        if !(Shutter { open, close, ramp: 0.0 }).is_sound() {
            return Err(InvalidField::new("scene.shutter.close", close, "the shutter cannot close before it opens"));
        }
        if !(0.0..=0.5).contains(&ramp) {
            return Err(InvalidField::new("scene.shutter.ramp", ramp, "a share from 0 to 0.5 is needed"));
        }
        Ok(())
    }
}

impl EnvironmentOptions {
    fn validate(&self) -> Checked {
        if let Some(EnvironmentLight::Radiance(radiance)) = &self.light {
            radiance.iter().try_for_each(|value| not_negative("environment.light", *value))?;
        }
        finite("environment.rotate", self.rotate, "degrees")?;
        not_negative("environment.strength", self.strength)
    }
}

impl ViewOptions {
    fn validate(&self) -> Checked {
        self.lens_radius.map_or(Ok(()), |radius| not_negative("view.lens_radius", radius))?;
        self.focus_distance.map_or(Ok(()), |distance| positive("view.focus_distance", distance))?;
        self.pose.map_or(Ok(()), |pose| pose.validate())?;
        self.validate_lens()?;
        if let (Some(fov), Some(_)) = (self.pose.and_then(|pose| pose.fov), self.projection) {
            let allowed = "`view.projection` has no such angle; set `view.fisheye_fov` for a fisheye";
            return Err(InvalidField::new("view.pose.fov", fov, allowed));
        }
        match (self.lens_radius, self.focus_distance) {
            (Some(radius), None) => Err(InvalidField::new(
                "view.lens_radius",
                radius,
                "it needs `view.focus_distance`, the distance in focus",
            )),
            _ => Ok(()),
        }
    }
}

impl ViewOptions {
    fn validate_lens(&self) -> Checked {
        match self.blades {
            Some(blades) if blades != 0 && !(3..=BLADES_MAX).contains(&blades) => {
                let allowed = format!("0 or a number from 3 to {BLADES_MAX} is needed");
                return Err(InvalidField::new("view.blades", blades, allowed));
            }
            _ => {}
        }
        finite("view.blade_rotation", self.blade_rotation, "degrees")?;
        if self.blade_rotation != 0.0 && self.blades.is_none() {
            return Err(InvalidField::new("view.blade_rotation", self.blade_rotation, "it needs `view.blades`"));
        }
        self.aperture_ratio.map_or(Ok(()), |ratio| positive("view.aperture_ratio", ratio))?;
        if !(self.fisheye_fov > 0.0 && self.fisheye_fov <= 360.0) {
            let allowed = "above 0 and at most 360 degrees is needed";
            return Err(InvalidField::new("view.fisheye_fov", self.fisheye_fov, allowed));
        }
        not_negative("view.eye_distance", self.eye_distance)?;
        self.convergence.map_or(Ok(()), |distance| positive("view.convergence", distance))?;
        if let (Some(distance), None) = (self.convergence, self.stereo) {
            return Err(InvalidField::new("view.convergence", distance, "it needs `view.stereo`"));
        }
        match self.rolling_shutter {
            Some(exposure) if !(0.0..=1.0).contains(&exposure) => {
                Err(InvalidField::new("view.rolling_shutter", exposure, "a share from 0 to 1 is needed"))
            }
            _ => Ok(()),
        }
    }
}

impl CameraPose {
    fn validate(&self) -> Checked {
        let Self { eye, target, up, fov } = self;
        for (field, place) in [("view.pose.eye", eye), ("view.pose.target", target), ("view.pose.up", up)] {
            let is_reached = place.iter().all(|value| value.abs() <= f64::from(COORDINATE_MAX));
            if !is_reached {
                let allowed = format!("three numbers from -{COORDINATE_MAX:e} to {COORDINATE_MAX:e} are needed");
                return Err(InvalidField::new(field, format!("{place:?}"), allowed));
            }
        }
        if self.looking([0.0; 3]).is_none() {
            let allowed = "it must differ from `eye` and not lie in the direction of `up`";
            return Err(InvalidField::new("view.pose.target", format!("{target:?}"), allowed));
        }
        match fov {
            Some(fov) if !(*fov > 0.0 && *fov < 180.0) => {
                Err(InvalidField::new("view.pose.fov", fov, "above 0 and below 180 degrees is needed"))
            }
            _ => Ok(()),
        }
    }

    /// Returns the transform from camera to world space, with the origin at `origin` in the coordinates of the file. `None`:
    /// eye and target coincide.
    pub(crate) fn looking(&self, origin: [f64; 3]) -> Option<Affine3A> {
        let from_origin = |place: [f64; 3]| (DVec3::from_array(place) - DVec3::from_array(origin)).as_vec3();
        let up = DVec3::from_array(self.up).try_normalize()?.as_vec3();
        Camera::looking(from_origin(self.eye), from_origin(self.target), up)
    }
}

impl FilmOptions {
    fn validate(&self) -> Checked {
        if let Some([width, height]) = self.size {
            check_size([width, height], self.crop)
                .map_err(|allowed| InvalidField::new("film.size", format!("{width}x{height}"), allowed.to_string()))?;
        }
        match self.crop {
            Some([x0, y0, x1, y1]) if x0 >= x1 || y0 >= y1 => Err(InvalidField::new(
                "film.crop",
                format!("{x0},{y0},{x1},{y1}"),
                "x0 < x1 and y0 < y1 are needed; x1 and y1 lie one past the part",
            )),
            _ if self.shadow_catchers.iter().any(String::is_empty) => {
                Err(InvalidField::new("film.shadow_catchers", "an empty pattern", "each pattern names objects"))
            }
            _ => self.validate_light_groups(),
        }
    }

    fn validate_light_groups(&self) -> Checked {
        let groups = &self.light_groups;
        let wrong = |value: String, allowed: String| Err(InvalidField::new("film.light_groups", value, allowed));
        if groups.len() > LIGHT_GROUPS_MAX {
            return wrong(format!("{} groups", groups.len()), format!("at most {LIGHT_GROUPS_MAX} are allowed"));
        }
        let is_name = |name: &str| {
            (1..=LIGHT_GROUP_CHARS_MAX).contains(&name.chars().count())
                && !name.chars().any(|c| c.is_control() || c == '.')
        };
        if let Some(name) = groups.keys().find(|name| !is_name(name)) {
            let allowed = format!("a group's name has 1 to {LIGHT_GROUP_CHARS_MAX} characters, none of them a dot");
            return wrong(format!("{name:?}"), allowed);
        }
        match groups.iter().find(|(_, patterns)| patterns.is_empty() || patterns.iter().any(String::is_empty)) {
            Some((name, _)) => {
                wrong(format!("`{name}` with an empty pattern"), "each group names its lights".to_owned())
            }
            None => Ok(()),
        }
    }
}

/// The reason why a picture cannot have a size. Its text says which sizes are allowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ThisError)]
pub enum SizeError {
    /// Width or height is 0, or above [`SIDE_MAX`].
    #[error("each side must be from 1 to {most}", most = SIDE_MAX)]
    Side,
    /// The rendered part has more than [`PIXELS_MAX`] pixels.
    #[error("more than {most} pixels: paint a smaller picture, or parts of one with a crop", most = PIXELS_MAX)]
    Pixels,
}

/// Checks that a picture of this size, or a part of it, is within the limits.
///
/// - `crop`: the rendered part, as x0, y0, x1, y1 in pixels; `None`: the whole picture.
///
/// # Errors
/// The picture is too large, or a side is empty.
pub fn check_size(size: [u32; 2], crop: Option<[u32; 4]>) -> Result<(), SizeError> {
    check_sides(size)?;
    let [width, height] = size;
    let [x0, y0, x1, y1] = crop.unwrap_or([0, 0, width, height]);
    let length = |from: u32, to: u32, side: u32| u64::from(to.min(side).saturating_sub(from));
    if length(x0, x1, width) * length(y0, y1, height) > PIXELS_MAX {
        return Err(SizeError::Pixels);
    }
    Ok(())
}

/// Checks width and height of a picture, regardless of its number of pixels.
///
/// # Errors
/// A side is empty or too long.
pub fn check_sides(size: [u32; 2]) -> Result<(), SizeError> {
    if size.iter().all(|side| (1..=SIDE_MAX).contains(side)) {
        return Ok(());
    }
    Err(SizeError::Side)
}

impl GoalOptions {
    fn validate(&self) -> Checked {
        not_both("goal.error", self.error.is_some(), "goal.time", self.time.is_some())
    }
}

impl PhotonOptions {
    fn validate(&self) -> Checked {
        share("photons.radius", self.radius)?;
        share("photons.irradiance_cache", self.irradiance_cache)?;
        not_both("photons.progressive", self.progressive, "photons.final_rays", self.final_rays.is_some())?;
        not_both("photons.progressive", self.progressive, "photons.irradiance_cache", self.irradiance_cache.is_some())
    }
}

impl GuideOptions {
    fn validate(&self) -> Checked {
        match self.by {
            Some(by @ (GuideChoice::None | GuideChoice::Directions)) if !self.uses.is_empty() => {
                Err(InvalidField::new(
                    "guide.uses",
                    "given",
                    format!(
                        "it says what lighting agents are used for, and `{}` uses none: leave it out, or set `guide.by` to `ala`",
                        super::WordChoice::word(by)
                    ),
                ))
            }
            _ => Ok(()),
        }
    }
}

impl EngineOptions {
    fn validate(&self) -> Checked {
        let others = self.names.iter().filter(|name| *name != super::BUILTIN).count();
        if self.names.is_empty() || self.names.len() > 2 || others > 1 || self.names.len() - others > 1 {
            return Err(InvalidField::new(
                "engine.names",
                format!("`{}`", self.names.join(",")),
                "one name is needed, or `builtin` and one other that reads the same scene",
            ));
        }
        if self.rules.is_some() && self.names.len() == 1 {
            return Err(InvalidField::new("engine.rules", "given", "it needs two engines: name both, or leave it out"));
        }
        Ok(())
    }
}

impl WorkOptions {
    fn validate(&self) -> Checked {
        match self.bands {
            BandChoice::Pixels(pixels) => within("work.bands.pixels", pixels, 1..=BAND_PIXELS_MAX),
            BandChoice::Off | BandChoice::Rules => Ok(()),
        }
    }
}

impl DeviceOptions {
    fn validate(&self) -> Checked {
        let names = || format!("`{}`", self.names.join(","));
        let choice = DeviceChoice::of(&self.names)
            .map_err(|allowed| InvalidField::new("devices.names", names(), allowed.to_string()))?;
        match choice {
            DeviceChoice::These { gpus, .. } if self.exact && !gpus.is_empty() => Err(InvalidField::new(
                "devices.names",
                names(),
                "the pixels of a GPU are not bit-identical to those of processors: leave out `devices.exact`, or the GPU",
            )),
            _ => Ok(()),
        }
    }
}

impl OutputOptions {
    fn validate(&self) -> Checked {
        if let Some(file) = &self.file {
            OutputFormat::of(file).map_err(|error| {
                let allowed = match error {
                    ImageError::NotWritable { reason, .. } => reason,
                    error => error.to_string(),
                };
                InvalidField::new("output.file", format!("`{}`", file.display()), allowed)
            })?;
        }
        Ok(())
    }
}
