//! Prepass work shared among the machines that render a picture: photon maps, lighting agents, the trial of a guide.

use std::{cell::Cell, ops::Range};

use bottega_hra::{HraClient, WorkUnit};

use crate::{
    error::RenderError,
    photon::bytes::{ByteForm, Reader, Writer},
    work::{RenderOutput, RenderWork},
};

/// Smallest number of work units that are shared.
const SHARED_MIN: usize = 32;
/// Largest number of parts of a stage.
const PARTS_MAX: usize = 32;

/// The machines that render the same picture of the same scene, with the same version of this program, and share the
/// work of its prepass.
pub trait Sharing: Send + Sync {
    /// Performs the parts of a stage, each on one of the participants, and waits for all of them. Returns the results
    /// of all parts, in order.
    ///
    /// - `stage`: number of the stage. All participants run the same stages in the same order, with equal numbers of
    ///   parts.
    /// - `parts`: number of parts of the stage.
    /// - `perform`: performs one part locally, by its number from 0. Its result depends on stage and part alone.
    ///
    /// # Errors
    /// Errors of `perform`; [`RenderError::Left`] if the shared work was abandoned.
    fn share(
        &self,
        stage: u32,
        parts: u32,
        perform: &mut dyn FnMut(u32) -> Result<Vec<u8>, RenderError>,
    ) -> Result<Vec<Vec<u8>>, RenderError>;
}

/// The stages after those of another part of a prepass: their numbers begin behind its own.
pub(crate) struct LaterStages<'a> {
    /// The machines.
    pub(crate) others: &'a dyn Sharing,
    /// Number of stages before.
    pub(crate) before: u32,
}

impl Sharing for LaterStages<'_> {
    fn share(
        &self,
        stage: u32,
        parts: u32,
        perform: &mut dyn FnMut(u32) -> Result<Vec<u8>, RenderError>,
    ) -> Result<Vec<Vec<u8>>, RenderError> {
        self.others.share(self.before + stage, parts, perform)
    }
}

/// The executors of work for one picture: local devices, and possibly other machines.
pub(crate) struct Executors<'a> {
    client: &'a HraClient<RenderWork>,
    others: Option<&'a dyn Sharing>,
    /// Number of stages so far.
    stage: Cell<u32>,
}

impl<'a> Executors<'a> {
    /// Creates the executors: `client` for local devices; `others`: machines to share with, if any.
    pub(crate) fn new(client: &'a HraClient<RenderWork>, others: Option<&'a dyn Sharing>) -> Self {
        Self { client, others, stage: Cell::new(0) }
    }

    /// Runs work units. Returns the results of all, in order.
    ///
    /// - `answer`: extracts the result from an output; `None`: the output is of another kind.
    pub(crate) fn run<T: ByteForm>(
        &self,
        works: Vec<RenderWork>,
        answer: impl Fn(RenderOutput) -> Option<T>,
    ) -> Result<Vec<T>, RenderError> {
        let here = |works: Vec<RenderWork>| {
            let outputs = run(self.client, works)?.into_iter();
            outputs.map(|output| answer(output).ok_or(RenderError::Unanswered)).collect::<Result<Vec<T>, _>>()
        };
        let Some(others) = self.others.filter(|_| works.len() >= SHARED_MIN) else { return here(works) };
        let stage = self.stage.replace(self.stage.get() + 1);
        in_parts(others, stage, works.len(), PARTS_MAX, |part| here(works[part].to_vec()))
    }
}

/// Runs a stage of work on all participants. Returns the results of its `count` pieces, in order.
///
/// - `parts`: largest number of parts; all parts but the last have equally many pieces.
/// - `here`: performs pieces locally; the result of each depends on it alone.
///
/// # Errors
/// Errors of [`Sharing::share`].
pub(crate) fn in_parts<T: ByteForm>(
    others: &dyn Sharing,
    stage: u32,
    count: usize,
    parts: usize,
    here: impl Fn(Range<usize>) -> Result<Vec<T>, RenderError>,
) -> Result<Vec<T>, RenderError> {
    let size = count.div_ceil(parts).max(1);
    let part = |number: usize| number * size..count.min((number + 1) * size);
    let results = others.share(stage, count.div_ceil(size) as u32, &mut |number| {
        let mut to = Writer::default();
        here(part(number as usize))?.iter().for_each(|found| found.write(&mut to));
        Ok(to.0)
    })?;
    let mut all = Vec::with_capacity(count);
    for (number, bytes) in results.iter().enumerate() {
        // Perform parts with unreadable results locally
        match found(bytes, part(number).len()) {
            Some(mut found) => all.append(&mut found),
            None => all.append(&mut here(part(number))?),
        }
    }
    Ok(all)
}

/// Deserializes the results of `count` pieces; `None`: the bytes are invalid.
fn found<T: ByteForm>(bytes: &[u8], count: usize) -> Option<Vec<T>> {
    let mut from = Reader(bytes);
    let found = (0..count).map(|_| T::read(&mut from)).collect::<Option<Vec<T>>>()?;
    from.0.is_empty().then_some(found)
}

/// Submits all work and returns the outputs in the same order.
pub(crate) fn run(client: &HraClient<RenderWork>, works: Vec<RenderWork>) -> Result<Vec<RenderOutput>, RenderError> {
    let count = works.len();
    client.submit_group(works.into_iter().zip(0..).map(|(work, ticket)| WorkUnit::new(work, ticket)).collect())?;
    let mut outputs: Vec<Option<RenderOutput>> = vec![None; count];
    let mut failure = None;
    // Take all answers even after a failure: none may be left for the client's next user
    while let Some(completed) = client.take() {
        match completed.output {
            Ok(RenderOutput::Refused(error)) => failure = Some(RenderError::Refused(error)),
            Ok(output) => outputs[completed.ticket as usize] = Some(output),
            Err(error) => failure = Some(error.into()),
        }
    }
    if let Some(error) = failure {
        return Err(error);
    }
    outputs.into_iter().collect::<Option<Vec<_>>>().ok_or(RenderError::Unanswered)
}
