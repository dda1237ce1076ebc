//! The HTTP client: sends messages to other platforms.

use std::time::Duration;

use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::TcpStream,
    time::timeout,
};

use super::{
    head::{HttpError, parse_status},
    multipart::seal,
};
use crate::{acc::Outbound, wire::WireError};

/// Timeout of connecting.
const CONNECT_WAIT: Duration = Duration::from_secs(3);
/// Timeout of the response.
const ANSWER_WAIT: Duration = Duration::from_secs(10);

/// The reason why a message to another platform was not sent or not accepted.
#[derive(Debug, thiserror::Error)]
pub enum SendError {
    /// There are no addresses.
    #[error("there is no address to try")]
    NoAddress,
    /// The address is not an HTTP address; holds at most 200 characters of it.
    #[error("`{0}` is not an HTTP address")]
    Address(String),
    /// The connection failed, or was closed before the response.
    #[error("no connection")]
    Io(#[from] std::io::Error),
    /// There was no connection within 3 s, or no response within 10 s.
    #[error("no answer in time")]
    Silence,
    /// The response has this status, which is not 200.
    #[error("the answer is {0}")]
    Status(u16),
    /// The response is not HTTP.
    #[error("the answer is not HTTP")]
    Answer(#[source] HttpError),
    /// The envelope of the message cannot be written.
    #[error("the message cannot be written")]
    Message(#[from] WireError),
}

/// Splits the address `http://host[:port][/path]`. Returns `host:port` and the path; by default port 80 and `/`.
///
/// # Errors
/// [`SendError::Address`]: another scheme, no host, a user name, or characters that are not printable ASCII.
pub fn parse_address(address: &str) -> Result<(String, &str), SendError> {
    let bad = || SendError::Address(address.chars().take(200).collect());
    let scheme = address.get(..7).filter(|scheme| scheme.eq_ignore_ascii_case("http://")).ok_or_else(bad)?;
    let rest = &address[scheme.len()..];
    let (host, path) = rest.find('/').map_or((rest, "/"), |slash| rest.split_at(slash));
    let clean = |part: &str| part.bytes().all(|byte| byte.is_ascii_graphic());
    if host.is_empty() || host.contains('@') || !clean(host) || !clean(path) {
        return Err(bad());
    }
    // An IPv6 address contains colons within its brackets
    let has_port = host.rsplit_once(':').is_some_and(|(_, port)| port.bytes().all(|byte| byte.is_ascii_digit()));
    Ok((if has_port { host.to_owned() } else { format!("{host}:80") }, path))
}

/// Sends a message to the first of its addresses that accepts it.
///
/// - `number`: makes the boundary of the multipart body unique.
///
/// # Errors
/// The message cannot be written, it has no addresses, or none accepts it: then the error of the last one.
pub async fn send(outbound: &Outbound, number: u64) -> Result<(), SendError> {
    let (content_type, body) = seal(outbound, number)?;
    let mut last = SendError::NoAddress;
    for address in &outbound.addresses {
        match send_to(address, &content_type, &body).await {
            Ok(()) => return Ok(()),
            Err(error) => last = error,
        }
    }
    Err(last)
}

async fn send_to(address: &str, content_type: &str, body: &[u8]) -> Result<(), SendError> {
    let (host, path) = parse_address(address)?;
    let mut stream = timeout(CONNECT_WAIT, TcpStream::connect(&host)).await.map_err(|_| SendError::Silence)??;
    let head = format!(
        "POST {path} HTTP/1.1\r\nHost: {host}\r\nCache-Control: no-cache\r\nMime-Version: 1.0\r\nContent-Type: \
         {content_type}\r\nContent-Length: {}\r\nConnection: close\r\n\r\n",
        body.len()
    );
    let exchange = async {
        stream.write_all(&[head.as_bytes(), body].concat()).await?;
        // JADE's responses have a body without a length: use the status only, and drop the connection
        let mut heard = Vec::new();
        loop {
            if let Some(status) = parse_status(&heard).map_err(SendError::Answer)? {
                // Skip an unrequested 100 Continue
                if status != 100 {
                    return if status == 200 { Ok(()) } else { Err(SendError::Status(status)) };
                }
                let next = super::head::end_of_head(&heard);
                match next {
                    Some(end) => drop(heard.drain(..end)),
                    None if heard.len() > super::HEAD_BYTES_MAX => return Err(SendError::Status(100)),
                    None => read_more(&mut stream, &mut heard).await?,
                }
                continue;
            }
            read_more(&mut stream, &mut heard).await?;
        }
    };
    timeout(ANSWER_WAIT, exchange).await.map_err(|_| SendError::Silence)?
}

async fn read_more(stream: &mut TcpStream, heard: &mut Vec<u8>) -> Result<(), SendError> {
    if stream.read_buf(heard).await? == 0 {
        return Err(std::io::Error::from(std::io::ErrorKind::UnexpectedEof).into());
    }
    Ok(())
}
