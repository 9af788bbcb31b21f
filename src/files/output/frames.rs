//! The groups and arrays of the file, and how one frame is added to them.

use std::fs;
use std::mem;
use std::ops::Range;
use std::path::Path;

use hdf5::types::FixedAscii;
use hdf5::{Dataset, File, FileBuilder, Group, Result};

use super::arrays::{Ground, fixed, fixed_rows, grow, set, set_new, set_new_text};
use super::collective::{Place, Row, Transfer, column_shape};
use super::run_group::{
    COUNT_COLUMNS, ENERGY_COLUMNS, REAL_ATTRIBUTES, REAL_COLUMNS, count_attributes, limit_attribute,
    run_group,
};
use super::{Contents, Measures, Numbers, Rows, RunInfo, mpio};
use crate::domain::comm::Comm;
use crate::model::columns::{Changes, Column as ParticleColumn, Columns, RADIUS};
use crate::ode::Limit;

/// Name of the column of positions.
const POSITION: &str = "position";
/// Rows in a chunk of the small arrays, which have one row per frame.
const FRAMES_PER_CHUNK: u64 = 1024;

/// Upper bound of what HDF5 needs to index one more chunk, bytes: a few nodes of a tree.
const INDEX_BYTES: u64 = 16 << 10;
/// Length of one row of a vector quantity, bytes.
const VECTOR_BYTES: u64 = 24;
/// Frames are held in memory up to this size, on all ranks together, bytes. Larger ones gain little.
const MOST_HELD: u64 = 1 << 20;

/// An array that VTKHDF needs to find the data of a frame. Row k, for frame k, is `first + k * stride`.
struct Schedule {
    array: Dataset,
    first: i64,
    stride: i64,
}

/// A column of `/run/series`, and the measure that fills it.
struct Column<N> {
    array: Dataset,
    measure: fn(&Measures) -> N,
}

/// A column of the particles that changes from frame to frame.
struct StateColumn {
    array: Dataset,
    column: ParticleColumn,
    /// The rows of this rank of all frames that are held.
    held: Vec<f64>,
}

/// The open file. Rust drops the fields in this order: arrays, groups, file.
pub struct Frames {
    /// The columns of the particles that change from frame to frame.
    state: Vec<StateColumn>,
    /// `NumberOfPoints`.
    sizes: Dataset,
    schedules: Vec<Schedule>,
    /// Offsets of a frame's cells, for VTK's four kinds of cells. All are 0: frames share their cells.
    cell_offsets: Vec<Dataset>,
    real_columns: Vec<Column<f64>>,
    count_columns: Vec<Column<u64>>,
    /// `Steps/Values`, s. It must never be longer than `NSteps` says if that is 2 or more, or VTK's reader
    /// crashes.
    times: Dataset,
    steps: Group,
    run: Group,
    transfer: Transfer,
    file: File,
    /// The same file, to make it longer; on rank 0 under MPI-IO only.
    plain: Option<fs::File>,
    /// Number of particles, which is the number of rows of a frame.
    count: u64,
    /// Number of complete frames in the file.
    complete: u64,
    /// Measures of the frames after them, which are held in memory.
    held: Vec<Measures>,
    /// Id of the first row of this rank in a frame.
    first_row: u64,
    /// How HDF5 wrote the rows of the last frame.
    report: String,
    /// Whether this rank writes the small arrays.
    writes_small: bool,
}

impl Frames {
    /// Creates the file without frames. `info` is the same on every rank. Collective.
    pub fn create(
        comm: &dyn Comm,
        path: &Path,
        info: &RunInfo,
        contents: &Contents,
        id_rows: Range<u64>,
        constants: &Numbers,
    ) -> Result<Self> {
        let file = options(comm)?.create(path)?;
        // Closing the file is collective. If this rank fails below, the second handle keeps the file open.
        let keep_open = file.clone();
        let created = Self::lay_out(comm, (file, path), &Ground::New(info), contents);
        let written = created
            .and_then(|frames| frames.write_static(comm, contents, id_rows, constants).map(|()| frames));
        written.inspect_err(|_| mem::forget(keep_open))
    }

    /// Opens the file of an earlier process. Collective.
    ///
    /// [`reopen::prepare`](super::reopen::prepare) must have cut it to `complete` frames.
    pub fn open(
        comm: &dyn Comm,
        path: &Path,
        energy: bool,
        contents: &Contents,
        complete: u64,
    ) -> Result<Self> {
        let file = options(comm)?.open_rw(path)?;
        let keep_open = file.clone();
        let ground = Ground::Found { energy, complete };
        Self::lay_out(comm, (file, path), &ground, contents).inspect_err(|_| mem::forget(keep_open))
    }

    fn lay_out(
        comm: &dyn Comm,
        (file, path): (File, &Path),
        ground: &Ground,
        contents: &Contents,
    ) -> Result<Self> {
        let count = contents.count;
        let transfer = Transfer::new(comm.raw())?;
        let writes_small = comm.rank() == 0;
        let plain = (writes_small && transfer.is_parallel())
            .then(|| fs::OpenOptions::new().write(true).open(path))
            .transpose()
            .map_err(|why| why.to_string())?;
        let root = ground.group(&file, "VTKHDF")?;
        let point_data = ground.group(&root, "PointData")?;
        let steps = ground.group(&root, "Steps")?;
        if let Ground::New(_) = ground {
            root.new_attr::<i64>().shape(2).create("Version")?.write(&[2_i64, 0])?;
            let kind = FixedAscii::<8>::from_ascii("PolyData").map_err(|e| e.to_string())?;
            root.new_attr::<FixedAscii<8>>().create("Type")?.write_scalar(&kind)?;
            set_new(&steps, "NSteps", 0_i64)?;
        }
        let offsets = ground.group(&steps, "PointDataOffsets")?;

        let n = count as i64;
        let mut schedules = Vec::new();
        let mut schedule = |group: &Group, name: &str, first: i64, stride: i64| -> Result<()> {
            let array = ground.array::<i64>(group, name, FRAMES_PER_CHUNK)?;
            schedules.push(Schedule { array, first, stride });
            Ok(())
        };
        for name in ["Vertices", "Lines", "Polygons", "Strips"] {
            // Every particle is a vertex. The other kinds of cells must exist and are empty.
            let cells = ground.group(&root, name)?;
            let shown = if name == "Vertices" { n } else { 0 };
            schedule(&cells, "NumberOfCells", shown, 0)?;
            schedule(&cells, "NumberOfConnectivityIds", shown, 0)?;
        }
        schedule(&steps, "PartOffsets", 0, 1)?;
        schedule(&steps, "NumberOfParts", 1, 0)?;
        schedule(&steps, "PointOffsets", 0, n)?;
        // Every point array needs offsets, even one that all frames share. Without them ParaView crashes.
        schedule(&offsets, "id", 0, 0)?;
        schedule(&offsets, RADIUS, 0, 0)?;
        for column in
            in_file(contents.columns).filter(|column| ![POSITION, RADIUS].contains(&&column.name[..]))
        {
            let stride = if column.changes == Changes::EveryStage { n } else { 0 };
            schedule(&offsets, &column.name, 0, stride)?;
        }

        let run = match ground {
            Ground::New(info) => run_group(&file, &transfer, info, writes_small)?,
            Ground::Found { .. } => file.group("run")?,
        };
        let series = ground.group(&run, "series")?;
        let rows = rows_per_chunk(count);
        Ok(Frames {
            state: in_file(contents.columns)
                .filter(|column| column.changes == Changes::EveryStage)
                .map(|column| {
                    let (group, name) = place_of(column, (&root, &point_data));
                    let array = ground.column(group, name, column.width, rows)?;
                    Ok(StateColumn { array, column: column.clone(), held: Vec::new() })
                })
                .collect::<Result<_>>()?,
            sizes: ground.array::<i64>(&root, "NumberOfPoints", FRAMES_PER_CHUNK)?,
            schedules,
            cell_offsets: ["CellOffsets", "ConnectivityIdOffsets"]
                .map(|name| ground.array::<[i64; 4]>(&steps, name, FRAMES_PER_CHUNK))
                .into_iter()
                .collect::<Result<_>>()?,
            times: ground.array::<f64>(&steps, "Values", FRAMES_PER_CHUNK)?,
            real_columns: REAL_COLUMNS
                .into_iter()
                .chain(ENERGY_COLUMNS.into_iter().filter(|_| ground.energy()))
                .map(|(column, measure)| {
                    let array = ground.array::<f64>(&series, column.name(), FRAMES_PER_CHUNK)?;
                    Ok(Column { array, measure })
                })
                .collect::<Result<_>>()?,
            count_columns: COUNT_COLUMNS
                .into_iter()
                .map(|(column, measure)| {
                    let array = ground.array::<i64>(&series, column.name(), FRAMES_PER_CHUNK)?;
                    Ok(Column { array, measure })
                })
                .collect::<Result<_>>()?,
            run,
            steps,
            transfer,
            file,
            plain,
            count,
            complete: match ground {
                Ground::New(_) => 0,
                Ground::Found { complete, .. } => *complete,
            },
            held: Vec::new(),
            first_row: 0,
            report: "none yet".to_string(),
            writes_small,
        })
    }

    /// Writes the arrays that all frames share: ids, radii, columns that do not change, and one vertex per
    /// particle. Collective.
    fn write_static(
        &self,
        comm: &dyn Comm,
        contents: &Contents,
        id_rows: Range<u64>,
        constants: &Numbers,
    ) -> Result<()> {
        let root = self.file.group("VTKHDF")?;
        let point_data = &root.group("PointData")?;
        let first = id_rows.start;
        let ids: Vec<i64> = id_rows.clone().map(|id| id as i64).collect();
        let together = |group: &Group, name: &str, length: u64, rows: &[i64]| {
            self.transfer.write_together(&fixed::<i64>(group, name, length)?, first, rows)
        };
        together(point_data, "id", self.count, &ids)?;
        if !contents.columns.sized() {
            let radii = vec![contents.radius; ids.len()];
            self.transfer.write_together(&fixed::<f64>(point_data, RADIUS, self.count)?, first, &radii)?;
        }
        for column in in_file(contents.columns).filter(|column| column.changes == Changes::WithLists) {
            let (name, shape) = (&column.name, column_shape(&column.width));
            let array = fixed_rows::<f64>(point_data, name, self.count, shape)?;
            set_new_text(&array, "unit", &column.unit)?;
            if !column.names.is_empty() {
                set_new_text(&array, "names", &column.names.join("\n"))?;
            }
            self.transfer.write_column(&array, &Place::from_row(first), column.width, &constants(column))?;
        }
        let vertices = root.group("Vertices")?;
        together(&vertices, "Connectivity", self.count, &ids)?;
        // There is one offset more than vertices. The last rank adds it, because its block ends the ids.
        let end = id_rows.end + u64::from(comm.rank() + 1 == comm.size());
        let bounds: Vec<i64> = (first..end).map(|id| id as i64).collect();
        together(&vertices, "Offsets", self.count + 1, &bounds)?;
        for name in ["Lines", "Polygons", "Strips"] {
            let cells = root.group(name)?;
            fixed::<i64>(&cells, "Connectivity", 0)?;
            let offsets = fixed::<i64>(&cells, "Offsets", 1)?;
            self.write_small(&offsets, 0, &[0_i64])?;
        }
        self.flush(0)
    }

    /// Whether one more frame is as many as may wait in memory. The same on every rank.
    pub fn are_full_with_the_next(&self) -> bool {
        self.held.len() as u64 + 1 >= frames_held(self.count)
    }

    /// Adds one frame. It is in the file after [`Frames::sync`], or now if `write` is set. Collective.
    pub fn append(&mut self, rows: &Rows, measures: &Measures, write: bool) -> Result<()> {
        self.held.push(*measures);
        self.first_row = rows.first;
        for k in 0..self.state.len() {
            let StateColumn { held, column, .. } = &mut self.state[k];
            let mut numbers = (rows.numbers)(column);
            if held.is_empty() {
                *held = numbers;
            } else {
                held.append(&mut numbers);
            }
            // A column at a time: a large frame is never in memory as a whole.
            if write {
                self.write_state(k)?;
            }
        }
        if write { self.declare() } else { Ok(()) }
    }

    /// Writes the frames that are held in memory and forces them to the disk. Collective.
    pub fn sync(&mut self) -> Result<()> {
        if self.held.is_empty() {
            return Ok(());
        }
        for k in 0..self.state.len() {
            self.write_state(k)?;
        }
        self.declare()
    }

    /// Where the first radius is in the file, bytes. Nothing is written there again, and it is not 0.
    pub fn written_once(&self) -> Option<u64> {
        self.file.dataset("VTKHDF/PointData/radius").ok()?.offset()
    }

    /// How HDF5 wrote the rows of the last frame.
    pub fn transfer_report(&self) -> &str {
        &self.report
    }

    /// Writes column `k` of the particles for all frames that are held. Collective.
    ///
    /// Arrays grow here and never shrink: if several ranks shrink an array within a chunk, HDF5 1.10 corrupts
    /// its bookkeeping.
    fn write_state(&mut self, k: usize) -> Result<()> {
        let StateColumn { array, column, held } = &mut self.state[k];
        let numbers = mem::take(held);
        let blocks = self.held.len() as u64;
        grow(array, (self.complete + blocks) * self.count, column_shape(&column.width))?;
        let first = self.complete * self.count + self.first_row;
        let place = Place { first, stride: self.count.max(1), blocks };
        self.transfer.write_column(array, &place, column.width, &numbers)
    }

    /// Writes what belongs to the frames that are held beside their columns, and flushes. Collective.
    ///
    /// First come all data, then `NSteps` and the times, which declare the frames complete. Of these two
    /// `NSteps` reaches the file first, because it lies before the other. A kill between them leaves frames
    /// without times, which [`inspect`](super::inspect) does not count.
    fn declare(&mut self) -> Result<()> {
        self.report = self.transfer.report()?;
        let held = mem::take(&mut self.held);
        let frames = self.complete..self.complete + held.len() as u64;
        let sizes = vec![self.count as i64; held.len()];
        let times: Vec<f64> = held.iter().map(|frame| frame.time).collect();
        // While `NSteps` is 0, VTK reads no times, however many there are. So the first come with the data:
        // they need a chunk, and a kill before the superblock knows of it would leave unreadable times.
        let first = frames.start == 0;
        if first {
            self.put(&self.times, 0, &times)?;
        }
        // While `NSteps` is 1, VTK treats the file as static and takes the rows of `NumberOfPoints` for
        // parts. So the second row must wait for `NSteps` = 2. No other row has to wait.
        let wait = frames.start == 1;
        if !wait {
            self.put(&self.sizes, frames.start, &sizes)?;
        }
        for schedule in &self.schedules {
            let row = |k: u64| schedule.first + k as i64 * schedule.stride;
            self.put(&schedule.array, frames.start, &frames.clone().map(row).collect::<Vec<_>>())?;
        }
        for array in &self.cell_offsets {
            self.put(array, frames.start, &vec![[0_i64; 4]; held.len()])?;
        }
        for Column { array, measure } in &self.real_columns {
            self.put(array, frames.start, &held.iter().map(measure).collect::<Vec<_>>())?;
        }
        for Column { array, measure } in &self.count_columns {
            let row = |measures: &Measures| measure(measures) as i64;
            self.put(array, frames.start, &held.iter().map(row).collect::<Vec<_>>())?;
        }
        self.flush(growth(self.count, self.state.len() as u64, &frames))?;

        // Only now do the times and `NSteps` declare the frames complete.
        if wait {
            self.put(&self.sizes, frames.start, &sizes)?;
        }
        if !first {
            self.put(&self.times, frames.start, &times)?;
        }
        set(&self.steps, "NSteps", frames.end as i64)?;
        if let Some(last) = held.last() {
            self.count_up(last)?;
        }
        self.flush(if first { 0 } else { small_growth(&frames) })?;
        self.complete = frames.end;
        Ok(())
    }

    /// Writes the final attributes. Collective.
    pub fn complete(&mut self, measures: &Measures, method: &str) -> Result<()> {
        self.count_up(measures)?;
        // The text is known only now, and so is its length. It is a new attribute and may lengthen the file.
        set_new_text(&self.run, "choice", method)?;
        self.flush(method.len() as u64 + INDEX_BYTES)?;
        set(&self.run, "completed", 1_i64)?;
        self.flush(0)
    }

    /// Writes what stopped the run before its end. Collective.
    pub fn stopped(&mut self, by: &str) -> Result<()> {
        set_new_text(&self.run, "stopped_by", by)?;
        self.flush(by.len() as u64 + INDEX_BYTES)
    }

    /// Closes everything, the file last. Collective.
    pub fn close(self) -> Result<()> {
        // A second handle of the file: all arrays and groups must be closed before the file is.
        let file = self.file.clone();
        drop(self);
        file.close()
    }

    /// Flushes everything written so far to the disk. The file may have grown by `growth` bytes. Collective.
    ///
    /// HDF5 writes the new length of the file into its superblock before it extends the file. If the run is
    /// killed between the two, the file is shorter than the superblock says and cannot be opened.
    ///
    /// So rank 0 extends the file first, which takes no disk space, and HDF5 cuts it to its true length. This
    /// is done under MPI-IO only, since the serial driver would not cut the file.
    fn flush(&self, growth: u64) -> Result<()> {
        if let (Some(file), true) = (&self.plain, growth > 0) {
            let length = file.metadata().map_err(|why| why.to_string())?.len();
            file.set_len(length + growth).map_err(|why| why.to_string())?;
        }
        self.file.flush()
    }

    /// Updates the attributes of `/run` that follow the last frame. Collective.
    fn count_up(&self, measures: &Measures) -> Result<()> {
        for (name, count) in count_attributes() {
            set(&self.run, name, count(measures) as i64)?;
        }
        for (limit, steps) in Limit::ALL.into_iter().zip(measures.limits) {
            set(&self.run, &limit_attribute(limit), steps as i64)?;
        }
        for (name, real) in REAL_ATTRIBUTES {
            set(&self.run, name, real(measures))?;
        }
        Ok(())
    }

    /// Appends rows to a small array, from row `first` on. Collective.
    fn put<R: Row>(&self, array: &Dataset, first: u64, rows: &[R]) -> Result<()> {
        grow(array, first + rows.len() as u64, R::SHAPE)?;
        self.write_small(array, first, rows)
    }

    /// Writes rows that are the same on every rank; rank 0 alone does so.
    fn write_small<R: Row>(&self, array: &Dataset, first: u64, rows: &[R]) -> Result<()> {
        if self.writes_small { self.transfer.write_alone(array, first, rows) } else { Ok(()) }
    }
}

/// Options for opening the file. Collective, like the call that opens it.
pub(super) fn options(comm: &dyn Comm) -> Result<FileBuilder> {
    let mut options = File::with_options();
    // HDF5 2.0 changed the default format. The earliest format makes the file independent of the library.
    // Older libraries can read it, and it can be opened after a kill.
    options.with_fapl(|access| access.libver_earliest());
    match comm.raw() {
        Some(communicator) => mpio::open_together(&mut options, communicator)?,
        // The run has a lock of its own. That of HDF5, which files that ranks open together do not have,
        // would keep readers out, and be kept out by them.
        None => {
            options.with_fapl(|access| access.file_locking(false));
        }
    }
    Ok(options)
}

/// Number of frames of `count` particles that are written at once at the latest. At least 1.
fn frames_held(count: u64) -> u64 {
    (MOST_HELD / (3 * VECTOR_BYTES * count).max(1)).clamp(1, FRAMES_PER_CHUNK)
}

/// Upper bound of the bytes that `frames` add to a file with `arrays` vectors of `count` particles.
///
/// It is 0 if they fit into chunks that exist already, because HDF5 then leaves the length alone.
fn growth(count: u64, arrays: u64, frames: &Range<u64>) -> u64 {
    let rows = rows_per_chunk(count);
    let chunks = |frames: u64| (frames * count).div_ceil(rows);
    let new = chunks(frames.end) - chunks(frames.start);
    arrays * new * (rows * VECTOR_BYTES + INDEX_BYTES) + small_growth(frames)
}

/// The part of `growth` for the arrays with one row per frame.
fn small_growth(frames: &Range<u64>) -> u64 {
    let chunks = |frames: u64| frames.div_ceil(FRAMES_PER_CHUNK);
    (chunks(frames.end) - chunks(frames.start)) * small_arrays()
}

/// Upper bound of the bytes that the frames of `count` particles which are written at once add to a file.
pub(super) fn largest_growth(count: u64) -> u64 {
    let rows = rows_per_chunk(count);
    let chunks = (frames_held(count) * count).div_ceil(rows) + 1;
    3 * chunks * (rows * VECTOR_BYTES + INDEX_BYTES) + small_arrays()
}

/// Upper bound of the bytes of one more chunk in every array with one row per frame.
fn small_arrays() -> u64 {
    64 * (FRAMES_PER_CHUNK * 32 + INDEX_BYTES)
}

/// The columns of the particles that are in the file.
fn in_file(columns: &Columns) -> impl Iterator<Item = &ParticleColumn> {
    columns.iter().filter(|column| column.in_file)
}

/// Group and name of the array of a column. VTKHDF has its own name for positions.
fn place_of<'a>(
    column: &'a ParticleColumn,
    (root, point_data): (&'a Group, &'a Group),
) -> (&'a Group, &'a str) {
    if column.name == POSITION { (root, "Points") } else { (point_data, &column.name) }
}

/// Rows in a chunk of a vector array: whole frames up to 64 KiB, or else parts of a frame up to 1 MiB.
fn rows_per_chunk(count: u64) -> u64 {
    let (few, most) = ((64 << 10) / VECTOR_BYTES, (1 << 20) / VECTOR_BYTES);
    match count {
        0 => 1,
        _ if count <= few => few / count * count,
        _ => count.div_ceil(count.div_ceil(most)),
    }
}
