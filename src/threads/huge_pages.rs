//! Large vectors in pages of 2 MiB. A right-hand side of many particles reads ten vectors side by side: with pages of 4 KiB the
//! processor spends a twentieth of the time of 200 000 particles on looking up where these are.

// An allocator can be had no other way; every call is handed on to the system's, which keeps the contract.
#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};

/// The system's allocator, which asks for large pages where a vector fills some.
pub struct HugePages;

/// Bytes of a large page.
const PAGE: usize = 2 << 20;

/// Bytes from which on a vector has large pages: it fills one at least.
const LARGE: usize = 2 * PAGE;

/// What the system is asked for in place of a large `layout`: it begins with a page.
fn of_pages(layout: Layout) -> Layout {
    layout.align_to(PAGE).unwrap_or(layout)
}

/// Asks for large pages in the `size` bytes from `begin` on. Without effect where there are none.
fn advise(begin: *mut u8, size: usize) {
    #[cfg(target_os = "linux")]
    if !begin.is_null() {
        // SAFETY: the advice changes neither contents nor validity of the bytes, nor of those that share their last page.
        let _ = unsafe { rustix::mm::madvise(begin.cast(), size, rustix::mm::Advice::LinuxHugepage) };
    }
}

// SAFETY: all memory is the system allocator's, by layouts that depend on the caller's alone, so that it is given back by
// the one by which it was taken, and that ask for no less.
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
            // SAFETY: so many bytes were just allocated.
            unsafe { begin.write_bytes(0, layout.size()) };
        }
        begin
    }

    unsafe fn dealloc(&self, begin: *mut u8, layout: Layout) {
        let layout = if layout.size() < LARGE { layout } else { of_pages(layout) };
        // SAFETY: `alloc` asked for the same layout.
        unsafe { System.dealloc(begin, layout) }
    }

    unsafe fn realloc(&self, begin: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        if layout.size().max(size) < LARGE {
            // SAFETY: as the caller promises.
            return unsafe { System.realloc(begin, layout, size) };
        }
        // SAFETY: the caller promises a size that is valid for this alignment, the old one is, and both blocks are apart.
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

    /// Bytes from the allocator itself, whichever the process has.
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
            // SAFETY: the block is of this allocator and this layout, and the size is not 0.
            self.begin = unsafe { HugePages.realloc(self.begin, self.layout, size) };
            self.layout = Layout::from_size_align(size, 8).unwrap();
        }

        fn get(&mut self) -> &mut [u8] {
            // SAFETY: so many bytes are there, and were zero or written.
            unsafe { std::slice::from_raw_parts_mut(self.begin, self.layout.size()) }
        }
    }

    impl Drop for Bytes {
        fn drop(&mut self) {
            // SAFETY: the block is of this allocator and this layout.
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
