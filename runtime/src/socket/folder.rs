//! The folder of the sockets, which no other user can open.

use std::fs::{self, DirBuilder};
use std::io::ErrorKind;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};

use nix::unistd::Uid;

/// Mode of the folder, and of a socket in it.
const FOLDER_MODE: u32 = 0o700;
const SOCKET_MODE: u32 = 0o600;
/// End of the name of a socket behind the number of its process.
const SOCKET_END: &str = ".sock";

/// Returns the folder of this user's sockets, and makes it if it is absent.
///
/// # Errors
/// If it cannot be made, or another user could open it.
fn folder() -> Result<PathBuf, String> {
    let user = Uid::effective().as_raw();
    let is_own = |path: &Path| path.is_absolute() && fs::metadata(path).is_ok_and(|found| found.uid() == user);
    let of_session = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from).filter(|path| is_own(path));
    let folder = match of_session {
        Some(session) => session.join("tactflow"),
        None => std::env::temp_dir().join(format!("tactflow-{user}")),
    };
    let made = DirBuilder::new().mode(FOLDER_MODE).create(&folder);
    if let Err(error) = made.or_else(|error| if error.kind() == ErrorKind::AlreadyExists { Ok(()) } else { Err(error) })
    {
        return Err(format!("cannot make the folder `{}`: {error}", folder.display()));
    }
    check(&folder, user)?;
    Ok(folder)
}

/// Checks that a folder is one, belongs to the user, and is closed to all others.
fn check(folder: &Path, user: u32) -> Result<(), String> {
    let name = folder.display();
    // A link could lead to the folder of another user.
    let found = fs::symlink_metadata(folder).map_err(|error| format!("cannot look at `{name}`: {error}"))?;
    if !found.is_dir() {
        return Err(format!("`{name}` is not a folder: remove it"));
    }
    if found.uid() != user {
        return Err(format!("`{name}` belongs to another user: set XDG_RUNTIME_DIR to a folder of your own"));
    }
    if found.mode() & 0o077 != 0 {
        return Err(format!("other users can open `{name}`: close it with `chmod 700 {name}`"));
    }
    Ok(())
}

/// Returns the sockets of the processes that live, each with the number of its process. Removes those that a dead
/// process has left.
///
/// # Errors
/// If the folder cannot be used.
pub(crate) fn sockets() -> Result<Vec<(u32, PathBuf)>, String> {
    let folder = folder()?;
    let entries = fs::read_dir(&folder).map_err(|error| format!("cannot read `{}`: {error}", folder.display()))?;
    let mut found = Vec::new();
    for path in entries.filter_map(|entry| Some(entry.ok()?.path())) {
        let name = path.file_name().and_then(|name| name.to_str());
        let Some(pid) = name.and_then(|name| name.strip_suffix(SOCKET_END)?.parse().ok()) else { continue };
        match UnixStream::connect(&path) {
            // A socket has its name only after it listens, so nobody listens any more.
            Err(error) if error.kind() == ErrorKind::ConnectionRefused => drop(fs::remove_file(&path)),
            _ => found.push((pid, path)),
        }
    }
    found.sort();
    Ok(found)
}

/// Opens the socket of this process, and removes those that dead processes have left.
///
/// # Errors
/// If it cannot be opened.
pub(super) fn bind() -> Result<(UnixListener, PathBuf), String> {
    sockets()?;
    let folder = folder()?;
    let pid = std::process::id();
    let (new, path) = (folder.join(format!("{pid}.new")), folder.join(format!("{pid}{SOCKET_END}")));
    // That of a dead process with the same number.
    let _ = fs::remove_file(&new);
    let bound = UnixListener::bind(&new).and_then(|listener| {
        fs::set_permissions(&new, PermissionsExt::from_mode(SOCKET_MODE))?;
        listener.set_nonblocking(true)?;
        fs::rename(&new, &path)?;
        Ok(listener)
    });
    let listener = bound.map_err(|error| format!("cannot open `{}`: {error}", path.display()))?;
    Ok((listener, path))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_that_others_can_open_is_refused() {
        let folder = std::env::temp_dir().join(format!("tactflow-folder-{}", std::process::id()));
        let user = Uid::effective().as_raw();
        DirBuilder::new().mode(FOLDER_MODE).create(&folder).expect("a folder");
        assert_eq!(check(&folder, user), Ok(()));
        assert!(check(&folder, user + 1).expect_err("not theirs").contains("belongs to another user"));
        for mode in [0o750, 0o701, 0o720] {
            fs::set_permissions(&folder, PermissionsExt::from_mode(mode)).expect("it is ours");
            assert!(check(&folder, user).expect_err("it is open").contains("chmod 700"), "{mode:o}");
        }
        let link = folder.with_extension("link");
        std::os::unix::fs::symlink(&folder, &link).expect("a link");
        assert!(check(&link, user).expect_err("a link").contains("is not a folder"));
        fs::remove_file(link).expect("it is ours");
        fs::remove_dir(folder).expect("it is ours");
    }
}
