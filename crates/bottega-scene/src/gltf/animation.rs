//! Evaluation of animations at one time: node transformations and morph weights. glTF 2.0, section 3.11 and appendix C.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::ops::Range;

use glam::DQuat;
use serde_json::Value;

use super::accessor::{Accessor, find};
use super::source::GltfSource;
use super::{document, pointer};
use crate::error::{SceneError, Warnings};
use crate::text::shortened;

/// Animated properties of a node; `None`: not animated, use the node's own.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct NodePose {
    pub(super) translation: Option<[f64; 3]>,
    /// Quaternion, interpolated or as in the file; not always of unit length.
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
    /// Weights of the morph targets.
    pub(super) weights: Option<Vec<f32>>,
}

impl NodePose {
    /// Returns true if translation, rotation or scale is animated.
    pub(super) fn moves(&self) -> bool {
        self.translation.is_some() || self.rotation.is_some() || self.scale.is_some()
    }
}

/// The animated properties of a node.
const MOVEMENTS: [&str; 4] = ["translation", "rotation", "scale", "weights"];

/// The animated nodes, by index.
pub(super) type Pose = BTreeMap<usize, NodePose>;

/// Animations at a time, in seconds.
#[derive(Clone, Debug)]
pub(super) struct AnimationTime {
    animations: Range<usize>,
    time: f32,
}

/// Returns the animations and time that the options select. `None`: nothing is animated.
pub(super) fn animation_time(
    source: &GltfSource<'_>,
    warnings: &mut Warnings,
) -> Result<Option<AnimationTime>, SceneError> {
    let animations = &source.document.animations;
    let chosen = match &source.options.animation {
        None => 0..animations.len(),
        Some(name) => {
            let index =
                source.by_name("animation", name, animations.iter().map(|animation| animation.name.as_str()))?;
            index..index + 1
        }
    };
    let opens = source.options.open_shutter().map(|shutter| shutter.open as f32);
    let time = match (opens.or(source.options.at), &source.options.animation) {
        (Some(time), _) => time,
        (None, Some(_)) => 0.0,
        (None, None) => {
            if !animations.is_empty() {
                warnings.add(
                    "animations",
                    "the scene is shown as its nodes stand; name a time or a shutter to see it animated",
                );
            }
            return Ok(None);
        }
    };
    if animations.is_empty() {
        warnings.add("", "the scene has no animations, it is the same at all times");
    }
    Ok(Some(AnimationTime { animations: chosen, time }))
}

impl AnimationTime {
    /// Returns the time, in seconds.
    pub(super) fn time(&self) -> f32 {
        self.time
    }

    /// Returns the same animations at later times, up to the one when the shutter is closed. Empty if it is open for no time
    /// or if nothing is animated.
    pub(super) fn later(&self, source: &GltfSource<'_>) -> Vec<Self> {
        /// Least number of steps per second, and most steps in all.
        const STEPS: (f64, f64) = (60.0, 16.0);
        let Some(shutter) = source.options.open_shutter().filter(crate::motion::Shutter::is_sound) else {
            return Vec::new();
        };
        let has_channels = self.channels(source).next().is_some();
        if shutter.is_instant() || !has_channels {
            return Vec::new();
        }
        let span = shutter.close - shutter.open;
        let steps = (span * STEPS.0).ceil().clamp(1.0, STEPS.1) as u32;
        let time = |step: u32| (shutter.open + span * f64::from(step) / f64::from(steps)) as f32;
        let mut later: Vec<Self> = Vec::new();
        for time in (1..=steps).map(time) {
            // Times that are one in single precision count once
            if time > later.last().map_or(self.time, |last| last.time) {
                later.push(Self { animations: self.animations.clone(), time });
            }
        }
        later
    }

    /// Iterates over all channels, in file order.
    fn channels<'a, 's>(&self, source: &'s GltfSource<'a>) -> impl Iterator<Item = AnimationChannel<'a, 's>> {
        self.animations.clone().flat_map(move |animation| {
            let count = source.document.animations[animation].channels.len();
            (0..count).map(move |number| AnimationChannel { source, animation, number })
        })
    }

    /// Evaluates the node transformations. If several animations move the same property, the first one is used.
    pub(super) fn pose(&self, source: &GltfSource<'_>, warnings: &mut Warnings) -> Result<Pose, SceneError> {
        let mut pose = Pose::new();
        self.channels(source).try_for_each(|channel| channel.apply(self.time, &mut pose, warnings))?;
        Ok(pose)
    }

    /// Evaluates KHR_animation_pointer for all but node transformations: pointers, and JSON values. Of several values
    /// of the same property, the first one is used.
    pub(super) fn pointed(
        &self,
        source: &GltfSource<'_>,
        warnings: &mut Warnings,
    ) -> Result<BTreeMap<String, Value>, SceneError> {
        let mut values = BTreeMap::new();
        for channel in self.channels(source) {
            let Some(pointer) = channel.target().pointer() else { continue };
            if channel.moved().is_some() || values.contains_key(pointer) {
                continue;
            }
            if !pointer::is_known(pointer) {
                let message = format!("`{}` is not animated (KHR_animation_pointer)", shortened(pointer));
                warnings.unsupported(channel.place(), message);
            } else if let Some(value) = channel.value(self.time, pointer)? {
                source.budget.take(source.path, "animations", pointer.len() + 64)?;
                values.insert(pointer.to_owned(), value);
            }
        }
        Ok(values)
    }
}

struct AnimationChannel<'a, 's> {
    source: &'s GltfSource<'a>,
    animation: usize,
    number: usize,
}

impl AnimationChannel<'_, '_> {
    fn invalid(&self, member: &str, problem: impl std::fmt::Display) -> SceneError {
        self.source.invalid(format!("animations[{}].channels[{}]{member}", self.animation, self.number), problem)
    }

    fn place(&self) -> String {
        format!("animations[{}]", self.animation)
    }

    fn target(&self) -> &document::AnimationTarget {
        &self.source.document.animations[self.animation].channels[self.number].target
    }

    fn sampler(&self) -> Result<&document::AnimationSampler, SceneError> {
        let animation = &self.source.document.animations[self.animation];
        let sampler = find("sampler", &animation.samplers, animation.channels[self.number].sampler);
        sampler.map_err(|problem| self.invalid(".sampler", problem))
    }

    /// Returns the node that it moves, and the property.
    fn moved(&self) -> Option<(usize, &str)> {
        let target = self.target();
        if target.path != "pointer" {
            return Some((target.node?, &target.path));
        }
        let (node, path) = target.pointer()?.strip_prefix("/nodes/")?.split_once('/')?;
        Some((node.parse().ok()?, path)).filter(|(_, path)| MOVEMENTS.contains(path))
    }

    fn apply(&self, time: f32, pose: &mut Pose, warnings: &mut Warnings) -> Result<(), SceneError> {
        let Some((node, path)) = self.moved() else { return Ok(()) };
        let description = find("node", &self.source.document.nodes, node);
        let description = description.map_err(|problem| self.invalid(".target.node", problem))?;
        let sampler = self.sampler()?;
        let node_pose = match pose.entry(node) {
            Entry::Occupied(entry) => entry.into_mut(),
            Entry::Vacant(entry) => entry.insert(NodePose::default()),
        };
        match path {
            "translation" if node_pose.translation.is_none() => {
                node_pose.translation = self.track(sampler, 3, 1)?.vector(time);
            }
            "scale" if node_pose.scale.is_none() => node_pose.scale = self.track(sampler, 3, 1)?.vector(time),
            "rotation" if node_pose.rotation.is_none() => {
                node_pose.rotation = self.track(sampler, 4, 1)?.rotation(time);
            }
            "weights" if node_pose.weights.is_none() => node_pose.weights = self.weights(description, sampler, time)?,
            path if MOVEMENTS.contains(&path) => {}
            other => warnings.unsupported(self.place(), format!("`{}` cannot be animated", shortened(other))),
        }
        Ok(())
    }

    /// Returns the value of a pointer's property; `None`: the sampler has no keys.
    fn value(&self, time: f32, pointer: &str) -> Result<Option<Value>, SceneError> {
        let sampler = self.sampler()?;
        let counts = |index: usize| self.source.document.accessors.get(index).map(|accessor| accessor.count);
        let width = |index: usize| self.source.document.accessors.get(index).map(|accessor| accessor.kind.as_str());
        let parts = if sampler.interpolation.as_deref() == Some("CUBICSPLINE") { 3 } else { 1 };
        // A list has as many numbers as each key.
        let elements = match (counts(sampler.output), counts(sampler.input)) {
            (Some(values), Some(times)) if times > 0 && pointer.ends_with("/weights") => values / times / parts,
            _ => 1,
        };
        let elements = usize::try_from(elements).unwrap_or(usize::MAX).max(1);
        self.source.budget.take(self.source.path, "animations", elements.saturating_mul(size_of::<Value>()))?;
        let components = match width(sampler.output) {
            Some("VEC2") => 2,
            Some("VEC3") => 3,
            Some("VEC4") => 4,
            _ => 1,
        };
        let track = self.track(sampler, components, elements)?;
        let Some(span) = track.span(time) else { return Ok(None) };
        let numbers: Vec<f64> = match components {
            2 => track.interpolate::<2>(span, 0).into(),
            3 => track.interpolate::<3>(span, 0).into(),
            4 => track.interpolate::<4>(span, 0).into(),
            _ => (0..elements).map(|element| track.interpolate::<1>(span, element)[0]).collect(),
        };
        // Round to single precision, as in a file.
        let number = |number: f64| Value::from(number as f32);
        Ok(Some(match &numbers[..] {
            [flag] if pointer::is_flag(pointer) => Value::Bool(*flag != 0.0),
            [single] if !pointer.ends_with("/weights") => number(*single),
            all => all.iter().copied().map(number).collect(),
        }))
    }

    /// Returns the weights of a node's morph targets, which a key holds consecutively.
    fn weights(
        &self,
        node: &document::Node,
        sampler: &document::AnimationSampler,
        time: f32,
    ) -> Result<Option<Vec<f32>>, SceneError> {
        let Some(mesh) = node.mesh.and_then(|mesh| self.source.document.meshes.get(mesh)) else { return Ok(None) };
        let count = mesh.primitives.iter().map(|primitive| primitive.targets.len()).max().unwrap_or(0);
        if count == 0 {
            return Ok(None);
        }
        self.source.budget.take(self.source.path, "animations", count * size_of::<f32>())?;
        let track = self.track(sampler, 1, count)?;
        let Some(span) = track.span(time) else { return Ok(None) };
        Ok(Some((0..count).map(|weight| track.interpolate::<1>(span, weight)[0] as f32).collect()))
    }

    /// Returns the validated keys of a sampler.
    ///
    /// - `width`: components per element.
    /// - `elements`: elements per key.
    fn track(
        &self,
        sampler: &document::AnimationSampler,
        width: usize,
        elements: usize,
    ) -> Result<Track<'_>, SceneError> {
        let accessor = |index: usize| {
            let accessor = Accessor::new(self.source.document, self.source.bytes, index);
            let accessor = accessor.map_err(|problem| self.invalid(".sampler", problem))?;
            // The list of replaced elements is scanned for every channel that refers to it.
            self.source.budget.take(self.source.path, "animations", accessor.sparse_bytes())?;
            Ok(accessor)
        };
        let (times, values) = (accessor(sampler.input)?, accessor(sampler.output)?);
        let interpolation = match sampler.interpolation.as_deref() {
            None | Some("LINEAR") => Interpolation::Linear,
            Some("STEP") => Interpolation::Step,
            Some("CUBICSPLINE") => Interpolation::CubicSpline,
            Some(other) => {
                return Err(self.invalid(".sampler", format!("unknown interpolation `{}`", shortened(other))));
            }
        };
        if times.width != 1 || values.width != width {
            let problem =
                format!("its times have {} components, its values {} instead of {width}", times.width, values.width);
            return Err(self.invalid(".sampler", problem));
        }
        let parts = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        if times.count.checked_mul(parts * elements) != Some(values.count) {
            let problem =
                format!("has {} values for {} times, not {} for each", values.count, times.count, parts * elements);
            return Err(self.invalid(".sampler", problem));
        }
        Ok(Track { times, values, interpolation, elements })
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Interpolation {
    Step,
    Linear,
    CubicSpline,
}

/// The keys of a sampler: times and values.
struct Track<'a> {
    times: Accessor<'a>,
    /// One key per time: `elements` values; for a spline, with as many tangents before and after.
    values: Accessor<'a>,
    interpolation: Interpolation,
    elements: usize,
}

/// Two keys, and the position of a time between them in [0, 1].
#[derive(Clone, Copy)]
struct KeySpan {
    keys: [usize; 2],
    fraction: f64,
    /// Time between the keys, in seconds.
    duration: f64,
}

/// A part of a spline key.
#[derive(Clone, Copy)]
enum SplinePart {
    TangentIn,
    Value,
    TangentOut,
}

impl Track<'_> {
    /// Finds the keys around a time; before the first and after the last key, these hold. `None`: there are no keys.
    fn span(&self, time: f32) -> Option<KeySpan> {
        let last = self.times.count.checked_sub(1)?;
        let time_of = |key: usize| self.times.at::<1>(key)[0];
        let hold = |key: usize| Some(KeySpan { keys: [key; 2], fraction: 0.0, duration: 0.0 });
        if time_of(0).total_cmp(&time).is_ge() {
            return hold(0);
        }
        if time_of(last).total_cmp(&time).is_le() {
            return hold(last);
        }
        let (mut before, mut after) = (0, last);
        while after - before > 1 {
            let middle = before + (after - before) / 2;
            if time_of(middle) <= time { before = middle } else { after = middle }
        }
        let start = f64::from(time_of(before));
        let duration = f64::from(time_of(after)) - start;
        let fraction = if duration > 0.0 { ((f64::from(time) - start) / duration).clamp(0.0, 1.0) } else { 0.0 };
        Some(KeySpan { keys: [before, after], fraction, duration })
    }

    fn value<const N: usize>(&self, key: usize, element: usize, part: SplinePart) -> [f64; N] {
        let index = match self.interpolation {
            Interpolation::CubicSpline => (3 * key + part as usize) * self.elements + element,
            Interpolation::Step | Interpolation::Linear => key * self.elements + element,
        };
        self.values.at::<N>(index).map(f64::from)
    }

    /// Interpolates one element of the keys, per component.
    fn interpolate<const N: usize>(&self, span: KeySpan, element: usize) -> [f64; N] {
        let [before, after] = span.keys.map(|key| self.value::<N>(key, element, SplinePart::Value));
        let s = span.fraction;
        match self.interpolation {
            _ if span.keys[0] == span.keys[1] => before,
            Interpolation::Step => before,
            Interpolation::Linear => std::array::from_fn(|k| before[k] + (after[k] - before[k]) * s),
            Interpolation::CubicSpline => {
                // Cubic Hermite, with tangents per second: appendix C.5.
                let leaving = self.value::<N>(span.keys[0], element, SplinePart::TangentOut);
                let arriving = self.value::<N>(span.keys[1], element, SplinePart::TangentIn);
                let (s2, s3) = (s * s, s * s * s);
                std::array::from_fn(|k| {
                    (2.0 * s3 - 3.0 * s2 + 1.0) * before[k]
                        + span.duration * (s3 - 2.0 * s2 + s) * leaving[k]
                        + (3.0 * s2 - 2.0 * s3) * after[k]
                        + span.duration * (s3 - s2) * arriving[k]
                })
            }
        }
    }

    fn vector(&self, time: f32) -> Option<[f64; 3]> {
        self.span(time).map(|span| self.interpolate(span, 0))
    }

    /// Interpolates a rotation; linear keys follow the shortest arc.
    fn rotation(&self, time: f32) -> Option<[f64; 4]> {
        let span = self.span(time)?;
        if self.interpolation != Interpolation::Linear {
            return Some(self.interpolate(span, 0));
        }
        let [before, after] = span.keys.map(|key| DQuat::from_array(self.value(key, 0, SplinePart::Value)).normalize());
        Some(before.slerp(after, span.fraction).to_array())
    }
}
