//! The link of a process to a farm: discovery, admission, connection.

use std::{
    collections::BTreeSet,
    fs,
    net::IpAddr,
    path::{Path, PathBuf},
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use bottega_agents::driver::nats::{Login, MemberKey, NatsError, NatsOptions, NatsUplink, Tls, enrol, newcomer};
use bottega_farm::FarmCodec;
use bottega_platform::permissions::make_private;
use serde::{Deserialize, Serialize};

use crate::{
    error::Error,
    names::{fresh_number, host_name, plain},
    server::{
        address::{FarmAddress, Group, JoinWord, Operator, saved_address},
        discovery,
    },
};
use bottega_platform::folders::state_folder;

/// The oldest NATS server version that is safe on untrusted networks.
const FIT_FOR_ALL: (u64, u64) = (2, 14);
/// The time for which a machine just admitted retries, while the server reloads its configuration.
const PATIENCE: Duration = Duration::from_secs(20);
/// The time for which a refused machine retries: its word may be wrong, or the farm may have removed it.
const PATIENCE_OF_REFUSED: Duration = Duration::from_secs(6);
/// Pause between attempts, at first and at most.
const FIRST_PAUSE: Duration = Duration::from_millis(50);
const LONGEST_PAUSE: Duration = Duration::from_secs(1);

/// The credentials for NATS servers of other operators; `None` in a field: not given.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Credentials {
    /// The path of a `.creds` file of NATS. It takes precedence over `nkey` and over the login of the address.
    pub creds: Option<PathBuf>,
    /// The path of a file with the seed of an NKey. It takes precedence over the login of the address.
    pub nkey: Option<PathBuf>,
    /// The path of a file with certificates of authorities, in place of those of the system (PEM).
    pub tls_ca: Option<PathBuf>,
    /// The paths of this machine's client certificate and of its private key (PEM).
    pub tls_own: Option<(PathBuf, PathBuf)>,
}

/// The connection of a process to a farm.
pub struct FarmLink {
    /// The NATS connection.
    pub uplink: Arc<NatsUplink<FarmCodec>>,
    /// The unique name of the process.
    pub name: String,
    /// The addresses of the servers, for display.
    pub servers: String,
}

/// The name of this machine at a farm, and the seed of its key.
#[derive(Serialize, Deserialize)]
struct Membership {
    member: String,
    seed: String,
    /// The digest of the secret it was admitted with; none: written by an older version.
    #[serde(default)]
    word: Option<String>,
}

impl Membership {
    /// Returns true if the machine was admitted with another secret than this one.
    fn is_by_other_word(&self, word: &JoinWord) -> bool {
        self.word.as_ref().is_some_and(|digest| *digest != digest_of(word))
    }

    /// Returns true if the farm knows the machine by this name.
    fn is_named(&self, name: &str) -> bool {
        self.member.rsplit_once('-').is_some_and(|(own, _)| own == plain(name).to_lowercase())
    }
}

fn digest_of(word: &JoinWord) -> String {
    blake3::hash(word.secret.as_bytes()).to_hex()[..32].to_owned()
}

/// The request of a machine to be admitted: its public key and its host name.
#[derive(Serialize, Deserialize)]
pub(crate) struct EnrolmentRequest {
    pub(crate) key: String,
    pub(crate) host: String,
}

/// The answer to an [`EnrolmentRequest`]: the member's name, or the reason for a refusal.
#[derive(Serialize, Deserialize)]
pub(crate) struct EnrolmentAnswer {
    pub(crate) member: Option<String>,
    pub(crate) refused: Option<String>,
}

/// Connects to the given farm, or else to the one that `bottega up` runs on this machine. Returns the connection.
///
/// # Errors
/// This machine has no saved farm, no server answers, the farm does not admit this machine, or the credentials cannot be read or
/// do not suit the kind of farm.
pub fn link(farm: Option<&FarmAddress>, credentials: &Credentials) -> Result<FarmLink, Error> {
    link_as(farm, credentials, None)
}

/// Connects to a farm as a machine of the given name. Returns the connection.
///
/// - `farm`: the address; `None`: the farm that `bottega up` runs on this machine.
/// - `name`: the machine's name at the farm: letters, digits and hyphens; letters of its key are appended. `None`: its name
///   there so far, or else its host name.
///
/// # Errors
/// As for [`link`].
pub fn link_as(farm: Option<&FarmAddress>, credentials: &Credentials, name: Option<&str>) -> Result<FarmLink, Error> {
    let mut address = farm.cloned().map_or_else(saved_address, Ok)?;
    if let (Operator::Up(word), true) = (&address.operator, address.servers.is_empty()) {
        address.servers = vec![discovery::find(word.pin)?];
    }
    let linked = match &address.operator {
        Operator::Up(word) if credentials.is_empty() => with_word(&address, word, name)?,
        Operator::Up(_) => {
            return Err(Error::usage(
                "a farm that `bottega up` runs needs only its word",
                "leave out --creds, --nkey and --tls-…",
            ));
        }
        Operator::Other { login: written, tls, .. } => {
            let host = name.map_or_else(host_name, plain);
            let member = format!("{host}-{:06x}", fresh_number() & 0xff_ffff);
            let options = NatsOptions {
                login: credentials.login(written)?,
                tls: credentials.tls(*tls),
                ..options(&address, &member)
            };
            connect(&options).map_err(link_error).map(|uplink| (uplink, member))?
        }
    };
    let (uplink, name) = linked;
    warn_of_age(&uplink.server_version(), &address.servers);
    Ok(FarmLink { uplink: Arc::new(uplink), name, servers: address.servers.join(", ") })
}

fn options(address: &FarmAddress, member: &str) -> NatsOptions {
    let servers = address.servers.iter().map(|server| format!("nats://{server}")).collect();
    NatsOptions { servers, farm: address.farm.clone(), member: member.to_owned(), ..NatsOptions::default() }
}

fn connect(options: &NatsOptions) -> Result<NatsUplink<FarmCodec>, NatsError> {
    NatsUplink::connect(options, FarmCodec)
}

/// Returns the connection options for a farm that `bottega up` runs.
pub(crate) fn pinned(address: &FarmAddress, word: &JoinWord, member: &str) -> NatsOptions {
    let tls = Tls { is_required: true, pin: Some(word.pin), ..Tls::default() };
    NatsOptions { tls, is_guest: word.group == Group::Guest, ..options(address, member) }
}

/// Connects as a member: with the membership of this machine, or else with a new one.
fn with_word(
    address: &FarmAddress,
    word: &JoinWord,
    name: Option<&str>,
) -> Result<(NatsUplink<FarmCodec>, String), Error> {
    let file = membership_file(word, name);
    let known = membership(&file);
    if let Some(known) = &known
        && let Some(linked) = as_known(address, word, known)
    {
        if linked.is_ok() && known.is_by_other_word(word) {
            tracing::warn!(
                "the farm knows this machine already, as {}, by a key of its own: the word of the address was not checked, and it is not \
                 the one by which the machine was admitted. To use it, remove {}",
                known.member,
                file.display()
            );
        }
        return linked;
    }
    let membership = {
        // Processes of one machine that start at the same moment share one membership.
        let _alone = lock(&file)?;
        match self::membership(&file) {
            Some(other) if known.is_none_or(|known| known.seed != other.seed) => other,
            _ => {
                let new = let_in(address, word, name)?;
                write_secret(&file, &serde_json::to_vec(&new).unwrap_or_default())?;
                new
            }
        }
    };
    let attempt = || as_member(address, word, &membership);
    let linked = persist(PATIENCE, NatsError::may_pass, attempt).map_err(reloading)?;
    Ok((linked, process_name(&membership.member)))
}

/// Connects with a known membership. `None`: the farm has removed it.
fn as_known(
    address: &FarmAddress,
    word: &JoinWord,
    known: &Membership,
) -> Option<Result<(NatsUplink<FarmCodec>, String), Error>> {
    let attempt = || as_member(address, word, known);
    let is_reloading =
        |error: &NatsError| error.is_refusal() || matches!(error, NatsError::Keep { .. }) && error.may_pass();
    match persist(PATIENCE_OF_REFUSED, is_reloading, attempt) {
        Err(error) if error.is_refusal() => None,
        Err(error) => Some(Err(link_error(error))),
        Ok(uplink) => Some(Ok((uplink, process_name(&known.member)))),
    }
}

/// Returns the file of this machine's membership. A machine has one for each name given to it; without a name, the first
/// one counts.
fn membership_file(word: &JoinWord, name: Option<&str>) -> PathBuf {
    let first = memberships().join(format!("{}-{}.json", word.pin, word.group.word()));
    match (name, membership(&first)) {
        (Some(name), Some(known)) if !known.is_named(name) => {
            first.with_file_name(format!("{}-{}-{}.json", word.pin, word.group.word(), plain(name).to_lowercase()))
        }
        _ => first,
    }
}

fn memberships() -> PathBuf {
    state_folder().join("members")
}

/// Returns the names of all memberships of this machine, at any farm.
pub(crate) fn own_members() -> BTreeSet<String> {
    let files = fs::read_dir(memberships()).into_iter().flatten().flatten().map(|file| file.path());
    let files = files.filter(|file| file.extension().is_some_and(|extension| extension == "json"));
    files.filter_map(|file| membership(&file)).map(|known| known.member).collect()
}

fn membership(file: &Path) -> Option<Membership> {
    serde_json::from_slice(&fs::read(file).ok()?).ok()
}

/// Locks a file against other processes of this machine until the result is dropped.
fn lock(file: &Path) -> Result<fs::File, Error> {
    let path = file.with_extension("lock");
    private_folder(file.parent().unwrap_or(Path::new(".")))?;
    let locked = fs::File::create(&path).and_then(|lock| lock.lock().map(|()| lock));
    locked.map_err(|source| Error::write(path, source))
}

/// Retries until success or a lasting error, with growing pauses, for at most `patience`.
fn persist<T>(
    patience: Duration,
    may_pass: impl Fn(&NatsError) -> bool,
    mut attempt: impl FnMut() -> Result<T, NatsError>,
) -> Result<T, NatsError> {
    let (begun, mut pause) = (Instant::now(), FIRST_PAUSE);
    loop {
        match attempt() {
            Err(error) if may_pass(&error) && begun.elapsed() < patience => {
                tracing::debug!(%error, "trying again");
                // Randomize the pause, so that processes that started together do not retry together.
                let share = 0.5 + (fresh_number() % 1024) as f64 / 1024.0;
                thread::sleep(pause.mul_f64(share));
                pause = LONGEST_PAUSE.min(2 * pause);
            }
            result => return result,
        }
    }
}

fn as_member(
    address: &FarmAddress,
    word: &JoinWord,
    membership: &Membership,
) -> Result<NatsUplink<FarmCodec>, NatsError> {
    let login = Login::NKey(membership.seed.clone());
    connect(&NatsOptions { login, ..pinned(address, word, &membership.member) })
}

/// Asks the farm for membership.
fn let_in(address: &FarmAddress, word: &JoinWord, name: Option<&str>) -> Result<Membership, Error> {
    let key = MemberKey::new();
    let request = EnrolmentRequest { key: key.public(), host: name.map_or_else(host_name, plain) };
    let request = serde_json::to_vec(&request).unwrap_or_default();
    let group = word.group.word();
    let options = NatsOptions { login: newcomer(group, &word.secret), ..pinned(address, word, "newcomer") };
    let begun = Instant::now();
    // A wrong word stays wrong, but a right one is also refused while the server reloads its configuration.
    let may_pass = |error: &NatsError| match error {
        NatsError::NobodyAnswers { .. } => true,
        error => error.is_refusal() && begun.elapsed() < PATIENCE_OF_REFUSED,
    };
    let answer = persist(PATIENCE, may_pass, || enrol(&options, group, &request)).map_err(link_error)?;
    let answer: Option<EnrolmentAnswer> = serde_json::from_slice(&answer).ok();
    let refused = |reason: String| {
        Error::failed(format!("the farm does not admit this machine: {reason}"), "see what `bottega up` says")
    };
    match (answer, key.seed()) {
        (Some(EnrolmentAnswer { member: Some(member), .. }), Some(seed)) => {
            Ok(Membership { member, seed, word: Some(digest_of(word)) })
        }
        (Some(EnrolmentAnswer { refused: Some(reason), .. }), _) => Err(refused(reason)),
        _ => Err(refused("cannot understand its answer".to_owned())),
    }
}

/// Returns a unique name for this process, from that of its machine.
fn process_name(member: &str) -> String {
    format!("{member}.{:08x}", fresh_number() & 0xffff_ffff)
}

/// Returns the error of a machine that was just admitted and cannot connect.
fn reloading(source: NatsError) -> Error {
    if !source.may_pass() {
        return link_error(source);
    }
    let remedy = format!(
        "the farm has admitted this machine, but its server has refused it for {} s: it reloads its configuration while \
         machines are admitted. Try again in a moment; see what `bottega up` says",
        PATIENCE.as_secs()
    );
    Error::Farm { source, remedy }
}

fn link_error(source: NatsError) -> Error {
    let remedy = match &source {
        NatsError::NobodyAnswers { .. } => {
            "the NATS server runs, but `bottega up` does not, or it is overloaded: see whether it runs, and try again"
        }
        NatsError::Connect { .. } => "is `bottega up` running there, and is this the line that it printed?",
        NatsError::Version { .. } => "install a newer nats-server, see `bottega up --help`",
        NatsError::Credentials { .. } => "use the file that the administrator of the servers gave you",
        _ => "see what `bottega up` printed",
    };
    Error::Farm { source, remedy: remedy.to_owned() }
}

/// Writes a file that only this user may read.
pub(crate) fn write_secret(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    let write_error = |source| Error::write(path.to_owned(), source);
    private_folder(path.parent().unwrap_or(Path::new(".")))?;
    let part = path.with_extension(format!("part-{}", std::process::id()));
    fs::write(&part, bytes).map_err(write_error)?;
    make_private(&part).map_err(write_error)?;
    fs::rename(&part, path).map_err(write_error)
}

/// Creates a folder that only this user may read.
pub(crate) fn private_folder(folder: &Path) -> Result<(), Error> {
    let write_error = |source| Error::write(folder.to_owned(), source);
    fs::create_dir_all(folder).map_err(write_error)?;
    make_private(folder).map_err(write_error)
}

impl Credentials {
    fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    fn login(&self, written: &Login) -> Result<Login, Error> {
        if let Some(path) = &self.creds {
            return Ok(Login::Credentials(path.clone()));
        }
        let Some(path) = &self.nkey else { return Ok(written.clone()) };
        let text = fs::read_to_string(path).map_err(|source| Error::read(path.clone(), source))?;
        let seed = text.lines().map(str::trim).find(|line| line.starts_with("SU"));
        seed.map(|seed| Login::NKey(seed.to_owned())).ok_or_else(|| {
            Error::failed(
                format!("`{}` holds no seed of a user's NKey", path.display()),
                "it is a line that begins with SU; `nk -gen user` makes one",
            )
        })
    }

    fn tls(&self, is_required: bool) -> Tls {
        let is_required = is_required || self.tls_ca.is_some() || self.tls_own.is_some();
        Tls { is_required, pin: None, authorities: self.tls_ca.clone(), own: self.tls_own.clone() }
    }
}

/// Warns of an old server on a public network: old versions have known vulnerabilities.
fn warn_of_age(version: &str, servers: &[String]) {
    let mut numbers = version.split('.').map_while(|part| part.parse::<u64>().ok());
    let is_old = numbers.next().zip(numbers.next()).is_some_and(|version| version < FIT_FOR_ALL);
    if is_old && !servers.iter().all(|server| is_near(server)) {
        let (major, minor) = FIT_FOR_ALL;
        tracing::warn!("the NATS server has version {version}: on untrusted networks use {major}.{minor} or newer");
    }
}

/// Returns true if a server is on this machine or in a private network.
fn is_near(server: &str) -> bool {
    let host = server.rsplit_once(':').map_or(server, |(host, _)| host);
    match host.trim_matches(['[', ']']).parse() {
        Ok(IpAddr::V4(ip)) => ip.is_loopback() || ip.is_private() || ip.is_link_local(),
        Ok(IpAddr::V6(ip)) => ip.is_loopback() || ip.is_unique_local() || ip.is_unicast_link_local(),
        Err(_) => host == "localhost" || host.ends_with(".local"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_membership_knows_its_word_and_name() {
        let word = |digit: &str| -> JoinWord { format!("t{}{}", digit.repeat(32), "0".repeat(32)).parse().unwrap() };
        let [one, other] = ["1", "2"].map(word);
        let known =
            Membership { member: "studio-a-abcdefgh".to_owned(), seed: String::new(), word: Some(digest_of(&one)) };
        assert!(!known.is_by_other_word(&one) && known.is_by_other_word(&other));
        assert!(!Membership { word: None, ..known }.is_by_other_word(&other), "it was not noted");
        let known = Membership { member: "studio-a-abcdefgh".to_owned(), seed: String::new(), word: None };
        assert!(known.is_named("Studio-A") && known.is_named("studio-a.example.org"));
        assert!(!known.is_named("studio") && !known.is_named("studio-a-abcdefgh"));
    }

    #[test]
    fn what_is_near_is_known_by_its_address() {
        for near in [
            "127.0.0.1:4222",
            "10.1.2.3:4222",
            "192.168.0.9:1",
            "localhost:4222",
            "[::1]:4222",
            "[fd00::1]:1",
            "x.local:1",
        ] {
            assert!(is_near(near), "{near}");
        }
        for far in ["8.8.8.8:4222", "nats.example.com:4222", "[2001:db8::1]:4222"] {
            assert!(!is_near(far), "{far}");
        }
    }
}
