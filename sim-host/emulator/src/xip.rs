//! What a fetch from flash costs: the cache in front of it (RP2040 datasheet 2.6.3).

/// Bytes of a line; 16 KiB in two ways of 1024 lines each (2.6.3.2: a flush takes
/// 16 kB / 8 bytes / 2 ways cycles).
const LINE: u32 = 8;
const SETS: usize = 1024;

/// The execute-in-place cache: 16 KiB, two ways, one cycle a hit.
#[derive(Clone, Debug)]
pub(crate) struct Cache {
    tags: Vec<[u32; 2]>,
    /// The way that was used last.
    recent: Vec<u8>,
    last_line: u32,
    miss_cycles: u32,
    pub(crate) hits: u64,
    pub(crate) misses: u64,
}

/// No line has this tag.
const EMPTY: u32 = u32::MAX;

impl Cache {
    pub(crate) fn new(miss_cycles: u32) -> Self {
        Self {
            tags: vec![[EMPTY; 2]; SETS],
            recent: vec![0; SETS],
            last_line: EMPTY,
            miss_cycles,
            hits: 0,
            misses: 0,
        }
    }

    pub(crate) fn flush(&mut self) {
        self.tags.fill([EMPTY; 2]);
        self.last_line = EMPTY;
    }

    /// The cycles that an access to a flash address waits.
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
            return self.miss_cycles;
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
            return self.miss_cycles;
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
