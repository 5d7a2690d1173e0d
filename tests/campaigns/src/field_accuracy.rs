//! `cargo campaign field-accuracy`: measures the solver on every built-in design: figures with
//! their estimated and true errors, profiles, force by two methods, Newton steps, time. The truth
//! is a fourth-order solution with a tolerance thirty times tighter, whose own error is far below
//! the errors judged here.
//!
//! Prints Markdown for `cargo xtask evidence field-accuracy`; fails where a claim does not hold.

#[path = "../../../model/field/tests/integration/dodd_deeds.rs"]
mod dodd_deeds;

use std::f64::consts::{PI, TAU};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use palpate_field::design::{BUILTIN, Design, builtin};
use palpate_field::figures::Figures;
use palpate_field::geometry::{Point, distance};
use palpate_field::solve::{
    Accuracy, Excitation, Locator, SolveError, Solved, Wanted, solve, solve_ac, solve_for,
};

use palpate_cli::evidence::{BEGIN, END};

use dodd_deeds::{MU_0, Plate, Ring, Spectrum};

const FINE: Accuracy = Accuracy {
    relative: 3e-6,
    order: 4,
    most_unknowns: 300_000,
};
/// Tolerance of `palpate field profile`.
const SHARP: f64 = 2e-3;
const CLAIMED: f64 = 1e-4;
const CLAIMED_PROFILE: f64 = 1e-2;

pub(crate) fn run() -> ExitCode {
    match measured() {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => {
            eprintln!("a claim does not hold");
            ExitCode::FAILURE
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

struct AccuracyRow {
    /// Row of the page, row of the profiles, and row of the ratios of true errors to estimates.
    text: [String; 3],
    /// Greatest ratio of a true error to its estimate, greatest difference of a profile, and
    /// difference of the forces.
    worst: [f64; 3],
    holds: bool,
}

fn measured() -> Result<bool, Box<dyn core::error::Error>> {
    let rows: Vec<(&str, AccuracyRow)> = BUILTIN
        .into_iter()
        .map(|name| Ok((name, judge(&builtin(name)?)?)))
        .collect::<Result<_, Box<dyn core::error::Error>>>()?;
    for (head, index) in [
        (
            "## Profiles\n\n| design | axis | r = R/2 | r = 0.9 R | radius in mid-plane | at 0.4 of the half gap | at 0.8 of it |\n\
             |---|---|---|---|---|---|---|",
            1,
        ),
        (
            "## True error over estimate\n\n\
             | design | centre | core mean | cv r8 | cv r6 | cv r4 | axial pp | radial pp | linkage | force | plates |\n\
             |---|---|---|---|---|---|---|---|---|---|---|",
            2,
        ),
    ] {
        println!("\n{head}");
        for (name, row) in &rows {
            println!("| {name} | {} |", row.text[index]);
        }
    }
    let (sheets, sheets_hold) = sheets()?;
    let holds = sheets_hold && rows.iter().all(|(_, row)| row.holds);
    let [ratio, profile, force] = [0, 1, 2].map(|index| {
        let of_designs = rows.iter().map(|(_, row)| row.worst[index]);
        of_designs.fold(0.0, f64::max)
    });
    println!(
        "{BEGIN}\n{}; the true error is at most {ratio:.2} of the estimate, profiles are within {:.2} %, forces by two methods within \
         {:.2} %.\n\n\
         Truth: fourth order at 3e-6; estimated and true errors of the figures are relative, for 1e-4. Profiles: the greatest difference over |B| (or a \
         fiftieth of the core's mean, where |B| is less), farther than 0.1 mm from corners, over 601 points on each of six lines. \
         Energy: that of the field in all of space over half the work of the currents. Linear solves: saturated at the design's \
         current.\n\n\
         | design | centre uT/A | core mean uT/A | centre: estimate | true | mean: estimate | true | virtual work / stress - 1 | energy - 1 \
         | linear solves on the last mesh | on all | unknowns | ms, meshing included | profiles |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|---|---|",
        if holds {
            "Every estimate covers its error and is at most 1e-4"
        } else {
            "A claim does not hold"
        },
        1e2 * profile,
        1e2 * force,
    );
    for (name, row) in &rows {
        println!("| {name} | {} |", row.text[0]);
    }
    println!("\n{sheets}\n{END}");
    Ok(holds)
}

/// A ring above copper sheets, wide and thin, at a frequency: estimated against true errors.
/// Returns the greatest of these errors as text, and whether every estimate covers its error.
fn sheets() -> Result<(String, bool), Box<dyn core::error::Error>> {
    const RADIUS_M: f64 = 10.0;
    const COPPER_S_PER_M: f64 = 5.8e7;
    println!(
        "\n## Wide thin parts at a frequency, for 1e-4\n\n\
         A ring of 10 turns, 20 mm in radius, 5 mm above a copper sheet 10 m in radius. Truth: Dodd and Deeds. Errors are relative.\n\n\
         | radius over thickness | thickness over skin depth | L uH | R mohm | L: estimate | true | R: estimate | true | L of a constant current: estimate | true | unknowns | ms |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|"
    );
    let ring = Ring {
        r_m: [19.5e-3, 20.5e-3],
        above_m: [5e-3, 6e-3],
        turns: 10.0,
    };
    let spectrum = Spectrum::of(ring);
    let in_air_h = spectrum.in_air_h();
    let mut holds = true;
    let mut greatest = [[0.0_f64; 2]; 3];
    for (slenderness, skin_depths) in [10.0, 100.0, 1000.0]
        .into_iter()
        .flat_map(|slenderness| [0.3, 3.0, 30.0].map(|skin_depths| (slenderness, skin_depths)))
    {
        let sheet = Plate {
            conductivity: COPPER_S_PER_M,
            mu_r: 1.0,
            loss_tangent: 0.0,
            thickness_m: RADIUS_M / slenderness,
        };
        let skin_depth_m = sheet.thickness_m / skin_depths;
        let frequency_hz = 1.0 / (PI * MU_0 * COPPER_S_PER_M * skin_depth_m.powi(2));
        let text = format!(
            "name = \"sheet\"\nlength_unit = \"m\"\n[core]\nr = 10e-3\nx = [1e-3, 4e-3]\n\
             [conductor]\nresistivity_ohm_m = 1.72e-8\ncurrent_A = 1\n{}{}",
            sheet.disc(RADIUS_M),
            ring.coil("c")
        );
        let design = Design::parse("sheet", &text)?;
        let start = Instant::now();
        let solved = solve_ac(&design, None, frequency_hz, &[0], &Accuracy::default())?;
        let time = start.elapsed();
        let coil = &solved.coils[0];
        let omega = TAU * frequency_hz;
        let change = spectrum.added_by(&sheet, omega);
        let rows = [
            (coil.inductance_h, in_air_h + change.re),
            (
                coil.resistance_ohm,
                coil.dc_resistance_ohm - omega * change.im,
            ),
            (coil.dc_inductance_h, in_air_h),
        ];
        let mut errors = String::new();
        for (((found, truth), estimate), worst) in
            rows.into_iter().zip(coil.errors).zip(&mut greatest)
        {
            let (error, estimate) = ((found / truth - 1.0).abs(), estimate / truth);
            *worst = [worst[0].max(estimate), worst[1].max(error)];
            errors.push_str(&format!("{estimate:.1e} | {error:.1e} | "));
            holds &= error <= estimate + Spectrum::LEFT_OUT;
        }
        holds &= solved.reached;
        println!(
            "| {slenderness} | {skin_depths} | {:.5} | {:.5} | {errors}{} | {:.0} |",
            1e6 * coil.inductance_h,
            1e3 * coil.resistance_ohm,
            solved.unknowns,
            1e3 * time.as_secs_f64(),
        );
    }
    let [l, r, constant] =
        greatest.map(|[estimate, error]| format!("{estimate:.1e} and {error:.1e}"));
    let text = format!(
        "A ring of 10 turns 5 mm above copper sheets 10 m in radius, 10 to 1000 times as wide as thick, 0.3 to 30 skin depths thick, against \
         Dodd and Deeds: greatest estimate and true error {l} of L, {r} of R, {constant} of L of a constant current."
    );
    Ok((text, holds))
}

fn judge(design: &Design) -> Result<AccuracyRow, SolveError> {
    let small = Excitation::small(design, 1.0);
    let of_figures = |excitation: &Excitation| {
        solve_for(design, excitation, &Accuracy::default(), Wanted::Figures)
    };
    let (solved, time) = timed(|| of_figures(&small))?;
    let fine = solve(design, &small, &FINE)?;
    let (f, e, t) = (&solved.figures, &solved.errors, &fine.figures);
    let centre = [
        e.centre_t / f.centre_t,
        (f.centre_t / t.centre_t - 1.0).abs(),
    ];
    let mean = [
        e.core_mean_t / f.core_mean_t,
        (f.core_mean_t / t.core_mean_t - 1.0).abs(),
    ];
    let covered = |[estimate, error]: [f64; 2]| error <= estimate && estimate <= CLAIMED;
    let force = f.force_n / f.force_by_stress_n - 1.0;
    let energy = solved.energy_j() / (0.5 * solved.work_j(design)) - 1.0;
    let saturated = Excitation::saturating(design, design.current_a);
    let saturated = of_figures(&saturated)?;
    let forces_agree = force.abs() <= 5e-3;
    let solves = saturated.report.newton_iterations <= 6;
    let ratios = ratios(&solved, &fine);
    let ratio_cells: Vec<String> = ratios.iter().map(|ratio| format!("{ratio:.2}")).collect();
    let all_covered = ratios.iter().all(|&ratio| ratio <= 1.0);
    let holds = covered(centre) && covered(mean) && all_covered;
    let report = &saturated.report;
    let figures = format!(
        "{:.4} | {:.4} | {:.1e} | {:.1e} | {:.1e} | {:.1e} | {force:.1e} | {energy:.1e} | {} | {} | {} | {:.0}",
        1e6 * f.centre_t,
        1e6 * f.core_mean_t,
        centre[0],
        centre[1],
        mean[0],
        mean[1],
        report.newton_iterations,
        report.linear_solves,
        solved.report.unknowns,
        1e3 * time.as_secs_f64(),
    );
    let field = solve(design, &small, &Accuracy::default())?;
    let misses = profiles(design, field, fine)?;
    let near = misses.iter().all(|&miss| miss <= CLAIMED_PROFILE);
    let cells: Vec<String> = misses.iter().map(|miss| format!("{miss:.1e}")).collect();
    let profile = misses.into_iter().fold(0.0, f64::max);
    Ok(AccuracyRow {
        worst: [ratios.into_iter().fold(0.0, f64::max), profile, force.abs()],
        text: [
            format!("{figures} | {profile:.1e}"),
            cells.join(" | "),
            ratio_cells.join(" | "),
        ],
        holds: holds && forces_agree && solves && near,
    })
}

/// Ratio of true to estimated error of each figure; 0 where there is no such figure.
fn ratios(solved: &Solved, fine: &Solved) -> [f64; 10] {
    let of = |f: &Figures| {
        let [r8, r6, r4] = f.cv;
        let rest = [
            f.axial_pp,
            f.radial_pp,
            f.linkage_wb,
            f.force_n,
            f.plate_max_t,
        ];
        let [axial, radial, linkage, force, plates] = rest;
        [
            f.centre_t,
            f.core_mean_t,
            r8,
            r6,
            r4,
            axial,
            radial,
            linkage,
            force,
            plates,
        ]
    };
    let errors = of(&solved.figures.change_from(&fine.figures));
    let mut ratios = of(&solved.errors);
    for (ratio, error) in ratios.iter_mut().zip(errors) {
        *ratio = if error > 0.0 { error / *ratio } else { 0.0 };
    }
    ratios
}

fn timed(f: impl Fn() -> Result<Solved, SolveError>) -> Result<(Solved, Duration), SolveError> {
    let mut least = Duration::MAX;
    for _ in 0..3 {
        let start = Instant::now();
        f()?;
        least = least.min(start.elapsed());
    }
    Ok((f()?, least))
}

/// Greatest relative difference along each line.
fn profiles(design: &Design, solved: Solved, fine: Solved) -> Result<[f64; 6], SolveError> {
    let lines = lines(design, &solved);
    let all: Vec<Point> = lines.iter().flatten().copied().collect();
    let fine = fine.sharpened(design, &all, 0.1 * SHARP)?;
    let solved = solved.sharpened(design, &all, SHARP)?;
    let mesh = &solved.level.space.mesh;
    let corners: Vec<Point> = mesh.corners.iter().map(|&c| mesh.position(c)).collect();
    let weak = 0.02 * fine.figures.core_mean_t;
    let (ours, truth) = (
        Locator::new(&solved.level, &solved.w),
        Locator::new(&fine.level, &fine.w),
    );
    let miss = |point: &Point| {
        let (a, b) = (ours.at(*point), truth.at(*point));
        (a.b[0] - b.b[0]).hypot(a.b[1] - b.b[1]) / b.size().max(weak)
    };
    let far = |point: &&Point| {
        corners
            .iter()
            .all(|&corner| distance(corner, **point) > 1e-4)
    };
    Ok(lines.map(|line| line.iter().filter(far).map(miss).fold(0.0, f64::max)))
}

fn lines(design: &Design, solved: &Solved) -> [Vec<Point>; 6] {
    const STEPS: u32 = 600;
    let share = |step: u32| f64::from(step) / f64::from(STEPS);
    let core = &design.core;
    let length = core.x_m[1] - core.x_m[0];
    let reach = solved.level.space.mesh.circle.radius;
    let parallel = |part: f64| -> Vec<Point> {
        let x = |step| core.x_m[0] - length + 3.0 * length * share(step);
        (0..=STEPS).map(|step| [part * core.r_m, x(step)]).collect()
    };
    let radius = |part: f64| -> Vec<Point> {
        let x = core.middle_m() + 0.5 * part * length;
        (0..=STEPS).map(|step| [reach * share(step), x]).collect()
    };
    [
        parallel(0.0),
        parallel(0.5),
        parallel(0.9),
        radius(0.0),
        radius(0.4),
        radius(0.8),
    ]
}
