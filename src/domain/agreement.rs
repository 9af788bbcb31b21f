//! Agreement between ranks. If one rank fails, all ranks end together and one of them prints the reason.

use crate::domain::{Comm, launch};
use crate::error::Error;

/// Calls `make` on rank 0 and returns its text on every rank. Collective.
///
/// If `make` fails, every rank gets its message as [`Error::Input`].
///
/// # Examples
///
/// ```rust
/// use demhybrid::domain::Solo;
/// use demhybrid::domain::agreement::share;
/// use demhybrid::error::Error;
///
/// assert_eq!(share(&Solo, || Ok("text of rank 0".to_owned())), Ok("text of rank 0".to_owned()));
/// let failed = share(&Solo, || Err(Error::Input("no such file".to_owned())));
/// assert_eq!(failed, Err(Error::Input("no such file".to_owned())));
/// ```
pub fn share(comm: &dyn Comm, make: impl FnOnce() -> Result<String, Error>) -> Result<String, Error> {
    let mut bytes = Vec::new();
    if comm.rank() == 0 {
        let (flag, text) = match make() {
            Ok(text) => (0, text),
            Err(why) => (1, why.to_string()),
        };
        bytes.push(flag);
        bytes.extend_from_slice(text.as_bytes());
    }
    comm.broadcast(&mut bytes);
    let text = String::from_utf8_lossy(&bytes[1..]).into_owned();
    if bytes[0] == 0 { Ok(text) } else { Err(Error::Input(text)) }
}

/// Calls `write` on rank 0 only. Collective.
///
/// If it fails, rank 0 gets the error and the other ranks get [`Error::Elsewhere`].
pub fn write_on_rank_0(comm: &dyn Comm, write: impl FnOnce() -> Result<(), Error>) -> Result<(), Error> {
    let mut written = Ok(());
    let failed = share(comm, || {
        written = write();
        Ok(if written.is_err() { "failed".to_owned() } else { String::new() })
    })?;
    match (failed.is_empty(), written) {
        (false, Ok(())) => Err(Error::Elsewhere { code: 4 }),
        (_, written) => written,
    }
}

/// Makes every rank fail if one rank fails; otherwise returns each rank's own value. Collective.
///
/// The lowest rank that failed reports its error, and all ranks return the exit code of that error. Rank 0
/// reports by returning the error. Another rank prints it and, like all the others, returns
/// [`Error::Elsewhere`].
pub fn agree<T>(comm: &dyn Comm, own: Result<T, Error>) -> Result<T, Error> {
    let rank = comm.rank() as f64;
    let failed = |why: &Error| [-rank, f64::from(why.exit_code())];
    let mut first = own.as_ref().err().map_or([f64::NEG_INFINITY, 0.0], failed);
    comm.max(&mut first);
    match own {
        own if first[0] == f64::NEG_INFINITY => own,
        Err(why) if first[0] == -rank => {
            if comm.rank() == 0 {
                return Err(why);
            }
            launch::say(&format!("demhybrid: error on rank {rank}: {why}"));
            Err(Error::Elsewhere { code: why.exit_code() })
        }
        _ => Err(Error::Elsewhere { code: first[1] as i32 }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::comm::team::team;

    #[test]
    fn a_failure_that_only_one_rank_meets_ends_all() {
        for failing in 0..3 {
            team(3, |comm| {
                let mistake = Error::Input("too little of something".into());
                let own = if comm.rank() == failing { Err(mistake.clone()) } else { Ok(comm.rank()) };
                let agreed = agree(comm, own);
                // Rank 0 returns its own error, which the program prints at its end.
                let tells_later = failing == 0 && comm.rank() == 0;
                assert_eq!(agreed, Err(if tells_later { mistake } else { Error::Elsewhere { code: 2 } }));
            });
        }
        team(3, |comm| assert_eq!(agree(comm, Ok(comm.rank())), Ok(comm.rank())));
    }
}
