//! Arrays and attributes of the file, new ones or those of an earlier process.

use super::RunInfo;
use super::collective::{Row, column_shape};
use hdf5::plist::dataset_create::{AllocTime, FillTime};
use hdf5::types::{H5Type, VarLenUnicode};
use hdf5::{Dataset, Extent, Group, Location, Result};
use std::str::FromStr;

/// What the file holds when `Frames` opens its groups and arrays.
pub(super) enum Ground<'a> {
    /// Nothing: all groups and arrays are created, for this run.
    New(&'a RunInfo),
    /// All groups and arrays, created by an earlier process.
    Found {
        /// Whether the file has columns for dissipated energy.
        energy: bool,
        /// Number of complete frames.
        complete: u64,
    },
}

impl Ground<'_> {
    pub(super) fn energy(&self) -> bool {
        match self {
            Ground::New(info) => info.energy,
            Ground::Found { energy, .. } => *energy,
        }
    }

    pub(super) fn group(&self, location: &Group, name: &str) -> Result<Group> {
        match self {
            Ground::New(_) => location.create_group(name),
            Ground::Found { .. } => location.group(name),
        }
    }

    /// An array that grows by rows; a chunk has `rows_per_chunk` of them.
    pub(super) fn array<R: Row>(&self, group: &Group, name: &str, rows_per_chunk: u64) -> Result<Dataset> {
        match self {
            Ground::New(_) => growing::<R::Number>(group, name, R::SHAPE, rows_per_chunk),
            Ground::Found { .. } => group.dataset(name),
        }
    }

    /// An array that grows by rows of `width` numbers.
    pub(super) fn column(
        &self,
        group: &Group,
        name: &str,
        width: usize,
        rows_per_chunk: u64,
    ) -> Result<Dataset> {
        match self {
            Ground::New(_) => growing::<f64>(group, name, column_shape(&width), rows_per_chunk),
            Ground::Found { .. } => group.dataset(name),
        }
    }
}

/// Makes an array `rows` long. An array of an earlier process may be longer already, and then stays so.
///
/// `shape` is that of a row.
pub(super) fn grow(array: &Dataset, rows: u64, shape: &[usize]) -> Result<()> {
    let rows = rows as usize;
    if array.shape().first().is_some_and(|&there| there >= rows) {
        return Ok(());
    }
    array.resize([&[rows], shape].concat())
}

/// Creates an empty array that grows by rows of this `shape`.
pub(super) fn growing<N: H5Type>(
    group: &Group,
    name: &str,
    shape: &[usize],
    rows_per_chunk: u64,
) -> Result<Dataset> {
    let extents: Vec<Extent> =
        [vec![Extent::resizable(0)], shape.iter().map(|&n| Extent::fixed(n)).collect()].concat();
    let chunk = [&[rows_per_chunk as usize], shape].concat();
    let builder = group.new_dataset::<N>().obj_track_times(false).fill_time(FillTime::Never);
    // Parallel HDF5 allocates early. A serial file must do the same, or its new chunks have no address when
    // several ranks go on with it.
    let builder = builder.alloc_time(Some(AllocTime::Early));
    // Nothing is read back. Without a cache, HDF5 writes chunks directly from the memory of the caller.
    builder.shape(extents).chunk(chunk).chunk_cache(1, 0, 1.0).create(name)
}

/// Creates an array with a fixed number of rows.
pub(super) fn fixed<R: Row>(group: &Group, name: &str, rows: u64) -> Result<Dataset> {
    fixed_rows::<R::Number>(group, name, rows, R::SHAPE)
}

/// Creates an array with a fixed number of rows of this `shape`.
pub(super) fn fixed_rows<N: H5Type>(
    group: &Group,
    name: &str,
    rows: u64,
    shape: &[usize],
) -> Result<Dataset> {
    let builder = group.new_dataset::<N>().obj_track_times(false).fill_time(FillTime::Never);
    builder.no_chunk().shape([&[rows as usize], shape].concat()).create(name)
}

pub(super) fn set_new<T: H5Type>(location: &Location, name: &str, value: T) -> Result<()> {
    location.new_attr::<T>().create(name)?.write_scalar(&value)
}

pub(super) fn set_new_text(location: &Location, name: &str, text: &str) -> Result<()> {
    let value = VarLenUnicode::from_str(text).map_err(|why| format!("attribute {name}: {why}"))?;
    set_new(location, name, value)
}

pub(super) fn set<T: H5Type>(location: &Location, name: &str, value: T) -> Result<()> {
    location.attr(name)?.write_scalar(&value)
}
