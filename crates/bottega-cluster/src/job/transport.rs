//! The NATS transport between the processes of a job.

use std::{io, sync::Arc};

use bottega_agents::{
    AclMessage, AgentId, Key, Mailbox, StoreRequest, Ticket, Time, Uplink,
    driver::nats::{BlobError, NatsUplink, PagedUplink},
};
use bottega_farm::{
    FarmCodec, FarmContent, FarmValue, JobAgent, JobTransport, JobUplink, Link, PLATFORM, TransportError, WorkId,
    directory_service_names,
};

/// Returns the link of this process to the others that render a work.
///
/// - `work`: the number of the painting.
/// - `job`: the number of its job. `None`: its agents are not registered in the directories.
/// - `name`: the unique name of this process.
pub fn job_link(uplink: Arc<NatsUplink<FarmCodec>>, work: WorkId, job: Option<u32>, name: String) -> Link {
    Link { transport: Arc::new(NatsTransport(uplink)), work, job, name }
}

/// A connection to the farm's server as the transport of a job.
struct NatsTransport(Arc<NatsUplink<FarmCodec>>);

/// A connection with the directories of the job's platform.
struct NatsJobUplink(PagedUplink<FarmCodec, JobAgent>);

impl JobTransport for NatsTransport {
    fn address_of(&self, agent: &AgentId) -> String {
        self.0.address_of(agent)
    }

    fn begin(&self, process: &str) -> io::Result<Arc<dyn JobUplink>> {
        let services = directory_service_names().to_vec();
        Ok(Arc::new(NatsJobUplink(PagedUplink::begin(Arc::clone(&self.0), PLATFORM, process, services)?)))
    }

    fn put_tile(&self, name: &str, bytes: &[u8]) -> Result<(), TransportError> {
        self.0.payloads().put(name, bytes).map_err(|error| transport_error(&error))
    }

    fn get_tile(&self, name: &str, bytes_max: usize) -> Result<Option<Vec<u8>>, TransportError> {
        self.0.payloads().get(name, bytes_max).map_err(|error| transport_error(&error))
    }

    fn is_connected(&self) -> bool {
        self.0.is_connected()
    }

    fn flush(&self) {
        self.0.flush();
    }

    fn forget(&self, prefix: &Key, folder: &str) {
        self.0.forget(prefix);
        self.0.payloads().forget(folder);
    }
}

impl Uplink<JobAgent> for NatsJobUplink {
    fn add(&self, agent: &AgentId, mailbox: Mailbox<JobAgent>) {
        self.0.add(agent, mailbox);
    }

    fn publish(&self, now: Time, message: &AclMessage<FarmContent>, receiver: &AgentId) {
        self.0.publish(now, message, receiver);
    }

    fn ask_store(&self, mailbox: Mailbox<JobAgent>, ticket: Ticket, request: StoreRequest<FarmValue>) {
        self.0.ask_store(mailbox, ticket, request);
    }
}

impl JobUplink for NatsJobUplink {
    fn close(&self) {
        self.0.close();
    }
}

fn transport_error(error: &BlobError) -> TransportError {
    TransportError { reason: error.to_string(), is_lasting: error.is_lasting, is_full: error.is_full }
}
