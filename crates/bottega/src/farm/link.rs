//! The way into a farm: found, let in, linked.

use std::{
    fs,
    net::IpAddr,
    path::{Path, PathBuf},
    process::Command,
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use bottega_agents::driver::nats::{Login, MemberKey, NatsError, NatsOptions, NatsUplink, Tls, enrol, newcomer};
use bottega_farm::FarmCodec;
use clap::{Args, ValueHint};
use serde::{Deserialize, Serialize};

use super::{
    address::{FarmAddress, Group, JoinWord, Keeper, saved_address, state_folder},
    discovery,
    job_board::JobBoard,
    names::{fresh_number, host_name},
};
use crate::error::CliError;

/// The oldest server that is fit for networks that are not to be trusted.
const FIT_FOR_ALL: (u64, u64) = (2, 14);
/// How long one who was just let in is patient with a server that reads its configuration anew.
const PATIENCE: Duration = Duration::from_secs(20);
/// The same of one who is turned away and may have no right to come in: whose word is wrong, whom the farm has forgotten.
const PATIENCE_OF_REFUSED: Duration = Duration::from_secs(6);
/// Between tries, at first and at most.
const FIRST_PAUSE: Duration = Duration::from_millis(50);
const LONGEST_PAUSE: Duration = Duration::from_secs(1);

/// Who one is to servers of others.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct LoginArgs {
    /// Credentials for NATS servers that others run: a `.creds` file.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, global = true, help_heading = "NATS servers of others")]
    creds: Option<PathBuf>,
    /// An NKey for them: a file with its seed.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, global = true, conflicts_with = "creds", help_heading = "NATS servers of others")]
    nkey: Option<PathBuf>,
    /// Certificates of more authorities than those of the system (PEM).
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, global = true, help_heading = "NATS servers of others")]
    tls_ca: Option<PathBuf>,
    /// The certificate by which the servers know this machine (PEM).
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, global = true, requires = "tls_key", help_heading = "NATS servers of others")]
    tls_cert: Option<PathBuf>,
    /// Its key (PEM).
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, global = true, requires = "tls_cert", help_heading = "NATS servers of others")]
    tls_key: Option<PathBuf>,
}

/// Which farm is looked at.
#[derive(Debug, Args)]
pub(super) struct FarmArgs {
    /// Where the farm is; default: the one that `bottega up` runs on this machine.
    #[arg(long, value_name = "ADDRESS", env = "BOTTEGA_FARM", hide_env_values = true, global = true)]
    farm: Option<FarmAddress>,
    /// Print JSON, an object a line, instead of text for people.
    #[arg(long, global = true)]
    pub(super) json: bool,
    #[command(flatten)]
    login: LoginArgs,
}

impl FarmArgs {
    /// Links up with the farm.
    pub(super) fn board(&self) -> Result<JobBoard, CliError> {
        Ok(JobBoard { uplink: link(self.farm.as_ref(), &self.login)?.uplink })
    }
}

/// A process in a farm.
pub(crate) struct FarmLink {
    pub(crate) uplink: Arc<NatsUplink<FarmCodec>>,
    /// Its name, which no other process has.
    pub(crate) name: String,
    /// Where the servers are.
    pub(crate) servers: String,
}

/// What a farm calls this machine, and what it knows it by.
#[derive(Serialize, Deserialize)]
struct Membership {
    member: String,
    seed: String,
}

/// What one who wants to be let in says, and hears.
#[derive(Serialize, Deserialize)]
pub(super) struct Request {
    pub(super) key: String,
    pub(super) host: String,
}

#[derive(Serialize, Deserialize)]
pub(super) struct Answer {
    pub(super) member: Option<String>,
    pub(super) refused: Option<String>,
}

/// Links up with the farm that was named, or else the one of this machine.
pub(crate) fn link(farm: Option<&FarmAddress>, login: &LoginArgs) -> Result<FarmLink, CliError> {
    let mut address = farm.cloned().map_or_else(saved_address, Ok)?;
    if let (Keeper::Up(word), true) = (&address.keeper, address.servers.is_empty()) {
        address.servers = vec![discovery::find(word.pin)?];
    }
    let linked = match &address.keeper {
        Keeper::Up(word) if login.is_empty() => with_word(&address, word)?,
        Keeper::Up(_) => {
            return Err(CliError::usage(
                "the word of a farm that `bottega up` runs says all",
                "leave out --creds, --nkey and --tls-…",
            ));
        }
        Keeper::Other { login: written, tls, .. } => {
            let member = format!("{}-{:06x}", host_name(), fresh_number() & 0xff_ffff);
            let options =
                NatsOptions { login: login.login(written)?, tls: login.tls(*tls), ..options(&address, &member) };
            connect(&options).map_err(told).map(|uplink| (uplink, member))?
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

/// What of the options concerns a farm that `bottega up` runs.
pub(super) fn pinned(address: &FarmAddress, word: &JoinWord, member: &str) -> NatsOptions {
    let tls = Tls { is_required: true, pin: Some(word.pin), ..Tls::default() };
    NatsOptions { tls, is_guest: word.group == Group::Guest, ..options(address, member) }
}

/// As a member: what this machine was once let in as, or else now.
fn with_word(address: &FarmAddress, word: &JoinWord) -> Result<(NatsUplink<FarmCodec>, String), CliError> {
    let file = state_folder().join("members").join(format!("{}-{}.json", word.pin, word.group.word()));
    let known = membership(&file);
    if let Some(known) = &known
        && let Some(linked) = as_known(address, word, known)
    {
        return linked;
    }
    let membership = {
        // Processes of one machine that come at the same moment are one member.
        let _alone = lock(&file)?;
        match self::membership(&file) {
            Some(other) if known.is_none_or(|known| known.seed != other.seed) => other,
            _ => {
                let new = let_in(address, word)?;
                write_secret(&file, &serde_json::to_vec(&new).unwrap_or_default())?;
                new
            }
        }
    };
    let attempt = || as_member(address, word, &membership);
    let linked = persist(PATIENCE, NatsError::may_pass, attempt).map_err(reloading)?;
    Ok((linked, process_name(&membership.member)))
}

/// As the member that this machine was let in as. `None`: the farm does not know it any more.
fn as_known(
    address: &FarmAddress,
    word: &JoinWord,
    known: &Membership,
) -> Option<Result<(NatsUplink<FarmCodec>, String), CliError>> {
    let attempt = || as_member(address, word, known);
    let is_reloading =
        |error: &NatsError| error.is_refusal() || matches!(error, NatsError::Keep { .. }) && error.may_pass();
    match persist(PATIENCE_OF_REFUSED, is_reloading, attempt) {
        Err(error) if error.is_refusal() => None,
        Err(error) => Some(Err(told(error))),
        Ok(uplink) => Some(Ok((uplink, process_name(&known.member)))),
    }
}

fn membership(file: &Path) -> Option<Membership> {
    serde_json::from_slice(&fs::read(file).ok()?).ok()
}

/// Keeps other processes of this machine from a file until it is dropped.
fn lock(file: &Path) -> Result<fs::File, CliError> {
    let path = file.with_extension("lock");
    private_folder(file.parent().unwrap_or(Path::new(".")))?;
    let locked = fs::File::create(&path).and_then(|lock| lock.lock().map(|()| lock));
    locked.map_err(|source| CliError::Write { path, source })
}

/// Tries until it is done or goes wrong for good, for some time, and less and less often.
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
                // Those who came together do not come together again.
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

/// Asks to become a member.
fn let_in(address: &FarmAddress, word: &JoinWord) -> Result<Membership, CliError> {
    let key = MemberKey::new();
    let request = Request { key: key.public(), host: host_name() };
    let request = serde_json::to_vec(&request).unwrap_or_default();
    let group = word.group.word();
    let options = NatsOptions { login: newcomer(group, &word.secret), ..pinned(address, word, "newcomer") };
    let begun = Instant::now();
    // A wrong word stays wrong; a right one is turned away, too, while the server reads its configuration anew.
    let may_pass = |error: &NatsError| match error {
        NatsError::NobodyAnswers { .. } => true,
        error => error.is_refusal() && begun.elapsed() < PATIENCE_OF_REFUSED,
    };
    let answer = persist(PATIENCE, may_pass, || enrol(&options, group, &request)).map_err(told)?;
    let answer: Option<Answer> = serde_json::from_slice(&answer).ok();
    let refused = |reason: String| {
        CliError::failed(format!("the farm does not let this machine in: {reason}"), "see what `bottega up` says")
    };
    match (answer, key.seed()) {
        (Some(Answer { member: Some(member), .. }), Some(seed)) => Ok(Membership { member, seed }),
        (Some(Answer { refused: Some(reason), .. }), _) => Err(refused(reason)),
        _ => Err(refused("its answer is not understood".to_owned())),
    }
}

/// The name of this process among those of its machine.
fn process_name(member: &str) -> String {
    format!("{member}.{:08x}", fresh_number() & 0xffff_ffff)
}

/// What is wrong with a link of one who was let in a moment ago.
fn reloading(source: NatsError) -> CliError {
    if !source.may_pass() {
        return told(source);
    }
    let remedy = format!(
        "the farm has let this machine in, and for {} s its server has not taken it: it reads its configuration anew while \
         machines are let in. Try again in a moment; see what `bottega up` says",
        PATIENCE.as_secs()
    );
    CliError::Farm { source, remedy }
}

fn told(source: NatsError) -> CliError {
    let remedy = match &source {
        NatsError::NobodyAnswers { .. } => {
            "the NATS server is there and `bottega up` is not, or it has no time: see whether it runs, and try again"
        }
        NatsError::Connect { .. } => "is `bottega up` running there, and is this the line that it printed?",
        NatsError::Version { .. } => "install a newer nats-server, see `bottega up --help`",
        NatsError::Credentials { .. } => "give the file that the keeper of the servers gave you",
        _ => "see what `bottega up` printed",
    };
    CliError::Farm { source, remedy: remedy.to_owned() }
}

/// Writes a file that nobody else may read.
pub(super) fn write_secret(path: &Path, bytes: &[u8]) -> Result<(), CliError> {
    let wrong = |source| CliError::Write { path: path.to_owned(), source };
    private_folder(path.parent().unwrap_or(Path::new(".")))?;
    let part = path.with_extension(format!("part-{}", std::process::id()));
    fs::write(&part, bytes).map_err(wrong)?;
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        fs::set_permissions(&part, fs::Permissions::from_mode(0o600)).map_err(wrong)?;
    }
    fs::rename(&part, path).map_err(wrong)
}

/// A folder that nobody else may read.
pub(super) fn private_folder(folder: &Path) -> Result<(), CliError> {
    let wrong = |source| CliError::Write { path: folder.to_owned(), source };
    fs::create_dir_all(folder).map_err(wrong)?;
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        fs::set_permissions(folder, fs::Permissions::from_mode(0o700)).map_err(wrong)?;
    }
    Ok(())
}

impl LoginArgs {
    /// Has another process of this program log in as this one does.
    pub(crate) fn tell(&self, command: &mut Command) {
        let all = [
            ("--creds", &self.creds),
            ("--nkey", &self.nkey),
            ("--tls-ca", &self.tls_ca),
            ("--tls-cert", &self.tls_cert),
            ("--tls-key", &self.tls_key),
        ];
        for (name, path) in all {
            if let Some(path) = path {
                command.arg(name).arg(path);
            }
        }
    }

    fn is_empty(&self) -> bool {
        [&self.creds, &self.nkey, &self.tls_ca, &self.tls_cert, &self.tls_key].iter().all(|it| it.is_none())
    }

    fn login(&self, written: &Login) -> Result<Login, CliError> {
        if let Some(path) = &self.creds {
            return Ok(Login::Credentials(path.clone()));
        }
        let Some(path) = &self.nkey else { return Ok(written.clone()) };
        let text = fs::read_to_string(path).map_err(|source| CliError::Read { path: path.clone(), source })?;
        let seed = text.lines().map(str::trim).find(|line| line.starts_with("SU"));
        seed.map(|seed| Login::NKey(seed.to_owned())).ok_or_else(|| {
            CliError::failed(
                format!("`{}` holds no seed of a user's NKey", path.display()),
                "it is a line that begins with SU; `nk -gen user` makes one",
            )
        })
    }

    fn tls(&self, is_required: bool) -> Tls {
        let own = self.tls_cert.clone().zip(self.tls_key.clone());
        let is_required = is_required || self.tls_ca.is_some() || own.is_some();
        Tls { is_required, pin: None, authorities: self.tls_ca.clone(), own }
    }
}

/// Old servers have known holes, and the whole world may try those that it can reach.
fn warn_of_age(version: &str, servers: &[String]) {
    let mut numbers = version.split('.').map_while(|part| part.parse::<u64>().ok());
    let is_old = numbers.next().zip(numbers.next()).is_some_and(|version| version < FIT_FOR_ALL);
    if is_old && !servers.iter().all(|server| is_near(server)) {
        let (major, minor) = FIT_FOR_ALL;
        tracing::warn!(
            "the NATS server is of version {version}: on networks that are not yours alone have {major}.{minor} or newer"
        );
    }
}

/// Whether a server is on this machine or in a private network.
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
