//! Work before a picture that those who paint it share out among them: maps of photons, lighting agents, the trial of a guide.

use std::{cell::Cell, ops::Range};

use bottega_hra::{HraClient, WorkUnit};

use crate::{
    RenderError, RenderOutput, RenderWork,
    photon::bytes::{ByteForm, Reader, Writer},
};

/// Units of work from which on they are shared out.
const SHARED_MIN: usize = 32;
/// Parts of a stage at most.
const PARTS_MAX: usize = 32;

/// Others who paint the same picture of the same scene, by the same version of this program.
pub trait Sharing: Send + Sync {
    /// Has the parts of a stage of the work done, each by one of those who take part. Returns what came of each, in order. Blocks.
    ///
    /// - `stage`: its number. All come to the same stages in the same order, with as many parts.
    /// - `perform`: does one part here. What comes of it depends on stage and part alone.
    ///
    /// # Errors
    /// What `perform` says; [`RenderError::Left`].
    fn share(
        &self,
        stage: u32,
        parts: u32,
        perform: &mut dyn FnMut(u32) -> Result<Vec<u8>, RenderError>,
    ) -> Result<Vec<Vec<u8>>, RenderError>;
}

/// All who work for one picture: the processors here, and perhaps others.
pub(crate) struct Hands<'a> {
    client: &'a HraClient<RenderWork>,
    others: Option<&'a dyn Sharing>,
    /// How many stages there were.
    stage: Cell<u32>,
}

impl<'a> Hands<'a> {
    pub(crate) fn new(client: &'a HraClient<RenderWork>, others: Option<&'a dyn Sharing>) -> Self {
        Self { client, others, stage: Cell::new(0) }
    }

    /// Has units of work done. Returns what came of each, in order.
    ///
    /// - `answer`: takes it out of an output; `None`: it is the answer to something else.
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

/// Has a stage of work done by all. Returns what came of each of `count` pieces of it, in order.
///
/// - `parts`: into how many parts it is cut at most, each of as many pieces but the last.
/// - `here`: does pieces here; what comes of each depends on it alone.
///
/// # Errors
/// As [`Sharing::share`].
pub(crate) fn in_parts<T: ByteForm>(
    others: &dyn Sharing,
    stage: u32,
    count: usize,
    parts: usize,
    here: impl Fn(Range<usize>) -> Result<Vec<T>, RenderError>,
) -> Result<Vec<T>, RenderError> {
    let size = count.div_ceil(parts).max(1);
    let part = |number: usize| number * size..count.min((number + 1) * size);
    let told = others.share(stage, count.div_ceil(size) as u32, &mut |number| {
        let mut to = Writer::default();
        here(part(number as usize))?.iter().for_each(|found| found.write(&mut to));
        Ok(to.0)
    })?;
    let mut all = Vec::with_capacity(count);
    for (number, bytes) in told.iter().enumerate() {
        // What cannot be read is found here.
        match found(bytes, part(number).len()) {
            Some(mut found) => all.append(&mut found),
            None => all.append(&mut here(part(number))?),
        }
    }
    Ok(all)
}

/// What others have told of so many units of work.
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
    // All answers are taken even after a failure: none may be left for the client's next user.
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
