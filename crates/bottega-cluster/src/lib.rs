//! The farm on NATS: many machines render one picture together.
//!
//! A job is a notice of the farm, its zones are rows of the Blackboard, and its scene and pixels are blobs. If the process
//! that leads a job dies, any other process takes over from what is stored.
//!
//! # Modules
//!
//! Seven folders; each uses only those above it. Other crates use the modules and types that this page re-exports.
//!
//! | what | where |
//! |---|---|
//! | **`files`**: scene files by content hash; chunks, pieces, the cache of a machine | `src/files/sent_files.rs`, `src/files/chunks.rs`, `src/files/pieces.rs`, [`cache`] |
//! | **`job`**: the record of a job: a [`Request`](bottega::Request) and the digests of its files | `src/job/record.rs` |
//! | the jobs of a farm, their leaders and progress; the end of a job | `src/job/board.rs`, [`view`]; `src/job/completion.rs`; jobs that wait although machines are free: `src/job/stall_watch.rs` |
//! | the presence of a machine; its activity, usage and refusals; commands to it | [`presence`], `src/job/activity.rs`, [`usage`], [`refusals`], [`machines`] |
//! | the Blackboard rows of a job; its agents, its auction and the credit of machines; zones to render again | [`blackboard`], [`society`], `src/job/requeue.rs` |
//! | messages between the agents of a job, for observers; their transport over NATS | [`messages`]; `src/job/transport.rs` |
//! | the fuzzy rules of a job, evaluated for a zone; learned zone times of machines | [`rules_of_job`]; `src/job/experience.rs` |
//! | the preview of a job while it is rendered; before its first zone | [`job_preview`]; `src/job/first_look.rs` |
//! | the layers of a job while it is rendered | [`job_film`] |
//! | stored photons and lighting agents; energy and its price | `src/job/shared_parts.rs`; [`energy`] |
//! | **`viewport`**: a viewport whose samples come from all free machines: its calls, the samples on the wire | `src/viewport/call.rs`, `src/viewport/calls.rs`, `src/viewport/frame.rs` |
//! | **`server`**: the NATS server of a farm, run as a child process, and its configuration | [`up`], `src/server/process.rs`, `src/server/supervisor.rs`, [`room`]; a server for one test or measurement: [`own_server`] |
//! | members of a farm and their permissions | `src/server/admission.rs`, `src/server/members.rs` |
//! | connecting to a farm: addresses, discovery on the local network, ports | [`link`](mod@link), [`address`], `src/server/discovery.rs`, [`ports`] |
//! | retries while a farm does not answer; removal of old data | `src/server/patience.rs`, `src/server/upkeep.rs` |
//! | secrets that the HTTP servers of one farm share: token, certificate; access tokens of users; the log of actions | [`web_secrets`]; [`web_tokens`]; [`deed_log`] |
//! | **`machine`**: a machine that works for a farm; its choice of a job | [`worker`]; `src/machine/shares.rs`, `src/machine/member.rs` |
//! | when the owner of a machine lets it work; its processor time and energy | [`owner`]; [`usage_meter`], `src/machine/power_counters.rs` |
//! | a job prepared on this machine; led or helped | `src/machine/prepared_job.rs`, `src/machine/part.rs`, `src/machine/part_observer.rs` |
//! | photons and lighting agents, shared by all machines | `src/machine/together.rs` |
//! | samples for somebody's viewport | `src/machine/viewport_helper.rs` |
//! | **`client`**: submitting a picture; an animation; commands to jobs | [`client`]: `src/client/submit.rs`, [`animation`], [`jobs`] |
//! | sending scenes; uploads in pieces from clients that are not machines of the farm; requests of jobs, submitted again | `src/client/transfer.rs`; [`uploads`]; `src/client/resubmission.rs` |
//! | a viewport of this process, shared with the machines | `src/client/shared_viewport.rs` |
//! | what a user may see of a farm; guests see only their own jobs | `src/client/shown_farm.rs` |
//! | **`agents`**: the farm as a FIPA platform; its jobs and machines as agents; painting agents of other platforms | [`platform`]; `src/agents/platform/farm_agents/`; `src/agents/platform/strangers/` |
//! | agents of jobs in the directories; removal of those whose process was killed | [`directories`] |
//! | names, the clock, the build identity of this farm process, errors | [`names`], `src/clock.rs`, [`build`](mod@build), [`error`] |
//! | submitting a picture from a program | `examples/submit.rs` |

mod agents;
pub mod build;
pub mod client;
mod clock;
pub mod error;
mod files;
mod job;
mod machine;
pub mod names;
mod server;
mod viewport;

pub use self::{
    agents::{directories, platform},
    client::{
        animation, jobs,
        submit::{SubmittedJob, render},
        uploads,
    },
    error::Error,
    files::cache,
    job::{
        activity::Activity,
        blackboard,
        board::JobBoard,
        energy,
        experience::ALL_MACHINES,
        job_film, job_preview, machines, messages, presence,
        record::{Job, JobState, LogLine, unix_seconds},
        refusals, rules_of_job, society,
        transport::job_link,
        usage, view,
    },
    machine::{owner, usage_meter, worker},
    server::{
        address::{self, FarmAddress},
        deed_log,
        discovery::{FoundFarm, farms},
        link::{self, Credentials, FarmLink, link, link_as},
        own_server, ports, room, up, web_secrets, web_tokens,
    },
};
