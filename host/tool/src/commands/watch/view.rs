//! State of a board as lines of a terminal.

use console::Style;
use palpate_cli::describe::stiffness;
use palpate_cli::modulus::Evaluated;
use palpate_wire::code::Contact;
use palpate_wire::record::{Conversion, Estimate, Sample, Touch};

use super::chart;
use super::history::History;
use super::known::{Known, MeasurementResult};

/// A view of a given size.
pub(super) struct View {
    rows: usize,
    columns: usize,
    colour: bool,
}

/// Width of the names on the left, in columns.
const NAMES: usize = 14;
/// Smallest useful height of a chart, rows.
const LEAST_CHART: usize = 3;

impl View {
    /// Creates a view of `rows` x `columns` characters.
    pub(super) fn new((rows, columns): (u16, u16), colour: bool) -> Self {
        Self {
            rows: rows.into(),
            columns: columns.into(),
            colour,
        }
    }

    /// Returns one line less than the terminal has, since the cursor needs the last one.
    pub(super) fn lines(&self, known: &Known) -> Vec<String> {
        let mut lines = vec![self.title(known), String::new()];
        lines.extend(self.state(known));
        lines.extend(
            known
                .samples
                .iter()
                .flatten()
                .flat_map(|of| self.sample(of)),
        );
        lines.extend(
            known
                .touch
                .iter()
                .map(|touch| self.plain("touch", &placed(touch))),
        );
        lines.push(self.conditions(known));
        lines.push(self.result(known));
        let modulus = known.modulus.iter().flat_map(Evaluated::lines);
        lines.extend(modulus.map(|text| self.plain("", &text)));
        let sentences = known
            .limited_by
            .iter()
            .flat_map(|text| text.splitn(2, ". "));
        lines.extend(sentences.map(|sentence| self.plain("", sentence)));
        lines.extend(known.relaxation.iter().map(|text| self.plain("", text)));
        lines.push(self.losses(known));
        lines.extend(self.faults(known));
        let rows = self.rows.saturating_sub(1);
        let left = rows.saturating_sub(lines.len() + 2);
        if left >= LEAST_CHART {
            lines.push(String::new());
            lines.extend(self.chart(known, left));
        }
        lines.resize(rows, String::new());
        lines
    }

    fn style(&self, style: Style, text: &str) -> String {
        style.force_styling(self.colour).apply_to(text).to_string()
    }

    /// A name with its text, cut to the width.
    fn named(&self, name: &str, text: &str, style: Style) -> String {
        let room = self.columns.saturating_sub(NAMES);
        let text: String = text.chars().take(room).collect();
        format!("{name:NAMES$}{}", self.style(style, &text))
    }

    fn plain(&self, name: &str, text: &str) -> String {
        self.named(name, text, Style::new())
    }

    fn title(&self, known: &Known) -> String {
        let what = known.hello.as_ref().map_or_else(String::new, |hello| {
            format!(
                "  firmware {}.{}.{}  unit {:016X}",
                hello.firmware_major, hello.firmware_minor, hello.firmware_patch, hello.unit
            )
        });
        let title = format!("{}{what}  {:.1} s", known.board, known.time_s);
        let title: String = title.chars().take(self.columns).collect();
        self.style(Style::new().bold(), &title)
    }

    fn state(&self, known: &Known) -> Vec<String> {
        if let Some(reason) = &known.gone {
            return vec![self.named("state", reason, Style::new().red())];
        }
        let state = known.state.map_or("not known yet", |state| state.name());
        let armed = if known.armed { "armed" } else { "not armed" };
        let touch = match known.contact() {
            None | Some(Contact::Settling) => "contact unknown",
            Some(Contact::Clear | Contact::Ended) => "nothing touches",
            Some(_) => "touched",
        };
        vec![self.plain("state", &format!("{state}, {armed}, {touch}"))]
    }

    /// One line for each channel, and one for the force.
    fn sample(&self, sample: &Sample) -> Vec<String> {
        let channels = sample.channels.iter();
        let lines = channels.map(|channel| self.channel(sample.sensor, channel));
        let force = match (sample.force_n, sample.force_sigma_n) {
            (Some(force_n), Some(sigma_n)) => format!("{force_n:.3} N ± {:.3}", 2.0 * sigma_n),
            _ => "not calibrated".to_owned(),
        };
        let current = sample
            .current_a
            .map_or_else(|| "not measured".to_owned(), |of| format!("{of:.2} A"));
        let force = self.plain("force", &format!("{force}, coil {current}"));
        lines.chain([force]).collect()
    }

    fn channel(&self, sensor: u8, channel: &Conversion) -> String {
        let deformation = match (channel.deformation_m, channel.deformation_sigma_m) {
            (Some(deformation_m), Some(sigma_m)) => {
                format!("{:.2} µm ± {:.2}", 1e6 * deformation_m, 2e6 * sigma_m)
            }
            _ => "not calibrated".to_owned(),
        };
        let beyond = if channel.extrapolated {
            ", beyond the curve"
        } else {
            ""
        };
        let name = format!("channel {sensor}.{}", channel.channel);
        let frequency_mhz = 1e-6 * channel.frequency_hz;
        self.plain(
            &name,
            &format!("{frequency_mhz:.6} MHz, {deformation}{beyond}"),
        )
    }

    fn conditions(&self, known: &Known) -> String {
        let Some(status) = &known.status else {
            return self.plain("board", "");
        };
        let of = |value: Option<f32>, unit: &str| {
            value.map_or_else(|| format!("- {unit}"), |value| format!("{value:.1} {unit}"))
        };
        let load = of(status.processor_load.map(|part| 100.0 * part), "%");
        let text = format!(
            "coil {}, supply {}, processor {load}",
            of(status.temperature_c, "°C"),
            of(status.supply_v, "V"),
        );
        self.plain("board", &text)
    }

    fn result(&self, known: &Known) -> String {
        let Some((at_s, outcome)) = &known.result else {
            return self.plain("stiffness", "nothing measured yet");
        };
        let ago_s = (known.time_s - at_s).max(0.0);
        match outcome {
            MeasurementResult::Estimate(estimate) => {
                let text = format!("{}, {ago_s:.0} s ago", claim(estimate));
                self.named("stiffness", &text, Style::new().green().bold())
            }
            MeasurementResult::Refusal(reason) => {
                let text = format!("refused {ago_s:.0} s ago: {reason}");
                self.named("stiffness", &text, Style::new().yellow())
            }
        }
    }

    fn losses(&self, known: &Known) -> String {
        let mut text = format!(
            "{} of {} records",
            known.missing,
            known.received + known.missing
        );
        let mut count = known.missing + u64::from(known.damaged);
        if known.damaged > 0 {
            text += &format!(", {} damaged frames", known.damaged);
        }
        if let Some(status) = &known.status {
            let lost =
                u64::from(status.conversions_lost) + u64::from(status.second_conversions_lost);
            text += &format!(", {lost} conversions");
            count += lost;
        }
        let style = if count > 0 {
            Style::new().yellow()
        } else {
            Style::new()
        };
        self.named("lost", &text, style)
    }

    fn faults(&self, known: &Known) -> Vec<String> {
        if known.faults.is_empty() {
            return vec![self.plain("faults", "none")];
        }
        let faults = known.faults.iter();
        let lines = faults.map(|code| {
            let meaning = code.meaning().trim();
            let text = format!("{} {code}: {meaning}", code.number());
            self.named("fault", &text, Style::new().red().bold())
        });
        lines.collect()
    }

    /// Chart of the deformation of the last seconds, scaled to its maximum.
    fn chart(&self, known: &Known, rows: usize) -> Vec<String> {
        let columns = self.columns.saturating_sub(NAMES);
        let values: Vec<f64> = known.deformation.last(columns).collect();
        let greatest_m = values.iter().copied().fold(0.0, f64::max);
        let span_s = columns as f64 * History::MEAN_S;
        let label = format!(
            "deformation of the last {span_s:.0} s, up to {:.1} µm",
            1e6 * greatest_m
        );
        let lines = chart::lines(&values, greatest_m, rows.saturating_sub(1), columns);
        let style = Style::new().cyan();
        let lines = lines.iter().map(|line| self.named("", line, style.clone()));
        lines.chain([self.plain("", &label)]).collect()
    }
}

/// Place, force and radius with their standard errors, or why there are none.
fn placed(touch: &Touch) -> String {
    let place = touch
        .x_m
        .zip(touch.x_sigma_m)
        .zip(touch.y_m.zip(touch.y_sigma_m));
    let force = touch.force_n.zip(touch.force_uncertainty);
    let Some((((x, x_sigma), (y, y_sigma)), (force_n, part))) = place.zip(force) else {
        return touch.verdict.name().replace('_', " ");
    };
    let [x, x_sigma, y, y_sigma] = [x, x_sigma, y, y_sigma].map(|of| 1e3 * of);
    let radius = touch.radius_m.zip(touch.radius_uncertainty).map_or_else(
        || "radius not determined".to_owned(),
        |(radius_m, part)| {
            format!(
                "radius {:.2} ± {:.2} mm",
                1e3 * radius_m,
                1e3 * radius_m * part
            )
        },
    );
    format!(
        "x {x:.3} ± {x_sigma:.3} mm, y {y:.3} ± {y_sigma:.3} mm, {force_n:.3} ± {:.3} N, {radius}",
        force_n * part
    )
}

/// Formats a result.
fn claim(estimate: &Estimate) -> String {
    let of = |n_per_m: Option<f32>| stiffness(n_per_m.map_or(f64::INFINITY, f64::from));
    format!(
        "{}, 95 % {} to {}, at {:.2} N",
        of(estimate.stiffness_n_per_m),
        of(Some(estimate.lower_n_per_m)),
        of(estimate.upper_n_per_m),
        estimate.force_n
    )
}
