//! What goes to stdout: it arrives there, or the program says that it did not.
#![allow(unsafe_code)] // to look at stdout before `main`: see `BEFORE_MAIN`

use std::io::{self, ErrorKind, Write};
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::Error;

/// Whether stdout was closed when the process began.
static CLOSED: AtomicBool = AtomicBool::new(false);

/// The system calls this before `main`. There Rust opens /dev/null in the place of a closed stdout, and
/// whatever is printed seems to arrive.
// SAFETY: a function without arguments is what the section holds. It makes one system call and sets one
// flag, and needs nothing that `main` has to prepare.
#[cfg(target_os = "linux")]
#[used]
#[unsafe(link_section = ".init_array")]
static BEFORE_MAIN: extern "C" fn() = {
    extern "C" fn look() {
        let closed = rustix::io::fcntl_getfd(rustix::stdio::stdout()).is_err();
        CLOSED.store(closed, Ordering::Relaxed);
    }
    look
};

/// Prints a text that others read as it comes. A reader that has gone, such as `head`, has what it wanted.
///
/// If the text does not arrive, the error adds `kept`: what there is all the same.
pub fn print(text: &str, kept: &str) -> Result<(), Error> {
    print_by(|| io::stdout().write_all(text.as_bytes()), kept)
}

/// The same with something that writes to stdout by itself.
pub fn print_by(write: impl FnOnce() -> io::Result<()>, kept: &str) -> Result<(), Error> {
    unless_reader_has_gone(arrive(write)).map_err(|why| failure(&why, kept))
}

/// Prints a text that somebody waits for. A reader that has gone is an error as well.
pub fn deliver(text: &str, kept: &str) -> Result<(), Error> {
    arrive(|| io::stdout().write_all(text.as_bytes())).map_err(|why| failure(&why, kept))
}

/// Takes a pipe whose reader has gone for success.
pub fn unless_reader_has_gone(written: io::Result<()>) -> io::Result<()> {
    match written {
        Err(why) if why.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => written,
    }
}

fn arrive(write: impl FnOnce() -> io::Result<()>) -> io::Result<()> {
    if CLOSED.load(Ordering::Relaxed) {
        return Err(io::Error::other("it is closed"));
    }
    // Lines are buffered: the flush brings what follows the last one, and its error.
    write().and_then(|()| io::stdout().flush())
}

fn failure(why: &io::Error, kept: &str) -> Error {
    Error::Print { why: why.to_string(), kept: kept.to_string() }
}
