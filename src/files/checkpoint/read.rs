//! Reads checkpoints: checks whether a file is usable, and reads its particles.

use super::file::{self, LONGEST_HEADER, Layout, MARK, PART, PIECE, PREAMBLE};
use super::{FORMAT, Header};
use crate::domain::agreement::agree;
use crate::domain::{Comm, rows};
use crate::engine::simulation::Remembered;
use crate::error::Error;
use crc32fast::Hasher;
use std::fs::{self, File};
use std::io;
use std::ops::Range;
use std::os::unix::fs::FileExt;
use std::path::Path;

/// The header of the checkpoint `path`, or what is wrong with the file; none if there is no such file.
///
/// Checks the header and the length of the file. [`verify`] checks the rest.
pub fn look(path: &Path) -> Option<Result<Header, String>> {
    // Only a regular file can be a checkpoint. Opening a pipe would block.
    let opened = fs::metadata(path).and_then(|found| match found.is_file() {
        true => File::open(path),
        false => Err(io::Error::other("it is not a regular file")),
    });
    match opened {
        Err(why) if why.kind() == io::ErrorKind::NotFound => None,
        Err(why) => Some(Err(format!("{}: {why}", path.display()))),
        Ok(file) => Some(head(&file).map(|(header, _)| header).map_err(|why| complaint(path, &why))),
    }
}

/// Compares every part of `path` with its checksum. Collective.
///
/// The ranks share out the parts. If one rank finds a fault, all ranks return an error.
pub fn verify(comm: &dyn Comm, path: &Path) -> Result<(), String> {
    let own = || {
        let file = File::open(path).map_err(|why| why.to_string())?;
        let (_, layout) = head(&file)?;
        wrong_part(&file, &layout, comm.rank(), comm.size())
    };
    // The rows of a part that is wrong, or why this rank cannot check its parts.
    let found: Result<Option<Range<u64>>, String> = own();
    let mark = match &found {
        Ok(None) => f64::NEG_INFINITY,
        Ok(Some(rows)) => -(rows.start as f64),
        Err(_) => f64::INFINITY,
    };
    let mut all = [mark];
    comm.max(&mut all);
    match (all[0], found) {
        (f64::NEG_INFINITY, _) => Ok(()),
        (f64::INFINITY, Err(why)) => Err(complaint(path, &why)),
        (f64::INFINITY, _) => Err(complaint(path, "a rank cannot read it")),
        (first, _) => {
            Err(complaint(path, &format!("particles from {} on do not match their checksum", -first)))
        }
    }
}

/// Reads the checkpoint `path`, which [`verify`] has accepted. Collective.
///
/// Returns the header and the particles of this rank's block of ids.
pub fn read(comm: &dyn Comm, path: &Path) -> Result<(Header, Remembered), Error> {
    let read = || {
        let file = File::open(path).map_err(|why| why.to_string())?;
        let (header, layout) = head(&file)?;
        let own = rows::block(header.count, comm.rank(), comm.size());
        let table = |k: usize| table(&file, &layout, k, &own).map_err(|why| why.to_string());
        let remembered = Remembered {
            memory: header.memory,
            state: table(0)?,
            constants: table(1)?,
            origin: table(2)?,
            slope: table(3)?,
            direction: table(4)?,
            contact_slots: header.contact_slots,
            contacts: table(5)?,
        };
        Ok((header, remembered))
    };
    agree(comm, read().map_err(|why: String| Error::Input(complaint(path, &why))))
}

/// Largest number of parts that a file may have: every rank that wrote it wrote one part.
const MOST_PARTS: u64 = 1 << 20;

fn complaint(path: &Path, why: &str) -> String {
    format!("{} is not a checkpoint that can be used: {why}", path.display())
}

/// Reads and checks the header of a file, and checks the length of the file.
fn head(file: &File) -> Result<(Header, Layout), String> {
    let there = file.metadata().map_err(|why| why.to_string())?.len();
    let mut preamble = [0; PREAMBLE as usize];
    file.read_exact_at(&mut preamble, 0).map_err(|_| format!("it has only {there} bytes"))?;
    if preamble[..16] != MARK {
        return Err("it does not begin like one".into());
    }
    let format = file::half(&preamble, 16);
    if format != FORMAT {
        return Err(format!(
            "it has the format {format}, and this program reads {FORMAT}: the version of demhybrid that \
             wrote it can resume the run, or the scene can be run again from its start with --force"
        ));
    }
    let (length, parts) = (file::word(&preamble, 24), file::word(&preamble, 32));
    if length > LONGEST_HEADER.min(there) {
        return Err(format!("it is cut off: a head of {length} bytes in a file of {there}"));
    }
    let mut encoded = vec![0; length as usize];
    file.read_exact_at(&mut encoded, PREAMBLE).map_err(|why| why.to_string())?;
    if crc32fast::hash(&encoded) != file::half(&preamble, 20) {
        return Err("its head does not match its checksum".into());
    }
    let header: Header =
        postcard::from_bytes(&encoded).map_err(|why| format!("its head is not readable: {why}"))?;
    // Every particle takes at least 48 bytes. With a larger count, the sums below could overflow.
    if header.count > there / 48 || parts > (there / PART).min(MOST_PARTS) {
        return Err(format!("it is cut off: {} particles in a file of {there} bytes", header.count));
    }
    // Every contact takes at least 32 bytes of every particle.
    let [slots, numbers] = header.contact_slots;
    if slots > there / 32 || numbers > there / 8 {
        return Err(format!("it is cut off: {slots} contacts a particle, each with {numbers} numbers"));
    }
    let layout = Layout::new(&header, length, parts);
    if layout.length() != there {
        return Err(format!("it has {there} bytes in place of {}", layout.length()));
    }
    Ok((header, layout))
}

/// The rows of the first part that does not match its checksum, among the parts that this rank checks.
///
/// Rank `rank` checks every `size`-th part.
fn wrong_part(file: &File, layout: &Layout, rank: usize, size: usize) -> Result<Option<Range<u64>>, String> {
    let mut table = vec![0; (layout.length() - layout.table()) as usize];
    file.read_exact_at(&mut table, layout.table()).map_err(|why| why.to_string())?;
    let (lines, checksum) = table.split_at(table.len() - 4);
    if crc32fast::hash(lines) != file::half(checksum, 0) {
        return Err("its table of parts does not match its checksum".into());
    }
    let (mut next, mut wrong) = (0, None);
    for (k, line) in lines.chunks_exact(PART as usize).enumerate() {
        let (first, rows) = (file::word(line, 0), file::word(line, 8));
        if first != next || rows > layout.count - first {
            return Err(format!("its parts do not follow one another: {rows} rows from {first} on"));
        }
        next += rows;
        if k % size == rank && wrong.is_none() {
            let found = sum(file, layout, &(first..next)).map_err(|why| why.to_string())?;
            wrong = (found != file::half(line, 16)).then_some(first..next);
        }
    }
    if next == layout.count { Ok(wrong) } else { Err(format!("its parts end at particle {next}")) }
}

/// The checksum of the rows `rows` in all columns.
fn sum(file: &File, layout: &Layout, rows: &Range<u64>) -> io::Result<u32> {
    let (mut hasher, mut piece) = (Hasher::new(), Vec::new());
    for k in 0..layout.widths.len() {
        let Range { mut start, end } = layout.place(k, rows);
        while start < end {
            piece.resize((end - start).min(PIECE as u64) as usize, 0);
            file.read_exact_at(&mut piece, start)?;
            hasher.update(&piece);
            start += piece.len() as u64;
        }
    }
    Ok(hasher.finalize())
}

/// The rows `rows` of table `k`; empty if the file does not have it.
fn table(file: &File, layout: &Layout, k: usize, rows: &Range<u64>) -> io::Result<Vec<f64>> {
    let Range { mut start, end } = layout.place(k, rows);
    let mut numbers = Vec::with_capacity(((end - start) / 8) as usize);
    let mut piece = Vec::new();
    while start < end {
        piece.resize((end - start).min(PIECE as u64) as usize, 0);
        file.read_exact_at(&mut piece, start)?;
        start += piece.len() as u64;
        numbers.extend(piece.chunks_exact(8).map(|bytes| f64::from_bits(file::word(bytes, 0))));
    }
    Ok(numbers)
}
