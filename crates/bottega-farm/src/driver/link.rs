//! A job on several machines: names of agents, and the exchange of tiles.

use std::{fmt::Write, io::Read, sync::Arc, thread, time::Duration};

use bottega_agents::{AgentId, BlobId, machine_of};
use bottega_image::Tile;
use flate2::{Compression, read::ZlibDecoder, read::ZlibEncoder};

use super::{
    stop::StopSwitch,
    transport::{JobTransport, TransportError},
};
use crate::{RegistrationConfig, ResultRef, WorkId, WorkKeys, digest, wire};

/// The largest tile accepted from another machine, in bytes.
const TILE_BYTES_MAX: usize = 1 << 30;
/// The size in bytes from which tiles are compressed. For smaller ones it does not pay.
const PACKED_FROM: usize = 16 << 10;
/// The first byte of uncompressed and of compressed tiles.
const PLAIN: u8 = 0;
const PACKED: u8 = 1;
/// The size of a number in a tile, in bytes.
const LANES: usize = 4;
/// The numbers of attempts after which the user is warned of a server that is connected and refuses.
const WARN_AFTER: [u32; 3] = [20, 240, 2400];
const BETWEEN_TRIES: Duration = Duration::from_millis(250);

/// The connection of this process to the others that render a work.
#[derive(Clone)]
pub struct Link {
    /// The network between the processes.
    pub transport: Arc<dyn JobTransport>,
    /// The identifier of the work.
    pub work: WorkId,
    /// The number of the work's job. `None`: no job; its agents know their Master's name and are not registered.
    pub job: Option<u32>,
    /// The unique name of this process, with which the names of its agents end.
    pub name: String,
}

impl Link {
    /// Returns the id of the work's Master, with its address; the name is the same whichever process leads the work.
    pub fn master(&self) -> AgentId {
        self.agent(format!("master@work-{}", self.work.0))
    }

    /// Returns an agent of this name, with its address.
    pub(super) fn agent(&self, name: String) -> AgentId {
        let id = AgentId::new(name);
        AgentId { addresses: Arc::new([self.transport.address_of(&id)]), ..id }
    }

    /// Returns how the agents of the work register; `None`: they do not.
    pub(super) fn registration(&self) -> Option<RegistrationConfig> {
        let master_home = Some(machine_of(&self.master().name).to_owned());
        self.job.map(|job| RegistrationConfig { master_home, ..RegistrationConfig::new(self.work, Some(job)) })
    }

    /// Returns the folder of the work's tiles.
    fn folder(&self) -> String {
        format!("work-{}", self.work.0)
    }

    fn blob(&self, tile: BlobId) -> String {
        let mut name = format!("{}/tile-", self.folder());
        // Writing to a string does not fail.
        tile.0.iter().for_each(|byte| _ = write!(name, "{byte:02x}"));
        name
    }

    /// Stores a tile for the other machines. Blocks, and tries again while the server is down or full, until `stop` is
    /// requested.
    ///
    /// - `id`: the digest of the tile.
    ///
    /// # Errors
    /// The network cannot store the tile and a retry would not help, or `stop` is requested before it is stored; with
    /// the reason.
    pub fn put(&self, id: BlobId, tile: &Tile, stop: &StopSwitch) -> Result<(), String> {
        let mut bytes = Vec::new();
        wire::put_tile(tile, &mut bytes);
        let packed = pack(&bytes, PACKED_FROM).map_err(|error| error.to_string())?;
        let name = self.blob(id);
        self.patiently(stop, || self.transport.put_tile(&name, &packed))
    }

    /// Fetches a tile from another machine, verifies its digest and returns it. Blocks, and tries again while the
    /// server is down, until `stop` is requested.
    ///
    /// - `result`: the reference to the tile, with its digest.
    ///
    /// # Errors
    /// The tile is missing, cannot be read, is larger than 1 GiB, or has another digest, or `stop` is requested before
    /// the network answers; with the reason.
    pub fn get(&self, result: &ResultRef, stop: &StopSwitch) -> Result<Tile, String> {
        let name = self.blob(result.digest);
        let packed = self.patiently(stop, || self.transport.get_tile(&name, TILE_BYTES_MAX))?;
        let packed = packed.ok_or("its pixels are missing")?;
        let bytes = unpack(&packed).map_err(|error| format!("its tile cannot be unpacked: {error}"))?;
        let tile = wire::read_tile(&bytes).map_err(|error| error.to_string())?;
        if digest(&tile) == result.digest { Ok(tile) } else { Err("its tile is another one".to_owned()) }
    }

    /// Retries until success, a lasting error, or a stop. A server that is down may come back, and a full disk may be
    /// cleaned up; until then the rendered tiles are kept.
    fn patiently<T>(&self, stop: &StopSwitch, attempt: impl Fn() -> Result<T, TransportError>) -> Result<T, String> {
        let mut tries: u32 = 0;
        loop {
            match attempt() {
                Ok(done) => return Ok(done),
                Err(error) if error.is_lasting || stop.is_requested() => return Err(error.to_string()),
                Err(error) if WARN_AFTER.contains(&tries) && self.transport.is_connected() => {
                    let remedy = if error.is_full { "; see how much each job holds: bottega jobs list" } else { "" };
                    tracing::warn!(
                        %error,
                        "the farm's server does not store data, its disk may be full; waiting for it{remedy}"
                    );
                }
                Err(error) => tracing::debug!(%error, "trying again"),
            }
            tries = tries.wrapping_add(1);
            thread::sleep(BETWEEN_TRIES);
        }
    }

    /// Deletes all data of the work at the farm: its rows and its tiles. Errors are not reported.
    pub fn forget(&self) {
        self.transport.forget(&WorkKeys::new(self.work).prefix(), &self.folder());
    }
}

/// Compresses 4-byte numbers without loss. Groups the bytes by their position in a number first, because the leading ones
/// differ least.
///
/// - `from`: shorter data stays uncompressed.
fn pack(bytes: &[u8], from: usize) -> std::io::Result<Vec<u8>> {
    if bytes.len() < from {
        return Ok([&[PLAIN], bytes].concat());
    }
    let sorted: Vec<u8> = (0..LANES).flat_map(|lane| bytes.iter().skip(lane).step_by(LANES)).copied().collect();
    let mut packed = vec![PACKED];
    ZlibEncoder::new(&sorted[..], Compression::fast()).read_to_end(&mut packed)?;
    Ok(packed)
}

fn unpack(packed: &[u8]) -> std::io::Result<Vec<u8>> {
    let packed = match packed.split_first() {
        Some((&PLAIN, bytes)) => return Ok(bytes.to_vec()),
        Some((&PACKED, packed)) => packed,
        _ => return Err(std::io::ErrorKind::InvalidData.into()),
    };
    let mut sorted = Vec::new();
    // Limit the output: few bytes can expand to very many.
    ZlibDecoder::new(packed).take(TILE_BYTES_MAX as u64).read_to_end(&mut sorted)?;
    let mut bytes = vec![0; sorted.len()];
    let mut from = sorted.iter();
    for lane in 0..LANES {
        for (to, byte) in bytes.iter_mut().skip(lane).step_by(LANES).zip(&mut from) {
            *to = *byte;
        }
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn what_is_packed_comes_back(bytes in prop::collection::vec(any::<u8>(), 0..300), from in 0_usize..300) {
            prop_assert_eq!(unpack(&pack(&bytes, from).unwrap()).unwrap(), bytes);
        }

        #[test]
        fn no_bytes_make_unpacking_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            _ = unpack(&bytes);
        }
    }
}
