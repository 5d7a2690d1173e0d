//! The result, as Markdown.

use std::io::Write;

use comfy_table::presets::ASCII_MARKDOWN;
use comfy_table::{CellAlignment, Table};
use palpate_cli::evidence::{BEGIN, END};
use palpate_cli::failure::Failure;
use palpate_emulator::{Handler, Image, Sources};
use palpate_sim::Time;

use super::parts::{FirmwarePart, Split};
use super::phases::{Measured, Phase};

pub(super) fn write(
    out: &mut impl Write,
    measured: &Measured,
    image: &Image,
    sources: &Sources,
    functions: usize,
) -> Result<(), Failure> {
    let splits: Vec<Split> = measured
        .phases
        .iter()
        .map(|phase| Split::new(&phase.profile, sources))
        .collect();
    writeln!(
        out,
        "Interrupts, of all phases together. A run counts without the handlers that \
         interrupt it, a start from the moment at which the interrupt is pending.\n\n{}",
        handlers(measured)
    )?;
    for (phase, split) in measured.phases.iter().zip(&splits) {
        if functions > 0 {
            let table = costliest(phase, split, functions);
            writeln!(out, "\n{}, cycles per sample:\n\n{table}", phase.name)?;
        }
    }
    let loads = measured.phases.iter().map(|phase| {
        let load = phase.load() * 100.0;
        format!("{load:.1} % {}", phase.name)
    });
    let loads = loads.collect::<Vec<_>>().join("; ");
    writeln!(
        out,
        "{BEGIN}\nProcessor load: {loads}. Flash {}, memory {}.\n\n{}\n\n\
         Cycles per sample, one channel at 1 kHz. Floating point, mathematics and copying \
         count as their caller's. {}\n\n{}\n{END}",
        kib(image.flash_bytes()),
        kib(memory_bytes(measured, image)),
        whole(measured, image),
        once(measured),
        per_sample(measured, &splits)
    )?;
    Ok(())
}

fn table(header: &[&str], left: usize) -> Table {
    let mut table = Table::new();
    table.load_style(ASCII_MARKDOWN);
    table.set_header(header);
    for column in table.column_iter_mut().skip(left) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

fn us(time: Time) -> String {
    format!("{:.2} µs", time.as_secs_f64() * 1e6)
}

/// Target of the processor load, phase by phase, at 1 kHz. A save waits for the flash in the
/// remaining time.
const LOADS: [&str; 6] = ["15 %", "15 %", "45 %", "", "", "45 %"];

fn kib(bytes: u32) -> String {
    format!("{:.1} KiB", f64::from(bytes) / 1024.0)
}

/// Static memory, code in memory and stack.
fn memory_bytes(measured: &Measured, image: &Image) -> u32 {
    image.static_bytes() + image.code_in_memory_bytes() + measured.stack_bytes
}

fn whole(measured: &Measured, image: &Image) -> Table {
    let mut rows = table(&["", "measured", "aimed at"], 1);
    for (phase, aim) in measured.phases.iter().zip(LOADS) {
        let load = format!("{:.1} %", phase.load() * 100.0);
        rows.add_row([format!("processor load, {}", phase.name), load, aim.into()]);
    }
    let of_phases = measured.phases.iter().chain([&measured.rest]);
    let mut latencies: Vec<Time> = of_phases.flat_map(|it| it.latencies.clone()).collect();
    latencies.sort_unstable();
    let median = latencies
        .get(latencies.len() / 2)
        .copied()
        .unwrap_or_default();
    let worst = latencies.last().copied().unwrap_or_default();
    for [what, value, aim] in [
        ["edge of INTB to START, median", &us(median), ""],
        ["edge of INTB to START, worst", &us(worst), "10 µs"],
        ["flash", &kib(image.flash_bytes()), ""],
        ["static memory", &kib(image.static_bytes()), ""],
        ["code in memory", &kib(image.code_in_memory_bytes()), ""],
        [
            "greatest depth of the stack",
            &kib(measured.stack_bytes),
            "",
        ],
        [
            "the three together",
            &kib(memory_bytes(measured, image)),
            "200 KiB",
        ],
        [
            "speed of the emulation, in real time, one core",
            &format!("{:.1}", measured.speed),
            "2.5",
        ],
    ] {
        rows.add_row([what, value, aim]);
    }
    rows
}

fn per_sample(measured: &Measured, splits: &[Split]) -> Table {
    let names = measured.phases.iter().map(|phase| phase.name);
    let header: Vec<&str> = ["part"].into_iter().chain(names).collect();
    let mut rows = table(&header, 1);
    let share = |cycles: u64, phase: &Phase| cycles as f64 / phase.samples.max(1) as f64;
    let mut totals = vec![0.0; splits.len()];
    for part in FirmwarePart::ALL {
        let mut row = vec![part.name().to_owned()];
        for ((phase, split), total) in measured.phases.iter().zip(splits).zip(&mut totals) {
            let cycles = share(split.charged(part), phase);
            *total += cycles;
            row.push(format!("{cycles:.0}"));
        }
        rows.add_row(row);
    }
    let mut row = vec!["entries into handlers".to_owned()];
    for ((phase, split), total) in measured.phases.iter().zip(splits).zip(&mut totals) {
        let handlers = phase.profile.handlers().values();
        let all: u64 = handlers.map(|handler| handler.cycles).sum();
        let executed: u64 = split.parts.values().map(|cycles| cycles.own).sum();
        let cycles = share(all - executed, phase);
        *total += cycles;
        row.push(format!("{cycles:.0}"));
    }
    rows.add_row(row);
    let totals = totals.iter().map(|total| format!("{total:.0}"));
    rows.add_row(["all".to_owned()].into_iter().chain(totals));
    rows
}

/// Cost of the estimate, once in a train: the longest run of the tasks that compute it.
fn once(measured: &Measured) -> String {
    let handlers = measured.rest.profile.handlers();
    let cycles = handlers.get(&ESTIMATES).map_or(0, |of| of.worst_cycles);
    format!(
        "The step that ends the train with its estimate takes {cycles} cycles, {:.1} ms, once.",
        cycles as f64 / measured.cpu_hz * 1e3
    )
}

/// Exception of the low-priority tasks, including the procedure's.
const ESTIMATES: u32 = 16 + 26;

/// Interrupts of the RP2040 (datasheet 2.3.2) that the firmware uses, with their purpose.
const INTERRUPTS: [(u32, &str); 9] = [
    (0, "TIMER_IRQ_0: the tasks' alarms"),
    (4, "PWM_IRQ_WRAP: control of the coil's current"),
    (5, "USBCTRL_IRQ: USB"),
    (7, "PIO0_IRQ_0: a transaction is over"),
    (13, "IO_IRQ_BANK0: edge of INTB"),
    (22, "ADC_IRQ_FIFO: current of the coil"),
    (23, "I2C0_IRQ: bytes of the bus"),
    (26, "SW0_IRQ: tasks of the lower priority"),
    (27, "SW1_IRQ: tasks of the higher priority"),
];

fn interrupt(exception: u32) -> String {
    let number = exception.checked_sub(16);
    let known = INTERRUPTS.iter().find(|(of, _)| Some(*of) == number);
    match (known, number) {
        (Some((_, name)), _) => (*name).to_owned(),
        (None, Some(number)) => format!("interrupt {number}"),
        (None, None) => format!("exception {exception}"),
    }
}

fn handlers(measured: &Measured) -> Table {
    let mut rows = table(
        &[
            "interrupt",
            "runs",
            "cycles, mean",
            "worst",
            "start after",
            "worst",
            "jitter",
        ],
        1,
    );
    let mut all = std::collections::BTreeMap::<u32, Handler>::new();
    for phase in measured.phases.iter().chain([&measured.rest]) {
        for (&exception, handler) in phase.profile.handlers() {
            all.entry(exception).or_default().join(handler);
        }
    }
    for (exception, handler) in all.into_iter().filter(|(exception, _)| *exception > 0) {
        let (least, worst) = handler.start.unwrap_or_default();
        rows.add_row([
            interrupt(exception),
            handler.runs.to_string(),
            format!("{:.0}", handler.cycles as f64 / handler.runs.max(1) as f64),
            handler.worst_cycles.to_string(),
            us(least),
            us(worst),
            us(handler.start_jitter()),
        ]);
    }
    rows
}

fn costliest(phase: &Phase, split: &Split, count: usize) -> Table {
    let mut rows = table(&["function", "part", "own", "with shared"], 2);
    let mut functions: Vec<_> = split.functions.iter().collect();
    functions.sort_by_key(|(_, cycles)| std::cmp::Reverse(cycles.own.max(cycles.charged)));
    let share = |cycles: u64| format!("{:.0}", cycles as f64 / phase.samples.max(1) as f64);
    for ((part, name), cycles) in functions.into_iter().take(count) {
        rows.add_row([
            name.clone(),
            part.name().to_owned(),
            share(cycles.own),
            share(cycles.charged),
        ]);
    }
    rows
}
