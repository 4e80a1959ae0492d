//! The address of the page and its token, both kept in a file so that an open page continues after a restart.

use std::fs;
use std::io;
use std::net::{IpAddr, SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::time::Duration;

use ppa_dataset::files::write_whole;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::error::StudioError;
use crate::token::Token;

/// Maximum age of an address that is reused.
const LIFETIME: Duration = Duration::from_secs(24 * 60 * 60);

/// A listening socket and the token that its page needs.
#[derive(Debug)]
pub struct Endpoint {
    /// The socket.
    pub listener: TcpListener,
    /// The token.
    pub token: Token,
}

#[derive(Serialize, Deserialize)]
struct Last {
    ip: IpAddr,
    port: u16,
    token: Token,
}

impl Endpoint {
    /// Listens on an address of this machine. Port 0 means the port in the file `last` if it is free, otherwise any free port.
    ///
    /// If address and port match `last`, the token in the file is reused, so that an open page continues. The file is then
    /// rewritten, unless a studio still runs there. It is used for one day, and only in a folder that nobody else can read;
    /// without it every start has a new token.
    ///
    /// # Errors
    /// [`StudioError::Listen`] if the port is in use, [`StudioError::Random`] if there are no random numbers.
    pub fn open(address: SocketAddr, last: Option<&Path>) -> Result<Self, StudioError> {
        let last = last.filter(|file| make_private_folder(file).is_ok());
        let known = last
            .and_then(read)
            .filter(|known| known.ip == address.ip() && [0, known.port].contains(&address.port()));
        let is_known = known.is_some();
        let again = known.and_then(|Last { ip, port, token }| {
            let listener = TcpListener::bind((ip, port)).ok()?;
            Some(Self { listener, token })
        });
        // The file belongs to a studio that still runs.
        let is_taken = is_known && again.is_none();
        let listen = |source| StudioError::Listen { address, source };
        let endpoint = match again {
            Some(again) => again,
            None => Self {
                listener: TcpListener::bind(address).map_err(listen)?,
                token: Token::random()?,
            },
        };
        if let Some(file) = last.filter(|_| !is_taken) {
            // The studio works without this file.
            let _ = endpoint.write(file);
        }
        Ok(endpoint)
    }

    fn write(&self, file: &Path) -> Result<(), Box<dyn std::error::Error>> {
        let bound = self.listener.local_addr()?;
        let now = Last {
            ip: bound.ip(),
            port: bound.port(),
            token: self.token.clone(),
        };
        Ok(write_whole(file, &serde_json::to_vec(&now)?)?)
    }

    /// Returns the file for the input opened at `path`, below the user's state folder: `XDG_STATE_HOME`, or `.local/state` in the
    /// home folder. `None` if neither is known.
    pub fn file_of(path: &Path) -> Option<PathBuf> {
        let of = |name| std::env::var_os(name).map(PathBuf::from);
        let state = of("XDG_STATE_HOME").filter(|folder| folder.is_absolute());
        let state = state.or_else(|| Some(of("HOME")?.join(".local/state")))?;
        let path = path.canonicalize().ok()?;
        let hash = Sha256::digest(path.as_os_str().as_encoded_bytes());
        let name: String = hash.iter().map(|byte| format!("{byte:02x}")).collect();
        Some(state.join("ppa").join("studio").join(name + ".json"))
    }
}

/// Reads the file; `None` if it is too old or invalid.
fn read(file: &Path) -> Option<Last> {
    let written = fs::metadata(file).ok()?.modified().ok()?;
    // A time in the future is an error.
    if written.elapsed().ok()? > LIFETIME {
        return None;
    }
    serde_json::from_slice(&fs::read(file).ok()?).ok()
}

/// Makes the folder of a file, readable by its owner only.
#[cfg(unix)]
fn make_private_folder(file: &Path) -> io::Result<()> {
    use std::os::unix::fs::{DirBuilderExt, PermissionsExt};

    let folder = file.parent().ok_or(io::ErrorKind::NotFound)?;
    let mut maker = fs::DirBuilder::new();
    maker.recursive(true).mode(0o700).create(folder)?;
    match fs::metadata(folder)?.permissions().mode() & 0o077 {
        0 => Ok(()),
        _ => Err(io::ErrorKind::PermissionDenied.into()),
    }
}

/// Always fails: no folder can be made private here, so no token is stored.
#[cfg(not(unix))]
fn make_private_folder(_: &Path) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

#[cfg(all(test, unix))]
mod tests {
    use std::fs::{File, Permissions};
    use std::os::unix::fs::PermissionsExt;
    use std::time::SystemTime;

    use super::*;

    const LOCAL: IpAddr = IpAddr::V4(std::net::Ipv4Addr::LOCALHOST);

    fn open(port: u16, last: &Path) -> Endpoint {
        Endpoint::open((LOCAL, port).into(), Some(last)).unwrap()
    }

    fn port(endpoint: &Endpoint) -> u16 {
        endpoint.listener.local_addr().unwrap().port()
    }

    #[test]
    fn a_second_start_has_the_address_of_the_first() {
        let folder = tempfile::tempdir().unwrap();
        let last = folder.path().join("ppa/studio/last.json");
        let first = open(0, &last);
        let (number, token) = (port(&first), first.token.clone());
        drop(first);
        for asked in [0, number] {
            let second = open(asked, &last);
            assert_eq!((port(&second), &second.token), (number, &token));
        }
        let mode = last.parent().unwrap().metadata().unwrap().permissions();
        assert_eq!(mode.mode() & 0o777, 0o700);
    }

    #[test]
    fn a_studio_beside_another_has_an_address_of_its_own() {
        let folder = tempfile::tempdir().unwrap();
        let last = folder.path().join("private/last.json");
        let first = open(0, &last);
        let second = open(0, &last);
        assert_ne!(port(&first), port(&second));
        assert_ne!(first.token, second.token);
        let taken = (LOCAL, port(&first)).into();
        assert!(matches!(
            Endpoint::open(taken, Some(&last)),
            Err(StudioError::Listen { .. })
        ));
        let (number, token) = (port(&first), first.token.clone());
        drop(first);
        let again = open(0, &last);
        assert_eq!((port(&again), again.token), (number, token));
    }

    #[test]
    fn old_files_and_folders_of_all_are_not_used() {
        let folder = tempfile::tempdir().unwrap();
        let last = folder.path().join("private/last.json");
        let first = open(0, &last).token;
        let yesterday = SystemTime::now() - LIFETIME - Duration::from_secs(60);
        let file = File::options().write(true).open(&last).unwrap();
        file.set_modified(yesterday).unwrap();
        let second = open(0, &last).token;
        assert_ne!(first, second);
        let allow = |mode| {
            let private = last.parent().unwrap();
            fs::set_permissions(private, Permissions::from_mode(mode)).unwrap();
        };
        allow(0o755);
        assert_ne!(second, open(0, &last).token);
        allow(0o700);
        fs::write(&last, "{}").unwrap();
        assert_ne!(second, open(0, &last).token);
    }
}
