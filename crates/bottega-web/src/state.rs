//! The shared state of all requests to a door.

use std::{net::IpAddr, sync::Arc, time::Duration};

use axum::http::StatusCode;
use bottega_cluster::deed_log::DeedLog;
use tokio::sync::Semaphore;

use crate::{
    comparisons::Comparisons,
    hosts::HostNames,
    limits::{EVENT_STREAMS_MAX, QUESTIONS_MAX, SUBMISSIONS_MAX, Tempo},
    problem::Problem,
    source::ShownFarm,
    tokens::TokenCookie,
    viewports::Viewports,
};

/// The address of a request's client.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Client(pub(crate) IpAddr);

/// The shared state of all requests to a door.
pub(crate) struct DoorState {
    pub(crate) farm: Arc<dyn ShownFarm>,
    pub(crate) cookie: TokenCookie,
    /// The log of changes; `None`: no log.
    pub(crate) deeds: Option<DeedLog>,
    pub(crate) hosts: HostNames,
    pub(crate) tempo: Tempo,
    /// The permits of event streams.
    pub(crate) streams: Arc<Semaphore>,
    questions: Arc<Semaphore>,
    /// The permits of submissions that are examined at the same time.
    pub(crate) submissions: Arc<Semaphore>,
    /// The viewports that are open at this door.
    pub(crate) viewports: Arc<Viewports>,
    /// The sent pictures and the last comparison.
    pub(crate) comparisons: Arc<Comparisons>,
}

impl DoorState {
    pub(crate) fn new(farm: Arc<dyn ShownFarm>, cookie: TokenCookie, hosts: HostNames, deeds: Option<DeedLog>) -> Self {
        let permits = |count| Arc::new(Semaphore::new(count));
        Self {
            farm,
            cookie,
            deeds,
            hosts,
            tempo: Tempo::default(),
            streams: permits(EVENT_STREAMS_MAX),
            questions: permits(QUESTIONS_MAX),
            submissions: permits(SUBMISSIONS_MAX),
            viewports: Arc::default(),
            comparisons: Arc::default(),
        }
    }

    /// Calls the farm on another thread, and waits at most `patience`. A call that takes longer continues in the background and
    /// occupies its place until it ends.
    ///
    /// # Errors
    /// The farm does not answer in time, or the call itself fails.
    pub(crate) async fn ask<T: Send + 'static>(
        &self,
        patience: Duration,
        question: impl FnOnce(&dyn ShownFarm) -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        let late = || {
            let detail = "the farm does not answer in time";
            Problem::new(StatusCode::SERVICE_UNAVAILABLE, detail, "try again in a moment")
        };
        let answered = async {
            let permit = Arc::clone(&self.questions).acquire_owned().await.map_err(|_| late())?;
            let farm = Arc::clone(&self.farm);
            let answer = tokio::task::spawn_blocking(move || {
                let _permit = permit;
                question(&*farm)
            });
            answer.await.unwrap_or_else(|error| {
                tracing::warn!(%error, "a question was not answered");
                let detail = "an internal error: this is a fault of the program";
                Err(Problem::new(StatusCode::INTERNAL_SERVER_ERROR, detail, "report it"))
            })
        };
        tokio::time::timeout(patience, answered).await.unwrap_or_else(|_| Err(late()))
    }
}
