//! The layout of a checkpoint file. All numbers are little-endian.

use super::{FORMAT, Header};
use crate::engine::simulation::Memory;
use crate::model::columns::Changes;
use std::ops::Range;

/// The first bytes of every checkpoint.
pub const MARK: [u8; 16] = *b"demhybrid-state\n";
/// Length of the preamble, bytes: mark, format, checksum and length of the header, number of parts.
pub const PREAMBLE: u64 = 16 + 4 + 4 + 8 + 8;
/// Length of one row in the table of parts, bytes: first id, number of rows, checksum.
pub const PART: u64 = 8 + 8 + 4;
/// Longest header that is read, bytes. The scene in it is a text that people write.
pub const LONGEST_HEADER: u64 = 16 << 20;
/// Bytes that one call reads or writes, about.
pub const PIECE: usize = 1 << 20;

/// The position of every column in a file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layout {
    /// Length of the encoded header, bytes.
    pub header: u64,
    /// Number of particles.
    pub count: u64,
    /// Numbers in one row of the tables state, constant columns, origin, slope, direction and contacts; 0 if
    /// a table is missing.
    pub widths: [u64; 6],
    /// Number of parts. A part is a block of rows with one checksum.
    pub parts: u64,
}

impl Layout {
    /// Layout of a file with the header `of`, which takes `header` bytes when it is encoded.
    pub fn new(of: &Header, header: u64, parts: u64) -> Self {
        let width = |changes| of.columns.width(changes) as u64;
        let (state, constants) = (width(Changes::EveryStage), width(Changes::WithLists));
        let known = |known: bool| if known { state } else { 0 };
        let Memory { slope_known, direction_known, .. } = of.memory;
        let vectors = 1 + u64::from(slope_known) + u64::from(direction_known);
        // The other particle of a contact, and the memory in every vector.
        let [slots, numbers] = of.contact_slots;
        let contacts = slots.saturating_mul(1 + numbers * vectors);
        let widths = [state, constants, 3, known(slope_known), known(direction_known), contacts];
        Layout { header, count: of.count, widths, parts }
    }

    /// Range of bytes that the rows `rows` of column `k` take.
    pub fn place(&self, k: usize, rows: &Range<u64>) -> Range<u64> {
        let before: u64 = self.widths[..k].iter().sum();
        let start = PREAMBLE + self.header + 8 * before * self.count;
        let row = 8 * self.widths[k];
        start + row * rows.start..start + row * rows.end
    }

    /// Position of the table of parts, bytes from the start of the file.
    pub fn table(&self) -> u64 {
        self.place(self.widths.len() - 1, &(0..self.count)).end
    }

    /// Length of the whole file, bytes. The last 4 bytes are the checksum of the table.
    pub fn length(&self) -> u64 {
        self.table() + PART * self.parts + 4
    }
}

/// The bytes before the columns: the preamble and the header.
pub fn head(header: &[u8], parts: u64) -> Vec<u8> {
    let mut bytes = MARK.to_vec();
    bytes.extend(FORMAT.to_le_bytes());
    bytes.extend(crc32fast::hash(header).to_le_bytes());
    bytes.extend((header.len() as u64).to_le_bytes());
    bytes.extend(parts.to_le_bytes());
    bytes.extend(header);
    bytes
}

/// The encoded table of parts: rows and checksum of every part, then the checksum of the table.
pub fn table(parts: &[(Range<u64>, u32)]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (rows, checksum) in parts {
        bytes.extend(rows.start.to_le_bytes());
        bytes.extend((rows.end - rows.start).to_le_bytes());
        bytes.extend(checksum.to_le_bytes());
    }
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    bytes
}

/// The 64-bit number that starts at byte `at`.
pub fn word(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(bytes[at..at + 8].try_into().expect("eight bytes"))
}

/// The 32-bit number that starts at byte `at`.
pub fn half(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes"))
}
