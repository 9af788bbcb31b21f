//! The one place that talks to HDF5 below its Rust interface: writes in which all ranks take part at once.
//!
//! The safe interface can only write rank by rank. Everything unsafe of the output is in this file, and all of it
//! has the same reason: functions of the C library that the crate does not wrap.
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

// Not in hdf5-metno-sys; since HDF5 1.10.2.
unsafe extern "C" {
    fn H5Fincrement_filesize(file: hid_t, bytes: u64) -> c_int;
}

/// Has new parts of `file`, open through the serial driver, begin `bytes` behind its end on the disk, wherever it takes its
/// own end to be.
pub fn begin_behind_the_end(file: &File, bytes: u64) -> Result<()> {
    hdf5::sync::sync(|| {
        // SAFETY: the file is open for writing; the call only moves the end of what is allocated.
        h5check(unsafe { H5Fincrement_filesize(file.id(), bytes) })
    })?;
    Ok(())
}

/// What one row of a dataset is made of: one number or a few.
///
/// # Safety
/// A value must be exactly as many `Number`s as the product of `SHAPE`, in C order and without padding.
pub unsafe trait Row: Copy {
    /// The number in memory and in the file.
    type Number: H5Type;
    /// Shape of the dataset beyond its rows: empty for one number.
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

/// How rows travel from memory to the file: through all ranks together, or through one of them alone.
pub struct Transfer {
    together: PropertyList,
    alone: PropertyList,
    communicator: Option<Communicator>,
}

impl Transfer {
    /// `communicator`: of the ranks on which the file is open through MPI-IO. Without, both ways are the same plain write.
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

    /// Collective. Writes this rank's `rows`, possibly none, to `dataset` from row `first` on. The dataset must
    /// already be long enough.
    pub fn write_together<R: Row>(&self, dataset: &Dataset, first: u64, rows: &[R]) -> Result<()> {
        write(&self.together, dataset, first, rows)
    }

    /// Writes `rows` to `dataset` from row `first` on. For small arrays that one rank holds; that rank alone calls it.
    /// The space must have been allocated, which MPI-IO files do when a dataset is created or extended.
    pub fn write_alone<R: Row>(&self, dataset: &Dataset, first: u64, rows: &[R]) -> Result<()> {
        write(&self.alone, dataset, first, rows)
    }

    /// Writes a text to a scalar dataset of fixed-length strings of `text.len()` bytes. One rank alone calls it.
    pub fn write_text(&self, dataset: &Dataset, text: &str) -> Result<()> {
        let (kind, space) = (dataset.dtype()?, dataset.space()?);
        debug_assert_eq!(kind.size(), text.len(), "the string type holds the text exactly");
        hdf5::sync::sync(|| {
            // SAFETY: memory and file type are the same string type of `text.len()` bytes, and the space has one element.
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

    /// How HDF5 really made the last `write_together`: it may fall back to independent writes without an error.
    pub fn report(&self) -> Result<String> {
        match self.communicator {
            None => Ok("serial".to_string()),
            Some(communicator) => mpio::report(&self.together, communicator),
        }
    }
}

fn transfer_list() -> Result<PropertyList> {
    // SAFETY: a fresh identifier that nobody else holds goes to the one owner that closes it.
    hdf5::sync::sync(|| unsafe { hdf5::from_id(h5check(H5Pcreate(*H5P_CLS_DATASET_XFER))?) })
}

fn write<R: Row>(list: &PropertyList, dataset: &Dataset, first: u64, rows: &[R]) -> Result<()> {
    // The memory space has the shape of the block in the file: a flat one was 8 times slower. A rank without rows
    // takes part with two empty selections, of one row that does not count.
    let shape = |rows: usize| -> Vec<usize> { [&[rows.max(1)], R::SHAPE].concat() };
    let in_memory = Dataspace::try_new(shape(rows.len()))?;
    let in_file = dataset.space()?;
    let number = Datatype::from_type::<R::Number>()?;
    let mut start = vec![0; 1 + R::SHAPE.len()];
    start[0] = first;
    let block: Vec<u64> = shape(rows.len()).iter().map(|&n| n as u64).collect();
    debug_assert_eq!(in_file.ndim(), start.len(), "rows have the shape of the dataset");
    // SAFETY: `start` and `block` have one entry per dimension; a null stride and block mean 1. The memory space holds
    // exactly the numbers of `rows`, an array of `R::Number` without padding, or nothing is selected in it.
    hdf5::sync::sync(|| unsafe {
        if rows.is_empty() {
            h5check(H5Sselect_none(in_memory.id()))?;
            h5check(H5Sselect_none(in_file.id()))?;
        } else {
            h5check(H5Sselect_hyperslab(
                in_file.id(),
                H5S_seloper_t::H5S_SELECT_SET,
                start.as_ptr(),
                std::ptr::null(),
                block.as_ptr(),
                std::ptr::null(),
            ))?;
        }
        h5check(H5Dwrite(
            dataset.id(),
            number.id(),
            in_memory.id(),
            in_file.id(),
            list.id(),
            rows.as_ptr().cast::<c_void>(),
        ))
    })?;
    Ok(())
}
