//! Cost of a fetch from flash, with its cache (RP2040 datasheet 2.6.3).

/// Bytes of a cache line; the cache has 16 KiB in two ways of 1024 lines each (2.6.3.2: a flush
/// takes 16 kB / 8 bytes / 2 ways cycles).
const LINE: u32 = 8;
const SETS: usize = 1024;

/// Cycles of the second word of a line on four wires: eight flash clocks of two cycles.
const QUAD_WORD_CYCLES: u32 = 16;
/// Cycles of a flush: one per line of a way (2.6.3.2).
pub(crate) const FLUSH_CYCLES: u64 = SETS as u64;

/// The execute-in-place cache: 16 KiB, two ways, one cycle per hit.
#[derive(Clone, Debug)]
pub(crate) struct Cache {
    tags: Vec<[u32; 2]>,
    /// Most recently used way of each set.
    recent: Vec<u8>,
    last_line: u32,
    /// Cycles to fetch a line on four wires.
    line_cycles: u32,
    pub(crate) hits: u64,
    pub(crate) misses: u64,
}

/// Tag that no line has.
const EMPTY: u32 = u32::MAX;

impl Cache {
    pub(crate) fn new(miss_cycles: u32) -> Self {
        Self {
            tags: vec![[EMPTY; 2]; SETS],
            recent: vec![0; SETS],
            last_line: EMPTY,
            line_cycles: miss_cycles,
            hits: 0,
            misses: 0,
        }
    }

    pub(crate) fn flush(&mut self) {
        self.tags.fill([EMPTY; 2]);
        self.last_line = EMPTY;
    }

    /// Wait cycles of an uncached word: half a line.
    pub(crate) const fn word_cycles(&self) -> u32 {
        self.line_cycles.saturating_sub(QUAD_WORD_CYCLES)
    }

    /// Wait cycles of an access that uses the cache without changing it.
    pub(crate) fn read_only(&self, address: u32) -> u32 {
        let line = address / LINE;
        let tags = self.tags.get(line as usize % SETS);
        if tags.is_some_and(|tags| tags.contains(&line)) {
            0
        } else {
            self.word_cycles()
        }
    }

    /// Wait cycles of an access that always fetches its line.
    pub(crate) fn refill(&mut self, address: u32) -> u32 {
        let line = address / LINE;
        self.last_line = line;
        self.look_up(line);
        self.line_cycles
    }

    /// Wait cycles of an access to a flash address.
    #[inline]
    pub(crate) fn access(&mut self, address: u32) -> u32 {
        let line = address / LINE;
        if line == self.last_line {
            return 0;
        }
        self.last_line = line;
        self.look_up(line)
    }

    fn look_up(&mut self, line: u32) -> u32 {
        let set = line as usize % SETS;
        let (Some(tags), Some(recent)) = (self.tags.get_mut(set), self.recent.get_mut(set)) else {
            return self.line_cycles;
        };
        if tags[0] == line {
            *recent = 0;
        } else if tags[1] == line {
            *recent = 1;
        } else {
            let way = 1 - *recent;
            tags[usize::from(way)] = line;
            *recent = way;
            self.misses += 1;
            return self.line_cycles;
        }
        self.hits += 1;
        0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_fetched_once_and_evicted_by_the_third_of_its_set() {
        let mut cache = Cache::new(96);
        let way = SETS as u32 * LINE;
        assert_eq!(cache.access(0x100), 96);
        assert_eq!(cache.access(0x104), 0);
        assert_eq!(cache.access(0x108), 96);
        assert_eq!(cache.access(0x100 + way), 96);
        assert_eq!(cache.access(0x100), 0, "two ways hold both");
        assert_eq!(cache.access(0x100 + 2 * way), 96);
        assert_eq!(
            cache.access(0x100 + way),
            96,
            "the one used longest ago went"
        );
    }
}
