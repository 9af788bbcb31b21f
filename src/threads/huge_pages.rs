//! An allocator that puts large vectors into pages of 2 MiB.
//!
//! A right-hand side of many particles reads ten vectors side by side. With pages of 4 KiB the processor
//! would spend much time on address translation.

// Only an allocator can do this for all vectors. Every call is passed on to the system's allocator, which
// keeps the contract.
#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};

/// The system's allocator, which asks the system for large pages where an allocation fills at least one.
pub struct HugePages;

/// Size of a large page, bytes.
const PAGE: usize = 2 << 20;

/// Smallest size with large pages, bytes. An allocation of this size fills at least one page.
const LARGE: usize = 2 * PAGE;

/// The layout that is requested in place of a large `layout`: it begins at a page boundary.
fn of_pages(layout: Layout) -> Layout {
    layout.align_to(PAGE).unwrap_or(layout)
}

/// Asks for large pages in the `size` bytes from `begin` on. Has no effect where the system has none.
fn advise(begin: *mut u8, size: usize) {
    #[cfg(target_os = "linux")]
    if !begin.is_null() {
        // SAFETY: the advice changes neither the contents nor the validity of these bytes or of others in
        // their last page.
        let _ = unsafe { rustix::mm::madvise(begin.cast(), size, rustix::mm::Advice::LinuxHugepage) };
    }
}

// SAFETY: all memory comes from the system's allocator. The layout passed to it depends only on the caller's
// layout, so memory is released with the layout with which it was allocated. That layout asks for no less
// than the caller's.
unsafe impl GlobalAlloc for HugePages {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if layout.size() < LARGE {
            // SAFETY: as the caller promises.
            return unsafe { System.alloc(layout) };
        }
        // SAFETY: the layout is not empty.
        let begin = unsafe { System.alloc(of_pages(layout)) };
        advise(begin, layout.size());
        begin
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        if layout.size() < LARGE {
            // SAFETY: as the caller promises.
            return unsafe { System.alloc_zeroed(layout) };
        }
        // SAFETY: as the caller promises.
        let begin = unsafe { self.alloc(layout) };
        if !begin.is_null() {
            // SAFETY: this many bytes have just been allocated.
            unsafe { begin.write_bytes(0, layout.size()) };
        }
        begin
    }

    unsafe fn dealloc(&self, begin: *mut u8, layout: Layout) {
        let layout = if layout.size() < LARGE { layout } else { of_pages(layout) };
        // SAFETY: `alloc` used the same layout.
        unsafe { System.dealloc(begin, layout) }
    }

    unsafe fn realloc(&self, begin: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        if layout.size().max(size) < LARGE {
            // SAFETY: as the caller promises.
            return unsafe { System.realloc(begin, layout, size) };
        }
        // SAFETY: the caller guarantees that the new size is valid for this alignment. The old size is valid,
        // and the two blocks do not overlap.
        unsafe {
            let new = self.alloc(Layout::from_size_align_unchecked(size, layout.align()));
            if !new.is_null() {
                new.copy_from_nonoverlapping(begin, layout.size().min(size));
                self.dealloc(begin, layout);
            }
            new
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A block of bytes from this allocator, whichever allocator the process uses.
    struct Bytes {
        begin: *mut u8,
        layout: Layout,
    }

    impl Bytes {
        fn new(size: usize) -> Self {
            let layout = Layout::from_size_align(size, 8).unwrap();
            // SAFETY: the size is not 0.
            Bytes { begin: unsafe { HugePages.alloc_zeroed(layout) }, layout }
        }

        fn resize(&mut self, size: usize) {
            // SAFETY: the block comes from this allocator and has this layout, and the size is not 0.
            self.begin = unsafe { HugePages.realloc(self.begin, self.layout, size) };
            self.layout = Layout::from_size_align(size, 8).unwrap();
        }

        fn get(&mut self) -> &mut [u8] {
            // SAFETY: the block has this many bytes, which have been zeroed or written.
            unsafe { std::slice::from_raw_parts_mut(self.begin, self.layout.size()) }
        }
    }

    impl Drop for Bytes {
        fn drop(&mut self) {
            // SAFETY: the block comes from this allocator and has this layout.
            unsafe { HugePages.dealloc(self.begin, self.layout) }
        }
    }

    #[test]
    fn blocks_keep_their_contents_as_they_grow_into_large_pages_and_out_of_them() {
        let pattern = |k: usize| (k % 251) as u8;
        let kept = |bytes: &[u8]| bytes.iter().enumerate().all(|(k, &byte)| byte == pattern(k));
        let mut block = Bytes::new(1000);
        block.get().iter_mut().enumerate().for_each(|(k, byte)| *byte = pattern(k));
        block.resize(8 * LARGE);
        assert_eq!(block.begin as usize % PAGE, 0);
        assert!(kept(&block.get()[..1000]));
        block.resize(16 * LARGE);
        assert!(kept(&block.get()[..1000]));
        block.resize(1000);
        assert!(kept(block.get()));
        assert!(Bytes::new(8 * LARGE).get().iter().all(|&byte| byte == 0));
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn the_system_is_asked_for_large_pages() {
        if !std::path::Path::new("/sys/kernel/mm/transparent_hugepage").exists() {
            return;
        }
        let mut block = Bytes::new(4 * LARGE);
        block.get()[0] = 1;
        let begin = block.begin as usize;
        let maps = std::fs::read_to_string("/proc/self/smaps").unwrap();
        let mut inside = false;
        let flags = maps.lines().find(|line| {
            let ends = line.split(' ').next().and_then(|ends| ends.split_once('-'));
            if let Some((from, to)) = ends {
                let [from, to] = [from, to].map(|end| usize::from_str_radix(end, 16).unwrap_or(0));
                inside = (from..to).contains(&begin);
            }
            inside && line.starts_with("VmFlags:")
        });
        assert!(flags.unwrap().contains(" hg"), "{flags:?}");
    }
}
