//! Calls to HDF5 below its Rust interface, above all collective writes, in which all ranks take part at once.
//!
//! The safe interface can only write rank by rank. All `unsafe` code of the output is here and in mpio.rs,
//! and has one reason: it calls functions of the C library that the crate does not wrap.
#![allow(unsafe_code)]

use std::ffi::{c_int, c_void};

use hdf5::types::H5Type;
use hdf5::{Dataset, Dataspace, Datatype, File, PropertyList, Result, h5check};
use hdf5_sys::h5d::H5Dwrite;
use hdf5_sys::h5i::hid_t;
use hdf5_sys::h5p::{H5P_CLS_DATASET_XFER, H5Pcreate};
use hdf5_sys::h5s::{H5S_seloper_t, H5Sselect_hyperslab, H5Sselect_none};

use super::mpio;
use crate::domain::world::Communicator;

// hdf5-metno-sys does not declare this function, which exists since HDF5 1.10.2.
unsafe extern "C" {
    fn H5Fincrement_filesize(file: hid_t, bytes: u64) -> c_int;
}

/// Makes HDF5 put new data of `file` at least `bytes` beyond the end of the file on the disk.
///
/// The end that HDF5 itself assumes may come earlier. The file must be open through the serial driver.
pub fn begin_behind_the_end(file: &File, bytes: u64) -> Result<()> {
    hdf5::sync::sync(|| {
        // SAFETY: the file is open for writing; the call only moves the end of what is allocated.
        h5check(unsafe { H5Fincrement_filesize(file.id(), bytes) })
    })?;
    Ok(())
}

/// One row of a dataset: one number or a few.
///
/// # Safety
/// A value must be exactly as many `Number`s as the product of `SHAPE`, in C order and without padding.
pub unsafe trait Row: Copy {
    /// Type of the numbers, in memory and in the file.
    type Number: H5Type;
    /// Shape of one row; empty for a single number.
    const SHAPE: &'static [usize];
}

// SAFETY: one number.
unsafe impl Row for f64 {
    type Number = f64;
    const SHAPE: &'static [usize] = &[];
}

// SAFETY: one number.
unsafe impl Row for i64 {
    type Number = i64;
    const SHAPE: &'static [usize] = &[];
}

// SAFETY: arrays of numbers have no padding.
unsafe impl<const W: usize> Row for [f64; W] {
    type Number = f64;
    const SHAPE: &'static [usize] = &[W];
}

// SAFETY: arrays of numbers have no padding.
unsafe impl<const W: usize> Row for [i64; W] {
    type Number = i64;
    const SHAPE: &'static [usize] = &[W];
}

/// How rows are written to the file: by all ranks together, or by one rank alone.
pub struct Transfer {
    together: PropertyList,
    alone: PropertyList,
    communicator: Option<Communicator>,
}

impl Transfer {
    /// For a file that is open through MPI-IO on the ranks of `communicator`.
    ///
    /// Without a communicator, both ways to write are the same plain write.
    pub fn new(communicator: Option<Communicator>) -> Result<Self> {
        let (together, alone) = (transfer_list()?, transfer_list()?);
        if let Some(communicator) = communicator {
            mpio::write_collectively(&together, communicator)?;
        }
        Ok(Transfer { together, alone, communicator })
    }

    /// Whether the file is open through MPI-IO.
    pub fn is_parallel(&self) -> bool {
        self.communicator.is_some()
    }

    /// Writes this rank's `rows`, possibly none, to `dataset` from row `first` on. Collective.
    ///
    /// The dataset must be long enough already.
    pub fn write_together<R: Row>(&self, dataset: &Dataset, first: u64, rows: &[R]) -> Result<()> {
        write(&self.together, dataset, first, rows)
    }

    /// Writes this rank's rows of a column, possibly none, to the `place` in `dataset`. Collective.
    ///
    /// A row has `width` numbers; the dataset has the shape that [`column_shape`] states.
    pub fn write_column(
        &self,
        dataset: &Dataset,
        place: &Place,
        width: usize,
        numbers: &[f64],
    ) -> Result<()> {
        let rows = Memory { rows: numbers.len() / width, shape: column_shape(&width), numbers };
        write_rows(&self.together, dataset, place, &rows)
    }

    /// Writes `rows` to `dataset` from row `first` on. One rank alone calls this.
    ///
    /// It is for small arrays, which one rank holds. The space must be allocated already. MPI-IO files
    /// allocate it when a dataset is created or extended.
    pub fn write_alone<R: Row>(&self, dataset: &Dataset, first: u64, rows: &[R]) -> Result<()> {
        write(&self.alone, dataset, first, rows)
    }

    /// Writes a text to a scalar dataset of fixed-length strings of `text.len()` bytes. One rank calls this.
    pub fn write_text(&self, dataset: &Dataset, text: &str) -> Result<()> {
        let (kind, space) = (dataset.dtype()?, dataset.space()?);
        debug_assert_eq!(kind.size(), text.len(), "the string type holds the text exactly");
        hdf5::sync::sync(|| {
            // SAFETY: memory and file type are the same string type of `text.len()` bytes, and the space has
            // one element.
            h5check(unsafe {
                H5Dwrite(
                    dataset.id(),
                    kind.id(),
                    space.id(),
                    space.id(),
                    self.alone.id(),
                    text.as_ptr().cast::<c_void>(),
                )
            })
        })?;
        Ok(())
    }

    /// How HDF5 made the last `write_together`. It may fall back to independent writes without an error.
    pub fn report(&self) -> Result<String> {
        match self.communicator {
            None => Ok("serial".to_string()),
            Some(communicator) => mpio::report(&self.together, communicator),
        }
    }
}

fn transfer_list() -> Result<PropertyList> {
    // SAFETY: the identifier is new and nobody else holds it. It goes to the one owner that closes it.
    hdf5::sync::sync(|| unsafe { hdf5::from_id(h5check(H5Pcreate(*H5P_CLS_DATASET_XFER))?) })
}

/// Where rows belong in a dataset: in blocks of equal length at equal distances.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    /// First row of the first block.
    pub first: u64,
    /// From the first row of a block to that of the next one, rows; not less than a block.
    pub stride: u64,
    /// Number of blocks, at least 1.
    pub blocks: u64,
}

impl Place {
    /// All rows one after the other, from row `first` on.
    pub fn from_row(first: u64) -> Self {
        Place { first, stride: 1, blocks: 1 }
    }
}

/// Shape of one row of a column of this `width`: a plain number has none.
pub fn column_shape(width: &usize) -> &[usize] {
    if *width == 1 { &[] } else { std::slice::from_ref(width) }
}

/// Rows in memory, as numbers of type `N`.
struct Memory<'a, N> {
    rows: usize,
    /// Shape of one row.
    shape: &'a [usize],
    numbers: &'a [N],
}

fn write<R: Row>(list: &PropertyList, dataset: &Dataset, first: u64, rows: &[R]) -> Result<()> {
    let count = rows.len() * R::SHAPE.iter().product::<usize>();
    // SAFETY: a row is exactly as many numbers as the product of its shape, without padding.
    let numbers = unsafe { std::slice::from_raw_parts(rows.as_ptr().cast::<R::Number>(), count) };
    let rows = Memory { rows: rows.len(), shape: R::SHAPE, numbers };
    write_rows(list, dataset, &Place::from_row(first), &rows)
}

fn write_rows<N: H5Type>(
    list: &PropertyList,
    dataset: &Dataset,
    place: &Place,
    memory: &Memory<N>,
) -> Result<()> {
    let &Memory { rows, shape, numbers } = memory;
    // The memory space has the shape of the block in the file, because HDF5 is much slower with a flat one. A
    // rank without rows takes part with two empty selections. Its memory space has one unselected row.
    let extent = [&[rows.max(1)], shape].concat();
    let in_memory = Dataspace::try_new(&extent[..])?;
    let in_file = dataset.space()?;
    let number = Datatype::from_type::<N>()?;
    let (mut start, mut stride, mut count) =
        (vec![0; extent.len()], vec![1; extent.len()], vec![1; extent.len()]);
    (start[0], stride[0], count[0]) = (place.first, place.stride, place.blocks);
    let mut block: Vec<u64> = extent.iter().map(|&n| n as u64).collect();
    block[0] /= place.blocks;
    // Blocks that touch are one block: HDF5 is faster with that.
    if block[0] == place.stride {
        (block[0], count[0]) = (extent[0] as u64, 1);
    }
    let fits = in_file.ndim() == start.len() && numbers.len() == rows * shape.iter().product::<usize>();
    if !fits || !(rows as u64).is_multiple_of(place.blocks) {
        return Err("an array of the file has another shape than its rows".into());
    }
    // SAFETY: `start`, `stride`, `count` and `block` have one entry per dimension. The memory space holds
    // exactly the numbers of `rows` rows, or nothing is selected in it.
    hdf5::sync::sync(|| unsafe {
        if rows == 0 {
            h5check(H5Sselect_none(in_memory.id()))?;
            h5check(H5Sselect_none(in_file.id()))?;
        } else {
            h5check(H5Sselect_hyperslab(
                in_file.id(),
                H5S_seloper_t::H5S_SELECT_SET,
                start.as_ptr(),
                stride.as_ptr(),
                count.as_ptr(),
                block.as_ptr(),
            ))?;
        }
        h5check(H5Dwrite(
            dataset.id(),
            number.id(),
            in_memory.id(),
            in_file.id(),
            list.id(),
            numbers.as_ptr().cast::<c_void>(),
        ))
    })?;
    Ok(())
}
