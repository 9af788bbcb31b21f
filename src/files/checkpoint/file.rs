//! Where everything is in a checkpoint file. All numbers are little-endian.

use super::{FORMAT, Header};
use std::ops::Range;

/// The first bytes of every checkpoint.
pub const MARK: [u8; 16] = *b"demhybrid-state\n";
/// Bytes before the header: mark, format, checksum of the header, its length, number of parts.
pub const PREAMBLE: u64 = 16 + 4 + 4 + 8 + 8;
/// Bytes of one line of the table of parts: first id, rows, checksum.
pub const PART: u64 = 8 + 8 + 4;
/// Longest header, bytes: a scene is a text that people write.
pub const LONGEST_HEADER: u64 = 16 << 20;
/// Bytes that are read or written at once.
pub const PIECE: usize = 1 << 20;

/// Numbers of one state.
pub fn width(rotation: bool) -> u64 {
    if rotation { 9 } else { 6 }
}

/// Where the columns of a file are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layout {
    /// Bytes of the encoded header.
    pub header: u64,
    /// Particles.
    pub count: u64,
    /// Numbers of one row of the columns state, origin, slope and direction; 0 where there is none.
    pub widths: [u64; 4],
    /// Blocks of rows with a checksum each.
    pub parts: u64,
}

impl Layout {
    /// Of a file with this header, `header` bytes long.
    pub fn new(of: &Header, header: u64, parts: u64) -> Self {
        let state = width(of.rotation);
        let known = |known: bool| if known { state } else { 0 };
        let widths = [state, 3, known(of.memory.slope_known), known(of.memory.direction_known)];
        Layout { header, count: of.count, widths, parts }
    }

    /// Bytes that the rows `rows` of column `k` take, and where.
    pub fn place(&self, k: usize, rows: &Range<u64>) -> Range<u64> {
        let before: u64 = self.widths[..k].iter().sum();
        let start = PREAMBLE + self.header + 8 * before * self.count;
        let row = 8 * self.widths[k];
        start + row * rows.start..start + row * rows.end
    }

    /// Where the table of parts is.
    pub fn table(&self) -> u64 {
        self.place(self.widths.len() - 1, &(0..self.count)).end
    }

    /// Bytes of the whole file: the table ends with its own checksum.
    pub fn length(&self) -> u64 {
        self.table() + PART * self.parts + 4
    }
}

/// What comes before the columns.
pub fn head(header: &[u8], parts: u64) -> Vec<u8> {
    let mut bytes = MARK.to_vec();
    bytes.extend(FORMAT.to_le_bytes());
    bytes.extend(crc32fast::hash(header).to_le_bytes());
    bytes.extend((header.len() as u64).to_le_bytes());
    bytes.extend(parts.to_le_bytes());
    bytes.extend(header);
    bytes
}

/// The table of parts: rows and checksum of each.
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

/// The number that starts at byte `at`.
pub fn word(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(bytes[at..at + 8].try_into().expect("eight bytes"))
}

/// The short number that starts at byte `at`.
pub fn half(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes"))
}
