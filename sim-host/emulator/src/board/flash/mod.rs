//! The flash chip of a Raspberry Pi Pico: a W25Q16JV of 2 MiB (its datasheet, revision H).

mod chance;
mod command;
mod geometry;
mod sectors;
mod transfer;

use std::collections::BTreeSet;
use std::sync::Arc;

use crate::time::Time;

use chance::Chance;
pub(crate) use geometry::{PAGE, SECTOR, SIZE};
use sectors::Sectors;
use transfer::Transfer;

/// Share of an erase's duration in which the flash first clears all bits, so that the cells age
/// alike. The datasheet does not give it; guess.
const CLEARING: f64 = 1.0 / 3.0;

/// Durations of the flash's operations (W25Q16JV datasheet, AC characteristics).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FlashTimes {
    /// Typical: a page 0.4 ms, a sector 45 ms, a block of 32 KiB 120 ms, one of 64 KiB 150 ms.
    #[default]
    Typical,
    /// Longest: a page 3 ms, a sector 400 ms, a block of 32 KiB 1.6 s, one of 64 KiB 2 s.
    Longest,
}

/// Kind of an operation that the flash runs after its command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FlashOperationKind {
    /// Programs up to 256 bytes within a page: a 0 in the data clears the bit.
    ProgramPage,
    /// Sets all bits of a sector of 4 KiB.
    EraseSector,
    /// Sets all bits of a block of 32 KiB.
    EraseBlock32,
    /// Sets all bits of a block of 64 KiB.
    EraseBlock64,
}

impl FlashOperationKind {
    /// Size of the affected area, bytes.
    #[must_use]
    pub const fn bytes(self) -> u32 {
        match self {
            Self::ProgramPage => PAGE as u32,
            Self::EraseSector => SECTOR as u32,
            Self::EraseBlock32 => 32 * 1024,
            Self::EraseBlock64 => 64 * 1024,
        }
    }

    /// Duration (datasheet, AC characteristics).
    #[must_use]
    pub const fn time(self, times: FlashTimes) -> Time {
        let (typical_us, longest_us) = match self {
            Self::ProgramPage => (400, 3_000),
            Self::EraseSector => (45_000, 400_000),
            Self::EraseBlock32 => (120_000, 1_600_000),
            Self::EraseBlock64 => (150_000, 2_000_000),
        };
        Time::from_us(match times {
            FlashTimes::Typical => typical_us,
            FlashTimes::Longest => longest_us,
        })
    }
}

/// An operation of the flash, as logged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlashOperation {
    /// Time of its start.
    pub begun: Time,
    /// Kind of the operation.
    pub kind: FlashOperationKind,
    /// Start of its page, sector or block, in bytes from the start of the flash.
    pub address: u32,
}

/// The flash chip. Its contents survive every reset and every power cut.
#[derive(Clone, Debug, PartialEq)]
pub struct Flash {
    sectors: Sectors,
    times: FlashTimes,
    /// Start addresses of the worn-out sectors.
    worn: Arc<BTreeSet<u32>>,
    log: Arc<Vec<FlashOperation>>,
    unique_id: [u8; 8],
    chance: Chance,
    /// Number of operations left before the one in which the power fails; `None` if no such failure
    /// is requested.
    cut_after: Option<u64>,
    power_fails_ps: Option<u64>,
    running: Option<Running>,
    write_enabled: bool,
    /// Whether the flash is in continuous read: the next read's address comes without a command
    /// (datasheet, command EBh).
    is_continuous: bool,
    transfer: Option<Transfer>,
    /// Whether the flash's contents have changed since the last query.
    has_changed: bool,
}

#[derive(Clone, Debug, PartialEq)]
struct Running {
    operation: FlashOperation,
    page: Box<[u8; PAGE]>,
    begun_ps: u64,
    ends_ps: u64,
}

impl Flash {
    pub(crate) fn new(contents: &[u8], times: FlashTimes, seed: u64) -> Self {
        let mut chance = Chance::new(seed);
        let unique_id = chance.word().to_be_bytes();
        Self {
            sectors: Sectors::new(contents),
            times,
            worn: Arc::default(),
            log: Arc::default(),
            unique_id,
            chance,
            cut_after: None,
            power_fails_ps: None,
            running: None,
            write_enabled: false,
            is_continuous: false,
            transfer: None,
            has_changed: false,
        }
    }

    // ---- inspection and faults ----

    /// Byte at an address, counted from the start of the flash; addresses repeat every 2 MiB.
    #[must_use]
    #[inline]
    pub fn byte(&self, address: u32) -> u8 {
        self.sectors.byte(address)
    }

    /// A little-endian word.
    #[inline]
    pub(crate) fn word(&self, address: u32) -> u32 {
        self.sectors.word(address)
    }

    /// `count` bytes from an address on.
    #[must_use]
    pub fn bytes(&self, address: u32, count: u32) -> Vec<u8> {
        (0..count)
            .map(|offset| self.byte(address.wrapping_add(offset)))
            .collect()
    }

    /// All contents, 2 MiB, to be kept in a file and passed to [`Self::import`].
    #[must_use]
    pub fn export(&self) -> Vec<u8> {
        self.sectors.bytes().collect()
    }

    /// Replaces all contents, from the start of the flash; the rest of the flash is erased, and
    /// bytes beyond 2 MiB are ignored. Counts and log stay.
    pub fn import(&mut self, contents: &[u8]) {
        self.sectors = Sectors::new(contents);
        self.has_changed = true;
    }

    /// Inverts one bit, 0 to 7, of a byte, as a cell that has lost its charge.
    pub fn flip_bit(&mut self, address: u32, bit: u8) {
        self.sectors
            .change_byte(address, |byte| byte ^ 1 << (bit & 7));
        self.has_changed = true;
    }

    /// Wears out the sector at an address: from now on its operations take their usual time, but
    /// leave its contents unchanged.
    pub fn wear_out(&mut self, address: u32) {
        Arc::make_mut(&mut self.worn).insert(sector_of(address));
    }

    /// All operations so far, in order of their start.
    #[must_use]
    pub fn operations(&self) -> &[FlashOperation] {
        &self.log
    }

    /// Unique identifier, read by command 4Bh. It follows from the board's seed.
    #[must_use]
    pub const fn unique_id(&self) -> [u8; 8] {
        self.unique_id
    }

    /// Whether an operation runs.
    #[must_use]
    pub const fn is_busy(&self) -> bool {
        self.running.is_some()
    }

    /// Makes the board's power fail during an operation: 0 for the next one. The board's seed
    /// determines the time within the operation, and which bits have changed by then. Half-charged
    /// cells, whose bits read differently each time, are not modelled.
    pub const fn cut_power_at_operation(&mut self, number: u64) {
        self.cut_after = Some(number);
    }

    /// Cancels [`Self::cut_power_at_operation`]; returns whether the power had not failed yet.
    pub const fn cancel_power_cut(&mut self) -> bool {
        self.power_fails_ps = None;
        self.cut_after.take().is_some()
    }

    // ---- time ----

    /// Time at which an operation ends or the power fails.
    #[inline]
    pub(crate) fn next_event(&self) -> Option<u64> {
        // The power fails only within an operation.
        let running = self.running.as_ref()?;
        Some(self.power_fails_ps.unwrap_or(running.ends_ps))
    }

    /// Ends an operation that is due.
    pub(crate) fn service(&mut self, now_ps: u64) {
        let is_due = |running: &Running| running.ends_ps <= now_ps;
        if !self.has_lost_power(now_ps) && self.running.as_ref().is_some_and(is_due) {
            self.finish(1.0);
        }
    }

    /// Whether the requested power cut has happened.
    pub(crate) fn has_lost_power(&self, now_ps: u64) -> bool {
        self.power_fails_ps.is_some_and(|fails| fails <= now_ps)
    }

    /// Cuts and restores the power: a running operation stays half done.
    pub(crate) fn cycle_power(&mut self, now_ps: u64) {
        let now_ps = self
            .power_fails_ps
            .map_or(now_ps, |fails| fails.min(now_ps));
        if let Some(running) = &self.running {
            let lasts = running.ends_ps - running.begun_ps;
            let passed = now_ps.saturating_sub(running.begun_ps).min(lasts);
            self.finish(passed as f64 / lasts as f64);
        }
        self.power_fails_ps = None;
        self.write_enabled = false;
        self.is_continuous = false;
        self.transfer = None;
    }

    /// Whether its contents have changed since the last call.
    pub(crate) const fn take_changed(&mut self) -> bool {
        std::mem::replace(&mut self.has_changed, false)
    }

    // ---- operations ----

    /// Starts an operation; no effect unless writing was enabled (datasheet, command 06h).
    pub(crate) fn begin(
        &mut self,
        kind: FlashOperationKind,
        address: u32,
        page: Box<[u8; PAGE]>,
        now_ps: u64,
    ) {
        if !self.write_enabled || self.is_busy() {
            return;
        }
        let operation = FlashOperation {
            begun: Time::from_ps(now_ps),
            kind,
            address: (address % SIZE as u32) & !(kind.bytes() - 1),
        };
        Arc::make_mut(&mut self.log).push(operation);
        let ends_ps = now_ps + kind.time(self.times).as_ps();
        self.schedule_cut(now_ps, ends_ps);
        self.running = Some(Running {
            operation,
            page,
            begun_ps: now_ps,
            ends_ps,
        });
    }

    /// Command 06h: enables the next operation.
    pub(crate) const fn enable_write(&mut self) {
        self.write_enabled = !self.is_busy();
    }

    fn schedule_cut(&mut self, now_ps: u64, ends_ps: u64) {
        match self.cut_after {
            Some(0) => {
                let passed = self.chance.fraction() * (ends_ps - now_ps) as f64;
                self.power_fails_ps = Some(now_ps + passed as u64);
                self.cut_after = None;
            }
            Some(left) => self.cut_after = Some(left - 1),
            None => {}
        }
    }

    /// Ends the running operation after the share `passed` of its duration.
    fn finish(&mut self, passed: f64) {
        let Some(running) = self.running.take() else {
            return;
        };
        match running.operation.kind {
            FlashOperationKind::ProgramPage => self.program(&running, passed),
            kind => self.erase(running.operation.address, kind.bytes(), passed),
        }
        self.write_enabled = false;
        self.has_changed = true;
    }

    fn program(&mut self, running: &Running, passed: f64) {
        let Self {
            sectors,
            chance,
            worn,
            ..
        } = self;
        let address = running.operation.address;
        if worn.contains(&sector_of(address)) {
            return;
        }
        sectors.change_page(address, &running.page, |cell, byte| {
            cell & (byte | !changed(chance, passed))
        });
    }

    fn erase(&mut self, address: u32, bytes: u32, passed: f64) {
        let Self {
            sectors,
            chance,
            worn,
            ..
        } = self;
        let all = (address..address + bytes).step_by(SECTOR);
        for sector in all.filter(|sector| !worn.contains(sector)) {
            sectors.change_sector(sector, |cell| {
                if passed < CLEARING {
                    cell & !changed(chance, passed / CLEARING)
                } else {
                    changed(chance, (passed - CLEARING) / (1.0 - CLEARING))
                }
            });
        }
    }

    // ---- continuous read ----

    /// Whether the flash takes addresses without commands.
    pub(crate) const fn is_continuous(&self) -> bool {
        self.is_continuous
    }

    /// A quad read with these mode bits: 10xx keeps the flash in continuous read (datasheet,
    /// command EBh).
    pub(crate) const fn read_quad(&mut self, mode_bits: u8) {
        self.is_continuous = mode_bits >> 4 & 0b11 == 0b10;
    }

    /// Ones on all wires end continuous read (datasheet, command EBh).
    pub(crate) const fn exit_continuous(&mut self) {
        self.is_continuous = false;
    }
}

/// Start address of the sector at an address.
const fn sector_of(address: u32) -> u32 {
    (address % SIZE as u32) & !(SECTOR as u32 - 1)
}

/// Bits of a byte that have changed after the share `passed` of an operation's duration: none at 0,
/// all at 1.
fn changed(chance: &mut Chance, passed: f64) -> u8 {
    if passed < 1.0 {
        chance.bits(passed)
    } else {
        u8::MAX
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const MS: u64 = 1_000_000_000;

    fn flash() -> Flash {
        Flash::new(&[], FlashTimes::Typical, 1)
    }

    /// Starts an operation and waits for its end.
    fn operate(flash: &mut Flash, kind: FlashOperationKind, address: u32, page: [u8; PAGE]) {
        let now_ps = flash
            .log
            .last()
            .map_or(0, |last| last.begun.as_ps() + 5_000 * MS);
        flash.enable_write();
        flash.begin(kind, address, Box::new(page), now_ps);
        flash.service(now_ps + kind.time(flash.times).as_ps());
        assert!(!flash.is_busy());
    }

    #[test]
    fn an_operation_takes_its_time_and_changes_nothing_before() {
        use FlashOperationKind::{EraseBlock32, EraseBlock64, EraseSector, ProgramPage};
        for (times, expected_us) in [
            (FlashTimes::Typical, [400, 45_000, 120_000, 150_000]),
            (FlashTimes::Longest, [3_000, 400_000, 1_600_000, 2_000_000]),
        ] {
            let kinds = [ProgramPage, EraseSector, EraseBlock32, EraseBlock64];
            for (kind, time_us) in kinds.into_iter().zip(expected_us) {
                let mut flash = Flash::new(&vec![0x0F; SIZE], times, 1);
                let before = flash.export();
                flash.enable_write();
                flash.begin(kind, 0x1_0000, Box::new([0x3C; PAGE]), 7);
                let ends_ps = 7 + Time::from_us(time_us).as_ps();
                assert_eq!(flash.next_event(), Some(ends_ps));
                flash.service(ends_ps - 1);
                assert!(flash.is_busy() && flash.export() == before, "{kind:?}");
                flash.service(ends_ps);
                assert!(!flash.is_busy() && flash.take_changed(), "{kind:?}");
                let value = if kind == ProgramPage { 0x0C } else { 0xFF };
                let bytes = kind.bytes();
                assert_eq!(flash.bytes(0x1_0000, bytes), vec![value; bytes as usize]);
                let around = [flash.byte(0xFFFF), flash.byte(0x1_0000 + bytes)];
                assert_eq!(around, [0x0F; 2], "{kind:?}");
            }
        }
    }

    #[test]
    fn a_write_that_was_not_enabled_does_nothing_and_an_enabled_one_counts_once() {
        let mut flash = flash();
        let sector = FlashOperationKind::EraseSector;
        flash.begin(sector, 0, Box::new([0; PAGE]), 0);
        assert!(!flash.is_busy());
        operate(&mut flash, sector, 0, [0; PAGE]);
        flash.begin(sector, 0, Box::new([0; PAGE]), 0);
        assert!(!flash.is_busy());
        assert_eq!(flash.operations().len(), 1);
    }

    /// A flash whose power failed in one operation, and the share of the operation's duration until
    /// then.
    fn cut(seed: u64, kind: FlashOperationKind, before: u8, page: u8) -> (Flash, f64) {
        let mut flash = Flash::new(&vec![before; SIZE], FlashTimes::Typical, seed);
        flash.cut_power_at_operation(0);
        flash.enable_write();
        flash.begin(kind, 0, Box::new([page; PAGE]), 0);
        let fails_ps = flash.next_event().unwrap();
        flash.service(fails_ps);
        assert!(flash.has_lost_power(fails_ps) && !flash.has_lost_power(fails_ps - 1));
        flash.cycle_power(fails_ps + MS);
        assert!(!flash.has_lost_power(u64::MAX) && !flash.is_busy());
        (
            flash,
            fails_ps as f64 / kind.time(FlashTimes::Typical).as_ps() as f64,
        )
    }

    #[test]
    fn a_cut_program_clears_some_of_its_bits_and_no_other() {
        for seed in 0..50 {
            let (flash, passed) = cut(seed, FlashOperationKind::ProgramPage, 0xF0, 0x3C);
            let page = flash.bytes(0, PAGE as u32);
            assert!(page.iter().all(|byte| byte & 0x3F == 0x30), "{seed}");
            let cleared: u32 = page
                .iter()
                .map(|byte| (byte & 0xC0).count_zeros() - 6)
                .sum();
            // Of the 512 bits to be cleared, the share `passed` is expected; the bound is 4.5
            // standard deviations.
            assert!((f64::from(cleared) - passed * 512.0).abs() < 51.0, "{seed}");
            assert_eq!(flash.byte(PAGE as u32), 0xF0);
        }
    }

    #[test]
    fn a_cut_erase_leaves_bits_of_either_value_in_its_sector_alone() {
        let mut cleared = 0;
        for seed in 0..50 {
            let (flash, passed) = cut(seed, FlashOperationKind::EraseSector, 0x0F, 0);
            let sector = flash.bytes(0, SECTOR as u32);
            let ones: u32 = sector.iter().map(|byte| byte.count_ones()).sum();
            let (all, half) = (8.0 * SECTOR as f64, 4.0 * SECTOR as f64);
            let expected = if passed < CLEARING {
                cleared += 1;
                half * (1.0 - passed / CLEARING)
            } else {
                all * (passed - CLEARING) / (1.0 - CLEARING)
            };
            assert!((f64::from(ones) - expected).abs() < 450.0, "{seed}");
            assert_eq!(flash.byte(SECTOR as u32), 0x0F);
        }
        assert!((5..30).contains(&cleared), "{cleared}");
    }

    /// One action of a test on the flash.
    #[derive(Clone, Debug)]
    enum Deed {
        Program(u32, Vec<u8>),
        Erase(FlashOperationKind, u32),
        Flip(u32, u8),
    }

    fn deeds() -> impl Strategy<Value = Vec<Deed>> {
        use FlashOperationKind::{EraseBlock32, EraseBlock64, EraseSector};
        // Few addresses, so that the actions overlap; the last ones of the flash as well.
        let address = prop_oneof![0..0x2_2000_u32, SIZE as u32 - 0x400..SIZE as u32];
        let kind = prop_oneof![Just(EraseSector), Just(EraseBlock32), Just(EraseBlock64)];
        let bytes = proptest::collection::vec(any::<u8>(), 1..600);
        let deed = prop_oneof![
            4 => (address.clone(), bytes).prop_map(|(address, bytes)| Deed::Program(address, bytes)),
            1 => (kind, address.clone()).prop_map(|(kind, address)| Deed::Erase(kind, address)),
            1 => (address, 0..8_u8).prop_map(|(address, bit)| Deed::Flip(address, bit)),
        ];
        proptest::collection::vec(deed, 1..24)
    }

    /// Applies an action to a plain array.
    fn expect(model: &mut [u8], deed: &Deed) {
        match deed {
            Deed::Program(address, bytes) => {
                let page = *address as usize / PAGE * PAGE;
                let mut buffer = [0xFF; PAGE];
                for (index, byte) in bytes.iter().enumerate() {
                    buffer[(*address as usize + index) % PAGE] = *byte;
                }
                for (offset, byte) in buffer.into_iter().enumerate() {
                    model[page + offset] &= byte;
                }
            }
            Deed::Erase(kind, address) => {
                let size = kind.bytes() as usize;
                let first = *address as usize / size * size;
                model[first..first + size].fill(0xFF);
            }
            Deed::Flip(address, bit) => model[*address as usize] ^= 1 << bit,
        }
    }

    fn command(flash: &mut Flash, bytes: &[u8], now_ps: u64) {
        flash.select();
        for &byte in bytes {
            flash.exchange(byte).unwrap();
        }
        flash.deselect(now_ps);
    }

    fn perform(flash: &mut Flash, deed: &Deed, now_ps: u64) {
        let (code, address, data) = match deed {
            Deed::Program(address, bytes) => (0x02, *address, bytes.as_slice()),
            Deed::Erase(FlashOperationKind::EraseSector, address) => (0x20, *address, &[][..]),
            Deed::Erase(FlashOperationKind::EraseBlock32, address) => (0x52, *address, &[][..]),
            Deed::Erase(_, address) => (0xD8, *address, &[][..]),
            Deed::Flip(address, bit) => return flash.flip_bit(*address, *bit),
        };
        let [_, high, middle, low] = address.to_be_bytes();
        command(flash, &[0x06], now_ps);
        command(flash, &[&[code, high, middle, low], data].concat(), now_ps);
        assert!(flash.is_busy());
        flash.service(now_ps + 200 * MS);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn commands_do_to_the_flash_what_they_do_to_a_plain_array(deeds in deeds()) {
            let mut model = vec![0xFF; SIZE];
            let mut flash = flash();
            for (index, deed) in deeds.iter().enumerate() {
                expect(&mut model, deed);
                perform(&mut flash, deed, index as u64 * 200 * MS);
            }
            prop_assert!(flash.export() == model);
        }
    }
}
