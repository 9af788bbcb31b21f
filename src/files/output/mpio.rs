//! What only parallel HDF5 has: files that all ranks open together, and collective writes.
//!
//! This file is part of the build with the feature `mpi`. Without that feature serial.rs replaces it.
//!
//! The `unsafe` code has the same reason as in collective.rs.
#![allow(unsafe_code)]

use std::ffi::c_int;

use hdf5::plist::file_access::{FileAccess, MetadataWriteStrategy};
use hdf5::{FileBuilder, PropertyList, Result, h5check};
use hdf5_sys::h5i::hid_t;
use hdf5_sys::h5p::{H5FD_mpio_xfer_t, H5Pset_dxpl_mpio};

use crate::domain::world::Communicator;

// hdf5-metno-sys does not declare these functions. The mode is an enumeration in C. Here it is an int,
// because a later library may return a value that the enumeration does not have today.
unsafe extern "C" {
    fn H5Pget_mpio_actual_io_mode(list: hid_t, mode: *mut c_int) -> c_int;
    fn H5Pget_mpio_no_collective_cause(list: hid_t, local: *mut u32, global: *mut u32) -> c_int;
}

/// Lets all ranks of `communicator` open one file.
pub fn open_together(options: &mut FileBuilder, communicator: Communicator) -> Result<()> {
    // One rank writes all metadata. By default all ranks share this work. If one of them is then killed a
    // little before the others, the file may hold half of an update.
    let mut cache = FileAccess::try_new()?.get_mdc_config()?;
    cache.metadata_write_strategy = MetadataWriteStrategy::ProcessZeroOnly;
    options.with_fapl(|access| access.mpio(communicator, None).mdc_config(&cache));
    Ok(())
}

/// Sets `list` to collective writes, in which all ranks take part.
pub fn write_collectively(list: &PropertyList, _: Communicator) -> Result<()> {
    hdf5::sync::sync(|| {
        // SAFETY: the list is a live transfer property list; the call only sets a value in it.
        h5check(unsafe { H5Pset_dxpl_mpio(list.id(), H5FD_mpio_xfer_t::H5FD_MPIO_COLLECTIVE) })
    })?;
    Ok(())
}

/// How HDF5 made the last write with `list`.
pub fn report(list: &PropertyList, _: Communicator) -> Result<String> {
    let (mut mode, mut local, mut global) = (0, 0, 0);
    hdf5::sync::sync(|| {
        // SAFETY: the list is a live transfer property list, and the result outlives the call.
        h5check(unsafe { H5Pget_mpio_actual_io_mode(list.id(), &mut mode) })?;
        // SAFETY: the same, with two results.
        h5check(unsafe { H5Pget_mpio_no_collective_cause(list.id(), &mut local, &mut global) })
    })?;
    Ok(match mode {
        0 => format!(
            "independent (cause {local:#x} on this rank, {global:#x} on all; H5D_MPIO_* in H5Dpublic.h)"
        ),
        1 => "chunk independent".to_string(),
        2 => "chunk collective".to_string(),
        3 => "chunk mixed".to_string(),
        4 => "contiguous collective".to_string(),
        other => format!("unknown to this program (H5D_mpio_actual_io_mode_t = {other})"),
    })
}
