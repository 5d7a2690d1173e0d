//! Converter tasks: each runs `palpate_node::converter` on its converter.

use core::future::Future;

use heapless::spsc::Producer;
use palpate_node::acquisition::Sampled;
use palpate_node::board::Clkin;
use palpate_node::converter::{CONVERTERS, ConverterState, ConverterTask, Port};
use palpate_node::supervision::Task;
use rtic::Mutex;
use rtic_monotonics::rp2040::prelude::*;

use crate::board::i2c::{self, Edges, Master};
use crate::board::pins::{self, IntbPin};
use crate::supervision::CHECK_INS;
use crate::wakeup::SAMPLES;
use crate::{Mono, app};

/// Longest wait without a check-in, in microseconds: half of the supervisor's period.
const SLICE_US: u32 = 5_000;

/// Resources of a converter's task.
pub struct Sensing {
    master: Master,
    edges: Edges,
    /// Queue of samples to the instrument.
    samples: Producer<'static, Sampled>,
}

impl Sensing {
    /// Takes the resources of a converter's task; `None` if they were already taken.
    pub fn take(converter: usize, samples: Producer<'static, Sampled>) -> Option<Self> {
        let (master, edges) = i2c::take(converter)?;
        Some(Self {
            master,
            edges,
            samples,
        })
    }
}

/// Task loop of the first converter.
pub async fn sensing(cx: app::sensing::Context<'_>) {
    run(0, cx.local.first, cx.shared.converters).await;
}

/// Task loop of the second converter.
pub async fn second_sensing(cx: app::second_sensing::Context<'_>) {
    run(1, cx.local.second, cx.shared.converters).await;
}

fn run<'a, S>(
    converter: usize,
    sensing: &'a mut Sensing,
    states: S,
) -> impl Future<Output = ()> + use<'a, S>
where
    S: Mutex<T = [ConverterState; CONVERTERS]>,
{
    let Sensing {
        master,
        edges,
        samples,
    } = sensing;
    let port = PicoPort {
        converter,
        states,
        samples,
    };
    async move {
        ConverterTask::new(converter, master, edges, port)
            .run()
            .await;
    }
}

/// Pins, clock and timer of a converter.
struct PicoPort<'a, S> {
    converter: usize,
    states: S,
    samples: &'a mut Producer<'static, Sampled>,
}

impl<S: Mutex<T = [ConverterState; CONVERTERS]>> Port for PicoPort<'_, S> {
    type Intb = IntbPin;

    fn intb(&self) -> IntbPin {
        IntbPin(pins::intb(self.converter))
    }

    fn shut_down(&mut self, off: bool) {
        pins::shut_down(self.converter, off);
    }

    fn set_clkin(&mut self, clkin: Clkin) {
        pins::set_clkin(clkin);
    }

    async fn wait_us(&mut self, time_us: u32) {
        let task = if self.converter == 0 {
            Task::Sensing
        } else {
            Task::SecondSensing
        };
        let mut left_us = time_us;
        while left_us > 0 {
            CHECK_INS.check_in(task);
            let slice_us = left_us.min(SLICE_US);
            Mono::delay(u64::from(slice_us).micros()).await;
            left_us -= slice_us;
        }
    }

    fn with_states<T>(&mut self, work: impl FnOnce(&mut [ConverterState; CONVERTERS]) -> T) -> T {
        self.states.lock(work)
    }

    fn hand_over(&mut self, sampled: Sampled) -> bool {
        defmt::debug!("sample of {} us", sampled.time_us);
        let has_room = self.samples.enqueue(sampled).is_ok();
        SAMPLES.call();
        has_room
    }
}
