//! `palpate field profile`: the field along a line.

use std::io::{self, Write};

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_field::geometry::Point;
use palpate_field::solve::{FieldAt, Locator, Solved};

use super::drive::{Drive, reached};
use super::input::{DesignSource, current, sharpened};
use super::tables::BeyondTable;

/// The field along a line, in mm and tesla, per ampere or at a current
#[derive(Args)]
#[command(after_help = "\
Every value is within 100 times --accuracy of |B| there (1 % without it), or of a fiftieth of the \
core's mean where it is weaker; nearer than 0.1 mm to a corner of a plate or body no accuracy is \
stated. Exit code 1 where that is not reached. \
`radius@x=` and `parallel@r=` take mm in the design's own coordinates: A has its mid-plane at 4.14.")]
pub(super) struct Arguments {
    #[command(flatten)]
    source: DesignSource,
    /// axis; radius@x=MM: outwards at a position on the axis; parallel@r=MM: along the axis
    #[arg(long, value_parser = line, allow_hyphen_values = true)]
    along: ProfileLine,
    /// The field at this current, with saturation, A
    #[arg(long, value_name = "A", value_parser = current)]
    current: Option<f64>,
    /// Start of the line, mm; without it, the start of the design's drawing
    #[arg(long, value_name = "MM", allow_hyphen_values = true)]
    from: Option<f64>,
    /// End of the line, mm
    #[arg(long, value_name = "MM", allow_hyphen_values = true)]
    to: Option<f64>,
    /// Number of points
    #[arg(long, default_value_t = 201, value_parser = clap::value_parser!(u32).range(2..=100_000))]
    points: u32,
    /// Print CSV instead of a table
    #[arg(long)]
    csv: bool,
}

/// A line in the half-plane; lengths in m.
#[derive(Clone, Copy, Debug)]
pub(super) enum ProfileLine {
    /// Along x, at this r.
    Parallel(f64),
    /// Along r, at this x.
    Radius(f64),
}

pub(super) fn line(text: &str) -> Result<ProfileLine, String> {
    let allowed = "allowed: axis, radius@x=MM, parallel@r=MM";
    let number = |text: &str| {
        let value: f64 = text.parse().map_err(|_| allowed)?;
        if value.is_finite() {
            Ok(1e-3 * value)
        } else {
            Err(allowed)
        }
    };
    if text == "axis" {
        Ok(ProfileLine::Parallel(0.0))
    } else if let Some(x) = text.strip_prefix("radius@x=") {
        Ok(ProfileLine::Radius(number(x)?))
    } else if let Some(r) = text.strip_prefix("parallel@r=") {
        match number(r)? {
            r if r >= 0.0 => Ok(ProfileLine::Parallel(r)),
            _ => Err("r is 0 or more".into()),
        }
    } else {
        Err(allowed.into())
    }
}

impl ProfileLine {
    /// Evenly spaced points on the line.
    pub(super) fn points(self, [from, to]: [f64; 2], count: u32) -> Vec<Point> {
        let step = (to - from) / f64::from(count.max(2) - 1);
        let along = (0..count).map(|point| from + f64::from(point) * step);
        along
            .map(|at| match self {
                Self::Parallel(r) => [r, at],
                Self::Radius(x) => [at, x],
            })
            .collect()
    }

    /// Returns positions along the line, m, with the field at these points.
    pub(super) fn sample(self, solved: &Solved, points: &[Point]) -> Vec<(f64, FieldAt)> {
        let locator = Locator::new(&solved.level, &solved.w);
        let along = |[r, x]: Point| match self {
            Self::Parallel(_) => x,
            Self::Radius(_) => r,
        };
        let points = points.iter();
        points
            .map(|&point| (along(point), locator.at(point)))
            .collect()
    }

    /// Range of the line between two ends, mm; without them, within the circle around the design. The
    /// range is in m.
    pub(super) fn between(
        self,
        solved: &Solved,
        ends_mm: [Option<f64>; 2],
    ) -> Result<[f64; 2], Failure> {
        let mut range = self.range(solved);
        for (end, given) in range.iter_mut().zip(ends_mm) {
            if let Some(given) = given {
                *end = 1e-3 * given;
            }
        }
        let lowest = if matches!(self, Self::Radius(_)) {
            0.0
        } else {
            f64::NEG_INFINITY
        };
        if !(range[0] < range[1] && range[0] >= lowest && range[1].is_finite()) {
            return Err(Failure::Argument(
                "--from has to be below --to, and for a radius 0 or more".to_owned(),
            ));
        }
        Ok(range)
    }

    /// Range of the line within the circle around the design, m.
    pub(super) fn range(self, solved: &Solved) -> [f64; 2] {
        let circle = solved.level.space.mesh.circle;
        match self {
            Self::Radius(_) => [0.0, circle.radius],
            Self::Parallel(_) => [
                circle.centre_x - circle.radius,
                circle.centre_x + circle.radius,
            ],
        }
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let design = arguments.source.load()?;
    let drive = Drive::of(&design, arguments.current)?;
    let solved = drive.attempt(&design, &arguments.source.effort)?;
    BeyondTable::say_all(&design, &solved);
    let range = (arguments.along).between(&solved, [arguments.from, arguments.to])?;
    let points = arguments.along.points(range, arguments.points);
    let solved = sharpened(&design, solved, &points, &arguments.source.effort)?;
    let samples = arguments.along.sample(&solved, &points);
    let mut out = io::stdout().lock();
    let per = drive.per();
    if arguments.csv {
        writeln!(out, "{}", csv_head(drive))?;
    } else {
        writeln!(
            out,
            "{:>10} {:>12} {:>12} {:>12}",
            "mm",
            format!("|B| uT{per}"),
            format!("Bx uT{per}"),
            format!("Br uT{per}")
        )?;
    }
    for (at, field) in samples {
        let (mm, size, [br, bx]) = (1e3 * at, field.size(), field.b);
        if arguments.csv {
            writeln!(out, "{mm:.6},{size:.9e},{bx:.9e},{br:.9e}")?;
        } else {
            let [size, bx, br] = [size, bx, br].map(|b| 1e6 * b);
            writeln!(out, "{mm:>10.4} {size:>12.3} {bx:>12.3} {br:>12.3}")?;
        }
    }
    reached(&design, &solved)
}

fn csv_head(drive: Drive) -> &'static str {
    match drive {
        Drive::PerAmpere => "mm,B_T_per_A,Bx_T_per_A,Br_T_per_A",
        Drive::Current(_) | Drive::Background => "mm,B_T,Bx_T,Br_T",
    }
}
