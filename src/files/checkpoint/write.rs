//! Writes checkpoints: every rank writes its block of rows, and rank 0 writes the rest.

use super::file::{self, Layout, PIECE};
use super::{Header, unfinished};
use crate::domain::Comm;
use crate::domain::agreement::agree;
use crate::domain::rows::{self, ById};
use crate::engine::simulation::Snapshot;
use crate::error::Error;
use crc32fast::Hasher;
use std::fs::{self, File};
use std::io;
use std::ops::Range;
use std::os::unix::fs::FileExt;
use std::path::Path;

/// Writes the run that `header` and `snapshot` describe to `path`. Collective.
///
/// `path` is the same on every rank. The file gets this name only when it is complete and on the disk. Then
/// it replaces the earlier file.
pub fn write(comm: &dyn Comm, path: &Path, header: &Header, snapshot: &Snapshot) -> Result<(), Error> {
    let mut processes = vec![0.0; comm.size()];
    comm.all_gather(&[f64::from(std::process::id())], &mut processes);
    let unfinished = unfinished(path, processes[0] as u32);
    let encoded = postcard::to_stdvec(header).expect("a header holds numbers and texts");
    let parts = comm.size() as u64;
    let layout = Layout::new(header, encoded.len() as u64, parts);
    let created = if comm.rank() == 0 { create(&unfinished, &encoded, &layout) } else { Ok(()) };
    let created = agree(comm, created.map_err(|why| failure(path, &why)));
    let written = created.and_then(|()| fill(comm, path, &unfinished, &layout, snapshot));
    if written.is_err() && comm.rank() == 0 {
        // If the removal fails too, the next run removes the file.
        let _ = fs::remove_file(&unfinished);
    }
    written
}

fn failure(path: &Path, why: &io::Error) -> Error {
    Error::Checkpoint { file: path.display().to_string(), why: why.to_string() }
}

/// Writes everything after the header, and gives the file its name. Collective.
fn fill(
    comm: &dyn Comm,
    path: &Path,
    unfinished: &Path,
    layout: &Layout,
    snapshot: &Snapshot,
) -> Result<(), Error> {
    let failure = |why: io::Error| failure(path, &why);
    let rows = rows::block(snapshot.count, comm.rank(), comm.size());
    let written = write_block(comm, unfinished, layout, &rows, snapshot);
    let checksum = agree(comm, written.map_err(failure))?;
    let mut checksums = vec![0.0; comm.size()];
    comm.all_gather(&[f64::from(checksum)], &mut checksums);
    let finished = if comm.rank() == 0 {
        let part = |(rank, &sum): (usize, &f64)| (rows::block(snapshot.count, rank, comm.size()), sum as u32);
        let table = file::table(&checksums.iter().enumerate().map(part).collect::<Vec<_>>());
        finish(unfinished, path, layout, &table)
    } else {
        Ok(())
    };
    agree(comm, finished.map_err(failure))
}

/// Creates the unfinished file with its full length, and writes the header.
fn create(path: &Path, header: &[u8], layout: &Layout) -> io::Result<()> {
    let file = File::create(path)?;
    file.set_len(layout.length())?;
    file.write_all_at(&file::head(header, layout.parts), 0)?;
    Ok(())
}

/// Writes the table, flushes the file to the disk and gives it its name.
fn finish(unfinished: &Path, path: &Path, layout: &Layout, table: &[u8]) -> io::Result<()> {
    fail::fail_point!("checkpoint", |_| Err(io::Error::other("a fail point")));
    let file = File::options().write(true).open(unfinished)?;
    file.write_all_at(table, layout.table())?;
    file.sync_all()?;
    fs::rename(unfinished, path)?;
    // The name is on the disk only when the folder is. Some file systems cannot flush folders: ignore errors.
    if let Some(folder) = path.parent().and_then(|folder| File::open(folder).ok()) {
        let _ = folder.sync_all();
    }
    Ok(())
}

/// Writes this rank's rows of all columns to the disk, and returns their checksum. Collective.
///
/// A rank that cannot write to the file still takes part in every collective call.
fn write_block(
    comm: &dyn Comm,
    path: &Path,
    layout: &Layout,
    rows: &Range<u64>,
    snapshot: &Snapshot,
) -> io::Result<u32> {
    let origin: Vec<f64> = snapshot.origin.iter().flatten().copied().collect();
    let Snapshot { state, constants, slope, direction, contacts, .. } = *snapshot;
    let tables = [state, constants, &origin, slope, direction, contacts];
    let mut file = File::options().write(true).open(path);
    let mut hasher = Hasher::new();
    for (k, table) in tables.into_iter().enumerate() {
        let width = layout.widths[k] as usize;
        if width == 0 {
            continue;
        }
        let by_id = ById::new(comm, snapshot.count, snapshot.ids, table, width);
        file = file.and_then(|file| {
            let start = layout.place(k, rows).start;
            write_rows(&file, (start, width), &by_id, &mut hasher)?;
            Ok(file)
        });
    }
    file.and_then(|file| file.sync_data())?;
    Ok(hasher.finalize())
}

/// Writes rows of `width` numbers from byte `start` on.
fn write_rows(
    file: &File,
    (mut start, width): (u64, usize),
    by_id: &ById,
    hasher: &mut Hasher,
) -> io::Result<()> {
    let mut piece = Vec::with_capacity(PIECE + 8 * width);
    let mut pour = |piece: &mut Vec<u8>| {
        file.write_all_at(piece, start)?;
        hasher.update(piece);
        start += piece.len() as u64;
        piece.clear();
        Ok(())
    };
    for row in by_id.iter() {
        piece.extend(row.iter().flat_map(|number| number.to_le_bytes()));
        if piece.len() >= PIECE {
            pour(&mut piece)?;
        }
    }
    pour(&mut piece)
}
