//! Start times of USB frames.

/// Period of a bus frame, us (USB 2.0 8.4.3.1).
const FRAME_US: u32 = 1_000;
/// Time from the start of a USB frame, us, after which no bulk packet may be made available: the packet
/// may meet the frame's end, and then the controller hangs until it is reset (RP2040-E15, whose
/// workaround excludes 800 to 998). Making a packet available takes 10 us, and interrupts may come
/// between. With 770, a packet was made available at 800 us after 44 s with the coil in its train, and
/// the controller hung. With 700, the latest packet in two minutes was made available at 721 us.
const FRAME_ENDS_US: u32 = 700;

/// Clock of the USB frames, from a flag that the controller sets at the start of a frame and that is
/// polled at any time. The clock is corrected only when a poll proves it wrong: the flag is often seen
/// late, and many times in a row.
#[derive(Clone, Copy, Debug, Default)]
pub struct UsbFrames {
    polled_us: u32,
    /// Start of the last frame whose flag was seen.
    began_us: Option<u32>,
}

impl UsbFrames {
    /// Creates the clock without a known frame, as after a bus reset.
    pub const fn new() -> Self {
        Self {
            polled_us: 0,
            began_us: None,
        }
    }

    /// Handles a poll that finds no flag. If by this clock the next frame should already have started,
    /// the clock is corrected: all frames start later.
    pub fn found_none(&mut self, now_us: u32) {
        let is_over = |&began_us: &u32| now_us.wrapping_sub(began_us) >= FRAME_US;
        if self.began_us.as_ref().is_some_and(is_over) {
            self.began_us = Some(now_us.wrapping_sub(FRAME_US - 1));
        }
        self.polled_us = now_us;
    }

    /// Handles a poll that finds the flag, which is then cleared. If by this clock no frame should have
    /// started since the last poll, the clock is corrected: all frames start earlier, this one at the
    /// time of the poll at the latest.
    pub fn found_start(&mut self, now_us: u32) {
        let since_look_us = now_us.wrapping_sub(self.polled_us);
        let late_us = self
            .began_us
            .map(|began_us| now_us.wrapping_sub(began_us) % FRAME_US)
            .filter(|&late_us| late_us < since_look_us)
            .unwrap_or(0);
        // A clock that is too fast is proven wrong only by polls between the flags; without such polls,
        // a flag that seems late by more than half a frame moves all frames a microsecond later.
        let is_doubtful = late_us > FRAME_US / 2;
        self.began_us = Some(now_us.wrapping_sub(late_us - u32::from(is_doubtful)));
        self.polled_us = now_us;
    }

    /// Returns whether no bulk packet may be made available: from the end of a frame until the next flag
    /// is seen.
    pub fn is_at_end(&self, now_us: u32) -> bool {
        self.began_us
            .is_some_and(|began_us| now_us.wrapping_sub(began_us) >= FRAME_ENDS_US)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Polls the flags of frames that start at 0 and every 1000 us, each with this delay.
    fn found(late_us: impl IntoIterator<Item = u32>) -> UsbFrames {
        let mut frames = UsbFrames::new();
        for (frame, late_us) in (1..).zip(late_us) {
            frames.found_start(1_000 * frame + late_us);
        }
        frames
    }

    fn ends_at(frames: &UsbFrames, end_us: u32) -> bool {
        !frames.is_at_end(end_us - 1) && frames.is_at_end(end_us) && frames.is_at_end(end_us + 300)
    }

    #[test]
    fn nothing_is_left_out_before_a_frame_has_begun() {
        assert!((0..2_000).all(|now_us| !UsbFrames::new().is_at_end(now_us)));
    }

    #[test]
    fn starts_that_are_found_late_do_not_move_the_clock() {
        for late_us in [1, 200, 499] {
            let frames = found([0].into_iter().chain([late_us; 300]));
            assert!(ends_at(&frames, 301_700), "{late_us} us late");
        }
        // A single late flag, followed by flags in time.
        for late_us in [501, 800, 999] {
            assert!(ends_at(&found([0, late_us]), 2_701), "{late_us} us late");
            assert!(ends_at(&found([0, late_us, 0]), 3_700), "{late_us} us late");
        }
    }

    #[test]
    fn a_clock_that_began_late_is_set_by_a_start_that_is_found_in_time() {
        for late_us in [1, 200, 499, 501, 800, 999] {
            assert!(ends_at(&found([late_us, 0]), 2_700), "{late_us} us late");
        }
    }

    #[test]
    fn a_frame_that_has_not_begun_when_it_should_sets_the_clock() {
        let mut frames = found([0]);
        frames.found_none(2_040);
        assert!(frames.is_at_end(2_041));
        frames.found_start(2_050);
        assert!(ends_at(&frames, 2_041 + 700));
    }

    #[test]
    fn the_clock_follows_frames_that_are_longer_and_shorter() {
        for ppm in [-500, 500] {
            let mut frames = UsbFrames::new();
            let start_us = |frame: i32| (frame * 1_000 + frame * ppm / 1_000) as u32;
            for frame in 1..4_000 {
                frames.found_start(start_us(frame));
                // Polls at all times of a frame.
                frames.found_none(start_us(frame) + (617 * frame as u32) % 999);
            }
            let last_us = start_us(3_999);
            assert!(!frames.is_at_end(last_us + 650) && frames.is_at_end(last_us + 701));
        }
    }
}
